"""The tuning page without a browser: what a person does and sees, by the page library's own simulation."""

from __future__ import annotations

import asyncio
from collections.abc import Awaitable, Callable
from pathlib import Path
from typing import Any

import pytest
from controller_tuning_page_cases import CONFIG, candidates, recordings

from bridge.config.load import load_config
from controller.tuning.page.bench import Bench

WAIT_S = 10.0


class Person:
    """Does and sees things on an open page."""

    def __init__(self, user: Any, file: Path) -> None:
        self.user, self.file = user, file

    def element(self, marker: str) -> Any:
        return next(iter(self.user.find(marker=marker).elements))

    def text(self, marker: str) -> str:
        return str(self.element(marker).text)

    def unseen(self, marker: str) -> bool:
        from nicegui import ElementFilter

        with self.user:
            return all(not element.visible for element in ElementFilter(marker=marker))

    def set(self, marker: str, value: Any) -> None:
        with self.user:
            self.element(marker).set_value(value)

    def click(self, marker: str) -> None:
        self.user.find(marker=marker).click()

    async def until(self, seen: Callable[[], bool]) -> None:
        async def wait() -> None:
            while not seen():
                await asyncio.sleep(0.01)

        await asyncio.wait_for(wait(), WAIT_S)

    async def counted(self) -> None:
        await self.until(lambda: "…" not in self.text("needless") and self.text("counting") == "")

    def happenings(self) -> str:
        from nicegui import ElementFilter, ui

        with self.user:
            within = ElementFilter(kind=ui.label).within(marker="happenings")
            return " ".join(label.text for label in within)


@pytest.fixture
def visit(tmp_path: Path) -> Callable[[Callable[[Person], Awaitable[None]]], None]:
    """Run something a person does on a freshly opened page."""
    testing = pytest.importorskip("nicegui.testing", reason="nicegui is not installed (pip install '.[tune]')")
    from controller.tuning.page.board import Board

    file = tmp_path / "walker.toml"
    file.write_text(CONFIG)
    bench = Bench(recordings(), load_config(file), file, file, candidates=candidates(), budget_per_h=60.0)

    def run(does: Callable[[Person], Awaitable[None]]) -> None:
        async def visiting() -> None:
            failed: Exception | None = None
            async with testing.user_simulation(root=lambda: Board(bench) and None) as user:
                await user.open("/")
                person = Person(user, file)
                try:
                    await person.counted()
                    await does(person)
                except (AssertionError, TimeoutError) as error:  # thrown through the simulation it would never end
                    failed = error
            if failed is not None:
                raise failed

        asyncio.run(visiting())

    return run


def test_a_moved_slider_moves_its_field_and_the_counts_and_can_be_taken_back(visit: Any) -> None:
    async def does(person: Person) -> None:
        assert person.text("caught") == "2 of 2"
        assert person.text("needless").startswith("1 in")
        person.set("slider probability_onset", 0.1)
        assert person.element("field probability_onset").value == 0.1
        await person.until(lambda: person.text("needless").startswith("2 in"))
        assert person.text("save") == "Save 1"
        person.click("discard")
        assert person.element("slider probability_onset").value == 0.4
        await person.until(lambda: person.text("needless").startswith("1 in"))
        assert person.file.read_text() == CONFIG

    visit(does)


def test_choosing_a_recording_shows_its_interventions_with_their_reasons(visit: Any) -> None:
    async def does(person: Person) -> None:
        assert "caught" in person.happenings()
        person.set("recording", "daily.npz:sitting down")
        await person.until(lambda: "needless" in person.happenings())
        assert "fall probability" in person.happenings() or "fall boundary" in person.happenings()
        person.set("recording", "daily.npz:walking")
        await person.until(lambda: "No intervention" in person.happenings())

    visit(does)


def test_only_the_recordings_with_needless_interventions_are_offered_on_request(visit: Any) -> None:
    async def does(person: Person) -> None:
        person.set("filter", "needless")
        assert list(person.element("recording").options) == ["daily.npz:sitting down"]
        await person.until(lambda: "needless" in person.happenings())

    visit(does)


def test_a_bad_value_is_said_and_the_curves_stay(visit: Any) -> None:
    async def does(person: Person) -> None:
        before = person.element("timeline").options["series"]
        person.set("field probability_onset", 0.9)
        assert "probability_onset = 0.9 must be below probability_full = 0.8" in person.text("refusal")
        person.click("save")
        assert person.user.notify.contains("Nothing written: intervention: probability_onset = 0.9 must be below")
        assert person.file.read_text() == CONFIG
        assert person.element("timeline").options["series"] == before
        person.set("field probability_onset", None)
        assert "input should be a valid number" in person.text("refusal")
        person.set("field probability_onset", 0.45)
        await person.until(lambda: person.unseen("refusal"))

    visit(does)


def test_a_clicked_candidate_sets_its_thresholds(visit: Any) -> None:

    async def does(person: Person) -> None:
        chart = person.element("tradeoff")
        click = {
            "componentType": "series", "seriesType": "scatter", "seriesIndex": 0, "seriesName": "candidates",
            "name": "", "dataIndex": 1, "data": {}, "value": [],
        }  # fmt: skip
        with person.user:
            for listener in [each for each in chart._event_listeners.values() if each.type == "componentClick"]:
                from nicegui.events import GenericEventArguments, handle_event

                handle_event(
                    listener.handler, GenericEventArguments(sender=chart, client=person.user.client, args=click)
                )
        assert person.element("slider probability_onset").value == 0.5
        assert person.element("field probability_full").value == 0.9
        assert person.text("save") == "Save 2"

    visit(does)


def test_a_file_changed_by_others_while_the_page_is_open_is_not_overwritten(visit: Any) -> None:
    async def does(person: Person) -> None:
        person.set("slider rise_per_s", 9.0)
        others = CONFIG.replace("0.4 ", "0.5 ")
        person.file.write_text(others)
        person.click("save")
        assert person.user.notify.contains("was changed since this page read it")
        assert person.file.read_text() == others
        assert person.text("save") == "Save 1"

    visit(does)
