"""The person's nervous system: from what the body does to torques at the joints, 250 times a second.

Standing legs push the wanted ground reaction through their soles (virtual model control: J. Pratt et al.,
'Virtual model control', IJRR 20(2), 2001: torques = -J^T force); the swinging leg follows a path to the next foothold;
trunk and arms keep their posture. No force acts on the person that floor, furniture, harness or a disturbance did not
exert.
"""

from __future__ import annotations

from dataclasses import dataclass
from math import atan2, cos, exp, hypot, sin, sqrt
from typing import Any, Final

import mujoco
import numpy as np

from bridge.messages import Floats
from simulation.person.ability import FRAIL, Ability
from simulation.person.anthropometry import BodySize
from simulation.person.body import SIDES
from simulation.person.leg import leg_angles
from simulation.person.posture import HIP_SHARE, turn_error
from simulation.person.reflexes import Reflexes
from simulation.person.stepping import DOUBLE_SUPPORT_S, Bob, bob, dip, foothold, plan_step
from simulation.person.support import Sole, Stance, double_support, ground_force, single_support, wanted_pressure
from simulation.person.swing import Leg
from simulation.person.upper_body import UpperBody

CONTROL_S: Final = 0.004
GRAVITY: Final = 9.81
LIMP_KD: Final = 1.0
URGE_GAIN: Final = 0.08  # per step
URGE_MOST_M_S: Final = 0.12
TALL_M: Final = 0.008  # above standing: the swinging leg lifts the centre of mass, not the hips
RAISE_GAIN: Final = 0.3  # per step
RAISE_MOST_M: Final = 0.06
DEEPENS_M_S: Final = 0.1  # how fast the dip of the body follows the length of the steps
LANDED: Final = 0.95  # share of a step after which a foot that touches the floor stands
FELT_TO_SWING_S: Final = 0.06  # a hurried foot still needs this
FASTEST_M_S: Final = 1.1  # planned: beyond it these reflexes lose their balance by themselves


@dataclass(frozen=True, slots=True)
class Intent:
    """What the person wants to do."""

    speed_m_s: float = 0.0
    yaw_rate_rad_s: float = 0.0
    crouch_m: float = 0.0  # centre of mass below its height in standing
    trunk_pitch_rad: float = 0.0  # forward bend in the hips and the back
    reach_rad: float = 0.0  # arms lifted forward
    back_m: float = 0.0  # centre of mass behind the middle of the feet: who sits down trusts the chair
    effort: float = 1.0  # share of the strength used; 0 in a faint


