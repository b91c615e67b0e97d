"""What `surefoot view` draws of a recording, read back from the file it saves."""

from __future__ import annotations

import subprocess
from collections import Counter
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from bridge_recordings import START_NS, Event, walk, write
from bridge_view_files import PLANE, Rrd, foreseen, with_message

from bridge.cli import main
from bridge.clock import NS
from bridge.messages import FallHorizon, Keypoints, NodeStatus, SupportCommand
from bridge.topics import DIAGNOSTICS, FALL_HORIZON, KEYPOINTS, ODOMETRY, SUPPORT_COMMAND, WRENCH
from bridge.transport.interface import Sample
from bridge.view.body import SHOWN_STEPS
from bridge.view.extra import load_rerun
from perception.skeleton import LINKS

pytest.importorskip("rerun", reason="rerun-sdk is not installed: pip install 'surefoot[view]'")

EVENTS = foreseen(1.5)


def shown(events: list[Event], folder: Path, *arguments: str) -> Rrd:
    out = folder / "walk.rrd"
    assert main(["view", str(write(folder / "walk.mcap", events)), "--out", str(out), *arguments]) == 0
    assert sorted(path.name for path in folder.iterdir()) == ["walk.mcap", "walk.rrd"]
    return Rrd(out)


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return tmp_path_factory.mktemp("view")


@pytest.fixture(scope="module")
def rrd(folder: Path) -> Rrd:
    return shown(EVENTS, folder)


def sent(kind: type) -> list:
    shown = [event for event in EVENTS if event.topic.key not in ("cmd_vel", "detections")]
    return [event.message for event in shown if isinstance(event.message, kind)]


def test_every_message_is_drawn_once(rrd: Rrd) -> None:
    count = Counter(event.topic for event in EVENTS)
    for entity, topic in {
        "/series/velocity/forward/commanded": SUPPORT_COMMAND,
        "/series/stiffening": SUPPORT_COMMAND,
        "/series/admittance/damping": SUPPORT_COMMAND,
        "/series/velocity/forward/measured": ODOMETRY,
        "/series/column/measured": ODOMETRY,
        "/series/force": WRENCH,
        "/series/probability": FALL_HORIZON,
        "/series/distance": FALL_HORIZON,
        "/health/on_arrival/keypoints": KEYPOINTS,
    }.items():
        assert len(rrd.drawn(entity, "scalars")) == count[topic], entity
    assert len(rrd.drawn("/image/person/links", "strips")) == count[KEYPOINTS]
    assert len(rrd.drawn("/image/forecast", "strips")) == count[FALL_HORIZON]
    assert len(rrd.drawn("/plane/ahead/path", "strips")) == count[FALL_HORIZON]
    assert sum(len(rrd.drawn(f"/health/rate/{role}", "scalars")) for role in ("drive", "perception")) == 16
    assert count[DIAGNOSTICS] == 32


def test_three_timelines_and_no_other(rrd: Rrd) -> None:
    assert rrd.timelines == {"trial", "stamp", "arrival"}
    rows = rrd.drawn("/series/stiffening", "scalars")
    commands = [event for event in EVENTS if event.topic == SUPPORT_COMMAND]
    assert [row.stamp_ns for row in rows] == [event.message.stamp_ns for event in commands]
    assert [row.arrival_ns for row in rows] == [event.sample.arrival_ns for event in commands]
    assert [row.trial_ns for row in rows] == [event.message.stamp_ns - START_NS for event in commands]


def test_curves_hold_the_numbers_of_the_messages(rrd: Rrd) -> None:
    commands, horizons = sent(SupportCommand), sent(FallHorizon)
    np.testing.assert_allclose(rrd.curve("/series/stiffening")[:, 0], [m.stiffening for m in commands])
    np.testing.assert_allclose(rrd.curve("/series/admittance/damping"), [m.damping for m in commands])
    ends = [np.concatenate((m.probabilities[0], m.probabilities[-1])) for m in horizons]
    np.testing.assert_allclose(rrd.curve("/series/probability"), ends)
    distances = [(m.distance[0], m.distance[-1]) for m in horizons]
    np.testing.assert_allclose(rrd.curve("/series/distance")[:, :2], distances)


