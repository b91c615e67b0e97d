"""A person driven by a motion-capture clip: what is read, where the joints go, and that forces alone move the body."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import mujoco
import numpy as np
import pytest

from bridge.config.simulation import SimulationConfig
from bridge.errors import SourceError
from bridge.messages import Floats
from simulation.kinematic.motion import Walker, move
from simulation.mocap.clip import Clip, clip_of, leg_length, load_clip
from simulation.mocap.follow import ASSIST, RELEASE_S
from simulation.mocap.retarget import retarget
from simulation.person.ability import STURDY
from simulation.person.anthropometry import BodySize
from simulation.person.body import LEG_JOINTS, UPPER_JOINTS
from simulation.person.person import CONTROL_S, Intent
from simulation.scenarios.disturbance import Faint
from simulation.scenarios.scenario import Performance, Scenario, Wish
from simulation.scenarios.single import scenario_from
from simulation.world.world import World

REST = (0.0, 0.0, 0.0, 0.0)
SIZE = BodySize(1.70, 75.0)


def walked(seconds: float = 5.0, speed: float = 0.7) -> Floats:
    """Keypoints (T, 12, 3) of a walking person at 30 Hz, in float16 as the recorded clips are."""
    motion = move(Walker(1.72, speed, 0.0), (), seconds, np.random.default_rng(0))
    every = round(1.0 / 30.0 / (motion.time_s[1] - motion.time_s[0]))
    return motion.keypoints_m[::every].astype(np.float16).astype(np.float64)


@pytest.fixture(scope="module")
def clip() -> Clip:
    return clip_of("walk", walked())


def written(tmp_path: Path, **arrays: object) -> str:
    file = tmp_path / "clips.npz"
    np.savez(file, **arrays)  # type: ignore[arg-type]
    return str(file)


def test_a_clip_is_read_by_name_from_where_it_is_wanted(tmp_path: Path) -> None:
    file = written(tmp_path, walk=walked().astype(np.float16), other=walked(2.0))
    whole, later = load_clip(f"{file}:walk"), load_clip(f"{file}:walk", 1.0, 2.5)
    assert whole.duration_s == pytest.approx(5.0, abs=0.05)
    assert later.duration_s == pytest.approx(2.5, abs=0.05)
    assert np.percentile(whole.points_m[:, 10:, 2].min(axis=1), 2.0) == pytest.approx(0.0, abs=1e-6)
    assert load_clip(written(tmp_path, only=walked())).name == "clips.npz:only"


@pytest.mark.parametrize(
    ("arrays", "name", "said"),
    [
        ({"walk": np.zeros((100, 12, 3))}, "wolk", "no clip 'wolk'.*such as walk"),
        ({"walk": np.zeros((100, 17, 3))}, "walk", r"shape \(100, 17, 3\), expected \(frames, 12, 3\)"),
        ({"walk": walked(0.5)}, "walk", "must be at least 1 s"),
        ({"walk": np.full((60, 12, 3), np.nan)}, "walk", "frame 0 has coordinates that are not finite"),
        ({"walk": 1000.0 * walked()}, "walk", "legs of .* m, must lie within.*metres"),
        ({"walk": walked(), "walk/fps": 3.0}, "walk", "3 frames a second"),
        ({"walk": np.array([["a"]])}, "walk", "not a readable npz file of clips"),
        ({"a": walked(), "b": walked()}, "", "name one of its clips"),
    ],
)
def test_what_is_no_clip_is_refused_by_name(tmp_path: Path, arrays: dict[str, object], name: str, said: str) -> None:
    file = written(tmp_path, **arrays)
    with pytest.raises(SourceError, match=said):
        load_clip(f"{file}:{name}" if name else file)


def test_a_file_that_is_none_is_an_error_in_one_line(tmp_path: Path) -> None:
    damaged = tmp_path / "damaged.npz"
    damaged.write_bytes(b"PK\x03\x04 nothing")
    for spec, said in ((f"{tmp_path}/none.npz:x", "no such file"), (f"{damaged}:x", "not a readable npz")):
        with pytest.raises(SourceError, match=said) as raised:
            load_clip(spec)
        assert "\n" not in str(raised.value)
    with pytest.raises(SourceError, match="no such file"):
        scenario_from(SimulationConfig(clip="nowhere.npz:walk"))


@pytest.mark.parametrize("size", [SIZE, BodySize(1.5, 45.0), BodySize(1.95, 120.0)])
def test_joints_go_where_the_clip_goes_on_a_body_of_any_size(clip: Clip, size: BodySize) -> None:
    """Forward kinematics of the retargeted angles gives the clip's directions of thighs, shanks, trunk and arms."""
    track = retarget(clip, size)
    world = World(size, STURDY, worn=False)
    model, data = world.model, world.data
    q = {name: model.joint(name).qposadr[0] for name in UPPER_JOINTS}
    q |= {f"{side}_{name}": model.joint(f"{side}_{name}").qposadr[0] for side in "lr" for name in LEG_JOINTS}
    scale = size.leg_m / leg_length(clip.points_m)
    for frame in range(0, len(track.hips_m), 10):
        for index, side in enumerate("lr"):
            for name, angle in zip(LEG_JOINTS, track.legs_rad[frame, index], strict=True):
                data.qpos[q[f"{side}_{name}"]] = angle
        for name, angle in zip(UPPER_JOINTS, track.upper_rad[frame], strict=True):
            data.qpos[q[name]] = angle
        heading, lean = track.heading_rad[frame], 0.6 * track.pitch_rad[frame]
        turn, bend = np.zeros(4), np.zeros(4)
        mujoco.mju_axisAngle2Quat(turn, (0.0, 0.0, 1.0), heading)
        mujoco.mju_axisAngle2Quat(bend, (0.0, 1.0, 0.0), lean)
        root = model.joint("root").qposadr[0]
        data.qpos[root : root + 3] = track.hips_m[frame]
        mujoco.mju_mulQuat(data.qpos[root + 3 : root + 7], turn, bend)
        mujoco.mj_kinematics(model, data)
        body, point = world.keypoints(), clip.points_m[frame]
        for first, second, allowed in ((6, 10, 0.10), (7, 11, 0.10), (0, 2, 0.03), (1, 3, 0.03), (2, 4, 0.15)):
            one, other = body[second] - body[first], point[second] - point[first]
            if first in (6, 7):
                one = one / scale
            else:
                one, other = one / np.linalg.norm(one), other / np.linalg.norm(other)
            assert np.linalg.norm(one - other) < allowed, (frame, first, second)


