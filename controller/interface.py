"""What the intervention logic tells a controller, and what every controller is."""

from __future__ import annotations

from typing import NamedTuple, Protocol

from bridge.messages import Floats, GaitState, Odometry, SupportCommand, Wrench


class Decision(NamedTuple):
    """One step's verdict on the walking person, with the stiffening it asks for.

    The profile is in time of *now*: the age of the horizon has already been taken
    out of it. `profile[0]` is the present stiffening.
    """

    state: GaitState
    reason: str  # why the supervisor is in this state, in words
    stiffening: float  # present s in [0, 1]
    profile: Floats  # (N,) read-only, s of stage k at now + k * stage_s, in [0, 1]
    fall_distance: float  # least distance to the fall boundary over the horizon [within-class sd], NaN if unknown
    fall_probability: float  # probability of fall at the end of the horizon, NaN if unknown
    rests_on_ns: int  # stamp of the newest frame behind the horizon [ns since the epoch], 0 if there was none

    @property
    def stop(self) -> bool:
        """Whether the base must come to rest and the column hold its height, whatever the wrench asks for."""
        return self.state in (GaitState.DISARMED, GaitState.SAFE_STOP)


class Controller(Protocol):
    """Turns a decision and the measured motion and wrench into a support command.

    The node calls `step` once per control period with inputs that are fresh and
    passed their checks, and only while `decision.stop` is false; what a stop asks for
    is the safety gate's braking ramp. The gate judges every answer before the wire.
    """

    def step(self, now_ns: int, odometry: Odometry, wrench: Wrench, decision: Decision) -> SupportCommand:
        """Return the command for the period that starts at `now_ns`.

        The command carries `stamp_ns=now_ns`, the decision's state, reason, stiffening, fall distance
        and probability, and `rests_on_ns`; its sequence is filled in when it is sent.
        """
        ...

    def reset(self) -> None:
        """Forget the past (anchor, warm start, tank history): the next `step` starts from the measured motion."""
        ...