def test_present_skeleton_black_and_foreseen_ones_cyan(rrd: Rrd) -> None:
    keypoints, horizon = sent(Keypoints)[3], sent(FallHorizon)[3]
    present = rrd.drawn("/image/person/links", "strips")[3].values
    np.testing.assert_allclose(present["strips"], keypoints.position_px[LINKS], rtol=1e-6)
    assert present["colors"] == [0x000000FF]
    ahead = rrd.drawn("/image/forecast", "strips")[3].values
    expected = np.concatenate([horizon.forecast_px[step][LINKS] for step in SHOWN_STEPS])
    np.testing.assert_allclose(ahead["strips"], expected, rtol=1e-6)
    assert ahead["colors"][-1] == 0x00B4C8FF
    red, green, blue = ((np.array(ahead["colors"]) >> shift) & 255 for shift in (24, 16, 8))
    assert (red < green).all()
    assert (red < blue).all()


def test_plane_shows_regions_boundary_and_both_trajectories(rrd: Rrd) -> None:
    (regions,) = rrd.drawn("/plane/regions", "blob")
    assert bytes(regions.values["blob"][0]).startswith(b"\x89PNG")
    (boundary,) = rrd.drawn("/plane/boundary", "strips")
    points = np.array(boundary.values["strips"]).reshape(-1, 2)
    np.testing.assert_allclose(PLANE.signed_distance(points), 0.0, atol=1e-5)
    horizon = sent(FallHorizon)[0]
    path = rrd.drawn("/plane/ahead/path", "strips")[0].values
    np.testing.assert_allclose(path["strips"][0], horizon.plane, rtol=1e-5, atol=1e-6)
    assert path["colors"] == [0x00B4C8FF]
    assert rrd.drawn("/plane/past", "strips")[5].values["colors"] == [0x000000FF]
    assert not any("regions are not drawn" in text for text in rrd.events())


def test_states_processes_and_events(rrd: Rrd) -> None:
    assert [row.values["state"] for row in rrd.drawn("/state/control/supervisor", "state")] == [["FOLLOW"]]
    for role in ("perception", "anticipation", "controller", "drive"):
        assert rrd.drawn(f"/state/process/{role}", "state")[0].values["state"] == ["ok"]
    document = rrd.drawn("/health/summary", "text")[-1].values["text"][0]
    assert all(role in document for role in ("perception", "anticipation", "controller", "drive"))
    assert "100 Hz" in document


def test_the_layout_travels_with_the_file(rrd: Rrd) -> None:
    kinds = Counter(rrd.views.values())
    assert kinds["2D"] == 3
    assert kinds["3D"] == kinds["TextLog"] == kinds["TextDocument"] == 1
    assert kinds["StateTimeline"] == 2
    assert kinds["TimeSeries"] >= 10
    for entity in ("/horizon/axes/grid", "/world/walker/frame", "/series/probability", "/state/control/supervisor"):
        assert len(rrd.static(entity)) == 1, entity


def test_rerun_itself_finds_the_file_in_order(rrd: Rrd, folder: Path) -> None:
    program, file = str(load_rerun().viewer), str(folder / "walk.rrd")
    subprocess.run([program, "rrd", "verify", file], check=True, capture_output=True, timeout=60)
    stats = subprocess.run([program, "rrd", "stats", file], check=True, capture_output=True, text=True, timeout=60)
    assert "/plane/boundary" in stats.stdout


def test_a_horizon_of_another_checkpoint_gets_no_regions(tmp_path: Path) -> None:
    rrd = shown(walk(0.3), tmp_path)  # its distances are made up
    assert not rrd.drawn("/plane/regions", "blob")
    assert not rrd.drawn("/plane/boundary", "strips")
    assert len(rrd.drawn("/plane/ahead/path", "strips")) == 9
    assert sum("regions are not drawn" in text for text in rrd.events()) == 1


