"""`surefoot tune`: options, and what is said and written."""

from __future__ import annotations

from enum import StrEnum
from pathlib import Path
from typing import Annotated, Final

import typer
from rich.progress import BarColumn, Progress, TextColumn, TimeElapsedColumn

from bridge.command_line.options import ConfigOption, ForceOption, JobsOption, JsonOption, SeedOption, SetOption
from bridge.command_line.output import STDOUT, note, progress, require_writable, result, write_json, write_text
from bridge.config.load import load_config
from bridge.config.surefoot import SurefootConfig
from bridge.errors import ConfigError, SurefootError
from controller.tuning.cases import Case
from controller.tuning.choose import parse_budget
from controller.tuning.load import load_cases
from controller.tuning.page.bench import Bench, Candidate
from controller.tuning.page.serve import DEFAULT_PORT, require_library, require_port
from controller.tuning.page.serve import serve as serve_page
from controller.tuning.recommend import Answer, Question, recommend
from controller.tuning.save import require_tomlkit, write_toml
from controller.tuning.score import Intervening
from controller.tuning.space import parse_space
from controller.tuning.words import findings, notes, outcome_words

FOLDS: Final = {"grid": 5, "study": 2}  # a study is made anew for every part, a grid is not


class Method(StrEnum):
    """How settings are found."""

    GRID = "grid"
    STUDY = "study"


def tune(
    recordings: Annotated[
        list[str],
        typer.Argument(
            metavar="RECORDING...",
            show_default=False,
            help="An .mcap file, a folder of them, a campaign's folder, FILE.npz or FILE.npz:CLIP[/ARRAY].",
        ),
    ],
    config: ConfigOption = None,
    set_: SetOption = None,
    budget: Annotated[
        str, typer.Option(metavar="BUDGET", help="Needless interventions allowed, such as '1 in 10 h', or an hour.")
    ] = "1 in 10 h",
    by: Annotated[Intervening, typer.Option(help="What counts as an intervention: arrest, or guard (and arrest).")] = (
        Intervening.ARREST
    ),
    falls: Annotated[
        Path | None,
        typer.Option(metavar="FILE.csv", show_default=False, help="Falls: recording,onset_s,impact_s,over_s."),
    ] = None,
    vary: Annotated[
        list[str] | None,
        typer.Option(
            metavar="KEY=LOW:HIGH[:N]",
            show_default=False,
            help="Vary this key of [intervention], or KEY=A,B,C; repeatable. Default: the usual ones.",
        ),
    ] = None,
    method: Annotated[
        Method | None, typer.Option(show_default=False, help="Default: grid; with --serve: no search.")
    ] = None,
    trials: Annotated[int, typer.Option(min=2, max=100_000, metavar="N", help="Settings that a study tries.")] = 200,
    folds: Annotated[
        int | None,
        typer.Option(min=2, max=100, metavar="N", show_default=False, help="Parts held out in turn: grid 5, study 2."),
    ] = None,
    out: Annotated[
        Path | None,
        typer.Option("--out", metavar="FILE.toml", show_default=False, help="Write the configuration here."),
    ] = None,
    plot: Annotated[
        Path | None, typer.Option(metavar="FILE.png", show_default=False, help="Draw the trade-off.")
    ] = None,
    report: Annotated[
        Path | None, typer.Option(metavar="FILE.html", show_default=False, help="Write a page with everything.")
    ] = None,
    json: JsonOption = None,
    cache: Annotated[
        Path | None, typer.Option(metavar="FOLDER", show_default=False, help="Keep the horizons of keypoint files.")
    ] = None,
    recompute: Annotated[
        bool, typer.Option("--recompute", help="Horizons of recordings anew from their keypoints.")
    ] = False,
    serve: Annotated[
        bool, typer.Option("--serve", help="Open a page on this machine to try thresholds by hand.")
    ] = False,
    port: Annotated[int, typer.Option(min=0, max=65535, help="Of the page; 0: any that is free.")] = DEFAULT_PORT,
    force: ForceOption = False,
    seed: SeedOption = 0,
    jobs: JobsOption = 1,
) -> int:
    """Replay recordings against other thresholds of [intervention] and recommend some for a budget.

    The trade-off between falls caught, lead time and needless interventions is shown as a table; the recommended
    setting is judged on recordings that had no say in its choice. The same seed gives the same answer with any --jobs.

    Example: surefoot tune walk.mcap clips.npz --config C.toml --budget "1 in 10 h" --out tuned.toml --plot tuned.png
    """
    if serve:
        require_library()
        require_port(port)
    loaded = load_config(config, set_ or [])
    chosen = method or (None if serve else Method.GRID)
    question = None if chosen is None else Question(
        parse_budget(budget), chosen.value, parse_space(vary or [], chosen.value), trials,
        folds or FOLDS[chosen.value], by, seed, jobs,
    )  # fmt: skip
    if chosen is None and vary:
        raise ConfigError("--vary goes with --method where --serve is given")
    budget_per_hour = parse_budget(budget)
    _require_outputs(out, force=force or serve, files=((plot, "--plot"), (report, "--report"), (json, "--json")))
    cases, answer = _work(recordings, loaded, question, falls, cache, jobs, recompute=recompute)
    for case in cases:
        if not case.horizons.stream.faults or all(case.horizons.stream.faults):
            note(f"{case.name}: no usable horizon in it, nothing can be seen there")
    if answer is not None:
        _tell(answer, json)
        _write(answer, plot, report, str(config or "defaults"))
        if out is not None and not serve:
            _save(answer, config, out, force=force)
    if serve:
        bench = Bench(
            cases, loaded, file=config, save_to=out or config, overrides=set_ or [], force=force,
            candidates=_candidates(answer), by=by, budget_per_h=budget_per_hour,
        )  # fmt: skip
        return serve_page(bench, port)
    return 0


