"""Counts over all recordings, and what happens in the one that is looked at."""

from __future__ import annotations

import math
from collections.abc import Sequence

from nicegui import ui

from controller.tuning.page import words
from controller.tuning.page.words import Happening
from controller.tuning.score import Outcome

MOST_LINES = 60


class Tiles:
    """Three counts over all recordings, each beside what the file's setting gives."""

    def __init__(self) -> None:
        with ui.element("div").classes("tiles"):
            self._caught = _Tile("falls caught", "caught")
            self._lead = _Tile("median lead", "lead")
            self._needless = _Tile("needless", "needless")
        self._progress = ui.label("counting …").classes("counting").mark("counting").props("data-progress")

    def show(self, now: Outcome, file: Outcome) -> None:
        """Show the counts of the page's setting, and what the file's are where they differ."""
        self._caught.show(
            words.caught_words(now), words.share_words(now), _was(words.caught_words(now), words.caught_words(file))
        )
        self._caught.judge(now.caught_share - file.caught_share)
        self._lead.show(words.lead_words(now), "", _was(words.lead_words(now), words.lead_words(file)))
        self._lead.judge(now.lead_median_s - file.lead_median_s)
        self._needless.show(
            words.needless_words(now),
            words.rate_words(now),
            _was(words.needless_words(now), words.needless_words(file)),
        )
        self._needless.judge(file.per_hour - now.per_hour)
        self._progress.set_text("")

    def counting(self, done: int, of: int) -> None:
        """Say that the counts are of an earlier setting, and how far the new ones are."""
        self._progress.set_text(f"counting: {done} of {of} recordings")


class HappeningList:
    """The interventions in one recording with their reasons."""

    def __init__(self) -> None:
        self._list = ui.element("ol").classes("happenings").mark("happenings")

    def show(self, lines: Sequence[Happening]) -> None:
        """Show these lines instead of the present ones."""
        self._list.clear()
        with self._list:
            for line in lines[:MOST_LINES]:
                with ui.element("li").classes(f"happening {line.verdict}"):
                    ui.label(f"{line.time_s:.2f} s").classes("when")
                    ui.label(line.state or "FALL").classes(f"state state-{line.state or 'FALL'}")
                    ui.label(line.what).classes("what")
                    ui.label(line.verdict).classes("verdict")
            if len(lines) > MOST_LINES:
                ui.label(f"and {len(lines) - MOST_LINES} more").classes("quiet")
            if not lines:
                ui.label("No intervention in this recording.").classes("quiet")


class _Tile:
    def __init__(self, title: str, name: str) -> None:
        with ui.element("div").classes("tile") as self._frame:
            ui.label(title).classes("tile-title")
            self._value = ui.label("…").classes("tile-value").mark(name).props(f'data-count="{name}"')
            self._certainty = ui.label("").classes("tile-remark")
            self._before = ui.label("").classes("tile-before")

    def show(self, value: str, certainty: str, before: str) -> None:
        self._value.set_text(value)
        self._certainty.set_text(certainty)
        self._before.set_text(before)

    def judge(self, gain: float) -> None:
        """Colour the tile by whether the page's setting is better than the file's."""
        verdict = "" if not math.isfinite(gain) or abs(gain) < 1e-9 else "better" if gain > 0.0 else "worse"
        self._frame.classes(remove="better worse", add=verdict)


def _was(now: str, file: str) -> str:
    return "" if now == file else f"was {file}"
