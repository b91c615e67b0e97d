"""`surefoot info`: what is in a recording, as a table or as JSON."""

from __future__ import annotations

import math
import time

from rich.progress import BarColumn

from bridge.clock import seconds
from bridge.command_line.options import JsonOption, RecordingArgument
from bridge.command_line.output import STDOUT, progress, require_writable, result, write_json
from bridge.record.info import RecordingInfo, TopicInfo, summarise
from bridge.record.reader import Recording

HEADINGS = ("topic", "messages", "rate [Hz]", "gap [ms]", "age p50/p99/max [ms]", "publishers", "missing", "type")


def info(recording: RecordingArgument, json: JsonOption = None) -> None:
    """Say what is in a recording: per topic how many, how regular, how old on arrival, and what is missing.

    Reads files that were cut off as far as they go, and says so.

    Example: surefoot info walk.mcap --json -
    """
    if json is not None:
        require_writable(json)
    read = Recording(recording)
    with progress("reading", BarColumn()) as bar:
        task = bar.add_task("reading", total=1.0)
        found = summarise(read, lambda: bar.update(task, completed=read.progress))
    if json is not None:
        write_json(json, {**found._asdict(), "whole": not found.damage})
    if json != STDOUT:
        result(_text(found))


def _text(found: RecordingInfo) -> str:
    lines = [f"{found.path}: {found.messages} messages in {found.duration_s:.2f} s, {found.bytes / 1e6:.2f} MB"]
    if found.start_ns:
        lines.append(f"began {time.strftime('%Y-%m-%d %H:%M:%S', time.localtime(seconds(found.start_ns)))}")
    if found.damage:
        lines.append(f"not whole: {found.damage}")
    rows = [HEADINGS, *(_row(topic) for topic in found.topics)]
    widths = [max(len(row[column]) for row in rows) for column in range(len(HEADINGS))]
    lines += ["  ".join(cell.ljust(width) for cell, width in zip(row, widths, strict=True)).rstrip() for row in rows]
    lines += [f"{name}: {count} messages, not a topic of Surefoot" for name, count in found.foreign.items()]
    return "\n".join(lines)


def _row(topic: TopicInfo) -> tuple[str, ...]:
    numbered = topic.publishers > 0
    missing = f"{topic.missing}" + (f" ({topic.disordered} out of order)" if topic.disordered else "")
    return (
        topic.topic,
        str(topic.messages),
        _number(topic.rate_hz, 1),
        _number(topic.largest_gap_s * 1e3, 1),
        " / ".join(_number(age, 2) for age in (topic.age_p50_ms, topic.age_p99_ms, topic.age_max_ms)),
        str(topic.publishers) if numbered else "-",
        missing if numbered else "-",
        topic.type,
    )


def _number(value: float, digits: int) -> str:
    return "-" if math.isnan(value) else f"{value:.{digits}f}"
