"""The controller's quick look at a message never lets pass what the message's own check refuses."""

from __future__ import annotations

import numpy as np
from hypothesis import example, given, settings
from hypothesis import strategies as st

from bridge.messages import Odometry, Wrench
from controller.admittance_controller import _fault, _ordinary

anything = st.floats(allow_nan=True, allow_infinity=True)
near_the_limits = st.sampled_from([0.0, 4.9, 5.1, -9.9, 10.1, 20.1, 999.0, -1001.0, 1999.0, 2001.0, 4999.0, -5001.0])
numbers = st.lists(anything | near_the_limits, min_size=6, max_size=6)


@settings(max_examples=300, deadline=None)
@given(numbers)
@example([0.0, 0.0, -5001.0, 0.0, 0.0, 0.0])
@example([0.0, 0.0, 0.0, 2001.0, 0.0, 0.0])
@example([float("nan"), 0.0, 0.0, 0.0, 0.0, 0.0])
def test_wrench(values: list[float]) -> None:
    message = Wrench(stamp_ns=0, force=np.array(values[:3]), torque=np.array(values[3:]))
    if _ordinary(message):
        message.check()
    else:
        assert isinstance(_fault(message), str)


@settings(max_examples=300, deadline=None)
@given(numbers, anything, anything | near_the_limits)
@example([0.0] * 6, 0.0, 20.1)
@example([0.0, 0.0, 0.0, 10.1, 0.0, 0.0], 0.0, 0.0)
@example([0.0] * 6, float("inf"), 0.0)
def test_odometry(values: list[float], yaw: float, yaw_rate: float) -> None:
    message = Odometry(
        stamp_ns=0, position=np.array(values[:3]), velocity=np.array(values[3:]), yaw=yaw, yaw_rate=yaw_rate
    )
    if _ordinary(message):
        message.check()


def test_what_a_walker_feels_is_ordinary() -> None:
    assert _ordinary(Wrench(stamp_ns=0, force=np.array([30.0, 5.0, -600.0]), torque=np.array([1.0, 2.0, 3.0])))
    assert _ordinary(Odometry(stamp_ns=0, position=np.ones(3), velocity=np.ones(3), yaw=1.0, yaw_rate=0.5))
