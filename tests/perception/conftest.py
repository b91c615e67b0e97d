"""A person to look at."""

from collections.abc import Callable

import numpy as np
import pytest
from numpy.typing import NDArray

Floats = NDArray[np.float64]

# In body lengths (shoulder to hip plus hip to ankle = 1), hips at the origin, y down.
_STANDING = np.array(
    [
        [0.12, -0.37],
        [-0.12, -0.37],
        [0.16, -0.20],
        [-0.16, -0.20],
        [0.17, -0.02],
        [-0.17, -0.02],
        [0.08, 0.0],
        [-0.08, 0.0],
        [0.08, 0.32],
        [-0.08, 0.32],
        [0.08, 0.63],
        [-0.08, 0.63],
    ]
)


@pytest.fixture(scope="session")
def body() -> Callable[..., Floats]:
    """Return a maker of one (12, 3) detection."""

    def make(
        x: float = 160.0, y: float = 120.0, size: float = 100.0, tilt: float = 0.0, confidence: float = 0.9
    ) -> Floats:
        turn = np.array([[np.cos(tilt), np.sin(tilt)], [-np.sin(tilt), np.cos(tilt)]])
        position = _STANDING @ turn * size + [x, y]
        return np.column_stack([position, np.full(12, confidence)])

    return make
