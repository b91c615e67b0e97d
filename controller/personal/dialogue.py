"""Asking a person at a terminal, or a script that pipes its answers in."""

from __future__ import annotations

import shlex
import sys
from collections.abc import Mapping
from typing import Final

from bridge.command_line.output import note
from bridge.errors import SurefootError
from controller.personal.session import Choice, Session
from controller.personal.trial import Trial

CHOICES: Final[Mapping[str, Choice]] = {"a": "a", "b": "b", "s": "same", "same": "same", "=": "same"}
_HELP: Final = "a or b: which felt better; s: about the same; u: take back the last answer; q: stop here, go on later"
_HELP_RUN: Final = "ta, tb: let the controller run with a or b; the walker stands meanwhile"


def ask(session: Session, trial: Trial | None) -> None:
    """Ask until the study is over, or until nobody answers any more; every answer is kept at once."""
    note(_HELP, *([_HELP_RUN] if trial is not None else []))
    shown = -1
    while not session.study.over:
        if len(session.study.replies) != shown:
            shown = len(session.study.replies)
            note(*question_lines(session, commands=trial is None))
            if trial is not None:
                trial.prepare([session.file("a"), session.file("b")])
        word = _word("which felt better? ")
        if word in {"", "q"}:
            break
        if word in CHOICES:
            session.answer(CHOICES[word])
        elif word == "u":
            shown = _taken_back(session, shown)
        elif trial is not None and word in {"ta", "tb"}:
            _try(session, trial, word[1])
        else:
            note(f"'{word}' is no answer. {_HELP}")
    done, all_ = len(session.study.replies), session.study.comparisons
    if done < all_:
        note(f"{done} of {all_} answered; the same command goes on from here")


def question_lines(session: Session, *, commands: bool) -> list[str]:
    """Return the open question in words, with the `commands` that run its two settings."""
    study = session.study
    lines = [f"comparison {len(study.replies) + 1} of {study.comparisons}"]
    for name, values in session.question().items():
        lines.append(f"  {name}  " + "  ".join(f"{key} = {value:g}" for key, value in values.items()))
        if commands:
            lines.append(f"     surefoot up --roles controller --config {shlex.quote(str(session.file(name)))}")
    return lines


def _taken_back(session: Session, shown: int) -> int:
    try:
        session.take_back()
    except SurefootError as error:
        note(str(error))
        return shown
    return -1


def _try(session: Session, trial: Trial, name: str) -> None:
    note(f"{name}: the walker stops; it goes on once the controller has looked at its inputs")
    try:
        trial.run(session.file(name))
    except SurefootError as error:
        note(str(error))


def _word(prompt: str) -> str:
    """Return the next word from stdin, '' at its end; an empty line is asked again."""
    while True:
        if sys.stdin.isatty():
            note_prompt(prompt)
        line = sys.stdin.readline()
        if not line:
            return ""
        if line.strip():
            return line.strip().lower()


def note_prompt(text: str) -> None:
    """Write a prompt to stderr, so that stdout holds the result alone."""
    sys.stderr.write(text)
    sys.stderr.flush()
