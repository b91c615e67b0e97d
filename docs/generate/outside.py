"""Does a built site fetch anything from elsewhere? `python docs/generate/outside.py site` names what it would."""

from __future__ import annotations

import re
import sys
from html.parser import HTMLParser
from pathlib import Path
from typing import Final

FETCHED: Final = {  # attributes whose address a browser fetches by itself; of links only what is no link to click
    "script": "src", "img": "src", "iframe": "src", "source": "src", "video": "src", "audio": "src", "embed": "src",
    "object": "data", "link": "href",
}  # fmt: skip
HARMLESS: Final = {"canonical", "next", "prev", "alternate", "author", "license"}
WAKES: Final = {  # what makes the theme's own script fetch something
    "mermaid": "class of a Mermaid diagram, which the theme fetches from unpkg.com",
    "md-source": "class of a link to the repository, whose figures the theme fetches from its host",
}
_OUTSIDE: Final = re.compile(r"^\s*(?:https?:)?//", re.IGNORECASE)
_IN_STYLE: Final = re.compile(r"(?:url\(|@import)\s*['\"]?\s*((?:https?:)?//[^'\")\s]+)", re.IGNORECASE)


class _Page(HTMLParser):
    def __init__(self) -> None:
        super().__init__()
        self.found: list[str] = []

    def handle_starttag(self, tag: str, attrs: list[tuple[str, str | None]]) -> None:
        values = {name: value or "" for name, value in attrs}
        address = values.get(FETCHED.get(tag, ""), "")
        if _OUTSIDE.match(address) and not HARMLESS & set(values.get("rel", "").split()):
            self.found.append(f"<{tag}> {address}")
        self.found += [WAKES[word] for word in values.get("class", "").split() if word in WAKES]
        self.found += _IN_STYLE.findall(values.get("style", ""))


def outside(site: Path) -> list[str]:
    """Return what pages and style sheets under `site` would fetch from elsewhere, with the file that does."""
    found = []
    for file in sorted(site.rglob("*")):
        if file.suffix == ".html":
            page = _Page()
            page.feed(file.read_text(encoding="utf-8"))
            found += [f"{file.relative_to(site)}: {what}" for what in page.found]
        elif file.suffix == ".css":
            styles = _IN_STYLE.findall(file.read_text(encoding="utf-8"))
            found += [f"{file.relative_to(site)}: {what}" for what in styles]
    return found


if __name__ == "__main__":
    problems = outside(Path(sys.argv[1]))
    for problem in problems:
        print(problem, file=sys.stderr)
    raise SystemExit(1 if problems else 0)
