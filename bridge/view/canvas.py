"""Where everything is drawn: a Rerun recording with three timelines, and plots gathered into columns."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any, Final, NamedTuple

import numpy as np

from bridge.colours import rgb
from bridge.view.extra import Rerun

TRIAL: Final = "trial"  # stamp since the first message [s]
STAMP: Final = "stamp"  # the message's own stamp
ARRIVAL: Final = "arrival"  # when it arrived at the recorder or here


class Moment(NamedTuple):
    """When something was, and when it was heard of [ns since the epoch]."""

    stamp_ns: int
    arrival_ns: int


class Canvas:
    """Draws at a moment, on all three timelines at once.

    Curves are gathered and sent as columns by `flush`: a tenth of the work of sending every point.
    """

    def __init__(self, rerun: Rerun, stream: Any) -> None:
        self.sdk = rerun.sdk
        self._stream = stream
        self._moment = Moment(0, 0)
        self._origin_ns: int | None = None
        self._rows: dict[str, list[tuple[Moment, Sequence[float]]]] = {}
        stream.set_log_time_enabled(False)  # when a file was converted says nothing
        stream.set_log_tick_enabled(False)

    def at(self, moment: Moment) -> None:
        """Draw at `moment` from here on; the first one is the origin of the trial's time."""
        self._moment = moment
        if self._origin_ns is None:
            self._origin_ns = moment.stamp_ns
        self._stream.set_time(TRIAL, duration=np.timedelta64(moment.stamp_ns - self._origin_ns, "ns"))
        self._stream.set_time(STAMP, timestamp=np.datetime64(moment.stamp_ns, "ns"))
        self._stream.set_time(ARRIVAL, timestamp=np.datetime64(moment.arrival_ns, "ns"))

    def draw(self, path: str, *archetypes: Any) -> None:
        """Draw at the present moment."""
        self._stream.log(path, *archetypes)

    def fix(self, path: str, *archetypes: Any) -> None:
        """Draw for all times."""
        self._stream.log(path, *archetypes, static=True)

    def clear(self, path: str) -> None:
        """Take away what is at `path` and below it, from the present moment on."""
        self._stream.log(path, self.sdk.Clear(recursive=True))

    def curves(self, path: str, names: Sequence[str], colours: Sequence[str], widths: Sequence[float]) -> None:
        """Name and colour the curves that `plot` will draw at `path`."""
        self.fix(path, self.sdk.SeriesLines(names=names, colors=[rgb(c) for c in colours], widths=widths))

    def plot(self, path: str, values: Sequence[float]) -> None:
        """Add a point to each curve at `path`; NaN leaves a gap."""
        self._rows.setdefault(path, []).append((self._moment, values))

    def log(self, path: str, text: str, level: str) -> None:
        """Write a line of text."""
        self._stream.log(path, self.sdk.TextLog(text, level=level))

    def flush(self) -> None:
        """Send the gathered points."""
        origin_ns = self._origin_ns or 0
        for path, rows in self._rows.items():
            stamps = np.array([moment.stamp_ns for moment, _ in rows], dtype=np.int64)
            arrivals = np.array([moment.arrival_ns for moment, _ in rows], dtype=np.int64)
            times = [
                self.sdk.TimeColumn(TRIAL, duration=(stamps - origin_ns).astype("timedelta64[ns]")),
                self.sdk.TimeColumn(STAMP, timestamp=stamps.astype("datetime64[ns]")),
                self.sdk.TimeColumn(ARRIVAL, timestamp=arrivals.astype("datetime64[ns]")),
            ]
            values = np.array([value for _, value in rows], dtype=np.float64)  # (rows, curves)
            columns = self.sdk.Scalars.columns(scalars=values.ravel()).partition([values.shape[1]] * len(rows))
            self._stream.send_columns(path, times, columns)
        self._rows.clear()
