"""A study's answer as a table, as JSON, and as one page of HTML that needs nothing beside it."""

from __future__ import annotations

import base64
from collections.abc import Sequence
from typing import Any, Final

from jinja2 import Environment, PackageLoader, StrictUndefined
from rich.table import Table

from controller.tuning.plot import draw, png
from controller.tuning.recommend import Answer, Judged
from controller.tuning.score import Outcome, Tally
from controller.tuning.space import Setting
from controller.tuning.words import findings, intervening_words, notes, number, rows, setting_words

FORMAT: Final = 1  # of the JSON document


def table(answer: Answer) -> Table:
    """Return the trade-off."""
    made = Table(title=f"{answer.tried} settings on {len(answer.cases)} recordings", title_justify="left")
    made.add_column("")
    made.add_column("setting", overflow="fold", max_width=72)
    for name in ("caught", "lead [s]", "needless", "per hour"):
        made.add_column(name, justify="right")
    for mark, judged in rows(answer):
        style = "bold" if "recommended" in mark else ""
        made.add_row(mark, setting_words(judged.setting), *_cells(judged.outcome), style=style)
    return made


def document(answer: Answer) -> dict[str, Any]:
    """Return everything there is to know, for scripts; numbers that are none are NaN."""
    question = answer.question
    return {
        "format": FORMAT,
        "question": {
            "budget_per_hour": question.budget_per_hour,
            "method": question.method,
            "vary": {each.key: [each.low, each.high] for each in question.space.ranges},
            "folds": question.folds,
            "by": question.by.value,
            "seed": question.seed,
        },
        "tried": answer.tried,
        "recordings": [
            {
                "name": case.name, "group": case.group, "duration_s": case.duration_s, "labelled": case.labelled,
                "falls": [{"onset_s": f.onset_s, "impact_s": f.impact_s, "over_s": f.over_s} for f in case.falls],
                "present": _tally(answer.present.tallies[place]),
                "recommended": _tally(answer.recommended.tallies[place]),
            }
            for place, case in enumerate(answer.cases)
        ],
        "present": _judged(answer.present),
        "recommended": {
            **_judged(answer.recommended),
            "keeps_budget": answer.within,
            "values": answer.recommended.config.model_dump(),
            "caught_share_wilson": answer.caught,
            "resampled": answer.resampled,
        },
        "front": [_judged(judged) for judged in answer.front],
        "held_out": None if answer.held_out is None else _outcome(answer.held_out),
        "folds": [
            {
                "changes": fold.setting, "keeps_budget": fold.within, "chosen_on": _outcome(fold.chosen_on),
                "held_out": _outcome(fold.held_out),
            }
            for fold in answer.folds
        ],
        "budget": {
            "shown_kept": answer.supported,
            "needless_per_hour": answer.needless,
            "at_most_per_hour": answer.bound_per_hour,
            "hours_recorded": answer.judged.hours,
            "hours_needed": answer.hours_needed,
        },
        "words": findings(answer) + notes(answer),
    }  # fmt: skip


def page(answer: Answer, config: str) -> str:
    """Return the report as HTML; `config` is what the file was called."""
    environment = Environment(
        loader=PackageLoader("controller.tuning", "."), autoescape=True, undefined=StrictUndefined, trim_blocks=True
    )
    picture = base64.b64encode(png(draw(answer))).decode()
    return environment.get_template("report.html").render(
        findings=findings(answer),
        notes=notes(answer),
        picture=picture,
        config=config,
        question=answer.question,
        by=intervening_words(answer.question.by),
        tried=answer.tried,
        rows=[(mark, setting_words(judged.setting), *_cells(judged.outcome)) for mark, judged in rows(answer)],
        folds=[
            (str(place), setting_words(fold.setting), *_cells(fold.chosen_on), *_cells(fold.held_out))
            for place, fold in enumerate(answer.folds, start=1)
        ],
        recordings=_recordings(answer),
        values=_values(answer),
    )


def _values(answer: Answer) -> list[tuple[str, str, str]]:
    before, after = answer.present.config.model_dump(), answer.recommended.config.model_dump()
    return [(key, f"{before[key]:g}", f"{after[key]:g}") for key in before]


def _recordings(answer: Answer) -> list[tuple[str, ...]]:
    pairs: Sequence[tuple[Tally, Tally]] = list(
        zip(answer.present.tallies, answer.recommended.tallies, strict=True)
    )  # fmt: skip
    return [
        (case.name, f"{case.duration_s:.1f}", _fall_words(old), _fall_words(new), _needless_words(old),
         _needless_words(new))
        for case, (old, new) in zip(answer.cases, pairs, strict=True)
    ]  # fmt: skip


def _fall_words(tally: Tally) -> str:
    words = []
    for fall in tally.falls:
        late = f"late by {fall.late_s:.2f} s" if fall.late_s == fall.late_s else "missed"
        words.append(f"{fall.lead_s:.2f} s before" if fall.caught else late)
    return ", ".join(words)


def _needless_words(tally: Tally) -> str:
    return ", ".join(f"{time_s:.2f}" for time_s in tally.needless_s)


def _cells(outcome: Outcome) -> tuple[str, str, str, str]:
    caught = f"{outcome.caught} of {outcome.falls}" if outcome.falls else "–"
    return caught, number(outcome.lead_median_s), str(outcome.needless), number(outcome.per_hour)


def _judged(judged: Judged) -> dict[str, Any]:
    changes: Setting = judged.setting
    return {"changes": changes, **_outcome(judged.outcome)}


def _outcome(outcome: Outcome) -> dict[str, Any]:
    return {
        "falls": outcome.falls, "caught": outcome.caught, "unwatched": outcome.unwatched,
        "caught_share": outcome.caught_share, "lead_median_s": outcome.lead_median_s, "needless": outcome.needless,
        "hours": outcome.hours, "needless_per_hour": outcome.per_hour,
    }  # fmt: skip


def _tally(tally: Tally) -> dict[str, Any]:
    return {
        "falls": [{"caught": f.caught, "lead_s": f.lead_s, "late_s": f.late_s} for f in tally.falls],
        "needless_s": tally.needless_s,
        "hours": tally.hours,
    }
