"""`surefoot rehearse` around the processes: its recording, its pictures, its errors."""

import numpy as np
import pytest
from demo_stream import run

from bridge.errors import SourceError
from bridge.launch import clip
from bridge.launch import rehearse as demo
from bridge.launch.summary import fall_of, summarise
from bridge.launch.timeline import Recorder


def test_the_recording_is_found_and_has_a_fall():
    labels = demo._labels(clip.shipped_recording())
    onset_s, lying_s = fall_of(labels.label, labels.time_s)
    assert onset_s is not None
    assert lying_s is not None
    assert 0.6 < lying_s - onset_s < 1.3


def test_snapshots_are_taken_before_and_during_the_fall():
    recorder = Recorder()
    run(recorder)
    rows = recorder.rows(0.02)
    moments = demo._moments(rows, summarise(rows, 2.2, 3.1))
    assert moments == sorted(moments)
    assert any(time_s < 1.0 or time_s < 2.2 for time_s in moments)
    assert sum(2.2 <= time_s <= 3.1 for time_s in moments) >= 4
    assert all(0.0 <= time_s <= rows[-1].time_s for time_s in moments)
    without_fall = demo._moments(rows, summarise(rows, None, None))
    assert np.all(np.diff(without_fall) > 0)
    assert len(without_fall) == 8


def test_a_missing_recording_is_named(monkeypatch, tmp_path):
    monkeypatch.setattr(clip.resources, "files", lambda _package: tmp_path)
    with pytest.raises(SourceError, match=r"walk-stumble-fall\.npz.*missing"):
        clip.shipped_recording()
