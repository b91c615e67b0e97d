"""The harness: straps that pull and never push down, with slack."""

from __future__ import annotations

from math import hypot
from typing import NamedTuple

from simulation.world.parameters import HarnessParameters


class HarnessWrench(NamedTuple):
    """Of the person on the walker, in the walker's axes."""

    forward_n: float
    left_n: float
    up_n: float  # negative: the person hangs
    yaw_nm: float


FREE = HarnessWrench(0.0, 0.0, 0.0, 0.0)


def harness_wrench(
    harness: HarnessParameters,
    offset: tuple[float, float, float, float],
    rate: tuple[float, float, float, float],
) -> HarnessWrench:
    """Return the wrench on the walker.

    Args:
        harness: slacks, stiffness and damping.
        offset: of the pelvis from where it hangs free: forward, left, up [m] and yaw [rad], in the walker's axes.
        rate: their rates [m/s, rad/s].

    A spring beyond the slack with damping in the strap; a strap goes limp rather than push, so the damper never turns
    the force round.
    """
    forward, left, up, yaw = offset
    away = hypot(forward, left)
    fx = fy = 0.0
    if away > harness.slack_horizontal_m:
        ux, uy = forward / away, left / away
        speed = ux * rate[0] + uy * rate[1]
        pull = harness.stiffness_horizontal_n_m * (away - harness.slack_horizontal_m)
        pull = max(pull + harness.damping_horizontal_ns_m * speed, 0.0)
        fx, fy = ux * pull, uy * pull
    fz = 0.0
    if up < -harness.slack_down_m:
        hang = harness.stiffness_down_n_m * (-up - harness.slack_down_m) - harness.damping_down_ns_m * rate[2]
        fz = -max(hang, 0.0)
    turn = 0.0
    if abs(yaw) > harness.slack_yaw_rad:
        sign = 1.0 if yaw > 0 else -1.0
        twist = harness.stiffness_yaw_nm_rad * (abs(yaw) - harness.slack_yaw_rad)
        turn = sign * max(twist + harness.damping_yaw_nms_rad * sign * rate[3], 0.0)
    return HarnessWrench(fx, fy, fz, turn)
