"""Decision and Controller: what every controller can rely on."""

from __future__ import annotations

import numpy as np
import pytest
from controller_loop import MPC, PERIOD_S, decision

from bridge.clock import NS
from bridge.config.admittance import AdmittanceConfig
from bridge.config.walker import WalkerConfig
from bridge.messages import GaitState, Odometry, Wrench
from controller.admittance_controller import AdmittanceController
from controller.interface import Controller, Decision
from controller.mock import LoggingController


@pytest.mark.parametrize("state", list(GaitState))
def test_stop_means_disarmed_or_safe_stop(state: GaitState) -> None:
    decision = Decision(state, "", 0.0, np.zeros(20), 1.0, 0.0, 0)
    assert decision.stop == (state in {GaitState.DISARMED, GaitState.SAFE_STOP})


@pytest.fixture(params=["mpc", "log"])
def controller(request: pytest.FixtureRequest) -> Controller:
    if request.param == "log":
        return LoggingController()
    return AdmittanceController(WalkerConfig(), AdmittanceConfig(), MPC, PERIOD_S)


def found(height_m: float, at_ns: int) -> Odometry:
    return Odometry(stamp_ns=at_ns, position=[0.0, 0.0, height_m], yaw=0.0, velocity=np.zeros(3), yaw_rate=0.0)


def test_every_controller_says_what_it_was_told(controller: Controller) -> None:
    """State, reason and the frame behind them reach the wire whoever computes the motion."""
    told = decision(0.4)._replace(state=GaitState.GUARD, reason="distance", rests_on_ns=7, fall_distance=1.5)
    command = controller.step(NS, found(1.0, NS), Wrench(stamp_ns=NS, force=np.zeros(3), torque=np.zeros(3)), told)
    command.check()
    assert (command.stamp_ns, command.state, command.reason) == (NS, GaitState.GUARD, "distance")
    assert (command.rests_on_ns, command.fall_distance) == (7, 1.5)
    assert command.stiffening == pytest.approx(0.4)


def test_every_controller_starts_from_where_it_is_after_a_reset(controller: Controller) -> None:
    """The column is commanded from its measured height, and not from the one before."""
    for height_m in (1.0, 0.9):
        controller.reset()
        wrench = Wrench(stamp_ns=NS, force=np.zeros(3), torque=np.zeros(3))
        command = controller.step(NS, found(height_m, NS), wrench, decision())
        assert command.column_height == pytest.approx(height_m, abs=0.01)
        np.testing.assert_allclose(command.velocity[:3], 0.0, atol=0.02)
