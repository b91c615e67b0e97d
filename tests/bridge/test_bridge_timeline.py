"""Messages in, columns out: nothing is invented, nothing is held for ever."""

import csv
import math
from io import StringIO

import numpy as np
import pytest
from demo_stream import command, horizon, keypoints, odometry, run, stamp, wrench
from hypothesis import given, settings
from hypothesis import strategies as st

from bridge.launch.timeline import Recorder, Row, Ticker, to_csv
from bridge.messages import GaitState
from bridge.topics import FALL_HORIZON, SUPPORT_COMMAND


@pytest.fixture
def recorder():
    fed = Recorder()
    run(fed)
    return fed


def test_time_begins_with_the_recordings_first_frame_even_if_it_was_missed():
    late = Recorder()
    late.add(keypoints(0.5))  # the sixteenth tick is the first that came
    assert late.origin_ns == pytest.approx(stamp(0.0), abs=1000)
    assert late.time_s(stamp(2.0)) == pytest.approx(2.0)


def test_keypoints_that_are_not_valid_do_not_set_the_time():
    recorder = Recorder()
    recorder.add(keypoints(0.0, valid=False, reason="nobody in view"))
    assert recorder.origin_ns is None
    assert math.isnan(recorder.time_s(stamp(1.0)))
    assert recorder.rows(0.1) == []


def test_a_row_holds_what_was_sent(recorder):
    row = recorder.row(2.7)
    assert (row.state, row.solver, row.reason) == ("ARREST", "mpc", "because ARREST")
    assert (row.stiffening, row.damping_x, row.stiffness_x) == (1.0, 440.0, 2000.0)
    assert (row.command_x, row.velocity_x, row.command_height, row.height) == (0.4, 0.38, 1.0, 0.99)
    assert (row.force_x, row.force_z) == (12.0, -30.0)
    assert (row.fall, row.fall_ahead) == pytest.approx((0.1, 0.3))
    assert row.stable + row.transient + row.fall == pytest.approx(1.0)
    assert (row.distance, row.distance_ahead, row.quality) == pytest.approx((3.0, 2.0, 0.9))


@pytest.mark.parametrize(
    ("silent", "gaps"),
    [
        ("horizon", {"stable", "fall", "fall_ahead", "distance", "distance_ahead", "quality"}),
        ("odometry", {"velocity_x", "height"}),
        ("wrench", {"force_x", "force_z"}),
        ("command", {"stiffening", "damping_x", "stiffness_x", "command_x", "command_height"}),
    ],
)
def test_a_silent_stream_leaves_gaps_and_no_zeros(silent, gaps):
    recorder = Recorder()
    run(recorder, without=(silent,))
    rows = recorder.rows(0.1)
    assert rows
    for row in rows:
        unknown = {name for name, value in row._asdict().items() if isinstance(value, float) and math.isnan(value)}
        assert gaps <= unknown
        assert not unknown & ({"stiffening", "velocity_x", "fall", "force_z"} - gaps)
        assert (row.state == "") == (silent == "command")


def test_a_stream_that_stops_is_not_held():
    recorder = Recorder()
    recorder.add(keypoints(0.0))
    recorder.add(horizon(0.0))
    recorder.add(command(0.0))
    assert recorder.row(FALL_HORIZON.max_age_s - 0.001).fall == pytest.approx(0.1)
    assert math.isnan(recorder.row(FALL_HORIZON.max_age_s + 0.001).fall)
    assert recorder.row(SUPPORT_COMMAND.max_age_s + 0.001).state == ""


def test_a_message_that_must_not_be_used_is_a_gap_and_not_the_one_before():
    recorder = Recorder()
    recorder.add(keypoints(0.0))
    recorder.add(horizon(0.0))
    recorder.add(horizon(1 / 30, valid=False, reason="skeleton unlike a person"))
    assert recorder.row(0.02).fall == pytest.approx(0.1)
    assert math.isnan(recorder.row(0.05).fall)


