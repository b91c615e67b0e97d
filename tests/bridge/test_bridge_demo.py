"""The demo command around the processes: its recording, its wire, its errors."""

import socket

import numpy as np
import pytest
from demo_stream import run

from bridge.config.load import load_config
from bridge.launch import rehearse as demo
from bridge.launch.summary import fall_of, summarise
from bridge.launch.timeline import Recorder


def test_the_recording_is_found_and_has_a_fall():
    labels = demo._labels(demo._recording())
    onset_s, lying_s = fall_of(labels.label, labels.time_s)
    assert onset_s is not None
    assert lying_s is not None
    assert 0.6 < lying_s - onset_s < 1.3


def test_the_demo_is_on_a_wire_of_its_own():
    loaded = load_config(None, demo.private_wire(None, []))
    assert loaded.bridge.namespace != load_config(None).bridge.namespace
    assert set(loaded.launch.roles) == {"perception", "anticipation", "controller", "drive"}
    assert not loaded.launch.restart


def test_a_port_in_use_is_not_used():
    with socket.socket() as busy:
        busy.bind(("127.0.0.1", 0))
        busy.listen()
        taken = f"tcp/127.0.0.1:{busy.getsockname()[1]}"
        overrides = [f"bridge.endpoints.controller={taken}"]
        loaded = load_config(None, [*overrides, *demo.private_wire(None, overrides)])
    assert loaded.bridge.endpoints["controller"] != taken
    assert len(set(loaded.bridge.endpoints.values())) == 4


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
    monkeypatch.setattr(demo.resources, "files", lambda _package: tmp_path)
    with pytest.raises(demo.SourceError, match=r"walk-stumble-fall\.npz.*missing"):
        demo._recording()
