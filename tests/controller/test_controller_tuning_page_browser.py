"""The tuning page in a real browser: dragging, counts, saving, reloading, refusing; and how it lies on two screens."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any

import pytest
from controller_tuning_page_browser import Page, Served, browsing, missing
from controller_tuning_page_cases import CONFIG, THRESHOLDS

pytestmark = pytest.mark.processes


@pytest.fixture(scope="module")
def browser(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Any]:
    """Chromium without a window; skips, saying why, where it is not installed."""
    pytest.importorskip("selenium", reason="selenium is not installed (pip install '.[dev]')")
    if missing():
        pytest.skip(missing())
    with browsing(tmp_path_factory.mktemp("profile")) as found:
        yield found


@pytest.fixture(scope="module")
def served(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Served]:
    page = Served(tmp_path_factory.mktemp("served"))
    yield page
    page.end()


@pytest.fixture
def page(browser: Any, served: Served) -> Page:
    served.config.write_text(CONFIG)
    return Page(browser, served)


def test_a_dragged_slider_changes_the_counts_and_what_is_saved_is_there_after_a_reload(page: Page) -> None:
    page.open(1280)
    assert page.too_wide() == []
    assert page.counts()[:2] == ["2 of 2", page.counts()[1]]
    assert page.counts()[2].startswith("1 in ")
    assert page.shown("probability_onset") == 0.4

    page.drag("probability_onset", -100)
    page.until(lambda: page.counts()[2].startswith("2 in "))
    new = page.shown("probability_onset")
    assert new < 0.2
    assert page.served.config.read_text() == CONFIG, "nothing is written before it is saved"

    page.button("Save").click()
    page.until(lambda: "saved to" in page.text(".q-notification"))
    assert page.served.values() == {**THRESHOLDS, "probability_onset": new}
    written = page.served.config.read_text()
    assert "# our walker" in written
    assert "0.4" in written, "the previous value stays as a comment"
    assert "tried in March" in written

    page.browser.refresh()
    page.settle()
    assert page.shown("probability_onset") == new
    assert page.counts()[2].startswith("2 in ")


def test_a_bad_value_is_refused_in_the_words_of_the_config_and_nothing_is_written(page: Page) -> None:
    page.open(1280)
    page.enter("probability_onset", "0.95")
    refusal = "probability_onset = 0.95 must be below probability_full = 0.8"
    page.until(lambda: refusal in page.text(".banner"))
    page.button("Save").click()
    page.until(lambda: refusal in page.text(".q-notification"))
    assert page.served.config.read_text() == CONFIG

    page.enter("probability_onset", "1.2")
    page.until(lambda: "probability_onset = 1.2: input should be less than or equal to 1" in page.text(".banner"))
    assert page.served.config.read_text() == CONFIG

    page.button("Discard").click()
    page.until(lambda: not page.text(".banner"))
    assert page.shown("probability_onset") == 0.4


def test_on_a_phone_nothing_reaches_over_the_edge_and_thumbs_can_be_dragged(page: Page) -> None:
    page.open(390, 844)
    assert page.too_wide() == []
    before = page.shown("distance_onset_sd")
    page.drag("distance_onset_sd", 40)
    page.until(lambda: page.shown("distance_onset_sd") > before + 0.3)
    for element in page.all("[data-count]"):
        assert element.is_displayed()
        assert 0 <= element.rect["y"] - page.browser.execute_script("return scrollY") < 844, (
            "the counts are in sight while a slider is dragged"
        )


def test_the_page_asks_nobody_but_its_own_server_and_complains_of_nothing(page: Page) -> None:
    page.browser.get_log("browser")
    page.open(1280)
    asked = page.browser.execute_script("return performance.getEntriesByType('resource').map(entry => entry.name)")
    assert any("echart" in url for url in asked)
    own = page.served.address(page.until).split("/")[2]
    assert {url.split("/")[2] for url in asked if not url.startswith("data:")} == {own}
    assert [entry["message"] for entry in page.browser.get_log("browser") if entry["level"] == "SEVERE"] == []


def test_another_website_in_the_same_browser_gets_nothing(page: Page) -> None:
    """The key is in this browser's cookies by now; a page from elsewhere must not be able to use them."""
    page.open(1280)
    address = page.served.address(page.until).split("?")[0]
    page.browser.get("data:text/html,<title>elsewhere</title>")
    answer = page.browser.execute_async_script(
        "const done = arguments[1]; const socket = new WebSocket(arguments[0]);"
        "socket.onopen = () => done('open'); socket.onerror = () => done('refused');",
        address.replace("http", "ws") + "_nicegui_ws/socket.io/?EIO=4&transport=websocket",
    )
    assert answer == "refused"
