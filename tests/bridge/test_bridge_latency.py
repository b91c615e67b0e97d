"""Every hop of a frame is counted once, the first command on a frame is the one that counts."""

from __future__ import annotations

import json
import math
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from bridge.cli import main
from bridge.errors import SurefootError
from bridge.latency.hops import HOPS, Heard, first_on_each_frame, frame_to_command, hops, measured, shares, spread
from bridge.messages import FallHorizon, GaitState, Keypoints, SupportCommand

MS = 1_000_000
START = 1_000 * 1_000_000_000


def keypoints(stamp_ns: int) -> Keypoints:
    return Keypoints(
        stamp_ns=stamp_ns, position_px=np.ones((12, 2)), confidence=np.ones(12), status=np.zeros(12, np.uint8),
        body_length_px=80.0, image_width=320, image_height=240,
    )  # fmt: skip


def horizon(stamp_ns: int) -> FallHorizon:
    return FallHorizon(
        stamp_ns=stamp_ns, probabilities=np.tile([1.0, 0, 0], (16, 1)), distance=np.ones(16),
        distance_rate=np.zeros(16), time_to_boundary=np.full(16, np.inf), centre_distance=np.ones((16, 3)),
        plane=np.ones((16, 2)), forecast_px=np.ones((16, 12, 2)), quality=1.0,
    )  # fmt: skip


def command(stamp_ns: int, rests_on_ns: int, solve_ms: float = 1.0) -> SupportCommand:
    zeros = np.zeros(4)
    return SupportCommand(
        stamp_ns=stamp_ns, velocity=zeros, acceleration=zeros, column_height=1.0, stiffening=0.0, damping=zeros,
        stiffness=zeros, state=GaitState.FOLLOW, solver="mpc", lifetime_s=0.06, rests_on_ns=rests_on_ns,
        solve_time_s=solve_ms * 1e-3,
    )  # fmt: skip


def heard(spans_ms: list[tuple[float, float, float, float, float]]) -> Heard:
    """Return what is heard of frames whose hops take these spans; the frame before them is there as well."""
    lists: tuple[list, list, list] = ([], [], [])
    for number, spans in enumerate([spans_ms[0], *spans_ms]):
        frame = START + number * 100 * MS
        seen, foreseen, turn, done, sent = frame + np.cumsum(np.array(spans) * MS).astype(np.int64)
        lists[0].append((keypoints(frame), int(seen)))
        lists[1].append((horizon(frame), int(foreseen)))
        first = command(int(turn), frame, (done - turn) / MS)
        again = command(int(turn) + 10 * MS, frame)
        lists[2].extend([(first, int(sent)), (again, int(sent) + 10 * MS)])
    return Heard(*lists)


span = st.floats(0.01, 15.0)


@settings(max_examples=50, deadline=None)
@given(st.lists(st.tuples(span, span, span, span, span), min_size=1, max_size=8))
def test_the_hops_of_a_frame_add_up(spans: list[tuple[float, float, float, float, float]]) -> None:
    everything = heard(spans)
    total, parts = frame_to_command(everything), hops(everything)
    assert total.frames == len(spans)
    assert total.max == pytest.approx(max(map(sum, spans)), abs=2e-3)
    for k, part in enumerate(parts.values()):
        assert part.max == pytest.approx(max(row[k] for row in spans), abs=2e-3)
    assert list(parts) == list(HOPS)
    assert sum(shares(parts).values()) == pytest.approx(1.0)


def test_the_first_command_on_a_frame_counts_and_the_first_frame_does_not() -> None:
    rests = [START, START, START + 1, START + 1, 0, START + 2]
    commands = [(command(START + k, frame), START + k) for k, frame in enumerate(rests)]
    assert [arrival - START for _, arrival in first_on_each_frame(commands)] == [2, 5]


def test_a_frame_whose_horizon_was_missed_has_no_hops() -> None:
    everything = heard([(1, 1, 1, 1, 1), (2, 2, 2, 2, 2)])
    assert hops(everything._replace(horizons=everything.horizons[:-1]))["perception"].max == pytest.approx(1.0)


def test_nothing_heard_is_not_a_number() -> None:
    assert math.isnan(spread([]).p99)
    assert math.isnan(hops(Heard([], [], []))["anticipation"].p50)


def test_nothing_measured_is_an_error_with_its_reason() -> None:
    """Neither a table of NaN nor JSON with them."""
    everything = heard([(1, 1, 1, 1, 1), (2, 2, 2, 2, 2)])
    assert measured(everything) == (frame_to_command(everything), hops(everything))
    with pytest.raises(SurefootError, match="0 keypoints, 0 horizons and 0 commands came, 0 of these rest on a frame"):
        measured(Heard([], [], []))
    stopped = [(command(START + k, 0), START + k) for k in range(5)]
    with pytest.raises(SurefootError, match="and 5 commands came, 0 of these rest on a frame"):
        measured(everything._replace(commands=stopped))
    with pytest.raises(SurefootError, match="of 2 frames that became commands the observer missed every one's"):
        measured(everything._replace(horizons=[]))


@pytest.mark.processes
@pytest.mark.timeout(300)
def test_the_command_measures_the_real_processes(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    file = tmp_path / "out" / "latency.json"
    assert main(["latency", "--duration", "2", "--controller", "log", "--json", str(file)]) == 0
    result = json.loads(file.read_text())
    assert result["frame_to_command_ms"].keys() == {"frames", "p50", "p99", "max"}
    assert result["frame_to_command_ms"]["frames"] > 10
    assert list(result["hops"]) == list(HOPS)
    assert sum(result["shares"].values()) == pytest.approx(1.0, abs=1e-3)
    printed = capsys.readouterr().out
    assert "frame -> command" in printed
    assert "target p99" in printed
