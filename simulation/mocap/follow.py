"""A person who follows a clip, and then is on their own.

Joint torques track the clip's angles, and feet on the floor push with their share of the weight. Twelve keypoints do
not balance, so a soft assistance holds the pelvis near the clip's: a spring and a damper, never stronger than ASSIST
of the weight and ASSIST_MOMENT_NM. RELEASE_S before the end, or at a touchdown shortly before, the nervous system of
`simulation.person` takes over, from where body and feet are; the assistance only steadies from there on, and fades.
At the end nothing of it is left, and contacts alone decide. Nothing is ever moved but by forces.
"""

from __future__ import annotations

from math import atan2, cos, sin
from typing import Final

import mujoco
import numpy as np

from bridge.messages import Floats
from simulation.mocap.retarget import Track
from simulation.person.person import CONTROL_S, GRAVITY, Intent
from simulation.person.posture import HIP_SHARE, turn_error
from simulation.world.world import World

RELEASE_S: Final = 1.2
PATIENCE_S: Final = 0.7
BEGIN_S: Final = 1.0  # from standing into the clip's first pose
START_S: Final = 1.0  # from that pose into its motion
ASSIST: Final = 0.8  # most force, of the weight
ASSIST_MOMENT_NM: Final = 450.0  # for 70 kg, as the gains below
TURN_NM_RAD: Final = 1500.0
TURN_NMS_RAD: Final = 100.0
PULL_1_S2: Final = 150.0  # stiffness over mass
PULL_1_S: Final = 20.0
FRICTION: Final = 0.4  # horizontal force of a foot, of the vertical one
STEADY_M_S: Final = 0.9  # faster walkers are slowed down before they are on their own
LEG_NM_RAD: Final = np.array([150.0, 500.0, 500.0, 400.0, 80.0, 60.0])
LEG_NMS_RAD: Final = np.array([8.0, 30.0, 30.0, 20.0, 4.0, 3.0])
UPPER_NM_RAD: Final = np.array([500.0, 500.0, 150.0, 50.0, 50.0, 40.0, 40.0, 25.0, 25.0])
UPPER_NMS_RAD: Final = np.array([35.0, 35.0, 12.0, 5.0, 5.0, 4.0, 4.0, 2.0, 2.0])


