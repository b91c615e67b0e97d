"""The world as a process: the topics of a walker and a camera, its own gate, the trial's trace; pictures of it."""

import logging
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from bridge.clock import NS, ManualClock
from bridge.config.load import load_config
from bridge.errors import ConfigError, SourceError
from bridge.inbox import Inbox
from bridge.lockstep import LockStep
from bridge.messages import GaitState, KeypointStatus, SupportCommand
from bridge.node import NodeContext
from bridge.outbox import Outbox
from bridge.topics import DETECTIONS, FALL_HORIZON, ODOMETRY, SUPPORT_COMMAND, WRENCH
from bridge.transport.memory import MemoryHub
from perception.sources.wire import WireSource
from simulation.node import SimulationNode, create
from simulation.person.anthropometry import BodySize
from simulation.person.person import Intent
from simulation.scenarios.disturbance import AtPhase, Push
from simulation.scenarios.scenario import Performance, Scenario, Wish
from simulation.scenarios.single import scenario_from
from simulation.trial import film
from simulation.trial.figure import Told, draw
from simulation.trial.outcome import outcome_of
from simulation.trial.trace import Trace, load_trace

START_NS = 1_000 * NS
TICK_NS = 10_000_000


class Stage:
    """The node on the in-memory wire, commanded by the test."""

    def __init__(self, **options: str) -> None:
        self.clock = ManualClock(START_NS)
        self.hub = MemoryHub(self.clock)
        context = NodeContext(load_config(None), self.hub.transport(), self.clock, logging.getLogger("test"), options)
        node = create(context)
        assert isinstance(node, SimulationNode)
        self.node = node
        self.wire = self.hub.transport()
        self.commands = Outbox(self.wire, SUPPORT_COMMAND)
        self.detections = Inbox(self.wire, DETECTIONS, depth=64)
        self.odometry = Inbox(self.wire, ODOMETRY)
        self.wrench = Inbox(self.wire, WRENCH)
        self.now_ns = START_NS

    def run(self, seconds: float, velocity: tuple[float, ...] | None = None) -> None:
        for _ in range(round(seconds * NS / TICK_NS)):
            if velocity is not None:
                self.commands.send(command(self.now_ns, velocity))
            self.node.step(self.now_ns)
            self.now_ns += TICK_NS
            self.clock.sleep_until(self.now_ns)


def command(stamp_ns: int, velocity: tuple[float, ...]) -> SupportCommand:
    return SupportCommand(
        stamp_ns=stamp_ns, velocity=list(velocity), acceleration=[0.0] * 4, column_height=1.0, stiffening=0.0,
        damping=[30.0, 60.0, 8.0, 800.0], stiffness=[0.0] * 4, state=GaitState.FOLLOW, solver="mpc", lifetime_s=0.06,
        rests_on_ns=stamp_ns,
    )  # fmt: skip


def test_it_speaks_the_topics_of_a_walker_and_a_camera() -> None:
    stage = Stage(scenario="walk")
    stage.run(1.0)
    seen = stage.detections.drain(stage.now_ns)
    assert len(seen) == pytest.approx(29, abs=1)
    assert np.all(np.abs(np.diff([m.stamp_ns for m in seen]) - NS / 30) < 4_100_000), "exposures keep their rate"
    lost = seen[0].status == KeypointStatus.LOST
    assert not lost.all()
    assert np.isnan(seen[0].position_px[lost]).all()
    assert stage.odometry.read(stage.now_ns).ok
    assert stage.wrench.read(stage.now_ns).ok


def test_a_camera_with_latency_is_late_but_stamps_the_exposure() -> None:
    late, quick = Stage(camera_latency_s="0.1"), Stage(camera_latency_s="0")
    for stage in (late, quick):
        stage.run(0.5)
    first = [stage.detections.drain(stage.now_ns) for stage in (late, quick)]
    assert len(first[1]) - len(first[0]) == pytest.approx(3, abs=1)
    assert first[0][0].stamp_ns == first[1][0].stamp_ns


def test_it_follows_commands_and_stops_when_they_stop() -> None:
    stage = Stage(scenario="walk")
    stage.run(2.0, (0.3, 0.0, 0.0, 0.0))
    moving = stage.odometry.read(stage.now_ns).message
    assert moving is not None
    assert moving.velocity[0] == pytest.approx(0.3, abs=0.1)
    stage.run(0.25)
    braked = stage.odometry.read(stage.now_ns).message
    stage.run(0.5)
    still = stage.odometry.read(stage.now_ns).message
    assert braked is not None
    assert still is not None
    assert np.linalg.norm(still.position[:2] - braked.position[:2]) < 0.05, "only the person's pull moves it now"
    assert stage.node.executed is not None
    assert not stage.node.executed.valid
    assert stage.node.status(stage.now_ns).level == 1


