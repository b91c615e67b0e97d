"""Every command in README and docs: where it stands, and what its words are."""

from __future__ import annotations

import re
import shlex
from pathlib import Path
from typing import NamedTuple

REPO = Path(__file__).resolve().parents[2]
PAGES = [
    REPO / "README.md",
    REPO / "CONTRIBUTING.md",
    REPO / "anticipation" / "weights" / "MODEL_CARD.md",
    *sorted((REPO / "docs").rglob("*.md")),
    *sorted((REPO / "examples").rglob("*.md")),
]
PROGRAMS = ("surefoot", "make", "python", "python3", "pip", "torchrun", "tensorboard", "dask", "rerun", "mcap", "ros2")
SHELLS = ("sh", "bash", "shell", "console")
_FENCE = re.compile(r"^ *```(?P<language>\w*)\n(?P<text>.*?)^ *```", re.DOTALL | re.MULTILINE)
_INLINE = re.compile(r"(?<!`)`([^`]+)`(?!`)")


class Documented(NamedTuple):
    """One command as a page gives it."""

    page: str  # relative to the repository
    text: str  # without its comment, spaces made single
    fenced: bool = True  # a line to be typed, and not words in a sentence

    @property
    def words(self) -> list[str]:
        """Its words as a shell sees them, up to a redirection or a pipe."""
        words = shlex.split(self.text)
        ends = [index for index, word in enumerate(words) if word in (">", "|", "2>", "&", ">>")]
        return words[: min(ends, default=len(words))]

    @property
    def output(self) -> str:
        """The file that its standard output goes to, if any."""
        found = re.search(r"(?<!2)> *(\S+)", self.text)
        return found[1] if found else ""

    @property
    def is_name(self) -> bool:
        """Whether a sentence only names it, such as `surefoot keys show`, and asks nothing of it."""
        return not self.fenced and all(re.fullmatch(r"[a-z][a-z-]*", word) for word in self.words)


def documented() -> list[Documented]:
    """Return the commands of all pages in their order; one that is given twice on a page only once."""
    found: dict[tuple[str, str], Documented] = {}
    for page in PAGES:
        name = str(page.relative_to(REPO))
        for text, fenced in commands(page.read_text(encoding="utf-8")):
            before = found.get((name, text))
            found[name, text] = Documented(name, text, fenced or (before is not None and before.fenced))
    return list(found.values())


def commands(page: str) -> list[tuple[str, bool]]:
    """Return the commands of one page's text in their order: lines of `sh` blocks (True), code in sentences (False)."""
    places: list[tuple[int, str, bool]] = []
    for fence in _FENCE.finditer(page):
        if fence["language"] in SHELLS:
            places += [(fence.start(), line, True) for line in _lines(fence["text"])]
    prose = _FENCE.sub(lambda fence: " " * len(fence[0]), page)  # places stay
    for code in _INLINE.finditer(prose):
        text = " ".join(code[1].split())
        if text.split(" ")[0] in PROGRAMS and " " in text:
            places.append((code.start(), text, False))
    return [(plain(text), fenced) for _, text, fenced in sorted(places, key=lambda place: place[0])]


def _lines(block: str) -> list[str]:
    joined = re.sub(r"\\\n\s*", " ", block)
    lines = (re.sub(r"(^|\s)#.*", "", line).strip().removeprefix("$ ") for line in joined.splitlines())
    return [part.strip() for line in lines if line for part in line.split("&&")]


def stray(page: str) -> list[str]:
    """Return lines that look like commands and stand in a block that is not `sh`, where nobody would execute them."""
    other = [fence["text"] for fence in _FENCE.finditer(page) if fence["language"] not in SHELLS]
    indented = re.findall(r"^ {4,}\S.*$", _FENCE.sub("", page), re.MULTILINE)
    lines = (line.strip().removeprefix("$ ") for block in [*other, *indented] for line in block.splitlines())
    return [line for line in lines if line.split(" ")[0] in PROGRAMS]


def plain(text: str) -> str:
    """Return a command without what only says that more may be given: `FILE [FILE ...] [--plot FOLDER]`."""
    text = re.sub(r"\[[^\]\[]*\.\.\.\]", " ", text)  # more of the same
    if "surefoot" in text:
        text = re.sub(r"(?<!\S)\[([^\]\[]*)\](?!\S)", r" \1 ", text)
    return " ".join(text.replace(" ...", " ").split())