class Person:
    """Walks, stands, bends and crouches; steps to recover; gives up when there is nothing left to do."""

    def __init__(
        self,
        model: Any,
        data: Any,
        size: BodySize,
        ability: Ability = FRAIL,
        reflexes: Reflexes | None = None,
    ) -> None:
        """Stand the person of `simulation.person.body.add_person` up where it is in `model`."""
        self._model, self._data, self.size, self.ability = model, data, size, ability
        self._reflexes = g = Reflexes() if reflexes is None else reflexes
        self._reaction = np.array([g.reaction_roll, g.reaction_pitch, g.reaction_yaw])
        self._trunk_kp = np.array([g.trunk_nm_rad, g.trunk_nm_rad, g.turn_nm_rad])
        self._trunk_kd = np.array([g.trunk_nms_rad, g.trunk_nms_rad, g.turn_nms_rad])
        self._turn_limit = g.turn_moment_nm * size.mass_kg / 70.0
        self.pelvis, self.torso = model.body("pelvis").id, model.body("torso").id
        self.legs = {side: Leg(model, data, side, sign, size, g, CONTROL_S) for side, sign in SIDES}
        self.upper = UpperBody(model, data, size, g)
        self._motors = np.concatenate((*(leg.motor for leg in self.legs.values()), self.upper.motor))
        self._dofs = np.concatenate((*(leg.dof for leg in self.legs.values()), self.upper.dof))
        self._torque = np.abs(model.actuator_ctrlrange[:, 1])
        self.foot = {side: leg.foot for side, leg in self.legs.items()}
        self.sole = {s: leg.geom for s, leg in self.legs.items()}
        self._jacobian, self._spin = np.zeros((3, model.nv)), np.zeros((3, model.nv))
        self._velocity = np.zeros(6)
        self._moment_limit = ability.trunk_moment_nm * size.mass_kg / 70.0
        self.width_m = g.step_width * size.height_m
        self._stand_up()
        self.standing_height_m = float(data.subtree_com[self.pelvis][2]) - 0.004 * size.height_m
        self.pelvis_height_m = float(data.xpos[self.pelvis][2])
        self._omega = sqrt(GRAVITY / self.standing_height_m)
        self.heading_rad = 0.0
        self.stance = "l"
        self.steps = 0
        self.fallen = False
        self._standing = True
        self._speed = 0.0
        self._time_in_step = 0.0
        self._step = plan_step(0.0, size.height_m, self.width_m, ability)
        self._lifts_s, self._lands_s = self._step.double_support_s, self._step.duration_s  # of this step, if hurried
        self._alarmed_s = 0.0  # for how long the DCM has been far from where it should be
        self._raised = 0.0  # what a person adds to the wanted height when they sagged in the last steps [m]
        self._sagged = 0.0  # sum over the turns of this step [m]
        self._urge = 0.0  # what a person adds to the wanted speed when the last steps fell short of it [m/s]
        self._began_at = (0.0, 0.0)  # where the centre of mass was at the last touchdown
        self._lifted = False  # whether the swing of this step has begun
        self._foothold = (0.0, 0.0)
        self._pitch = 0.0
        self._crouch = self._back = 0.0
        self._deep = 0.0  # by which the body is lowered in double support [m]

    @property
    def swing(self) -> str:
        """The side that does not stand, or stands less."""
        return "r" if self.stance == "l" else "l"

    @property
    def swinging(self) -> bool:
        """Whether the swing leg is in the air by intention."""
        return not self._standing and self._time_in_step >= self._lifts_s

    @property
    def phase(self) -> float:
        """Share of the present step that is over, 0..1."""
        return min(self._time_in_step / self._lands_s, 1.0)

    def act(self, intent: Intent) -> None:
        """Set the torques for the next CONTROL_S seconds."""
        model, data, g = self._model, self._data, self._reflexes
        mujoco.mj_subtreeVel(model, data)
        com, com_velocity = data.subtree_com[self.pelvis], data.subtree_linvel[self.pelvis]
        trunk = data.xmat[self.torso]
        if trunk[8] < cos(self.ability.give_up_tilt_rad) or com[2] < 0.62 * self.standing_height_m:
            self.fallen = True
        effort = 0.0 if self.fallen else intent.effort
        if effort <= 0.0:
            data.ctrl[self._motors] = np.clip(-LIMP_KD * data.qvel[self._dofs], -5.0, 5.0)  # a little tone
            return
        self._follow(intent)
        dcm = (float(com[0] + com_velocity[0] / self._omega), float(com[1] + com_velocity[1] / self._omega))
        heading = (cos(self.heading_rad), sin(self.heading_rad))
        lead, trail = self.legs[self.stance].sole(), self.legs[self.swing].sole()
        self._decide(dcm, lead, trail, intent, heading)
        lead, trail = self.legs[self.stance].sole(), self.legs[self.swing].sole()
        torque = np.zeros(model.nu)
        stance, in_air = self._stance(dcm, lead, trail, heading)
        moment = self._trunk_moment()
        if in_air:
            reaction = self._swing_leg(torque, dcm, stance.centre, lead, heading)
            moment += self._reaction * reaction
            moment[2] = min(max(moment[2], -self._turn_limit), self._turn_limit)
        wave = self._bob()
        height = self.standing_height_m - self._crouch - wave.low_m
        self._sagged += height - float(com[2])
        height += self._raised + (0.0 if self._standing else TALL_M)
        lift = g.lift_1_s2 * (height - float(com[2])) - g.lift_1_s * (float(com_velocity[2]) + wave.sinking_m_s)
        lift = wave.upward_m_s2 + min(max(lift, -6.0), 6.0)
        vertical = self.size.mass_kg * max(GRAVITY + lift, 2.0)
        force = ground_force(com, max(float(com[2]), 0.3), stance.centre, vertical, (moment[0], moment[1]))
        sides = (self.stance,) if in_air else (self.stance, self.swing)
        for side, share, point in zip(sides, stance.share, stance.pressure, strict=True):
            self.push(torque, side, share * force, point, share * moment[2])
        feet = data.xpos[self.foot["l"]] - data.xpos[self.foot["r"]]
        apart = heading[0] * float(feet[0]) + heading[1] * float(feet[1])
        torque[self.upper.motor] = self.upper.torque(self._pitch, intent.reach_rad, apart, self._speed)
        self.exert(torque, effort)
        self._time_in_step += CONTROL_S

    def exert(self, torque: Floats, effort: float = 1.0) -> None:
        """Set the motors to `torque` (n_motors,) [N m], within `effort` of the person's strength."""
        limit = self._torque * (self.ability.strength * effort)
        self._data.ctrl[self._motors] = np.clip(torque, -limit, limit)[self._motors]

    def resume(self, pitch_rad: float) -> None:
        """Go on by oneself, standing or in the middle of a step, from where body and feet are now.

        Args:
            pitch_rad: forward bend of the trunk.
        """
        data, feet = self._data, {side: leg.on_floor() for side, leg in self.legs.items()}
        mujoco.mj_subtreeVel(self._model, data)
        com, velocity, m = data.subtree_com[self.pelvis], data.subtree_linvel[self.pelvis], data.xmat[self.pelvis]
        self.heading_rad, self._pitch, self.fallen = atan2(m[3], m[0]), pitch_rad, False
        c, s = cos(self.heading_rad), sin(self.heading_rad)
        self._speed = min(max(c * float(velocity[0]) + s * float(velocity[1]), 0.0), FASTEST_M_S)
        ahead = {
            side: c * float(data.xpos[foot][0]) + s * float(data.xpos[foot][1]) for side, foot in self.foot.items()
        }
        leading = "l" if ahead["l"] > ahead["r"] else "r"
        both = feet["l"] == feet["r"]
        self._standing = both and self._speed < 0.1
        self._begin(leading if both else "l" if feet["l"] else "r", standing=self._standing)
        if not both:
            passed = (c * float(com[0]) + s * float(com[1]) - ahead[self.stance]) / max(self._step.length_m, 0.2)
            self._time_in_step = self._lifts_s + min(max(0.5 + passed, 0.0), 0.8) * (self._lands_s - self._lifts_s)

    # --- what to do -------------------------------------------------------------------------------------------------

    def _follow(self, intent: Intent) -> None:
        """Let wishes become movements no faster than a body can."""
        change = 0.6 * CONTROL_S
        self._speed += min(max(intent.speed_m_s - self._speed, -change), change)
        if not self._standing:
            self.heading_rad += intent.yaw_rate_rad_s * CONTROL_S
        self._pitch += min(max(intent.trunk_pitch_rad - self._pitch, -1.5 * CONTROL_S), 1.5 * CONTROL_S)
        self._back += min(max(intent.back_m - self._back, -1.0 * CONTROL_S), 1.0 * CONTROL_S)
        self._crouch += min(max(intent.crouch_m - self._crouch, -0.8 * CONTROL_S), 0.8 * CONTROL_S)

    def _decide(
        self, dcm: tuple[float, float], lead: Sole, trail: Sole, intent: Intent, heading: tuple[float, float]
    ) -> None:
        """Start, end and repeat steps."""
        if self._standing:
            astray = self._astray(dcm, lead, trail, heading)
            if intent.speed_m_s > 0.02 or (astray and self._back == 0.0):
                self._begin(self._first_stance(dcm, lead, trail, heading))
            return
        self._hurry(dcm, lead, heading)
        planned = self._lands_s
        if self._time_in_step < self._lifts_s + 0.5 * (planned - self._lifts_s):
            return
        landed = self.legs[self.swing].on_floor()
        if not ((landed and self._time_in_step > LANDED * planned) or self._time_in_step > planned + 0.15):
            return
        self.steps += 1
        self._learn()
        wants_rest = intent.speed_m_s < 0.02 and self._speed < 0.05
        if wants_rest and not self._astray(dcm, lead, trail, heading):
            self._standing, self._lifted = True, False
        else:
            self._begin(self.swing)

    def _hurry(self, dcm: tuple[float, float], lead: Sole, heading: tuple[float, float]) -> None:
        """Step at once, and sooner, when what was felt exceeds what standing feet can mend."""
        g = self._reflexes
        reference = self._reference(lead, heading)
        beside = heading[0] * (dcm[1] - reference[1]) - heading[1] * (dcm[0] - reference[0])
        if abs(beside) < g.alarm * self.size.height_m:
            self._alarmed_s = 0.0
            return
        self._alarmed_s += CONTROL_S
        if self._alarmed_s < self.ability.reaction_s:
            return
        if self._time_in_step < self._lifts_s:
            c, s = heading
            sign = 1.0 if self.stance == "l" else -1.0
            outside = sign * (c * (dcm[1] - lead.y) - s * (dcm[0] - lead.x))
            if outside > g.alarm_swap * self.size.height_m:
                self.stance = self.swing
            self._lifts_s = self._time_in_step
            self._lands_s = min(self._step.duration_s, self._lifts_s + self.ability.shortest_step_s)
        else:
            least = (1.0 - self.legs[self.swing].swung) * g.hurry * self.ability.shortest_step_s
            soonest = self._time_in_step + max(least, FELT_TO_SWING_S)
            self._lands_s = min(self._lands_s, soonest)

    def _learn(self) -> None:
        """Walk a little harder after a step that was slower than wanted, and the other way round."""
        com = self._data.subtree_com[self.pelvis]
        way = (float(com[0]) - self._began_at[0]) * cos(self.heading_rad)
        way += (float(com[1]) - self._began_at[1]) * sin(self.heading_rad)
        turns = self._time_in_step / CONTROL_S
        self._raised = min(max(self._raised + RAISE_GAIN * self._sagged / turns, 0.0), RAISE_MOST_M)
        short = self._speed - way / self._time_in_step
        self._urge = min(max(self._urge + URGE_GAIN * short, -URGE_MOST_M_S), URGE_MOST_M_S) if self._speed > 0 else 0.0

    def _begin(self, stance: str, standing: bool = False) -> None:
        self._standing = standing
        self.stance, self._time_in_step, self._lifted = stance, 0.0, False
        com = self._data.subtree_com[self.pelvis]
        self._began_at, self._sagged = (float(com[0]), float(com[1])), 0.0
        self._step = plan_step(
            min(self._speed + self._urge, FASTEST_M_S), self.size.height_m, self.width_m, self.ability
        )
        self._lifts_s, self._lands_s = self._step.double_support_s, self._step.duration_s

    def _astray(self, dcm: tuple[float, float], lead: Sole, trail: Sole, heading: tuple[float, float]) -> bool:
        """Whether standing still can no longer keep the DCM over the feet."""
        stance = double_support(lead, trail, dcm, heading, 0.0)
        return hypot(dcm[0] - stance.centre[0], dcm[1] - stance.centre[1]) > 0.015

    def _first_stance(self, dcm: tuple[float, float], lead: Sole, trail: Sole, heading: tuple[float, float]) -> str:
        """Return the foot to stand on: the one the body moves towards."""
        side = heading[0] * (dcm[1] - (lead.y + trail.y) / 2) - heading[1] * (dcm[0] - (lead.x + trail.x) / 2)
        left = self.stance if self.stance == "l" else self.swing
        if abs(side) < 0.01:
            return self.stance
        return left if side > 0 else ("r" if left == "l" else "l")

    # --- how to do it -----------------------------------------------------------------------------------------------

    def _stance(
        self, dcm: tuple[float, float], lead: Sole, trail: Sole, heading: tuple[float, float]
    ) -> tuple[Stance, bool]:
        """Return the stance and whether the other leg is in the air."""
        if self._standing:
            c, s = heading
            middle = ((lead.x + trail.x) / 2 - c * self._back, (lead.y + trail.y) / 2 - s * self._back)
            return double_support(lead, trail, self._pressure(dcm, middle, middle), heading, 0.0), False
        wanted = self._pressure(dcm, self._reference(lead, heading), (lead.x, lead.y))
        if self._time_in_step >= self._lifts_s:
            return single_support(lead, wanted, heading), True
        return double_support(lead, trail, wanted, heading, self._time_in_step / self._lifts_s), False

    def _reference(self, lead: Sole, heading: tuple[float, float]) -> tuple[float, float]:
        """Return where the DCM should be at this moment of the step [m]."""
        step = self._step
        side = 1.0 if self.stance == "l" else -1.0
        bx, by = step.offset(self._omega, side)
        shrink = exp(-self._omega * self._until_transfer())
        ahead, beside = (step.length_m + bx) * shrink, (-side * step.width_m + by) * shrink
        c, s = heading
        return lead.x + c * ahead - s * beside, lead.y + s * ahead + c * beside

    def _bob(self) -> Bob:
        """Return how the body is to rise and sink now."""
        g, deep = self._reflexes, 0.0
        if not self._standing:
            ahead = 0.5 * abs(self._step.length_m) - self.size.sole_forward_m
            deep = dip(ahead, self.size.leg_m, g.knees_bent, g.landing_leg)
        change = DEEPENS_M_S * CONTROL_S
        self._deep += min(max(deep - self._deep, -change), change)
        return bob(self._deep, self._time_in_step - 0.5 * self._step.double_support_s, self._lands_s)

    def _pressure(
        self, dcm: tuple[float, float], reference: tuple[float, float], nominal: tuple[float, float]
    ) -> tuple[float, float]:
        return wanted_pressure(dcm, reference, nominal, 1.0 + self._reflexes.dcm_gain_1_s / self._omega)

    def _until_transfer(self) -> float:
        """Return the time until the load is taken to change feet, a little after touchdown [s]."""
        return max(self._lands_s - self._time_in_step, 0.0) + self._reflexes.transfer * DOUBLE_SUPPORT_S

    def _swing_leg(
        self, torque: Floats, dcm: tuple[float, float], centre: tuple[float, float], lead: Sole,
        heading: tuple[float, float],
    ) -> Floats:  # fmt: skip
        """Move the swing leg towards the foothold; return the moment (3,) with which the leg turns the pelvis [N m]."""
        step, side, g = self._step, self.swing, self._reflexes
        c, s = heading
        sign = 1.0 if self.stance == "l" else -1.0
        growth = exp(self._omega * self._until_transfer())
        px, py = lead.x + g.pressure_carried * (centre[0] - lead.x), lead.y + g.pressure_carried * (centre[1] - lead.y)
        bx, by = step.offset(self._omega, sign)
        dx = px + (dcm[0] - px) * growth - lead.x
        dy = py + (dcm[1] - py) * growth - lead.y
        target = foothold((c * dx + s * dy - bx, c * dy - s * dx - by), sign, self.size.height_m, self.ability)
        leg = self.legs[side]
        if not self._lifted:
            self._lifted, self._foothold = True, target
            leg.lift()
        blend = min(CONTROL_S / max(self.ability.reaction_s / 3.0, CONTROL_S), 1.0)
        self._foothold = (
            self._foothold[0] + blend * (target[0] - self._foothold[0]),
            self._foothold[1] + blend * (target[1] - self._foothold[1]),
        )
        forward, left = self._foothold[0] - self.size.sole_forward_m, self._foothold[1]
        aim = (lead.x + c * forward - s * left, lead.y + s * forward + c * left)
        move = leg.move(aim, heading, self._lands_s - self._time_in_step, self.ability.strength)
        torque[leg.motor] = move + self._data.qfrc_bias[leg.dof]
        return leg.turns_pelvis(move)

    def _trunk_moment(self) -> Floats:
        """Return the moment (3,) that turns the pelvis to its wanted posture [N m]."""
        mujoco.mj_objectVelocity(self._model, self._data, mujoco.mjtObj.mjOBJ_BODY, self.pelvis, self._velocity, 0)
        lean = HIP_SHARE * self._pitch  # the rest is in the back
        error = turn_error(self._data.xmat[self.pelvis], self.heading_rad, lean)
        moment = self._trunk_kp * error - self._trunk_kd * self._velocity[:3]
        moment *= self.size.strength
        limit = np.array([self._moment_limit, self._moment_limit, self._turn_limit])
        np.clip(moment, -limit, limit, out=moment)
        return moment

    def push(
        self, torque: Floats, side: str, force: Floats, point: tuple[float, float] | None = None, turn: float = 0.0
    ) -> None:
        """Set in `torque` how the leg of `side` pushes `force` through `point` of the floor, or its sole's middle."""
        point = self.legs[side].sole()[:2] if point is None else point
        ankle = self._data.xpos[self.foot[side]]
        dof = self.legs[side].dof
        mujoco.mj_jac(self._model, self._data, self._jacobian, self._spin, ankle, self.foot[side])
        rx, ry, rz = point[0] - ankle[0], point[1] - ankle[1], -self.size.ankle_height_m
        fx, fy, fz = force
        moment = np.array([ry * fz - rz * fy, rz * fx - rx * fz, rx * fy - ry * fx + turn])
        torque[self.legs[side].motor] = -(self._jacobian[:, dof].T @ force + self._spin[:, dof].T @ moment)

    def _stand_up(self) -> None:
        data, size = self._data, self.size
        root = self._model.joint("root").qposadr[0]
        down = self._reflexes.knees_bent * size.leg_m
        for leg in self.legs.values():
            ankle = leg.hip + np.array([-0.3 * size.sole_forward_m, 0.0, -down])
            data.qpos[leg.q] = leg_angles(ankle, np.eye(3), leg.hip, size.thigh_m, size.shank_m)
        data.qpos[root + 2] = down + size.ankle_height_m + 0.001
        data.qpos[self.upper.q] = UpperBody.REST
        mujoco.mj_forward(self._model, data)