class Follower:
    """Drives the person of `world` along `track`, in the place of `Person.act`.

    Attributes:
        until_s: when the person is on their own: the disturbance, or the end of the clip [s].
        assistance_n: size of the assisting force of the last turn [N].
    """

    def __init__(self, world: World, track: Track, until_s: float) -> None:
        """Begin from where the person stands now."""
        self._world, self._track, self._person = world, track, world.person
        self.until_s = min(until_s, track.duration_s + BEGIN_S + 0.5 * START_S)
        self.assistance_n = 0.0
        self._time_s = 0.0
        self._own_s = 0.0  # when the person began to act by themselves; 0 before
        data, person = world.data, world.person
        self._origin: Floats = world.pelvis_m.copy()
        self._standing = [data.qpos[person.legs[side].q].copy() for side in "lr"]
        self._rest = data.qpos[person.upper.q].copy()
        m = data.xmat[person.pelvis]
        self._heading_rad = atan2(m[3], m[0])
        self._before = self._reference(0.0)
        self._velocity = np.zeros(6)

    def act(self, intent: Intent) -> None:
        """Set torques and assistance of the next turn."""
        self._time_s += CONTROL_S
        self.assistance_n = 0.0
        if not self._own_s and not self._ready():
            wanted = self._reference(self._time_s)
            force = self._pull(wanted)
            self._track_joints(wanted, force)
            self._assist(wanted, force, 1.0)
            self._before = wanted
            return
        if not self._own_s:
            self._own_s = self._time_s
            self._person.resume(float(self._before.pitch_rad))
        self._person.act(intent)
        if self._time_s < self.until_s:
            self._let_go((self.until_s - self._time_s) / (self.until_s - self._own_s))

    def _ready(self) -> bool:
        """Whether to take over: when both feet stand, a step begins; at the latest RELEASE_S before the end."""
        before_s = self.until_s - self._time_s
        both = all(leg.on_floor() for leg in self._person.legs.values())
        return before_s <= RELEASE_S or (both and before_s <= RELEASE_S + PATIENCE_S)

    def _reference(self, time_s: float) -> Track:
        """Return where the body should be, in the world: from standing into the clip."""
        u = min(time_s / BEGIN_S, 1.0)
        u = u * u * (3.0 - 2.0 * u)
        moving_s = max(time_s - BEGIN_S, 0.0)
        early_s = min(moving_s, START_S)
        now = self._track.at(0.5 * early_s * early_s / START_S + moving_s - early_s)
        c, s = cos(self._heading_rad), sin(self._heading_rad)
        x, y, z = now.hips_m
        hips = self._origin + np.array([c * x - s * y, s * x + c * y, u * (z - self._origin[2])])
        legs = np.stack([(1.0 - u) * still + u * leg for still, leg in zip(self._standing, now.legs_rad, strict=True)])
        return Track(
            self._track.fps_hz, hips, self._heading_rad + now.heading_rad, u * now.pitch_rad, legs,
            (1.0 - u) * self._rest + u * now.upper_rad, (1.0 - u) * 0.5 + u * now.load,
        )  # fmt: skip

    def _track_joints(self, wanted: Track, pull: Floats) -> None:
        """Set the motors: stiffness and damping about the clip, and the weight on the feet that carry it."""
        data, person, before = self._world.data, self._person, self._before
        weight, strength = person.size.mass_kg * GRAVITY, person.size.strength
        torque = np.zeros(self._world.model.nu)
        up = weight + min(max(float(pull[2]), -0.5 * weight), 0.5 * weight)
        along = pull[:2] * min(1.0, FRICTION * up / max(float(np.linalg.norm(pull[:2])), 1e-9))
        carried = np.array([*along, up])
        for index, side in enumerate("lr"):
            leg = person.legs[side]
            rate = (wanted.legs_rad[index] - before.legs_rad[index]) / CONTROL_S
            hold = LEG_NM_RAD * (wanted.legs_rad[index] - data.qpos[leg.q]) + LEG_NMS_RAD * (rate - data.qvel[leg.dof])
            share = float(wanted.load[index])
            if share > 0.0 and leg.on_floor():
                person.push(torque, side, share * carried)
            else:
                torque[leg.motor] = data.qfrc_bias[leg.dof]
            torque[leg.motor] += strength * hold
        upper = person.upper
        rate = (wanted.upper_rad - before.upper_rad) / CONTROL_S
        hold = UPPER_NM_RAD * (wanted.upper_rad - data.qpos[upper.q]) + UPPER_NMS_RAD * (rate - data.qvel[upper.dof])
        torque[upper.motor] = strength * hold + data.qfrc_bias[upper.dof]
        person.exert(torque)

    def _pull(self, wanted: Track) -> Floats:
        """Return the force (3,) that would bring the pelvis to the clip's [N]."""
        self._measure()
        speed = (wanted.hips_m - self._before.hips_m) / CONTROL_S
        force = PULL_1_S2 * (wanted.hips_m - self._world.pelvis_m) + PULL_1_S * (speed - self._velocity[3:])
        result: Floats = self._person.size.mass_kg * force
        return result

    def _let_go(self, share: float) -> None:
        """Steady the person who walks on by themselves: only slower than they can, only upright."""
        person, v = self._person, self._velocity
        self._measure()
        c, s = cos(person.heading_rad), sin(person.heading_rad)
        forward, aside = c * v[3] + s * v[4], c * v[4] - s * v[3]
        brake = PULL_1_S * person.size.mass_kg * (max(forward - STEADY_M_S, 0.0) * np.array([-c, -s, 0.0]))
        brake += 0.25 * PULL_1_S * person.size.mass_kg * aside * np.array([s, -c, 0.0])
        upright = self._before._replace(heading_rad=np.array(person.heading_rad))
        self._assist(upright, brake, share)

    def _assist(self, wanted: Track, force: Floats, share: float) -> None:
        """Pull at the pelvis, softly, and keep it upright."""
        world, person = self._world, self._person
        mass = person.size.mass_kg
        force = force * min(1.0, ASSIST * mass * GRAVITY / max(float(np.linalg.norm(force)), 1e-9))
        lean = HIP_SHARE * float(wanted.pitch_rad)
        error = turn_error(world.data.xmat[person.pelvis], float(wanted.heading_rad), lean)
        moment = TURN_NM_RAD * error - TURN_NMS_RAD * self._velocity[:3]
        moment *= mass / 70.0 * min(1.0, ASSIST_MOMENT_NM / max(float(np.linalg.norm(moment)), 1e-9))
        world.disturbing.append((person.pelvis, share * np.concatenate((force, moment))))
        self.assistance_n = share * float(np.linalg.norm(force))

    def _measure(self) -> None:
        """Find the pelvis' turning and linear velocity in world axes."""
        kind, world = mujoco.mjtObj.mjOBJ_BODY, self._world
        mujoco.mj_objectVelocity(world.model, world.data, kind, self._person.pelvis, self._velocity, 0)
