"""What a timeline says about one fall: when the walker stiffened, and when it did so for nothing."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Final, NamedTuple

import numpy as np
from numpy.typing import NDArray

from bridge.launch.timeline import Row
from bridge.messages import Floats, GaitState

SOME: Final = 0.05  # stiffening that counts
MOST: Final = 0.90


class Episode(NamedTuple):
    """A time during which the walker was stiffer than in free walking."""

    start_s: float
    end_s: float
    largest: float  # stiffening
    states: tuple[str, ...]  # in the order in which they came


class Summary(NamedTuple):
    """One fall and what was done about it; None for what did not happen."""

    onset_s: float | None  # the recording's own label: balance is lost
    lying_s: float | None
    stiffening_s: float | None  # start of the episode that lasted until the body lay, else of the last before
    stiff_s: float | None  # nearly full
    guard_s: float | None
    arrest_s: float | None
    before: tuple[Episode, ...]  # what was over before the fall began
    stopped_s: float | None = None  # the run ended then, before the fall was over


def fall_of(label: NDArray[np.int8], time_s: Floats) -> tuple[float | None, float | None]:
    """Return when the recording's last fall begins and when the person lies, by its labels."""
    lying = np.flatnonzero(label == 1)
    if not len(lying):
        return None, None
    down = int(lying[0])
    begin = down
    while begin > 0 and label[begin - 1] == 0:
        begin -= 1
    return float(time_s[begin]), float(time_s[down])


def summarise(rows: Sequence[Row], onset_s: float | None, lying_s: float | None) -> Summary:
    """Judge the rows of a run against the times of the recording's fall."""
    episodes = _episodes(rows)
    if onset_s is None:
        return Summary(None, None, None, None, None, None, tuple(episodes))
    before = tuple(episode for episode in episodes if episode.end_s < onset_s)
    end_s = rows[-1].time_s
    stopped_s = end_s if end_s < (onset_s if lying_s is None else lying_s) else None
    during = [episode for episode in episodes if episode.end_s >= onset_s]
    met = next((episode for episode in during if lying_s is None or episode.end_s >= lying_s), None)
    met = met or (during[-1] if during else None)
    if met is None:
        return Summary(onset_s, lying_s, None, None, None, None, before, stopped_s)
    since = [row for row in rows if row.time_s >= met.start_s]
    return Summary(
        onset_s,
        lying_s,
        met.start_s,
        next((row.time_s for row in since if row.stiffening >= MOST), None),
        next((row.time_s for row in since if row.state == GaitState.GUARD), None),
        next((row.time_s for row in since if row.state == GaitState.ARREST), None),
        before,
        stopped_s,
    )


def sentences(summary: Summary, latency_s: Floats) -> list[str]:
    """Return the summary in plain words, one line each."""
    lines = [*_about_walking(summary), *_about_the_fall(summary)]
    if len(latency_s):
        p50, p99 = np.percentile(latency_s, [50, 99]) * 1e3
        lines.append(
            f"Frame to command over three processes: {p50:.1f} ms median, {p99:.1f} ms p99 ({len(latency_s)} frames)."
        )
    return lines


def _episodes(rows: Sequence[Row]) -> list[Episode]:
    episodes: list[Episode] = []
    open_ = False
    for row in rows:
        if not row.stiffening > SOME:  # also where it is not known
            open_ = False
            continue
        if not open_:
            episodes.append(Episode(row.time_s, row.time_s, row.stiffening, (row.state,)))
            open_ = True
            continue
        last = episodes[-1]
        states = last.states if last.states[-1] == row.state else (*last.states, row.state)
        episodes[-1] = Episode(last.start_s, row.time_s, max(last.largest, row.stiffening), states)
    return episodes


def _about_walking(summary: Summary) -> list[str]:
    if not summary.before:
        return ["Before the fall the walker never stiffened."]
    return [
        f"Before the fall, {episode.start_s:.2f} to {episode.end_s:.2f} s: stiffening up to {episode.largest:.2f} "
        f"({', '.join(episode.states)})."
        for episode in summary.before
    ]


def _about_the_fall(summary: Summary) -> list[str]:
    if summary.onset_s is None:
        return ["The recording holds no fall."]
    onset_s = summary.onset_s
    if summary.stopped_s is not None and summary.stiffening_s is None:
        return [f"Stopped at {summary.stopped_s:.2f} s; balance is lost at {onset_s:.2f} s, so nothing is known of it."]
    lines = [f"Balance is lost at {onset_s:.2f} s" + _at("the body lies", summary.lying_s, onset_s) + "."]
    if summary.stiffening_s is None:
        return [*lines, "The walker did not stiffen: the fall was missed."]
    happened = (
        ("first stiffening", summary.stiffening_s),
        ("GUARD", summary.guard_s),
        ("ARREST", summary.arrest_s),
        (f"stiffening {MOST:g}", summary.stiff_s),
    )
    said = ", ".join(
        f"{name} {'not reached' if time_s is None else f'{time_s - onset_s:+.2f} s'}" for name, time_s in happened
    )
    lines.append(f"From there: {said}.")
    if summary.stiff_s is not None and summary.lying_s is not None:
        lead_s = summary.lying_s - summary.stiff_s
        lines.append(f"The walker was stiff {abs(lead_s):.2f} s {'before' if lead_s >= 0 else 'after'} the body lay.")
    return lines


def _at(what: str, time_s: float | None, onset_s: float) -> str:
    return "" if time_s is None else f"; {what} {time_s - onset_s:.2f} s later"
