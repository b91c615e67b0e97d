"""A recording replayed: the same bytes every time, and on the wire as it was, but now."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import closing
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from bridge_recordings import NAMESPACE, SOURCES, START_NS, command, horizon, keypoints, walk, write
from bridge_toys import free_ports, wait_until
from hypothesis import given, settings
from hypothesis import strategies as st

from bridge.cli import main
from bridge.clock import NS, SystemClock
from bridge.codec import decode, encode
from bridge.config.bridge import BridgeConfig, RouterConfig
from bridge.config.load import load_config
from bridge.errors import SourceError, TransportError
from bridge.messages import FallHorizon, GaitState, SupportCommand
from bridge.record.offline import replay_offline
from bridge.record.online import Pace, StandIns, play
from bridge.record.reader import Recording
from bridge.record.rebase import TimeMap, rebase
from bridge.topics import (
    DIAGNOSTICS,
    FALL_HORIZON,
    KEYPOINTS,
    ODOMETRY,
    SUPPORT_COMMAND,
    TOPICS,
    TWIST,
    WRENCH,
    Topic,
)
from bridge.transport.interface import Sample
from bridge.transport.zenoh import ZenohTransport, open_session

CONFIG = load_config(None)


@pytest.fixture(autouse=True)
def elsewhere(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """No configuration file is found here: the defaults hold."""
    monkeypatch.chdir(tmp_path)


@pytest.fixture(scope="module")
def walked(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return write(tmp_path_factory.mktemp("walk") / "walk.mcap", walk(3.0))


def replayed(path: Path, roles: list[str], **options: dict[str, str]) -> list[tuple[Topic, Sample]]:
    kept: list[tuple[Topic, Sample]] = []
    replay_offline(Recording(path), roles, CONFIG, options, lambda topic, sample: kept.append((topic, sample)))
    return kept


ROLES = [
    pytest.param(["controller"], {"controller": {"controller": "log"}}, id="controller=log"),
    pytest.param(["anticipation", "controller"], {"controller": {"controller": "mpc"}}, id="both"),
]


@pytest.mark.parametrize(("roles", "options"), ROLES)
def test_a_replay_gives_the_same_bytes_every_time(walked: Path, roles: list[str], options: dict[str, Any]) -> None:
    first, second = replayed(walked, roles, **options), replayed(walked, roles, **options)
    assert [(topic.key, sample.payload, sample.arrival_ns) for topic, sample in first] == [
        (topic.key, sample.payload, sample.arrival_ns) for topic, sample in second
    ]
    made = {topic.key for topic, _ in first}
    assert made == {key for role in roles for key in MAKES[role]}


MAKES = {"anticipation": {"fall_horizon"}, "controller": {"support_command", "cmd_vel"}}


def test_the_controller_works_on_what_was_recorded(walked: Path) -> None:
    kept = replayed(walked, ["controller"], controller={"controller": "log"})
    commands: list[SupportCommand] = [decode(topic, s.payload) for topic, s in kept if topic == SUPPORT_COMMAND]
    assert len(commands) == pytest.approx(300, abs=2)  # a hundred a second, from the first message to the last
    states = [command.state for command in commands]
    assert GaitState.FOLLOW in states
    assert max(c.rests_on_ns for c in commands) > START_NS + 2 * NS
    after = states[states.index(GaitState.FOLLOW) :]
    assert set(after) <= {GaitState.FOLLOW, GaitState.GUARD}


def test_anticipation_foresees_from_what_was_recorded(walked: Path) -> None:
    kept = replayed(walked, ["anticipation"])
    horizons: list[FallHorizon] = [decode(topic, sample.payload) for topic, sample in kept]
    recorded = {recorded.publish_time_ns for recorded in Recording(walked).samples([KEYPOINTS])}
    assert {horizon.stamp_ns for horizon in horizons if horizon.valid} <= recorded
    assert sum(horizon.valid for horizon in horizons) > 60


def test_a_gap_in_the_recording_is_lived_through(tmp_path: Path) -> None:
    """Two seconds without a message: the nodes go on, the controller goes safe and comes back."""
    events = [*walk(1.0), *walk(1.0, START_NS + 3 * NS)]
    kept = replayed(write(tmp_path / "gap.mcap", events), ["controller"], controller={"controller": "log"})
    commands = [decode(topic, sample.payload) for topic, sample in kept if topic == SUPPORT_COMMAND]
    assert len(commands) == pytest.approx(400, abs=2)
    silent = [c for c in commands if START_NS + 1.3 * NS < c.stamp_ns < START_NS + 2.9 * NS]
    assert {command.state for command in silent} == {GaitState.SAFE_STOP}


def test_a_recording_without_the_inputs_is_refused(tmp_path: Path) -> None:
    path = write(tmp_path / "odom.mcap", walk(1.0, topics=(ODOMETRY,)))
    with pytest.raises(SourceError, match=r"odom.mcap: holds nothing that is fed to anticipation \(keypoints\)"):
        replayed(path, ["anticipation"])


def run(*arguments: object) -> int:
    return main([str(argument) for argument in arguments])


def test_two_runs_of_the_command_write_the_same_file(walked: Path, tmp_path: Path) -> None:
    first, second = tmp_path / "first" / "out.mcap", tmp_path / "second" / "out.mcap"
    for out in (first, second):
        out.parent.mkdir()
        arguments = ["--only", "controller", "--as-fast-as-possible", "--option", "controller=log"]
        assert run("replay", walked, *arguments, "--out", out) == 0
    assert first.read_bytes() == second.read_bytes()
    recording = Recording(first)
    assert {recorded.topic for recorded in recording.samples()} == {SUPPORT_COMMAND, TWIST}
    assert recording.listened == ("support_command", "cmd_vel")


@pytest.mark.parametrize(
    ("arguments", "what"),
    [
        (["--out", "OUT"], "--out goes with --only"),
        (["--as-fast-as-possible"], "--as-fast-as-possible goes with --only"),
        (["--only", "controller", "--topics", "odom"], "--topics goes without --only"),
        (["--only", "controller", "--as-fast-as-possible", "--rate", "2"], "--rate does not go with"),
        (["--only", "perceptoin"], "no such role"),
        (["--only", "controller", "--option", "anticipation.x=1"], "expected ROLE.NAME=VALUE"),
        (["--only", "controller", "--option", "controller"], "expected ROLE.NAME=VALUE"),
        (["--only", "controller", "--as-fast-as-possible", "--out", "IN", "--force"], "is the recording"),
        (["--only", "controller", "--as-fast-as-possible", "--out", "IN"], "is the recording"),
        (["--only", "drive", "--as-fast-as-possible", "--option", "sript=fall", "--out", "OUT"], "drive option sript"),
    ],
)
def test_what_makes_no_sense_is_said_in_one_line(
    walked: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str], arguments: list[str], what: str
) -> None:
    before = walked.read_bytes()
    places = {"OUT": str(tmp_path / "out.mcap"), "IN": str(walked)}
    assert run("replay", walked, *(places.get(word, word) for word in arguments)) == 2
    error = capsys.readouterr().err
    assert error.count("\n") == 1
    assert what in error
    assert not (tmp_path / "out.mcap").exists()
    assert walked.read_bytes() == before


@settings(max_examples=50, deadline=None)
@given(shift_s=st.integers(-(10**6), 10**6), rate=st.sampled_from([0.5, 1.0, 2.0, 10.0]))
def test_rebasing_moves_stamps_and_nothing_else(shift_s: int, rate: float) -> None:
    times = TimeMap(START_NS, START_NS + shift_s * NS, rate)
    stamp_ns = START_NS + 3 * NS
    for topic, message in [(KEYPOINTS, keypoints(stamp_ns, 5)), (FALL_HORIZON, horizon(stamp_ns, 6))]:
        payload, moved_ns = rebase(topic, encode(topic, message), times)
        moved = decode(topic, payload)
        assert moved.stamp_ns == moved_ns == times.to_now(stamp_ns)
        back, _ = rebase(topic, payload, TimeMap(moved_ns, stamp_ns, 1.0))
        assert back == encode(topic, message)


def test_rebasing_moves_the_frame_a_command_rests_on() -> None:
    times = TimeMap(START_NS, START_NS + 77 * NS, 1.0)
    sent = command(START_NS)
    moved = decode(SUPPORT_COMMAND, rebase(SUPPORT_COMMAND, encode(SUPPORT_COMMAND, sent), times)[0])
    assert moved.rests_on_ns == sent.rests_on_ns + 77 * NS
    none = SupportCommand(**{name: getattr(sent, name) for name in sent.__slots__} | {"rests_on_ns": 0})
    assert decode(SUPPORT_COMMAND, rebase(SUPPORT_COMMAND, encode(SUPPORT_COMMAND, none), times)[0]).rests_on_ns == 0


@pytest.mark.parametrize("payload", [b"", b"\x00\x01\x00\x00", b"\x00\x01\x00\x00" + b"\xff" * 40])
def test_garbage_is_replayed_as_garbage(payload: bytes) -> None:
    assert rebase(KEYPOINTS, payload, TimeMap(START_NS, START_NS + NS, 1.0)) == (payload, START_NS + NS)


@pytest.fixture
def wire(request: pytest.FixtureRequest) -> BridgeConfig:
    roles = ("perception", "anticipation", "controller", "drive")
    return BridgeConfig(
        endpoints={role: f"tcp/127.0.0.1:{port}" for role, port in zip(roles, free_ports(len(roles)), strict=True)},
        naming=getattr(request, "param", "ros2dds"),
    )


both_namings = pytest.mark.parametrize("wire", ["ros2dds", "rmw_zenoh"], indirect=True)


@pytest.fixture
def viewer(wire: BridgeConfig) -> Iterator[dict[str, list[Sample]]]:
    got: dict[str, list[Sample]] = {topic.key: [] for topic in TOPICS}
    with closing(ZenohTransport(wire, "viewer", SystemClock())) as transport:
        for topic in TOPICS:
            transport.subscribe(topic, got[topic.key].append)
        yield got


@both_namings
def test_the_whole_system_goes_over_the_wire_again(
    tmp_path: Path, wire: BridgeConfig, viewer: dict[str, list[Sample]]
) -> None:
    events = walk(0.5)
    recording = Recording(write(tmp_path / "walk.mcap", events))
    clock = SystemClock()
    began_ns = clock.now_ns()
    with StandIns(wire, SOURCES, clock) as stand_ins, closing(ZenohTransport(wire, "second", clock)) as other:
        seen: dict[str, bool] = {}
        other.watch_alive(seen.__setitem__)
        wait_until(lambda: len(seen) == 4, "the stand-ins are seen as the roles they stand in for")
        played = play(recording, TOPICS, stand_ins, Pace(rate=1.0, delay_s=1.0), clock, lambda _done: False)
        assert sum(played.sent.values()) == len(events)
        counts = {topic.key: sum(event.topic == topic for event in events) for topic in TOPICS}
        wait_until(lambda: {key: len(got) for key, got in viewer.items()} == counts, "everything arrives")
    assert len({sample.source for sample in viewer[DIAGNOSTICS.key]}) == 4
    for key, topic in ((topic.key, topic) for topic in TOPICS if topic != TWIST):
        stamps = [decode(topic, sample.payload).stamp_ns for sample in viewer[key]]
        recorded = [event.message.stamp_ns for event in events if event.topic == topic]
        assert len({stamp - recorded_ns for stamp, recorded_ns in zip(sorted(stamps), recorded, strict=True)}) == 1
        assert min(stamps) > began_ns
    arrivals = [sample.arrival_ns for sample in viewer[WRENCH.key]]
    assert np.all(np.diff(arrivals) >= 0)


def test_a_replay_does_not_mix_with_live_processes(wire: BridgeConfig) -> None:
    clock = SystemClock()
    with (
        closing(ZenohTransport(wire, "drive", clock)),
        pytest.raises(TransportError, match="drive cannot listen on .*: the port is in use"),
    ):
        StandIns(wire, ["perception", "drive"], clock)
    StandIns(wire, ["perception", "drive"], clock).close()  # what was opened is free again


def test_a_replay_stays_on_this_machine(wire: BridgeConfig) -> None:
    far = BridgeConfig(endpoints=wire.endpoints, connect=("tls/robot.example:7447",))
    with pytest.raises(TransportError, match="stays on this machine, and tls/robot.example:7447 does not"):
        StandIns(far, ["perception"], SystemClock())


def test_a_replay_does_not_leave_through_this_machines_router(tmp_path: Path, wire: BridgeConfig) -> None:
    """Recorded commands must not move a walker on another machine: who listens behind the router hears nothing."""
    router = f"tcp/127.0.0.1:{free_ports(1)[0]}"
    recording = Recording(write(tmp_path / "walk.mcap", walk(0.5)))
    clock = SystemClock()
    routed = BridgeConfig(endpoints=wire.endpoints, connect=(router,))
    behind, beside = BridgeConfig(mode="client", connect=(router,)), BridgeConfig(endpoints=wire.endpoints)
    heard: dict[str, list[Sample]] = {"behind": [], "beside": []}
    with (
        closing(open_session(BridgeConfig(router=RouterConfig(listen=(router,))), "router")),
        closing(ZenohTransport(behind, "viewer", clock)) as far,
        closing(ZenohTransport(beside, "viewer", clock)) as near,
    ):
        for transport, got in ((far, heard["behind"]), (near, heard["beside"])):
            transport.subscribe(SUPPORT_COMMAND, got.append)
        with StandIns(routed, SOURCES, clock) as stand_ins:
            play(recording, TOPICS, stand_ins, Pace(rate=1.0, delay_s=1.0), clock, lambda _done: False)
            wait_until(lambda: len(heard["beside"]) == 50, "the commands are heard on this machine")
    assert heard["behind"] == []


def test_a_replay_does_not_stand_in_for_a_role_elsewhere(wire: BridgeConfig) -> None:
    here = BridgeConfig(endpoints={**wire.endpoints, "controller": ""})
    with pytest.raises(TransportError, match=r"bridge.endpoints.controller is elsewhere"):
        StandIns(here, ["controller"], SystemClock())


@pytest.mark.parametrize("rate", [0.5, 4.0])
def test_a_replay_goes_at_the_rate_that_was_asked_for(tmp_path: Path, wire: BridgeConfig, rate: float) -> None:
    """By the stamps, which are moved with the messages: spans are divided by the rate."""
    events = walk(0.4, topics=(KEYPOINTS,))
    recording = Recording(write(tmp_path / "walk.mcap", events))
    got: list[Sample] = []
    clock = SystemClock()
    with closing(ZenohTransport(wire, "viewer", clock)) as viewer, StandIns(wire, ["perception"], clock) as stand_ins:
        viewer.subscribe(KEYPOINTS, got.append)
        began_ns = clock.now_ns()
        play(recording, TOPICS, stand_ins, Pace(rate, 1.0), clock, lambda _done: False)
        lasted_s = (clock.now_ns() - began_ns) / NS - 1.0
        wait_until(lambda: len(got) == len(events), "everything arrives")
    recorded_s = (events[-1].sample.arrival_ns - events[0].sample.arrival_ns) / NS
    stamps = [decode(KEYPOINTS, sample.payload).stamp_ns for sample in got]
    assert (stamps[-1] - stamps[0]) / NS == pytest.approx(recorded_s / rate, rel=1e-3)
    assert lasted_s >= recorded_s / rate - 0.01, "nothing is sent before its time"


def test_a_replay_ends_when_it_is_told_to(tmp_path: Path, wire: BridgeConfig) -> None:
    recording = Recording(write(tmp_path / "walk.mcap", walk(30.0, topics=(KEYPOINTS,))))
    clock = SystemClock()
    with StandIns(wire, ["perception"], clock) as stand_ins:
        turns = iter(range(20))
        played = play(recording, TOPICS, stand_ins, Pace(100.0, 0.0), clock, lambda _done: next(turns, None) is None)
    assert sum(played.sent.values()) < 20


@both_namings
@pytest.mark.processes
def test_a_process_is_fed_and_its_answers_are_kept(tmp_path: Path, wire: BridgeConfig) -> None:
    path = write(tmp_path / "walk.mcap", walk(1.5))
    endpoints = [f"bridge.endpoints.{role}={endpoint}" for role, endpoint in wire.endpoints.items()]
    endpoints.append(f"bridge.naming={wire.naming}")
    arguments = ["--only", "controller", "--option", "controller=log", "--delay", "0.5", "--out", tmp_path / "out.mcap"]
    assert run("replay", path, *arguments, *(word for pair in endpoints for word in ("--set", pair))) == 0
    commands = [message for _, message, _ in Recording(tmp_path / "out.mcap").messages([SUPPORT_COMMAND])]
    assert GaitState.FOLLOW in {command.state for command in commands}  # it was fed, and found its inputs fresh


def test_namespace_of_the_recordings() -> None:
    assert CONFIG.bridge.namespace == NAMESPACE
