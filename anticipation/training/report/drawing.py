"""What all pictures share: size, axes, colours, and writing a small PNG whole or not at all."""

from __future__ import annotations

from pathlib import Path
from typing import Any, Final

import numpy as np
from matplotlib.axes import Axes
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.figure import Figure

from bridge.colours import INK

DOTS_PER_INCH: Final = 110
PALETTE: Final = 255  # colours of the file: a third of the size, and no difference to the eye


def figure(width: float, height: float) -> Figure:
    """Return an empty figure of a size in inches, laid out so that nothing overlaps."""
    made = Figure(figsize=(width, height), dpi=DOTS_PER_INCH, layout="constrained")
    FigureCanvasAgg(made)
    return made


def plain(axes: Axes, title: str = "", x: str = "", y: str = "") -> None:
    """Take frame and clutter away and write what the axes are."""
    axes.set_title(title, fontsize=10, color=INK, loc="left")
    axes.set_xlabel(x, fontsize=9, color=INK)
    axes.set_ylabel(y, fontsize=9, color=INK)
    axes.tick_params(labelsize=8, colors=INK)
    axes.spines[["top", "right"]].set_visible(False)


def write(drawn: Figure, path: Path) -> Path:
    """Write a figure as PNG."""
    from PIL import Image  # noqa: PLC0415 (comes with matplotlib; needed at the very end only)

    canvas: Any = drawn.canvas
    canvas.draw()
    part = path.with_name(path.name + ".part")
    image = Image.fromarray(np.asarray(canvas.buffer_rgba())).convert("RGB")
    image.quantize(PALETTE, dither=Image.Dither.NONE).save(part, format="PNG", optimize=True)
    part.replace(path)
    return path
