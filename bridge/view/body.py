"""The person in the camera's image: keypoints, links, and the skeletons that are foreseen."""

from __future__ import annotations

from typing import Final

import numpy as np
from numpy.typing import NDArray

from bridge.colours import FAINT, FORECAST, INK, TRANSIENT, rgb, tint
from bridge.messages import STEPS, FallHorizon, Floats, Keypoints, KeypointStatus
from bridge.view.canvas import Canvas

IMAGE: Final = "image"
SHOWN_STEPS: Final = (3, 6, 9, 12, 15)  # 100 ... 500 ms ahead
_STATUS_COLOUR: Final = {KeypointStatus.MEASURED: rgb(INK), KeypointStatus.FILLED: rgb(TRANSIENT)}


class Body:
    """Draws in pixels of the image that the keypoints are given in."""

    def __init__(self, canvas: Canvas, links: NDArray[np.int64]) -> None:
        self._canvas, self._links = canvas, links
        self._size: tuple[int, int] | None = None

    def keypoints(self, message: Keypoints) -> None:
        """Draw the present skeleton in black; a filled keypoint is orange, a lost one is not drawn."""
        sdk, canvas = self._canvas.sdk, self._canvas
        self._outline(message.image_width, message.image_height)
        known = np.isfinite(message.position_px).all(axis=1)
        strips = self._strips(message.position_px)
        ui = sdk.Radius.ui_points
        # a white rim keeps black lines readable over a dark video
        canvas.draw(
            f"{IMAGE}/person/rim", sdk.LineStrips2D(strips, colors=[255, 255, 255], radii=ui(3.0), draw_order=10.0)
        )
        canvas.draw(f"{IMAGE}/person/links", sdk.LineStrips2D(strips, colors=[0, 0, 0], radii=ui(1.6), draw_order=11.0))
        colours = [_STATUS_COLOUR.get(KeypointStatus(s), rgb(FAINT)) for s in message.status[known].tolist()]
        canvas.draw(
            f"{IMAGE}/person/joints",
            sdk.Points2D(message.position_px[known], colors=colours, radii=ui(3.5), draw_order=12.0),
        )

    def forecast(self, horizon: FallHorizon) -> None:
        """Draw the foreseen skeletons in cyan, 100 to 500 ms ahead, the last one strongest."""
        sdk = self._canvas.sdk
        strips: list[Floats] = []
        colours: list[tuple[int, int, int]] = []
        radii: list[float] = []
        for step in SHOWN_STEPS:
            share = step / (STEPS - 1)
            here = self._strips(horizon.forecast_px[step])
            strips += here
            colours += [tint(FORECAST, 0.25 + 0.75 * share**2)] * len(here)
            radii += [-(0.7 + 0.9 * share**2)] * len(here)  # negative: in points of the screen
        self._canvas.draw(f"{IMAGE}/forecast", sdk.LineStrips2D(strips, colors=colours, radii=radii, draw_order=5.0))

    def no_person(self) -> None:
        """Take the skeleton away: the keypoints are invalid or silent."""
        self._canvas.clear(f"{IMAGE}/person")

    def no_forecast(self) -> None:
        """Take the foreseen skeletons away."""
        self._canvas.clear(f"{IMAGE}/forecast")

    def _outline(self, width: int, height: int) -> None:
        if self._size != (width, height):
            self._size = (width, height)
            box = self._canvas.sdk.Boxes2D(mins=[0, 0], sizes=[width, height], colors=rgb(FAINT))
            self._canvas.draw(f"{IMAGE}/outline", box)

    def _strips(self, position_px: Floats) -> list[Floats]:
        """Return the links whose two ends are known, (2, 2) each."""
        ends = position_px[self._links]  # (12, 2, 2)
        return list(ends[np.isfinite(ends).all(axis=(1, 2))])
