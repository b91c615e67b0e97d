"""Decision and Controller: what every controller can rely on."""

from __future__ import annotations

import numpy as np
import pytest

from bridge.messages import GaitState
from controller.interface import Controller, Decision
from controller.mock import LoggingController


@pytest.mark.parametrize("state", list(GaitState))
def test_stop_means_disarmed_or_safe_stop(state: GaitState) -> None:
    decision = Decision(state, "", 0.0, np.zeros(20), 1.0, 0.0, 0)
    assert decision.stop == (state in {GaitState.DISARMED, GaitState.SAFE_STOP})


def test_mock_is_a_controller() -> None:
    controller: Controller = LoggingController()
    controller.reset()