def _require_outputs(out: Path | None, *, force: bool, files: tuple[tuple[Path | None, str], ...]) -> None:
    """Raise for what cannot be written before time is spent on it."""
    for file, option in files:
        if file is not None:
            require_writable(file, option)
    if out is not None:
        require_tomlkit()
        require_writable(out, "--out")
        if out.exists() and not force:
            raise SurefootError(f"--out {out}: is there already; --force replaces it")


def _work(
    recordings: list[str],
    config: SurefootConfig,
    question: Question | None,
    falls: Path | None,
    cache: Path | None,
    jobs: int,
    *,
    recompute: bool,
) -> tuple[list[Case], Answer | None]:
    columns = (TextColumn("{task.description}"), BarColumn(), TimeElapsedColumn())
    with progress(*columns) as bar:
        task = bar.add_task("reading recordings", total=None)
        cases = load_cases(
            recordings, config, falls=falls, cache=cache, recompute=recompute, jobs=jobs,
            told=lambda done, of, name: bar.update(
                task, completed=done, total=of, description=f"reading recordings {name}"
            ),
        )  # fmt: skip
        bar.update(task, description="reading recordings")
        if question is None:
            return cases, None
        return cases, recommend(cases, config, question, _Steps(bar))


class _Steps:
    """Shows what a study is at."""

    def __init__(self, bar: Progress) -> None:
        self._bar = bar
        self._tasks: dict[str, int] = {}

    def __call__(self, what: str, share: float) -> None:
        if what not in self._tasks:
            self._tasks[what] = self._bar.add_task(what, total=1.0)
        self._bar.advance(self._tasks[what], share)  # type: ignore[arg-type]


def _tell(answer: Answer, json: Path | None) -> None:
    from controller.tuning.report import document, table  # noqa: PLC0415 (matplotlib is loaded only where it draws)

    if json is not None:
        write_json(json, document(answer))
    if json != STDOUT:
        result(table(answer), *findings(answer))
    note(*notes(answer))


def _write(answer: Answer, plot: Path | None, report: Path | None, config: str) -> None:
    if plot is not None:
        from controller.tuning.plot import draw, png  # noqa: PLC0415

        _write_bytes(plot, png(draw(answer)))
    if report is not None:
        from controller.tuning.report import page  # noqa: PLC0415

        write_text(report, page(answer, config), "--report")


def _write_bytes(file: Path, content: bytes) -> None:
    part = file.with_name(f".{file.name}.part")
    try:
        part.write_bytes(content)
        part.replace(file)
    except OSError as error:
        part.unlink(missing_ok=True)
        raise SurefootError(f"--plot {file}: cannot be written: {error.strerror}") from error


def _save(answer: Answer, config: Path | None, out: Path, *, force: bool) -> None:
    question = answer.question
    source = "recommended by `surefoot tune`"
    lines = [
        f"{source}, {question.method}, seed {question.seed}, budget {question.budget_per_hour:g} needless an hour",
        f"on {len(answer.cases)} recordings: {outcome_words(answer.recommended.outcome)}",
    ]
    if answer.held_out is not None:
        lines.append(f"on recordings that had no say: {outcome_words(answer.held_out)}")
    if not answer.supported:
        lines.append(f"the recordings do not show that the budget is kept: {answer.hours_needed:.0f} h would be needed")
    recommended, file = answer.recommended.config, load_config(config).intervention  # without --set
    changes = {key: value for key, value in recommended.model_dump().items() if value != getattr(file, key)}
    write_toml(config, out, changes, note=lines, force=force)
    note(f"{out}")


def _candidates(answer: Answer | None) -> list[Candidate]:
    if answer is None:
        return []
    front = {str(judged.setting): judged for judged in (*answer.front, answer.recommended)}
    return [
        Candidate(dict(judged.setting), judged.outcome, judged.setting == answer.recommended.setting)
        for judged in front.values()
    ]
