"""What the shell offers to complete beside files and options: settings, roles, topics, clips.

Shells ask by running `surefoot` with a variable in the environment. Bash breaks words at `=` and `:` before it
asks and replaces the last piece alone; `answer` puts the pieces together and takes off what Bash already has.
"""

from __future__ import annotations

import io
import os
import shlex
import typing
import zipfile
from collections.abc import Callable, Iterable, Iterator, Sequence
from contextlib import redirect_stdout, suppress
from typing import Any, Final, Literal

VARIABLE: Final = "_SUREFOOT_COMPLETE"
_BREAKS: Final = "=:"  # those of Bash's COMP_WORDBREAKS that occur in our words


def asked_words() -> list[str] | None:
    """Return the words before the one the shell wants to have completed, without the program; None: it does not ask.

    A command is loaded only when its name is whole.
    """
    if not os.environ.get(VARIABLE):
        return None
    if "COMP_WORDS" in os.environ:
        return _split(os.environ["COMP_WORDS"])[1 : int(os.environ.get("COMP_CWORD", "1"))]
    text = os.environ.get("_TYPER_COMPLETE_ARGS", "")
    words = _split(text)[1:]
    return words if text.endswith(" ") else words[:-1]


def answer(complete: Callable[[], object]) -> str:
    """Return what `complete` prints, as the shell that asks wants it."""
    if os.environ.get(VARIABLE) != "complete_bash":
        return _printed(complete)
    words, position = join_broken(_split(os.environ.get("COMP_WORDS", "")), int(os.environ.get("COMP_CWORD", "0")))
    os.environ["COMP_WORDS"], os.environ["COMP_CWORD"] = shlex.join(words), str(position)
    word = words[position] if position < len(words) else ""
    has = max(word.rfind(sign) for sign in _BREAKS) + 1
    lines = filter(None, _printed(complete).splitlines())
    return "".join(f"{line[has:]}\n" for line in lines if line.startswith(word[:has]))


def join_broken(words: Sequence[str], position: int) -> tuple[list[str], int]:
    """Return the words that Bash broke at `=` and `:` put together again, and where the one at `position` is now."""
    joined: list[str] = []
    where = len(words)
    open_end = False  # the last piece was a break, so the next belongs to the same word
    for index, piece in enumerate(words):
        is_break = bool(piece) and not piece.strip(_BREAKS)
        if is_break and joined and joined[-1].startswith("--"):  # --option=VALUE is --option VALUE
            if index >= position:
                where = len(joined)
            continue
        if joined and (is_break or open_end):
            joined[-1] += piece
        else:
            joined.append(piece)
        if index == position:
            where = len(joined) - 1
        open_end = is_break
    if position >= len(words):
        where = len(joined)  # the word under the cursor is still empty
    return joined, where


def settings(incomplete: str) -> list[str]:
    """Return `SECTION.KEY=` and, where the key is known, the values it may have, or its default."""
    from bridge.config.surefoot import SurefootConfig  # noqa: PLC0415 (loaded only when asked for)

    known = {f"{key}=": [f"{key}={value}" for value in _values(*field)] for key, *field in _keys(SurefootConfig(), "")}
    written = [key for key in known if incomplete.startswith(key)]
    if written:
        return known[written[0]]
    begun = [key for key in known if key.startswith(incomplete)]
    return begun + known[begun[0]] if len(begun) == 1 else begun  # a single offer would close the word


def roles(incomplete: str) -> list[str]:
    """Return lists of roles, with commas."""
    from bridge.config.bridge import DEFAULT_ENDPOINTS  # noqa: PLC0415 (loaded only when asked for)

    return _listed(incomplete, DEFAULT_ENDPOINTS)


def topics(incomplete: str) -> list[str]:
    """Return lists of topics, with commas."""
    from bridge.topics import TOPICS  # noqa: PLC0415 (loaded only when asked for)

    return _listed(incomplete, [topic.key for topic in TOPICS])


def estimators(incomplete: str) -> list[str]:
    """Return the pose estimators that come with Surefoot."""
    return [name for name in ("movenet", "yolo") if name.startswith(incomplete)]


def identities(incomplete: str) -> list[str]:
    """Return who may have a certificate."""
    from bridge.keys.identity import IDENTITIES  # noqa: PLC0415 (loaded only when asked for)

    return [name for name in IDENTITIES if name.startswith(incomplete)]


def clips(incomplete: str) -> list[str]:
    """Return the clips of a keypoint file once its name is written: FILE.npz:CLIP."""
    file, colon, _ = incomplete.partition(".npz:")
    if not colon:
        return []
    try:
        with zipfile.ZipFile(f"{file}.npz") as archive:
            names = {name.rpartition("/")[0] for name in archive.namelist() if "/" in name}
    except (OSError, zipfile.BadZipFile):
        return []
    return [f"{file}.npz:{name}" for name in sorted(names)]


def _listed(incomplete: str, known: Iterable[str]) -> list[str]:
    before, comma, _ = incomplete.rpartition(",")
    taken = before.split(",")
    return [f"{before}{comma}{name}" for name in known if name not in taken]


def _keys(section: Any, prefix: str) -> Iterator[tuple[str, Any, Any]]:
    """Give every key that can be set, its default and its annotation."""
    for name, field in type(section).model_fields.items():
        value = getattr(section, name)
        if hasattr(type(value), "model_fields"):
            yield from _keys(value, f"{prefix}{name}.")
        elif isinstance(value, dict):
            for key, item in value.items():
                yield f"{prefix}{name}.{key}", item, str
        elif prefix:  # what stands in no section cannot be set
            yield prefix + name, value, field.annotation


def _values(default: Any, annotation: Any) -> Iterable[str]:
    if typing.get_origin(annotation) is Literal:
        return [str(value) for value in typing.get_args(annotation)]
    if isinstance(default, bool):
        return ["true", "false"]
    if isinstance(default, (tuple, list, dict)) or default == "":
        return []
    return [str(default)]


def _split(text: str) -> list[str]:
    """Return the words of a command line that may end within quotes."""
    lexer = shlex.shlex(text, posix=True)
    lexer.whitespace_split, lexer.commenters = True, ""
    words: list[str] = []
    try:
        words.extend(lexer)
    except ValueError:
        words.append(lexer.token)
    return words


def _printed(complete: Callable[[], object]) -> str:
    with redirect_stdout(io.StringIO()) as printed, suppress(SystemExit):  # how it ends
        complete()
    return printed.getvalue()
