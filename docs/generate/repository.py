"""Links of pages into the repository: followed to pages of the site, or to pages that show the file."""

from __future__ import annotations

import posixpath
import re
from pathlib import Path
from typing import Final

REPO: Final = Path(__file__).resolve().parents[2]

ELSEWHERE: Final = {  # pages whose text stands outside docs/: where, and what they are called in the site
    "README.md": "index.md",
    "CONTRIBUTING.md": "contributing.md",
    "CHANGELOG.md": "changelog.md",
    "anticipation/weights/MODEL_CARD.md": "model-card.md",
}
SAME_AS: Final = {"bridge/msg": "reference/messages.md"}  # shown better by a page there is

_LINK: Final = re.compile(r"(?P<text>!?\[(?:[^\[\]]|\[[^\]]*\])*\])\((?P<target>[^)\s#]+)(?P<anchor>#[^)\s]*)?\)")
_CODE: Final = re.compile(r"^ *```.*?^ *```|`[^`\n]*`", re.DOTALL | re.MULTILINE)
_LANGUAGES: Final = {".py": "python", ".toml": "toml", ".msg": "text", ".urdf": "xml", ".yml": "yaml", ".json": "json"}


class Links:
    """Leads the links of a text to where they are in the site, and remembers which files have to be shown."""

    def __init__(self) -> None:
        self.pages: dict[str, str] = {}  # page in the site -> file or folder in the repository

    def rewrite(self, text: str, origin: str, page: str) -> str:
        """Return `text`, which stands at `origin` in the repository, with links as they are on `page` of the site."""
        code = [match.span() for match in _CODE.finditer(text)]

        def replace(match: re.Match[str]) -> str:
            target = match["target"]
            if ":" in target or target.startswith("/") or any(a <= match.start("target") < b for a, b in code):
                return match[0]
            path = posixpath.normpath(posixpath.join(posixpath.dirname(origin), target))
            there = self._page(path)
            if there is None:
                return match[0]
            return f"{match['text']}({posixpath.relpath(there, posixpath.dirname(page) or '.')}{match['anchor'] or ''})"

        return _LINK.sub(replace, text)

    def _page(self, path: str) -> str | None:
        """Return the page of the site that is, or shows, a file or folder of the repository; None if there is none."""
        if path in ELSEWHERE:
            return ELSEWHERE[path]
        if path in SAME_AS:
            return SAME_AS[path]
        if path.startswith("docs/"):
            return path.removeprefix("docs/")
        if path.startswith("..") or not (REPO / path).exists():
            return None  # MkDocs names it
        page = f"source/{path}.md"
        self.pages[page] = path
        return page


def show(path: str) -> str:
    """Return a page with the text of a file, or of every Python file right in a folder."""
    place = REPO / path
    files = sorted(place.glob("*.py")) if place.is_dir() else [place]
    parts = [f"# `{path}`\n\nAs it stands in the repository.\n"]
    for file in files:
        if len(files) > 1:
            parts.append(f"## `{file.name}`\n")
        body = file.read_text(encoding="utf-8").rstrip()
        parts.append(f"````{_LANGUAGES.get(file.suffix, 'text')}\n{body}\n````\n")
    return "---\nsearch:\n  exclude: true\n---\n\n" + "\n".join(parts)