def test_what_was_overtaken_is_dropped():
    recorder = Recorder()
    recorder.add(keypoints(0.0))
    recorder.add(odometry(0.2, velocity=0.2))
    recorder.add(odometry(0.1, velocity=0.1))
    assert recorder.row(0.2).velocity_x == pytest.approx(0.2)
    assert math.isnan(recorder.row(0.12).velocity_x)


def test_the_csv_is_what_was_fed(recorder):
    rows = recorder.rows(0.02)
    read = list(csv.DictReader(StringIO(to_csv(rows))))
    assert tuple(read[0]) == Row._fields
    assert len(read) == len(rows) == round(3.5 / 0.02) + 1
    for line, row in zip(read, rows, strict=True):
        for name, value in row._asdict().items():
            if isinstance(value, str):
                assert line[name] == value
            else:
                assert float(line[name]) == pytest.approx(value, rel=1e-5, nan_ok=True)


def test_the_csv_writes_gaps_as_nan():
    recorder = Recorder()
    run(recorder, duration_s=0.3, without=("horizon",))
    assert {line["fall"] for line in csv.DictReader(StringIO(to_csv(recorder.rows(0.1))))} == {"nan"}


def test_there_is_a_line_every_half_second_and_at_each_transition(recorder):
    lines = list(Ticker(recorder).new())
    changes = [(round(row.time_s, 3), row.state) for row, changed in lines if changed]
    assert changes == [(0.0, "FOLLOW"), (2.0, "GUARD"), (2.5, "ARREST")]
    times = [row.time_s for row, _ in lines]
    assert times == sorted(times)
    assert {round(2 * time_s) for time_s in times} == set(range(8))


@settings(deadline=None, max_examples=20)
@given(st.lists(st.sampled_from(list(GaitState)), min_size=1, max_size=60), st.integers(1, 7))
def test_no_transition_is_missed_however_the_messages_come_in(states, chunk):
    recorder, lines = Recorder(), []
    ticker = Ticker(recorder, period_s=0.5)
    recorder.add(keypoints(0.0))
    for index, state in enumerate(states):
        recorder.add(command(index / 100, state))
        if index % chunk == 0:
            lines += list(ticker.new())
    lines += list(ticker.new())
    expected = [state for index, state in enumerate(states) if index == 0 or state is not states[index - 1]]
    assert [row.state for row, changed in lines if changed] == expected


def test_commands_before_the_recording_are_not_shown():
    recorder = Recorder()
    recorder.add(command(-0.5, GaitState.DISARMED))
    assert list(Ticker(recorder).new()) == []
    recorder.add(keypoints(0.0))
    assert list(Ticker(recorder).new()) == []


def test_the_snapshot_sets_the_forecast_beside_what_came(recorder):
    shot = recorder.snapshot(1.0)
    assert shot.present_px[0, 0] == pytest.approx(10.0)
    assert shot.forecast_px[0, 0] == pytest.approx(15.0)
    assert shot.later_px[0, 0] == pytest.approx(15.0, abs=1e-6)  # ten pixels a second, half a second later
    end = recorder.snapshot(3.4)
    assert np.isnan(end.later_px).all()
    assert np.isfinite(end.present_px).all()


def test_a_snapshot_without_a_horizon_has_no_forecast():
    recorder = Recorder()
    run(recorder, without=("horizon",))
    shot = recorder.snapshot(1.0)
    assert np.isfinite(shot.present_px).all()
    assert np.isnan(shot.forecast_px).all()


def test_latency_is_counted_once_for_each_frame():
    recorder = Recorder()
    for time_s, frame_s, arrival_s in ((0.01, 0.0, 0.012), (0.02, 0.0, 0.022), (0.04, 1 / 30, 0.045)):
        recorder.add(command(time_s, rests_on_ns=stamp(frame_s)), arrival_ns=stamp(arrival_s))
    assert recorder.latency_s == pytest.approx([0.012, 0.045 - 1 / 30])


def test_streams_that_a_timeline_does_not_show_are_ignored(recorder):
    before = recorder.rows(0.5)
    recorder.add(wrench(3.5))
    assert recorder.rows(0.5) == before
