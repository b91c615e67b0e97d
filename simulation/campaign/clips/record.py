"""One scenario as the camera on the walker sees it, with what really happens beside it.

When a disturbance becomes visible is found by performing the scenario again without it, with the same commands to the
walker: up to the disturbance both are the same to the last bit, and from the first moment at which a keypoint is
elsewhere the body is disturbed.
"""

from __future__ import annotations

from dataclasses import replace
from typing import Final, NamedTuple

import numpy as np

from bridge.clock import NS
from bridge.config.surefoot import SurefootConfig
from bridge.lockstep import LockStep
from bridge.messages import Floats, Keypoints
from simulation.campaign.clips.node import talking_camera
from simulation.campaign.trial import START_NS, TURN_NS
from simulation.node import SimulationNode, performing
from simulation.scenarios.deed import SitDown
from simulation.scenarios.library import chair
from simulation.scenarios.scenario import Performance, Scenario
from simulation.world.world import World

AFTER_S: Final = 2.8  # of a fall that is held, nothing new is seen later
AFTER_CONTACT_S: Final = 0.5
APART_M: Final = 0.05  # as far as a keypoint must be from where it would have been to be seen there
NEVER: Final = float("inf")


class Help(NamedTuple):
    """What the walker does: nothing, wait for the harness' load, or stiffen at a moment of its own."""

    name: str
    steps_used: int
    alarm_s: float = NEVER  # after the disturbance in a fall, else after the beginning [s]
    lasts_s: float = NEVER

    def alarmed(self, since_s: float) -> bool:
        """Whether a fall is foreseen, `since_s` after the disturbance or the beginning."""
        return self.alarm_s <= since_s < self.alarm_s + self.lasts_s


class History(NamedTuple):
    """What happened and what was seen."""

    seen: list[Keypoints]
    time_s: Floats  # (T,) every turn of the person, 4 ms
    keypoints_m: Floats  # (T, 12, 3)
    pelvis_m: Floats  # (T,) height
    load_n: Floats  # (T,) downward pull at the interface
    commands: list[tuple[float, float, float, float]]  # to the walker in each turn
    touched_s: float  # first contact of a knee or trunk with the floor; inf: none
    disturbed_s: float  # inf: never
    standing_m: float  # height of the pelvis in standing


class _Noted(Performance):
    """A performance that keeps the walker's commands."""

    def __init__(self, scenario: Scenario) -> None:
        super().__init__(scenario)
        self.commands: list[tuple[float, float, float, float]] = []

    def advance(self, command: tuple[float, float, float, float]) -> None:
        """Keep the command and move on."""
        self.commands.append(command)
        super().advance(command)


def perform(scenario: Scenario, help_: Help, config: SurefootConfig) -> History:
    """Perform `scenario` in the harness; the networks' place is taken by `help_`."""
    performance = _Noted(scenario)
    rows: list[tuple[float, Floats, float, float]] = []
    seen: list[Keypoints] = []
    made: list[SimulationNode] = []

    def note(world: World) -> None:
        rows.append((world.time_s, world.keypoints(), float(world.pelvis_m[2]), -world.wrench.up_n))

    def alarm() -> bool:
        began = performance.disturbed_s if scenario.kind == "fall" else 0.0
        return began is not None and help_.alarmed(performance.time_s - began)

    performance.watchers.append(note)
    intervention = config.intervention.model_copy(update={"steps_used": help_.steps_used})
    simulation = config.simulation.model_copy(update={"seed": scenario.seed})
    stack = LockStep(
        config.model_copy(update={"intervention": intervention, "simulation": simulation}),
        {
            "anticipation": (talking_camera(seen, alarm), {}),
            "drive": (performing(performance, made.append), {}),
            "controller": ("controller.node", {}),
        },
        START_NS,
    )
    standing_m = performance.world.person.pelvis_height_m
    touched_s = NEVER
    try:
        for turn in range(round(scenario.duration_s * NS / TURN_NS)):
            stack.advance_to(START_NS + turn * TURN_NS)
            now_s = performance.time_s
            disturbed_s = performance.disturbed_s
            if touched_s == NEVER and performance.world.touched_down():
                touched_s = now_s
            held = scenario.kind == "fall" and disturbed_s is not None and now_s > disturbed_s + AFTER_S
            if held or now_s > touched_s + AFTER_CONTACT_S:
                break
    finally:
        stack.close()
    disturbed_s = performance.disturbed_s
    return History(
        seen, np.array([row[0] for row in rows]), np.array([row[1] for row in rows]),
        np.array([row[2] for row in rows]), np.array([row[3] for row in rows]), performance.commands, touched_s,
        NEVER if disturbed_s is None else disturbed_s, standing_m,
    )  # fmt: skip


def undisturbed(scenario: Scenario) -> Scenario:
    """Return `scenario` without its mishap: whoever misses a seat finds a chair."""
    if not scenario.disturbances or not isinstance(scenario.disturbances[0], SitDown):
        return replace(scenario, disturbances=())
    return replace(scenario, seat=chair(scenario.size, scenario.lowered_m))


def visible_s(history: History, scenario: Scenario) -> float:
    """Return when the disturbance showed first: when the body was elsewhere than it would have been [s]; inf: never."""
    twin = Performance(undisturbed(scenario))
    for row, command in enumerate(history.commands):
        twin.advance(command)
        if history.time_s[row] >= history.disturbed_s:
            apart = np.linalg.norm(history.keypoints_m[row] - twin.world.keypoints(), axis=1)
            if apart.max() > APART_M:
                return float(history.time_s[row])
    return NEVER


def record(scenario: Scenario, help_: Help, config: SurefootConfig, impact_s: float) -> dict[str, Floats]:
    """Return a clip: what was seen, and the facts from which its labels are made.

    Args:
        scenario: who does what.
        help_: what the walker does.
        config: of the controller, the camera and the walker.
        impact_s: from the disturbance to the floor when nobody helps [s]; NaN: they do not fall.
    """
    history = perform(scenario, help_, config)
    shows_s = visible_s(history, scenario) if scenario.kind == "fall" else NEVER
    exposed_s = np.array([(message.stamp_ns - START_NS) / NS for message in history.seen])
    rows = np.clip(np.searchsorted(history.time_s, exposed_s - 1e-6), 0, len(history.time_s) - 1)
    keypoints = np.array([np.column_stack((m.position_px, m.confidence)) for m in history.seen])
    camera = config.simulation
    return {
        "keypoints": keypoints.astype(np.float32),
        "fps": np.array(camera.camera_rate_hz),
        "image_size": np.array([camera.camera_width_px, camera.camera_height_px]),
        "fall": np.array(float(scenario.kind == "fall")),
        "drop_m": (history.standing_m - history.pelvis_m[rows]).astype(np.float32),
        "lowered_m": np.array(scenario.lowered_m),
        "load_weights": (history.load_n[rows] / (9.81 * scenario.size.mass_kg)).astype(np.float32),
        "disturbed_s": np.array(history.disturbed_s),
        "visible_s": np.array(shows_s),
        "touched_s": np.array(history.touched_s),
        "impact_s": np.array(impact_s),
    }
