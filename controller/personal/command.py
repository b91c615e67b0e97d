"""`surefoot personalise`: which of two settings felt better, until the best one is known."""

from __future__ import annotations

from contextlib import ExitStack
from enum import StrEnum
from pathlib import Path
from typing import Annotated, Final

import typer

from bridge.command_line.options import ConfigOption, ForceOption, JsonOption, SeedOption
from bridge.command_line.output import STDOUT, note, require_writable, result, result_text, write_json
from controller.personal.dialogue import CHOICES, ask, question_lines
from controller.personal.proposals import AXES
from controller.personal.session import RESULT, Session
from controller.personal.state import FILE, StudyError, load
from controller.personal.trial import Trial

FOLDER: Final = Path("runs/personal")


class Action(StrEnum):
    """What to do with a study."""

    ASK = "ask"
    NEXT = "next"
    ANSWER = "answer"
    UNDO = "undo"
    SHOW = "show"


def personalise(
    action: Annotated[
        Action,
        typer.Argument(
            help="ask: at the terminal until the study is over. next: say what to compare. answer CHOICE: take an "
            "answer. undo: take the last one back. show: the best setting so far."
        ),
    ] = Action.ASK,
    choice: Annotated[
        str | None, typer.Argument(metavar="CHOICE", help="With answer: a, b or same.", show_default=False)
    ] = None,
    out: Annotated[
        Path, typer.Option("--out", metavar="FOLDER", help="Folder of the study: one for each person.")
    ] = FOLDER,
    axes: Annotated[
        str | None,
        typer.Option(metavar="AXIS,...", help=f"Of {', '.join(AXES)}; default: forward.", show_default=False),
    ] = None,
    comparisons: Annotated[
        int | None,
        typer.Option(
            min=1, max=200, metavar="N", help="In all; default: six for each value to be found.", show_default=False
        ),
    ] = None,
    run: Annotated[
        bool, typer.Option("--run", help="With ask: run the controller with the settings to be compared.")
    ] = False,
    seed: SeedOption = 0,
    force: ForceOption = False,
    config: ConfigOption = None,
    json: JsonOption = None,
) -> None:
    """Find the virtual mass and damping that one person likes, by asking which of two settings felt better.

    Every answer is kept at once in FOLDER; the same command goes on from there. `a.toml` and `b.toml` in it are your
    configuration with the two settings, `personal.toml` in the end the one with what was liked best.

    Example: surefoot personalise --config my.toml --out runs/personal/anna
    """
    if json is not None:
        require_writable(json)
    _check(action, choice, run=run)
    if action in {Action.ANSWER, Action.UNDO, Action.SHOW} and not force:
        load(out / FILE)  # one that is not there is not begun by these
    session = Session.open(
        out,
        config,
        axes=tuple(axis.strip() for axis in axes.split(",")) if axes is not None else None,
        comparisons=comparisons,
        seed=seed,
        anew=force,
    )
    if action is Action.ANSWER and choice is not None:
        session.answer(CHOICES[choice])
    elif action is Action.UNDO:
        session.take_back()
    elif action is Action.ASK:
        with ExitStack() as stack:
            ask(session, stack.enter_context(Trial(out / "controller.log")) if run else None)
    if json is not None:
        write_json(json, session.plain())
    if json != STDOUT:
        _say(session, action)


def _check(action: Action, choice: str | None, *, run: bool) -> None:
    if action is Action.ANSWER and choice not in CHOICES:
        raise StudyError(f"answer {choice or ''}: expected a, b or same".replace(" :", ":"))
    if action is not Action.ANSWER and choice is not None:
        raise StudyError(f"{action} {choice}: only answer takes a choice")
    if run and action is not Action.ASK:
        raise StudyError(f"--run is for ask, not for {action}")


def _say(session: Session, action: Action) -> None:
    if session.study.over or action is Action.SHOW:
        result_text(session.fragment())
        if session.study.over:
            note(f"{session.folder / RESULT}: your configuration with these values")
    elif action is not Action.ASK:
        result("\n".join(question_lines(session, commands=True)))
