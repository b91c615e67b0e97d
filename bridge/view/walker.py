"""The walker on the floor: its path, its support at its height, and the force at the interface."""

from __future__ import annotations

from typing import Final

import numpy as np

from bridge.clock import NS
from bridge.colours import FAINT, FALL, FORECAST, rgb
from bridge.config.walker import WalkerConfig
from bridge.messages import Odometry, Wrench
from bridge.view.canvas import Canvas

WORLD: Final = "world"
_EVERY_NS: Final = round(0.9 * NS / 30)  # the eye needs no more than about 30 of the 100 poses a second
_METRES_PER_NEWTON: Final = 0.4 / 400.0


class WalkerPanel:
    """Draws in the odometry frame, metres, z up."""

    def __init__(self, canvas: Canvas, walker: WalkerConfig) -> None:
        self._canvas = canvas
        self._shown_ns = self._force_ns = 0
        sdk, height = canvas.sdk, walker.chassis_box_height_m
        half = (0.5 * walker.chassis_length_m, 0.5 * walker.chassis_width_m)
        canvas.fix(WORLD, sdk.ViewCoordinates.RIGHT_HAND_Z_UP)
        # the frame is open towards the person: two sides and a front
        thin = 0.04
        canvas.fix(
            f"{WORLD}/walker/frame",
            sdk.Boxes3D(
                centers=[(0, half[1], 0.5 * height), (0, -half[1], 0.5 * height), (half[0], 0, 0.5 * height)],
                half_sizes=[(half[0], thin, 0.06), (half[0], thin, 0.06), (thin, half[1], 0.06)],
                colors=rgb(FAINT),
            ),
        )
        wheels = [
            (x * walker.wheelbase_m / 2, y * walker.track_m / 2, walker.wheel_radius_m)
            for x in (1, -1)
            for y in (1, -1)
        ]
        canvas.fix(f"{WORLD}/walker/wheels", sdk.Points3D(wheels, radii=walker.wheel_radius_m, colors=[60, 60, 60]))
        bar = sdk.Boxes3D(half_sizes=[(0.03, 0.5 * walker.carriage_width_m, 0.03)], colors=rgb("#b98bdc"))
        canvas.fix(f"{WORLD}/walker/support/bar", bar)

    def odometry(self, odometry: Odometry) -> None:
        """Move the walker, about 30 times a second."""
        if 0 <= odometry.stamp_ns - self._shown_ns < _EVERY_NS:
            return
        self._shown_ns = odometry.stamp_ns
        sdk, canvas = self._canvas.sdk, self._canvas
        x, y, height = odometry.position.tolist()
        turn = sdk.RotationAxisAngle(axis=[0, 0, 1], radians=odometry.yaw)
        canvas.draw(f"{WORLD}/walker", sdk.Transform3D(translation=[x, y, 0.0], rotation=turn))
        canvas.draw(f"{WORLD}/walker/support", sdk.Transform3D(translation=[0.0, 0.0, height]))
        column = sdk.LineStrips3D([[(0, 0, 0.1), (0, 0, height)]], colors=rgb(FAINT), radii=0.025)
        canvas.draw(f"{WORLD}/walker/column", column)
        canvas.draw(f"{WORLD}/path", sdk.Points3D([[x, y, 0.0]], colors=rgb(FORECAST), radii=0.012))

    def wrench(self, wrench: Wrench) -> None:
        """Draw the force of the person on the walker, 0.4 m for 400 N."""
        if 0 <= wrench.stamp_ns - self._force_ns < _EVERY_NS:
            return
        self._force_ns = wrench.stamp_ns
        vector = np.asarray(wrench.force) * _METRES_PER_NEWTON
        arrow = self._canvas.sdk.Arrows3D(vectors=[vector], colors=rgb(FALL), radii=0.02)
        self._canvas.draw(f"{WORLD}/walker/support/force", arrow)

    def no_odometry(self) -> None:
        """Take the walker away: where it is is not known."""
        self._shown_ns = 0
        self._canvas.clear(f"{WORLD}/path")

    def no_wrench(self) -> None:
        """Take the force away."""
        self._force_ns = 0
        self._canvas.clear(f"{WORLD}/walker/support/force")