def test_what_is_silent_is_taken_away(tmp_path: Path) -> None:
    last_ns = START_NS + NS // 2
    events = [e for e in EVENTS if e.topic not in {KEYPOINTS, FALL_HORIZON} or e.message.stamp_ns <= last_ns]
    rrd = shown(events, tmp_path)
    gone_ns = last_ns + round(KEYPOINTS.max_age_s * NS)
    for entity in ("/image/person", "/image/forecast", "/plane/present"):
        (clear,) = rrd.drawn(entity, "is_recursive")
        assert clear.stamp_ns == gone_ns
    curve = rrd.drawn("/series/probability", "scalars")
    assert curve[-1].stamp_ns == gone_ns
    assert np.isnan(curve[-1].values["scalars"]).all()
    assert "keypoints is silent: nothing for 150 ms" in rrd.events()


def test_what_is_invalid_is_not_drawn_and_says_why(tmp_path: Path) -> None:
    def spoil(event: Event) -> Event:
        if event.message.stamp_ns < START_NS + NS // 5:
            return event
        if isinstance(event.message, FallHorizon):
            nothing = {name: np.full_like(getattr(event.message, name), np.nan) for name in ("plane", "forecast_px")}
            reason = "two people in view"
            return with_message(event, replace(event.message, valid=False, reason=reason, quality=0.25, **nothing))
        if isinstance(event.message, Keypoints):
            position = event.message.position_px.copy()
            position[4] = np.nan
            status = event.message.status.copy()
            status[4] = 2
            return with_message(event, replace(event.message, position_px=position, status=status))
        return event

    rrd = shown([spoil(event) for event in foreseen(0.5)], tmp_path)
    assert len(rrd.drawn("/image/forecast", "strips")) == 6
    assert np.isnan(rrd.curve("/series/probability")[6:]).all()
    np.testing.assert_allclose(rrd.curve("/series/quality")[6:, 0], 0.25)
    assert rrd.events().count("horizon is not valid: two people in view") == 1
    links = [len(row.values["strips"]) for row in rrd.drawn("/image/person/links", "strips")]
    assert links[0] == 12
    assert links[-1] == 11  # the lost wrist ends one link
    assert len(rrd.drawn("/image/person/joints", "positions")[-1].values["positions"]) == 11


def test_a_process_that_falls_silent_is_shown_so(tmp_path: Path) -> None:
    def said_by(event: Event) -> str:
        return event.message.role if isinstance(event.message, NodeStatus) else ""

    events = [e for e in EVENTS if said_by(e) != "controller" or e.message.stamp_ns < START_NS + NS // 10]
    rrd = shown(events, tmp_path)
    states = [row.values["state"][0] for row in rrd.drawn("/state/process/controller", "state")]
    assert states == ["ok", "silent"]
    assert "controller says nothing any more" in rrd.events()


def test_bytes_that_do_not_decode_are_named_and_the_rest_is_drawn(tmp_path: Path) -> None:
    def spoil(event: Event) -> Event:
        sample: Sample = event.sample._replace(payload=event.sample.payload[:20])
        return Event(event.topic, event.message, sample) if event.topic == WRENCH else event

    rrd = shown([spoil(event) for event in foreseen(0.3)], tmp_path)
    assert sum(text.startswith("refused: wrench does not decode") for text in rrd.events()) == 1
    assert len(rrd.drawn("/series/stiffening", "scalars")) == 30


def test_names_from_the_wire_cannot_leave_their_place(tmp_path: Path) -> None:
    status = NodeStatus(
        stamp_ns=START_NS, role="a/b |x", level=1, summary="a|b", values={"../rate": "1", "rate_hz": "nan"}
    )
    events = [*foreseen(0.1)]
    index = next(i for i, event in enumerate(events) if event.topic == DIAGNOSTICS)
    events[index] = with_message(events[index], status)
    rrd = shown(events, tmp_path)
    odd = [entity for entity in rrd.rows if "rate" in entity and "\\" in entity]
    assert odd
    assert all(entity.startswith("/health/figure/") for entity in odd)
