"""The admittance the person feels at the interface, stiffened along a profile and paid for from an energy tank.

`M a + D(s) v + K_hold (p - p_hold) + K(s) (p - p_a) = f` along x, y, yaw and height, in the base frame's axes;
s in [0, 1] is the stiffening. `D` only dissipates and follows `s` at once. Raising `K` by dK at a displacement d
injects `dK d^2 / 2`, which a tank pays (Ferraguti, Secchi and Fantuzzi 2013); an empty tank holds K where it is.
The anchor `p_a` is placed where the person is when K leaves zero, so that nothing jumps, and slips along when a
walking person has stretched the spring to its reach: a plastic spring, which dissipates.

Slack in the harness is height a person falls before anything holds them. So while stiffened the column takes it up:
a force `D(s) s v_up (1 - load / (s F))`, which moves an unloaded column at `s v_up` and vanishes at a pull of `s F`,
lifts it, and the height's anchor follows it up and never down, like a ratchet (`controller.take_up`). The tank pays for
what the lifting gives beyond what the damper takes.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np

from bridge.config.admittance import AdmittanceConfig
from bridge.messages import Floats
from controller.take_up import TakeUp

HEIGHT = 3
YAW = 2


class AdmittanceStages(NamedTuple):
    """The law over the horizon. Displacements and `p` of the residual count from the motion's present pose.

    Residual of stage k: `M a + D_k v + (K_k + K_hold) p - f_k + load_k`.
    """

    mass: Floats  # (4,) [kg, kg, kg m^2, kg]
    damping: Floats  # (N, 4) [N s/m, N s/m, N m s/rad, N s/m]
    stiffness: Floats  # (N, 4) K_k + K_hold [N/m, N/m, N m/rad, N/m]
    load: Floats  # (N, 4) spring forces at the present pose [N, N, N m, N]


class _Rendered(NamedTuple):
    """What a profile asks for if the tank can pay. Shared between steps: not to be written to."""

    damping: Floats  # (N, 4)
    stiffness: Floats  # (N, 4) K
    total: Floats  # (N, 4) K + K_hold
    onset: int  # first stage that stiffens, 0 if none does


class EnergyTank:
    """Energy that stiffening may spend [J]."""

    def __init__(self, initial_j: float, capacity_j: float) -> None:
        self._capacity_j = capacity_j
        self.energy_j = initial_j

    def change(self, amount_j: float) -> None:
        """Take in (or give out, negative) energy between empty and full."""
        self.energy_j = min(max(self.energy_j + amount_j, 0.0), self._capacity_j)


class Admittance:
    """The law with its memory: present stiffness, anchor and tank.

    Args:
        config: values free and in an arrest.
        stage_s: length of a stage of the horizon [s].
        fading: (N,) what is left of the present wrench at each stage.

    Attributes:
        stiffness: (4,) K now, without K_hold.
        anchor: (4,) pose x, y, yaw, height in the odometry frame where the spring is slack; None while K is zero.
    """

    def __init__(self, config: AdmittanceConfig, stage_s: float, fading: Floats) -> None:
        self.mass: Floats = np.array(config.mass)
        self._free: Floats = np.array(config.damping_free)
        self._rise: Floats = np.array(config.damping_arrest) - self._free
        self._arrest: Floats = np.array(config.stiffness_arrest)
        self.hold: Floats = np.array([0.0, 0.0, 0.0, config.stiffness_hold_height_n_m])
        self._hold_height = config.height_hold_m
        self._take_up = TakeUp(config, stage_s)
        self._reach_m, self._reach_rad = config.spring_reach_horizontal_m, config.spring_reach_yaw_rad
        self._refill = config.tank_refill_fraction
        self._initial_j, self._capacity_j = config.tank_initial_j, config.tank_capacity_j
        self._stage_s = stage_s
        self._fading = fading
        self._drift = self._free_motion()
        self._last_profile = b""
        self.reset()

    def reset(self) -> None:
        """Forget anchor and stiffness; the tank starts with its initial content."""
        self.tank = EnergyTank(self._initial_j, self._capacity_j)
        self.release()

    def release(self) -> None:
        """Let go of the spring, as after a stop: stiffening anew anchors it where the walker then is."""
        self.stiffness: Floats = np.zeros(4)
        self.anchor: Floats | None = None
        self._anchored_m = 0.0  # height at which the anchor was placed
        self._lift_n, self._lift_m_s = 0.0, 0.0  # of the present step
        self._rise_m = 0.0  # how far the anchor may follow the column up

    def stages(self, profile: Floats, pose: Floats, velocity: Floats, force: Floats) -> AdmittanceStages:
        """Advance to the present stiffening and return the law over the horizon.

        Args:
            profile: (N,) stiffening at now + k stage_s, in [0, 1].
            pose: (4,) x, y, yaw, height in the odometry frame [m, rad].
            velocity: (4,) in the base frame.
            force: (4,) generalised force of the person now.
        """
        rendered = self._rendered(profile)
        hold_load = self.hold[HEIGHT] * (pose[HEIGHT] - self._hold_height)
        if profile[0] <= 0.0:
            # What the spring still stores is the tank's again.
            if self.anchor is not None:
                self._pay(np.zeros(4), self._displacement(pose))
                self.anchor = None
            self._lift_n = self._lift_m_s = self._rise_m = 0.0
            onset, stiffness, total = rendered.onset, rendered.stiffness, rendered.total
            displacement = -self._coast(onset, velocity, force, hold_load) if onset else np.zeros(4)
        else:
            if self.anchor is None:
                self.anchor = pose.copy()
                self._anchored_m = float(pose[HEIGHT])
            self._slip(pose)
            self._follow_up(float(pose[HEIGHT]))
            displacement = self._displacement(pose)
            stiffness, total = rendered.stiffness, rendered.total
            change = stiffness - self.stiffness
            cost = 0.5 * change @ displacement**2
            energy = self.tank.energy_j
            if not cost.max() <= energy:
                share = np.where(cost > energy, energy / np.maximum(cost, 1e-12), 1.0)
                stiffness = self.stiffness + share[:, None] * change
                total = stiffness + self.hold
            self._pay(stiffness[0], displacement)
        load = stiffness * displacement
        load[:, HEIGHT] += hold_load
        if self.anchor is not None:
            raised_m = float(self.anchor[HEIGHT]) - self._anchored_m
            damping = rendered.damping[:, HEIGHT]
            lift = self._take_up.lift(profile, damping, -float(force[HEIGHT]), raised_m, self.tank.energy_j)
            load[:, HEIGHT] -= lift.force_n
            self._lift_n, self._lift_m_s = float(lift.force_n[0]), float(lift.speed_m_s[0])
        return AdmittanceStages(self.mass, rendered.damping, total, load)

    def _rendered(self, profile: Floats) -> _Rendered:
        """Return what a profile (N,) asks for; a profile that stays, as in free walking, is evaluated once."""
        key = profile.tobytes()
        if key != self._last_profile:
            s = profile[:, None]
            stiffness = s**2 * self._arrest
            onset = int(np.argmax(profile > 0.0))
            self._last_rendered = _Rendered(self._free + s * self._rise, stiffness, stiffness + self.hold, onset)
            self._last_profile = key
        return self._last_rendered

    def settle(self, before: Floats, after: Floats, stages: AdmittanceStages, force: Floats, span_s: float) -> None:
        """Book what the damper dissipated while the velocity went from `before` to `after` (4,) in `span_s`.

        Where limits kept the motion from the law, the force missing to it may have done work on the
        person; that is taken from the dissipation first, and from the tank if it was more.
        """
        if span_s <= 0.0:
            return
        mean = 0.5 * (before + after)
        spring = stages.load[0] + stages.stiffness[0] * (0.5 * span_s * mean)
        missing = self.mass * (after - before) / span_s + stages.damping[0] * mean + spring - force
        net = float(stages.damping[0] @ mean**2) - max(float(missing @ mean), 0.0)
        net -= max(self._lift_n * float(mean[HEIGHT]), 0.0)
        self.tank.change(span_s * (self._refill * net if net > 0.0 else net))
        self._rise_m = span_s * self._lift_m_s

    def _pay(self, stiffness: Floats, displacement: Floats) -> None:
        self.tank.change(-0.5 * float((stiffness - self.stiffness) @ displacement**2))
        self.stiffness = stiffness

    def _displacement(self, pose: Floats) -> Floats:
        """Return `pose` from the anchor, (4,) along the base frame's axes."""
        if self.anchor is None:
            return np.zeros(4)
        x, y = pose[0] - self.anchor[0], pose[1] - self.anchor[1]
        cosine, sine = math.cos(pose[YAW]), math.sin(pose[YAW])
        turned = math.remainder(pose[YAW] - self.anchor[YAW], 2.0 * math.pi)
        return np.array([cosine * x + sine * y, cosine * y - sine * x, turned, pose[HEIGHT] - self.anchor[HEIGHT]])

    def _slip(self, pose: Floats) -> None:
        assert self.anchor is not None
        x, y = pose[0] - self.anchor[0], pose[1] - self.anchor[1]
        distance = math.hypot(x, y)
        if distance > self._reach_m:
            self.anchor[:2] = pose[:2] - self._reach_m / distance * np.array([x, y])
        turned = math.remainder(pose[YAW] - self.anchor[YAW], 2.0 * math.pi)
        if abs(turned) > self._reach_rad:
            self.anchor[YAW] = pose[YAW] - math.copysign(self._reach_rad, turned)

    def _follow_up(self, height_m: float) -> None:
        """Let the height's anchor follow the column up as far as slack was taken up."""
        assert self.anchor is not None
        anchor = float(self.anchor[HEIGHT])
        raised = min(height_m, anchor + self._rise_m)
        self._rise_m = 0.0
        if raised > anchor:
            released = (height_m - anchor) ** 2 - (height_m - raised) ** 2
            self.tank.change(0.5 * float(self.stiffness[HEIGHT]) * released)
            self.anchor[HEIGHT] = raised

    def _coast(self, stage: int, velocity: Floats, force: Floats, hold_load: float) -> Floats:
        """Return how far the free walker moves until `stage`: there the spring will be anchored."""
        by_velocity, by_force, by_load = self._drift[:, stage]
        distance: Floats = by_velocity * velocity + by_force * force
        distance[HEIGHT] -= by_load[HEIGHT] * hold_load
        return distance

    def _free_motion(self) -> Floats:
        """Displacement (3, N, 4) of the law at s = 0 for unit velocity, unit fading force, unit constant force."""
        stages = len(self._fading)
        drift = np.zeros((3, stages, 4))
        velocity = np.array([np.ones(4), np.zeros(4), np.zeros(4)])
        position = np.zeros((3, 4))
        for k in range(stages):
            drift[:, k] = position
            push = np.array([np.zeros(4), np.full(4, self._fading[k]), np.ones(4)])
            acceleration = one_step(
                self.mass, self._free, self.hold, push - self.hold * position, velocity, self._stage_s
            )
            position = position + self._stage_s * (velocity + 0.5 * self._stage_s * acceleration)
            velocity = velocity + self._stage_s * acceleration
        return drift


def one_step(
    mass: Floats, damping: Floats, stiffness: Floats, force: Floats, velocity: Floats, span_s: float
) -> Floats:
    """Return the acceleration that obeys the law on average over the coming `span_s`.

    `M a + D (v + a dt/2) + K (v dt/2 + a dt^2/4) = f`, f with the spring's present load taken off: the average-
    acceleration method (Newmark 1959), stable for any stiffness, neither adding nor losing energy.
    """
    half = 0.5 * span_s
    result: Floats = (force - (damping + half * stiffness) * velocity) / (mass + half * damping + half**2 * stiffness)
    return result