def test_one_seed_is_one_world() -> None:
    runs = []
    for seed in ("3", "3", "4"):
        stage = Stage(scenario="push", event_s="3", seed=seed)
        stage.run(4.0, (0.2, 0.0, 0.0, 0.0))
        newest, wrench = stage.detections.read(stage.now_ns).message, stage.wrench.read(stage.now_ns).message
        assert newest is not None
        assert wrench is not None
        runs.append((newest.position_px.tobytes(), wrench.force.tobytes()))
    assert runs[0] == runs[1]
    assert runs[0] != runs[2]


def test_an_option_nobody_knows_is_named() -> None:
    with pytest.raises(ConfigError, match="simulation option wind: known: trace, scenario"):
        Stage(wind="1")
    with pytest.raises(ConfigError, match="simulation option person_mass_kg = 300"):
        Stage(person_mass_kg="300")


def test_perception_takes_detections_from_the_wire() -> None:
    stage = Stage(scenario="walk")
    source = WireSource(Inbox(stage.wire, DETECTIONS, depth=64))
    stage.run(0.5)
    frames = [frame for _ in range(30) if (frame := source.next(stage.now_ns)) is not None]
    assert len(frames) == pytest.approx(14, abs=1)
    seen = stage.detections.drain(stage.now_ns)
    assert frames[3].stamp_ns == seen[3].stamp_ns
    found = seen[3].status == KeypointStatus.MEASURED
    np.testing.assert_array_equal(frames[3].people[0][found, :2], seen[3].position_px[found])
    assert np.all(frames[3].people[0][~found, 2] == 0.0)
    assert source.next(stage.now_ns) is None


def test_detections_that_declare_themselves_invalid_show_nobody() -> None:
    stage = Stage(scenario="walk")
    source = WireSource(Inbox(stage.wire, DETECTIONS, depth=64))
    stage.run(0.2)
    good = stage.detections.drain(stage.now_ns)[0]
    stage.node._detections.send(replace(good, stamp_ns=stage.now_ns, valid=False, reason="lens cap"))
    frames = [frame for _ in range(30) if (frame := source.next(stage.now_ns)) is not None]
    assert [bool(frame.people) for frame in frames] == [*[True] * (len(frames) - 1), False]


def test_what_waits_for_the_gait_does_not_count_the_time_before_the_scenario() -> None:
    late = AtPhase(Push(1.0, 10.0), 0.3, patience_s=0.5)
    scenario = Scenario("x", "non_fall", "x", BodySize(), (Wish(0.0, Intent()),), disturbances=(late,))
    performance = Performance(scenario)
    performance.waiting = True
    while performance.world.time_s < 3.0:
        performance.advance((0.0, 0.0, 0.0, 0.0))
    performance.waiting = False
    while performance.disturbed_s is None:
        performance.advance((0.0, 0.0, 0.0, 0.0))
    assert 1.5 <= performance.disturbed_s <= 1.52, "who stands has no phase that would be waited for: patience ends it"


def test_the_person_waits_until_the_walker_follows() -> None:
    stage = Stage(scenario="walk", begins="armed")
    stage.run(3.0)
    assert stage.node.world.person.steps == 0
    stage.run(3.0, (0.0, 0.0, 0.0, 0.0))
    assert stage.node.world.person.steps > 0