def performed(clip: Clip, scenario: Scenario, seconds: float) -> tuple[Performance, list[float], list[float]]:
    """Return the performance, and speed and assistance after each turn."""
    performance = Performance(replace(scenario, clip=clip), worn=False)
    speeds, assistance = [], []
    while performance.time_s < seconds:
        performance.advance(REST)
        follower = performance.follower
        assert follower is not None
        speeds.append(performance.world.pelvis_velocity_m_s.copy())
        assistance.append(follower.assistance_n)
    return performance, speeds, assistance


WALK = Scenario("clip", "non_fall", "walking", SIZE, (Wish(0.0, Intent(0.7)),), STURDY)


def test_the_person_follows_the_clip_and_then_walks_on_alone(clip: Clip) -> None:
    performance, speeds, assistance = performed(clip, WALK, 8.0)
    follower, world = performance.follower, performance.world
    assert follower is not None
    assert follower.until_s < 8.0
    released = round(follower.until_s / CONTROL_S)
    track = retarget(clip, SIZE)
    assert world.pelvis_m[0] > track.hips_m[-1, 0] * 0.6
    assert max(assistance) <= ASSIST * SIZE.mass_kg * 9.81 + 1e-6
    assert not any(assistance[released + 1 :]), "after the release nothing but contact acts"
    assert np.mean(assistance[: released - round(RELEASE_S / CONTROL_S)]) < 0.4 * SIZE.mass_kg * 9.81
    jumps = np.linalg.norm(np.diff(np.array(speeds), axis=0), axis=1)
    assert jumps.max() < 0.25, "no turn moves the person by anything but forces"
    assert not world.person.fallen
    assert world.person.steps >= 2


def test_the_disturbance_finds_the_person_alone(clip: Clip) -> None:
    faint = replace(WALK, kind="fall", disturbances=(Faint(3.0),))
    performance, _, assistance = performed(clip, faint, 5.0)
    follower = performance.follower
    assert follower is not None
    assert follower.until_s == 3.0
    assert not any(assistance[round(3.0 / CONTROL_S) :])
    assert performance.world.touched_down()


def test_who_waits_stands_and_the_clip_begins_when_the_waiting_ends(clip: Clip) -> None:
    performance = Performance(replace(WALK, clip=clip), worn=False)
    performance.waiting = True
    for _ in range(50):
        performance.advance(REST)
    assert performance.follower is None
    performance.waiting = False
    performance.advance(REST)
    assert performance.follower is not None


@pytest.mark.data
@pytest.mark.parametrize(
    ("file", "name", "from_s"),
    [("bandai_namco", "dataset-2_walk_normal_016", 0.0), ("cmu", "002_05", 1.0), ("lafan1", "walk1_subject1", 4.0)],
)
def test_recorded_people_drive_the_person(data_dir: Path, file: str, name: str, from_s: float) -> None:
    recorded = load_clip(f"{data_dir}/mocap/{file}.npz:{name}", from_s, 5.0)
    performance, _, assistance = performed(recorded, WALK, 5.0)
    assert not performance.world.person.fallen
    assert performance.world.touched_down() == ""
    assert np.mean(assistance) < 0.4 * SIZE.mass_kg * 9.81
