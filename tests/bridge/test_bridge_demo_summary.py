"""What is said of a run: nothing better than it was."""

import numpy as np
import pytest
from demo_stream import run
from rich.text import Text

from bridge.launch.observer import line
from bridge.launch.summary import fall_of, sentences, summarise
from bridge.launch.timeline import Recorder, Row

LABEL = np.repeat(np.array([-1, 0, 1], dtype=np.int8), [60, 30, 30])
TIME_S = np.arange(120) / 30


def row(time_s: float, stiffening: float, state: str = "FOLLOW") -> Row:
    numbers = dict.fromkeys(Row._fields, float("nan"))
    return Row(**(numbers | {"time_s": time_s, "stiffening": stiffening, "state": state, "solver": "", "reason": ""}))


def rows_of(*stiffening_and_state: tuple[float, str]) -> list[Row]:
    return [row(0.1 * index, *what) for index, what in enumerate(stiffening_and_state)]


def test_the_fall_is_where_the_labels_say():
    assert fall_of(LABEL, TIME_S) == pytest.approx((2.0, 3.0))
    assert fall_of(np.full(120, -1, dtype=np.int8), TIME_S) == (None, None)


def test_a_foreseen_fall_is_timed_from_its_onset():
    recorder = Recorder()
    run(recorder)
    summary = summarise(recorder.rows(0.02), 2.2, 3.1)
    assert summary.stiffening_s == pytest.approx(2.0)
    assert summary.guard_s == pytest.approx(2.0)
    assert summary.arrest_s == pytest.approx(2.5)
    assert summary.stiff_s == pytest.approx(2.5)
    text = " ".join(sentences(summary, recorder.latency_s))
    assert "first stiffening -0.20 s" in text
    assert "0.60 s before the body lay" in text
    assert "never stiffened" in text


def test_a_missed_fall_is_called_missed():
    summary = summarise(rows_of(*[(0.0, "FOLLOW")] * 20), 1.0, 1.5)
    assert summary.stiffening_s is None
    assert "missed" in " ".join(sentences(summary, np.array([])))


def test_a_fall_that_was_not_waited_for_is_not_called_missed():
    summary = summarise(rows_of(*[(0.0, "FOLLOW")] * 20), 5.0, 6.0)
    text = " ".join(sentences(summary, np.array([])))
    assert "Stopped at" in text
    assert "missed" not in text


def test_stiffening_for_nothing_is_said():
    walk = [(0.0, "FOLLOW")] * 5 + [(0.4, "GUARD")] * 3 + [(0.0, "FOLLOW")] * 5 + [(1.0, "ARREST")] * 5
    summary = summarise(rows_of(*walk), 1.2, 1.6)
    assert len(summary.before) == 1
    assert summary.before[0].largest == pytest.approx(0.4)
    assert "up to 0.40 (GUARD)" in " ".join(sentences(summary, np.array([])))


def test_a_walker_that_was_late_is_called_late():
    summary = summarise(rows_of(*[(0.0, "FOLLOW")] * 15, *[(1.0, "ARREST")] * 5), 0.5, 1.2)
    assert "after the body lay" in " ".join(sentences(summary, np.array([])))


def test_a_twitch_that_passed_is_not_the_answer_to_the_fall():
    states = [(0.0, "FOLLOW")] * 11 + [(0.1, "FOLLOW")] + [(0.0, "FOLLOW")] * 3 + [(1.0, "ARREST")] * 6
    summary = summarise(rows_of(*states), 1.0, 1.8)
    assert summary.stiffening_s == pytest.approx(1.5)


def test_unknown_stiffening_is_no_episode():
    assert summarise(rows_of(*[(float("nan"), "")] * 10), None, None).before == ()


def test_a_recording_without_a_fall_says_so():
    assert "no fall" in " ".join(sentences(summarise(rows_of((0.0, "FOLLOW")), None, None), np.array([0.01])))


def test_a_printed_line_shows_gaps_as_dashes():
    shown = line(row(1.0, float("nan"), ""))
    assert isinstance(shown, Text)
    assert "nan" not in shown.plain
    assert " - " in shown.plain
    assert "0.50" in line(row(1.0, 0.5)).plain
