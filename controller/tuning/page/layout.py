"""Measures of the charts in pixels: one above the other with a common axis of time, on a wide screen and on a phone."""

from __future__ import annotations

from typing import Any, Final, NamedTuple

from controller.tuning.page.palette import Palette

BAND_TOP: Final = 20  # room for the names of the falls
BAND: Final = 26
NO_ANIMATION: Final = {"animation": False}  # a slider moves the curves many times a second


class Layout(NamedTuple):
    """Where the panels of a timeline lie [px]."""

    wide: bool

    @property
    def left(self) -> int:
        """Room for the numbers of the vertical axes."""
        return 48 if self.wide else 34

    @property
    def right(self) -> int:
        """Room for the names of thresholds; on a phone they lie in the panels."""
        return 152 if self.wide else 16

    @property
    def panel(self) -> int:
        """Height of a panel."""
        return 112 if self.wide else 96

    @property
    def room_px(self) -> int:
        """About the width of the panels, by which a name is judged to fit."""
        return 640 if self.wide else 300

    @property
    def gap(self) -> int:
        """Between two panels: the title of the lower one."""
        return 30

    def top(self, index: int) -> int:
        """Upper edge of panel `index`; 0 is the band of states, which is lower than the others."""
        return BAND_TOP if index == 0 else BAND_TOP + BAND + self.gap + (index - 1) * (self.panel + self.gap)

    def height(self, index: int) -> int:
        """Height of panel `index`."""
        return BAND if index == 0 else self.panel

    def total(self, panels: int) -> int:
        """Height of the chart of so many panels, with the axis of time and the zoom below."""
        return self.top(panels - 1) + self.height(panels - 1) + 66


def axis(palette: Palette, **more: Any) -> dict[str, Any]:
    """Return an axis in the page's look."""
    return {
        "axisLine": {"show": True, "lineStyle": {"color": palette.quiet}},
        "axisTick": {"show": False},
        "axisLabel": {"color": palette.quiet, "fontSize": 11},
        "splitLine": {"show": True, "lineStyle": {"color": palette.grid}},
        **more,
    }


def tooltip(palette: Palette, **more: Any) -> dict[str, Any]:
    """Return a tooltip in the page's look."""
    return {
        "confine": True,
        "backgroundColor": palette.card,
        "borderColor": palette.grid,
        "textStyle": {"color": palette.ink, "fontSize": 12},
        **more,
    }
