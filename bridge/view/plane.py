"""The transient plane: three regions, the fall boundary, where the gait was, is and will be."""

from __future__ import annotations

import io
from collections import deque
from typing import Final

import numpy as np
from numpy.typing import NDArray
from PIL import Image

from bridge.clock import NS
from bridge.colours import CLASS_COLOURS, FALL, FORECAST, rgb, tint
from bridge.messages import CLASSES, FallHorizon, Floats
from bridge.view.canvas import Canvas
from bridge.view.geometry import Box, Plane, around, belongs, fall_boundary, raster, region

PLANE: Final = "plane"
NOT_ITS_PLANE: Final = (
    "regions are not drawn: the horizon's distances are not those of this checkpoint's plane "
    "(--set anticipation.checkpoint=FILE names another)"
)
SEEN_SD: Final = 2.2  # shown around the class centres
_DRAWN_SD: Final = 12.0  # beyond it there is no colour
_PIXELS: Final = 900
_TRAIL: Final = 30  # one second
_BREAK_NS: Final = round(0.2 * NS)  # a longer gap between two horizons breaks the trail


class PlanePanel:
    """Draws in units of within-class standard deviations."""

    def __init__(self, canvas: Canvas, plane: Plane) -> None:
        self._canvas, self._plane = canvas, plane
        self._trail: deque[Floats] = deque(maxlen=_TRAIL)
        self._last_ns = 0
        self._regions: bool | None = None  # whether they are drawn; None: not decided yet

    def horizon(self, horizon: FallHorizon) -> str:
        """Draw one horizon: the last second and the present black, the next half second cyan.

        Returns:
            Why the regions are not drawn, where that has just become known; else ''.
        """
        sdk, canvas, points = self._canvas.sdk, self._canvas, horizon.plane
        news = self._decide(horizon)
        if abs(horizon.stamp_ns - self._last_ns) > _BREAK_NS:
            self._trail.clear()
        self._last_ns = horizon.stamp_ns
        self._trail.append(points[0])
        ui = sdk.Radius.ui_points
        trail = [np.array(self._trail)] if len(self._trail) > 1 else []
        canvas.draw(f"{PLANE}/past", sdk.LineStrips2D(trail, colors=[0, 0, 0], radii=ui(1.4), draw_order=11.0))
        canvas.draw(
            f"{PLANE}/ahead/path", sdk.LineStrips2D([points], colors=rgb(FORECAST), radii=ui(1.8), draw_order=10.0)
        )
        canvas.draw(
            f"{PLANE}/ahead/steps", sdk.Points2D(points[1:], colors=rgb(FORECAST), radii=ui(2.6), draw_order=10.5)
        )
        canvas.draw(f"{PLANE}/present", sdk.Points2D(points[:1], colors=[0, 0, 0], radii=ui(5.0), draw_order=12.0))
        return news

    def nothing(self) -> None:
        """Take the trajectory away: the horizon is invalid or silent."""
        for part in ("past", "ahead", "present"):
            self._canvas.clear(f"{PLANE}/{part}")
        self._trail.clear()

    def _decide(self, horizon: FallHorizon) -> str:
        """Draw the regions once a horizon shows that they are the ones it was judged by; take them away if not."""
        fits = belongs(self._plane, horizon)
        if fits == self._regions:
            return ""
        self._regions = fits
        if fits:
            self._draw_regions()
            return ""
        for part in ("regions", "boundary", "centres", "names"):
            self._canvas.clear(f"{PLANE}/{part}")
        return NOT_ITS_PLANE

    def _draw_regions(self) -> None:
        sdk, canvas, plane = self._canvas.sdk, self._canvas, self._plane
        box = around(plane, _DRAWN_SD)
        palette = np.array([tint(colour, 0.22) for colour in CLASS_COLOURS], dtype=np.uint8)
        pixels = palette[raster(plane, box, _PIXELS)]
        image = sdk.EncodedImage(contents=_png(pixels), media_type="image/png", draw_order=-20.0)
        scale = (box.high - box.low) / _PIXELS
        canvas.draw(
            f"{PLANE}/regions",
            sdk.Transform3D(translation=[*box.low.tolist(), 0.0], scale=[*scale.tolist(), 1.0]),
            image,
        )
        lines = sdk.LineStrips2D(fall_boundary(plane, box), colors=rgb(FALL), radii=sdk.Radius.ui_points(1.5))
        canvas.draw(f"{PLANE}/boundary", lines)
        centres = sdk.Points2D(
            plane.centres,
            colors=[rgb(colour) for colour in CLASS_COLOURS],
            radii=sdk.Radius.ui_points(7.0),
            draw_order=1.0,
        )
        canvas.draw(f"{PLANE}/centres", centres)
        self._name_regions()

    def _name_regions(self) -> None:
        """Write each class's name in the outer part of what is seen of its region, where few gaits are."""
        seen = around(self._plane, SEEN_SD)
        corners = {name: region(self._plane, kind, seen) for kind, name in enumerate(CLASSES)}
        places = {name: _outer(points, seen) for name, points in corners.items() if len(points)}
        sdk = self._canvas.sdk
        words = sdk.Points2D(
            list(places.values()),
            labels=list(places),
            show_labels=True,
            radii=sdk.Radius.ui_points(0.0),
            colors=[rgb(CLASS_COLOURS[CLASSES.index(name)]) for name in places],
        )
        self._canvas.draw(f"{PLANE}/names", words)


def _outer(corners: Floats, box: Box) -> Floats:
    """Return a point inside of a region, towards its corner farthest from the middle of `box`."""
    away = np.linalg.norm(corners - 0.5 * (box.low + box.high), axis=1)
    outer: Floats = 0.55 * corners.mean(axis=0) + 0.45 * corners[away.argmax()]
    return outer


def _png(pixels: NDArray[np.uint8]) -> bytes:
    """Return pixels (H, W, 3) as PNG: few colours need few bytes."""
    file = io.BytesIO()
    Image.fromarray(pixels).save(file, format="PNG")
    return file.getvalue()
