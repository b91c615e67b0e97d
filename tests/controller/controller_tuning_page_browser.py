"""A browser without a window, a served tuning page, and what a person sees and does in it.

Run as a program it takes the pictures of the documentation: `python FILE docs/images/tune-page.png`.
"""

from __future__ import annotations

import base64
import os
import re
import shutil
import signal
import subprocess
import sys
import tempfile
import tomllib
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

from controller_tuning_page_cases import CONFIG

REPO = Path(__file__).resolve().parents[2]
SERVED = Path(__file__).with_name("controller_tuning_page_cases.py")
BROWSERS = ("chromium", "chromium-browser", "google-chrome")
FLAGS = (
    "--headless", "--no-sandbox", "--disable-gpu", "--disable-quic", "--no-first-run", "--disable-sync",
    "--disable-background-networking", "--disable-component-update", "--disable-default-apps", "--lang=en",
)  # fmt: skip
WAIT_S = 30.0


def missing() -> str:
    """Return what there is to install before a browser can be driven, or ''."""
    if not any(map(shutil.which, BROWSERS)) or shutil.which("chromedriver") is None:
        return "no browser here (Debian: apt-get install chromium chromium-driver)"
    return ""


@contextmanager
def browsing(profile: Path) -> Iterator[Any]:
    """Give a browser with an empty profile that writes down what it complains of."""
    from selenium import webdriver
    from selenium.webdriver.chrome.service import Service

    options = webdriver.ChromeOptions()
    options.binary_location = next(filter(None, map(shutil.which, BROWSERS)))
    for flag in (*FLAGS, f"--user-data-dir={profile}"):
        options.add_argument(flag)
    options.set_capability("goog:loggingPrefs", {"browser": "ALL"})
    service = Service(shutil.which("chromedriver"))
    browser = webdriver.Chrome(options=options, service=service)
    try:
        yield browser
    finally:
        browser.quit()
        service.stop()


class Served:
    """A page of made-up recordings, its address and its file."""

    def __init__(self, folder: Path, *words: str) -> None:
        self.config = folder / "walker.toml"
        self.config.write_text(CONFIG)
        self.said = folder / "said.txt"
        with self.said.open("w") as said:
            self._process = subprocess.Popen(
                [sys.executable, str(SERVED), self.config.name, *words],
                cwd=folder,
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


def main(picture: Path) -> None:
    """Take the picture of the page with a slider moved, at the width of a laptop."""
    with tempfile.TemporaryDirectory() as folder:
        served = Served(Path(folder), "many")
        try:
            with browsing(Path(folder) / "profile") as browser:
                page = Page(browser, served)
                page.open(1280)
                page.drag("probability_onset", -40)
                page.settle()
                height = browser.execute_script("return document.querySelector('.results').scrollHeight") + 90
                page.resize(1280, height)
                page.until(lambda: browser.execute_script("return innerHeight") == height)
                browser.execute_script("document.querySelector('.knobs').scrollTo(0, 0)")
                page.picture(picture)
        finally:
            served.end()


if __name__ == "__main__":
    main(Path(sys.argv[1]))