@pytest.fixture(scope="module")
def traced(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A short trial without any command: the person falls in a walker that stands."""
    path = tmp_path_factory.mktemp("trial") / "deep" / "trial.npz"
    stage = Stage(scenario="faint", event_s="3", trace=str(path))
    stage.run(6.0)
    assert not path.exists()
    assert not stage.node.finished()
    stage.run(3.2)
    assert stage.node.finished()
    stage.node.close()
    return path


def test_a_trace_holds_the_trial(traced: Path) -> None:
    trace = load_trace(traced)
    assert np.allclose(np.diff(trace.time_s), 0.02, atol=0.0041)
    assert np.all(np.diff(trace.stamp_ns) > 0)
    assert trace.qpos.shape == (len(trace.time_s), Stage().node.world.model.nq)
    outcome = outcome_of(trace, 3.0)
    assert 0.0 < outcome.drop_m < 0.3
    assert outcome.peak_force_n > 300
    assert not list(traced.parent.glob("*.part"))


def test_a_broken_trace_is_named(tmp_path: Path) -> None:
    (tmp_path / "x.npz").write_bytes(b"no archive")
    with pytest.raises(SourceError, match=r"x\.npz: cannot be read as a trace"):
        load_trace(tmp_path / "x.npz")


def test_the_outcome_says_what_happened() -> None:
    time_s = np.arange(0.0, 8.0, 0.02)
    flat = np.tile((0.0, 0.0, 0.9), (len(time_s), 1))
    quiet = Trace(time_s, time_s * 1e9, flat, flat, flat * 0, np.zeros((len(time_s), 4)), time_s * 0 + 1, time_s * 0,
                  time_s * 0)  # fmt: skip
    assert outcome_of(quiet, 4.0).held
    sunk = flat - np.outer(time_s > 5.0, (0.0, 0.0, 0.101))
    assert not outcome_of(quiet._replace(pelvis_m=sunk), 4.0).held
    assert not outcome_of(quiet._replace(touched=np.where(time_s > 5, 1.0, 0.0)), 4.0).held
    assert not outcome_of(quiet._replace(tilt_rad=np.where(time_s > 5, 0.3, 0.0)), 4.0).held
    assert outcome_of(quiet._replace(touched=np.where(time_s < 3, 1.0, 0.0)), 4.0).held, "before the event"


def test_the_figure_is_drawn_whole(traced: Path, tmp_path: Path) -> None:
    trace = load_trace(traced)
    draw([Told("a", trace, 3.0, [], 0.0), Told("b", trace, 3.0, [], 0.0)], tmp_path / "t.png")
    assert (tmp_path / "t.png").read_bytes().startswith(b"\x89PNG")
    assert [each.name for each in tmp_path.iterdir()] == ["t.png"]


def test_without_opengl_the_film_says_so(
    traced: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    def refuse(*_: object) -> None:
        raise RuntimeError("no EGL device")

    sizes = []
    monkeypatch.setattr(film, "scenario_from", lambda config: sizes.append(config) or scenario_from(config))
    monkeypatch.setattr(film.mujoco, "Renderer", refuse)
    tall = tmp_path.parent / "tall.toml"
    tall.write_text("[simulation]\nperson_height_m = 1.9\n")
    film.main([str(traced), str(traced), str(tmp_path), "--event-s", "3", "--config", str(tall)])
    assert sizes[0].person_height_m == 1.9, "the film shows who walked"
    capsys.readouterr()
    assert film.main([str(traced), str(traced), str(tmp_path), "--event-s", "3"]) == film.NO_PICTURES
    assert "no film: OpenGL cannot be used here (no EGL device)" in capsys.readouterr().err
    assert list(tmp_path.iterdir()) == []


def test_the_whole_stack_arrests_who_faints() -> None:
    """Perception, anticipation, controller and world in lock-step: the walker arms, follows, and arrests."""
    config = load_config(None, ["simulation.event_s=3"])
    system = LockStep(
        config,
        {
            "perception": ("perception.node", {"source": "wire"}),
            "anticipation": ("anticipation.node", {}),
            "drive": ("simulation.node", {"scenario": "faint"}),
            "controller": ("controller.node", {}),
        },
        START_NS,
    )
    wire = system.hub.transport()
    commands: Inbox[SupportCommand] = Inbox(wire, SUPPORT_COMMAND, max_age_s=float("inf"))
    horizons = Inbox(wire, FALL_HORIZON, max_age_s=float("inf"))
    world = next(node for node, _ in system._periodic if isinstance(node, SimulationNode)).world
    states, heights = [], []
    for tick in range(600):
        system.advance_to(START_NS + tick * TICK_NS)
        message = commands.read(system.clock.now_ns()).message
        states.append(None if message is None else message.state)
        heights.append(float(world.pelvis_m[2]))
        assert world.touched_down() == ""
    system.close()
    assert min(heights) > np.mean(heights[200:300]) - 0.10, "a fall is arrested within ten centimetres"
    assert horizons.read(system.clock.now_ns()).message is not None
    assert states[250] is GaitState.FOLLOW
    assert states[-1] is GaitState.ARREST
