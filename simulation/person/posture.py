"""How far a body is turned from where it should be."""

from __future__ import annotations

from collections.abc import Sequence
from math import cos, sin
from typing import Final

import numpy as np

from bridge.messages import Floats

HIP_SHARE: Final = 0.6  # of the trunk's forward bend; the rest is in the back


def turn_error(matrix: Sequence[float] | Floats, heading_rad: float, lean_rad: float) -> Floats:
    """Return the rotation (3,) that brings a body upright to `heading_rad`, leant forward by `lean_rad` [rad].

    Half the sum of the cross products of the axes, (e_i x w_i) / 2: exact in direction, the sine of the angle in size.

    Args:
        matrix: (9,) rotation of the body, row by row.
        heading_rad: about the vertical.
        lean_rad: forward.
    """
    m = matrix
    c, s, cl, sl = cos(heading_rad), sin(heading_rad), cos(lean_rad), sin(lean_rad)
    # columns of the wanted orientation: Rz(heading) Ry(lean)
    x, y, z = (c * cl, s * cl, -sl), (-s, c, 0.0), (c * sl, s * sl, cl)
    fx, fy, fz = m[0::3], m[1::3], m[2::3]
    return 0.5 * np.array([
        fx[1] * x[2] - fx[2] * x[1] + fy[1] * y[2] - fy[2] * y[1] + fz[1] * z[2] - fz[2] * z[1],
        fx[2] * x[0] - fx[0] * x[2] + fy[2] * y[0] - fy[0] * y[2] + fz[2] * z[0] - fz[0] * z[2],
        fx[0] * x[1] - fx[1] * x[0] + fy[0] * y[1] - fy[1] * y[0] + fz[0] * z[1] - fz[1] * z[0],
    ])  # fmt: skip
