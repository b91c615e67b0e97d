"""From what an observer heard to the time from frame to command, and to each hop's share of it. Pure."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from itertools import pairwise
from typing import Final, NamedTuple

import numpy as np

from bridge.errors import SurefootError
from bridge.messages import FallHorizon, Keypoints, SupportCommand

MS: Final = 1e6  # nanoseconds in one

HOPS: Final = {
    "perception": "frame captured -> keypoints arrive: waiting for the frame, cleaning, one wire",
    "anticipation": "keypoints arrive -> horizon arrives: networks, one wire",
    "controller_wait": "horizon arrives -> the controller's next turn begins",
    "controller_compute": "judging inputs and solving, as the controller measured it",
    "controller_send": "safety gate, encoding, one wire",
}


class Spread(NamedTuple):
    """Of a number of spans."""

    frames: int
    p50: float  # [ms]
    p99: float  # [ms]
    max: float  # [ms]


class Heard(NamedTuple):
    """Everything an observer heard, each message with its arrival [ns]."""

    keypoints: Sequence[tuple[Keypoints, int]]
    horizons: Sequence[tuple[FallHorizon, int]]
    commands: Sequence[tuple[SupportCommand, int]]


def spread(spans_ms: Iterable[float]) -> Spread:
    """Return how many, median, 99th percentile and largest; NaN of nothing."""
    values = np.array(list(spans_ms))
    if not len(values):
        return Spread(0, float("nan"), float("nan"), float("nan"))
    p50, p99 = np.percentile(values, [50, 99])
    return Spread(len(values), round(float(p50), 3), round(float(p99), 3), round(float(values.max()), 3))


def first_on_each_frame(commands: Iterable[tuple[SupportCommand, int]]) -> list[tuple[SupportCommand, int]]:
    """Return the first of the commands that rest on the same frame; the very first frame is left out.

    Whoever begins to listen may have missed that frame's first command.
    """
    first: list[tuple[SupportCommand, int]] = []
    for command, arrival_ns in commands:
        if command.rests_on_ns and (not first or command.rests_on_ns != first[-1][0].rests_on_ns):
            first.append((command, arrival_ns))
    return first[1:]


def frame_to_command(heard: Heard) -> Spread:
    """Return the spread of capture of a frame to arrival of the first command that rests on it [ms]."""
    return spread((arrival - c.rests_on_ns) / MS for c, arrival in first_on_each_frame(heard.commands))


def hops(heard: Heard) -> dict[str, Spread]:
    """Return the spread of each hop [ms], in order; the hops of one frame add up to its frame-to-command time.

    Frames whose keypoints or horizon the observer missed are left out.
    """
    seen = {message.stamp_ns: arrival for message, arrival in heard.keypoints}
    foreseen = {message.stamp_ns: arrival for message, arrival in heard.horizons}
    rows: list[tuple[float, ...]] = []
    for command, arrival_ns in first_on_each_frame(heard.commands):
        frame_ns = command.rests_on_ns
        if frame_ns not in seen or frame_ns not in foreseen:
            continue
        computed_ns = command.stamp_ns + round(command.solve_time_s * 1e9)
        moments = (frame_ns, seen[frame_ns], foreseen[frame_ns], command.stamp_ns, computed_ns, arrival_ns)
        rows.append(tuple((b - a) / MS for a, b in pairwise(moments)))
    columns: Sequence[Iterable[float]] = list(zip(*rows, strict=True)) if rows else [()] * len(HOPS)
    return dict(zip(HOPS, map(spread, columns), strict=True))


def measured(heard: Heard) -> tuple[Spread, dict[str, Spread]]:
    """Return what `frame_to_command` and `hops` say of `heard`.

    Raises:
        SurefootError: there is not one frame to speak of; says what was heard and what was not.
    """
    total, parts = frame_to_command(heard), hops(heard)
    if not total.frames:
        rest = sum(command.rests_on_ns > 0 for command, _ in heard.commands)
        raise SurefootError(
            f"nothing to measure: {len(heard.keypoints)} keypoints, {len(heard.horizons)} horizons and"
            f" {len(heard.commands)} commands came, {rest} of these rest on a frame; it takes commands on two frames"
        )
    if not all(part.frames for part in parts.values()):
        raise SurefootError(
            f"nothing to measure: of {total.frames} frames that became commands the observer missed every one's"
            f" keypoints or horizon ({len(heard.keypoints)} keypoints, {len(heard.horizons)} horizons came):"
            " the machine is too busy"
        )
    return total, parts


def shares(spreads: Mapping[str, Spread]) -> dict[str, float]:
    """Return each hop's share of the sum of the medians, 0..1."""
    total = sum(part.p50 for part in spreads.values())
    return {name: part.p50 / total for name, part in spreads.items()}
