"""Tables of the project's own messages, from the `.msg` files, and of the topics, from the topic table."""

from __future__ import annotations

import re
from pathlib import Path
from typing import Final

from repository import REPO
from table import row

from bridge.topics import TOPICS

FOLDER: Final = REPO / "bridge" / "msg"
_FIELD: Final = re.compile(r"(?P<type>[\w/\[\]]+)\s+(?P<name>\w+)(?:=(?P<value>\S+))?\s*(?:#\s*(?P<said>.*))?$")


def message_reference() -> str:
    """Return a chapter for each `.msg` file: what it is, its constants, its fields."""
    return "\n".join(_chapter(file) for file in sorted(FOLDER.glob("*.msg")))


def _chapter(file: Path) -> str:
    lines = file.read_text(encoding="utf-8").splitlines()
    head = " ".join(line.lstrip("# ") for line in lines if line.startswith("#"))
    fields = [match for line in lines if line and not line.startswith("#") and (match := _FIELD.match(line))]
    rows = []
    for field in fields:
        value = f" = {field['value']}" if field["value"] else ""
        rows.append(row((f"`{field['name']}`{value}", f"`{field['type']}`", field["said"] or "")))
    table = "| field | type | meaning |\n|---|---|---|\n" + "\n".join(rows)
    return f"### `surefoot_msgs/msg/{file.stem}`\n\n{head}\n\n{table}\n"


def topic_reference() -> str:
    """Return the topic table of `bridge/topics.py`."""
    rows = []
    for topic in TOPICS:
        publisher = "every role" if topic.publisher == "*" else topic.publisher
        carried = f"{topic.priority}{', express' if topic.express else ''}"
        timing = (f"{topic.rate_hz:g} Hz", f"{topic.max_age_s * 1e3:g} ms")
        name = f"`surefoot/{topic.key}`"
        rows.append(row((name, f"`{topic.ros_type}`", publisher, *timing, carried, topic.quality.delivery)))
    return (
        "| key | type | publisher | rate | maximum age | priority | a reader gets |\n|---|---|---|---|---|---|---|\n"
        + "\n".join(rows)
        + "\n"
    )
