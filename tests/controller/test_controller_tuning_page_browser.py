"""The tuning page in a real browser: dragging, counts, saving, reloading, refusing; and how it lies on two screens."""

from __future__ import annotations

import base64
import json
import os
import re
import shutil
import signal
import subprocess
import sys
import tomllib
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import pytest

REPO = Path(__file__).resolve().parents[2]
SERVED = Path(__file__).with_name("controller_tuning_page_cases.py")
BROWSERS = ("chromium", "chromium-browser", "google-chrome")
FLAGS = (
    "--headless", "--no-sandbox", "--disable-gpu", "--disable-quic", "--no-first-run", "--disable-sync",
    "--disable-background-networking", "--disable-component-update", "--disable-default-apps", "--lang=en",
)  # fmt: skip
WAIT_S = 15.0
CONFIG = "# our walker\nversion = 1\n\n[intervention]\nprobability_onset = 0.4  # tried in March\n"

pytestmark = pytest.mark.processes


@pytest.fixture(scope="module")
def browser(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Any]:
    """Chromium without a window; skips, saying why, where it is not installed."""
    selenium = pytest.importorskip("selenium.webdriver", reason="selenium is not installed (pip install '.[dev]')")
    chrome = next(filter(None, map(shutil.which, BROWSERS)), None)
    driver = shutil.which("chromedriver")
    if chrome is None or driver is None:
        pytest.skip("no browser here (Debian: apt-get install chromium chromium-driver)")
    from selenium.webdriver.chrome.service import Service

    options = selenium.ChromeOptions()
    options.binary_location = chrome
    for flag in (*FLAGS, f"--user-data-dir={tmp_path_factory.mktemp('profile')}"):
        options.add_argument(flag)
    options.set_capability("goog:loggingPrefs", {"browser": "ALL", "performance": "ALL"})
    service = Service(driver)
    found = selenium.Chrome(options=options, service=service)
    yield found
    found.quit()
    service.stop()


class Served:
    """A page of made-up recordings, its address and its file."""

    def __init__(self, folder: Path) -> None:
        self.config = folder / "walker.toml"
        self.config.write_text(CONFIG)
        self.said = folder / "said.txt"
        with self.said.open("w") as said:
            self._process = subprocess.Popen(
                [sys.executable, str(SERVED), str(self.config)],
                cwd=REPO,
                stderr=said,
                env={**os.environ, "PYTHONPATH": str(REPO), "OMP_NUM_THREADS": "1"},
            )

    def address(self, wait: Callable[[Callable[[], Any]], Any]) -> str:
        match = wait(lambda: re.search(r"http://\S+", self.said.read_text()))
        return str(match[0])

    def values(self) -> dict[str, float]:
        return dict(tomllib.loads(self.config.read_text())["intervention"])

    def end(self) -> int:
        self._process.send_signal(signal.SIGINT)
        return self._process.wait(timeout=WAIT_S)


@pytest.fixture(scope="module")
def served(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Served]:
    page = Served(tmp_path_factory.mktemp("served"))
    yield page
    page.end()


class Page:
    """What a person sees and does."""

    def __init__(self, browser: Any, served: Served) -> None:
        self.browser, self.served = browser, served

    def until(self, seen: Callable[[], Any]) -> Any:
        """Wait for something to be there, or to be so."""
        from selenium.common.exceptions import StaleElementReferenceException
        from selenium.webdriver.support.ui import WebDriverWait

        waiting = WebDriverWait(self.browser, WAIT_S, 0.05, ignored_exceptions=(StaleElementReferenceException,))
        return waiting.until(lambda _: seen())

    def open(self, width: int, height: int = 860) -> None:
        self.resize(width, height)
        self.browser.get(self.served.address(self.until))
        self.settle()

    def resize(self, width: int, height: int) -> None:
        measures = {"width": width, "height": height, "deviceScaleFactor": 1, "mobile": width < 600}
        self.browser.execute_cdp_cmd("Emulation.setDeviceMetricsOverride", measures)

    def settle(self) -> None:
        """Wait until the counts are there and of the present setting."""
        self.until(lambda: "…" not in self.counts() and not self.text("[data-progress]"))

    def all(self, selector: str) -> list[Any]:
        return list(self.browser.find_elements("css selector", selector))

    def one(self, selector: str) -> Any:
        return self.until(lambda: next(iter(self.all(selector)), None))

    def text(self, selector: str) -> str:
        return " ".join(element.text for element in self.all(selector))

    def counts(self) -> list[str]:
        return [element.text for element in self.all("[data-count]")]

    def button(self, name: str) -> Any:
        return next(element for element in self.all("button") if element.text.startswith(name))

    def drag(self, key: str, right_px: int) -> None:
        from selenium.webdriver import ActionChains

        thumb = self.one(f'[data-key="{key}"] .q-slider__thumb')
        self.browser.execute_script("arguments[0].scrollIntoView({block: 'center'})", thumb)
        chain = ActionChains(self.browser, duration=30).click_and_hold(thumb)
        for _ in range(4):
            chain = chain.move_by_offset(right_px // 4, 0)
        chain.release().perform()

    def enter(self, key: str, text: str) -> None:
        from selenium.webdriver import Keys

        field = self.one(f'input[aria-label="{key}"]')
        field.send_keys(Keys.CONTROL, "a")
        field.send_keys(text)

    def shown(self, key: str) -> float:
        return float(self.one(f'input[aria-label="{key}"]').get_attribute("value"))

    def too_wide(self) -> list[str]:
        """Return what reaches over the right edge of the screen."""
        return list(
            self.browser.execute_script(
                "return [...document.querySelectorAll('body *')].filter(e => e.getClientRects().length &&"
                " e.getBoundingClientRect().right > innerWidth + 1).map(e => e.className + ' ' + e.textContent)"
            )
        )

    def picture(self, path: Path) -> None:
        path.write_bytes(base64.b64decode(self.browser.execute_cdp_cmd("Page.captureScreenshot", {})["data"]))


@pytest.fixture
def page(browser: Any, served: Served) -> Page:
    served.config.write_text(CONFIG)
    return Page(browser, served)


def test_a_dragged_slider_changes_the_counts_and_what_is_saved_is_there_after_a_reload(page: Page) -> None:
    page.open(1280)
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
    assert page.served.values() == {"probability_onset": new}
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


@pytest.mark.parametrize(("width", "height"), [(1280, 860), (390, 844)])
def test_nothing_reaches_over_the_edge_and_thumbs_can_be_dragged(page: Page, width: int, height: int) -> None:
    page.open(width, height)
    assert page.too_wide() == []
    before = page.shown("distance_onset_sd")
    page.drag("distance_onset_sd", 40)
    page.until(lambda: page.shown("distance_onset_sd") > before + 0.3)
    for element in page.all("[data-count]"):
        assert element.is_displayed()
        assert 0 <= element.rect["y"] - page.browser.execute_script("return scrollY") < height, (
            "the counts are in sight while a slider is dragged"
        )


def test_the_page_asks_nobody_but_its_own_server_and_complains_of_nothing(page: Page) -> None:
    page.browser.get_log("browser")
    page.browser.get_log("performance")
    page.open(1280)
    asked = [
        message["params"]["request"]["url"]
        for entry in page.browser.get_log("performance")
        if (message := json.loads(entry["message"])["message"])["method"] == "Network.requestWillBeSent"
    ]
    assert any("echart" in url for url in asked)
    assert {url.split("/")[2] for url in asked if url.startswith(("http", "ws"))} == {
        page.served.address(page.until).split("/")[2]
    }
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
