"""How the processes are: states, rates, ages of their inputs, what they say, and what was refused here."""

from __future__ import annotations

import math
import re
from typing import Final

from bridge.clock import NS
from bridge.colours import FAINT, FALL, FORECAST, TRANSIENT, rgb
from bridge.messages import NodeStatus
from bridge.topics import DIAGNOSTICS, TOPICS, TWIST, Topic
from bridge.view.canvas import Canvas, Moment

EVENTS: Final = "events"
SUMMARY: Final = "health/summary"
RATE: Final = "health/rate"
AGE: Final = "health/age"
FIGURE: Final = "health/figure"
ON_ARRIVAL: Final = "health/on_arrival"
PROCESS: Final = "state/process"
LEVELS: Final = ("ok", "warning", "error", "stale")
GONE: Final = "gone"
SILENT: Final = "silent"
_LEVEL_COLOUR: Final = {
    "ok": "#5fae6b",
    "warning": TRANSIENT,
    "error": FALL,
    "stale": FAINT,
    SILENT: FAINT,
    GONE: "#7a1d18",
}
MOST_FIGURES: Final = 512  # of all processes: what the wire says shall not fill the memory here
MOST_ROLES: Final = 32
_EVENT_LEVEL: Final = ("INFO", "WARN", "ERROR", "WARN")
_NUMBERS: Final = re.compile(r"[-+]?\d+(\.\d+)?")
_SILENCE_NS: Final = round(DIAGNOSTICS.max_age_s * NS)
_SUMMARY_NS: Final = round(0.2 * NS)
_ROLE_COLOUR: Final = {
    "perception": FORECAST,
    "anticipation": TRANSIENT,
    "controller": "#b98bdc",
    "drive": "#7ccf7c",
}
_COLOURS: Final = (FORECAST, TRANSIENT, FALL, "#7ccf7c", "#b98bdc", "", FORECAST, FAINT)
_TOPIC_COLOUR: Final = dict(zip((topic.key for topic in TOPICS), _COLOURS, strict=True))


class HealthPanel:
    """Keeps the newest status of each role and says once what has changed."""

    def __init__(self, canvas: Canvas) -> None:
        self._canvas = canvas
        self._statuses: dict[str, NodeStatus] = {}
        self._heard_ns: dict[str, int] = {}  # role -> arrival of its newest status
        self._states: dict[str, str] = {}  # role -> ok, warning, error, stale, silent or gone
        self._named: set[str] = set()  # paths whose curve has a name
        self._said: dict[str, str] = {}  # subject -> what was said of it last
        self._summary_ns: int | None = None
        for topic in TOPICS:
            if topic not in {TWIST, DIAGNOSTICS}:
                path = f"{ON_ARRIVAL}/{topic.key}"
                canvas.curves(path, (f"{topic.key} [ms]",), (_TOPIC_COLOUR[topic.key],), (1.2,))

    def status(self, status: NodeStatus, arrival_ns: int) -> None:
        """Take in what a process says about itself."""
        role = status.role
        if role not in self._states and len(self._states) >= MOST_ROLES:
            return
        self._statuses[role] = status
        self._heard_ns[role] = arrival_ns
        level = min(status.level, len(LEVELS) - 1)
        if self._become(role, LEVELS[level]):
            self.say(f"process {role}", f"{role}: {status.summary}", _EVENT_LEVEL[level])
        for key, text in status.values.items():
            value = _number(text)
            if value is None:
                continue
            place, unit = _place(role, key)
            path = "/".join(self._canvas.sdk.escape_entity_path_part(part) for part in place)
            if path not in self._named:
                if len(self._named) >= MOST_FIGURES:
                    continue
                self._named.add(path)
                name = f"{role} {key.removeprefix('age_ms.').removesuffix('_age_ms')}".removesuffix(" rate_hz")
                self._canvas.curves(path, (f"{name}{unit}",), (_ROLE_COLOUR.get(role, FAINT),), (1.5,))
            self._canvas.plot(path, (value,))
        self._summarise(arrival_ns)

    def arrived(self, topic: Topic, age_s: float) -> None:
        """Take in how old a message was when it arrived."""
        self._canvas.plot(f"{ON_ARRIVAL}/{topic.key}", (1e3 * age_s,))

    def alive(self, role: str, alive: bool) -> None:
        """Take in that a process has come or gone; known at once, live only."""
        if not alive:
            self._become(role, GONE)
            self.say(f"process {role}", f"{role} is gone", "ERROR")
        elif self._states.get(role, GONE) == GONE:
            self._become(role, "ok")
            self.say(f"process {role}", f"{role} is on the wire", "INFO")

    def silent(self, now_ns: int) -> None:
        """Mark the roles that have said nothing for longer than the diagnostics allow."""
        for role, heard_ns in self._heard_ns.items():
            if now_ns - heard_ns > _SILENCE_NS and self._states[role] not in {SILENT, GONE}:
                self._canvas.at(Moment(self._statuses[role].stamp_ns + _SILENCE_NS, heard_ns + _SILENCE_NS))
                self._become(role, SILENT)
                self.say(f"process {role}", f"{role} says nothing any more", "ERROR")

    def say(self, subject: str, text: str, level: str) -> None:
        """Write an event unless it is what was said of `subject` last, but for its numbers; '' forgets that."""
        kind = _NUMBERS.sub("#", text)
        if self._said.get(subject, "") != kind:
            self._said[subject] = kind
            if text:
                self._canvas.log(EVENTS, text, level)

    def _become(self, role: str, state: str) -> bool:
        """Begin a new stretch of the role's lane; return whether it is one."""
        if self._states.get(role) == state:
            return False
        path = f"{PROCESS}/{self._canvas.sdk.escape_entity_path_part(role)}"
        if role not in self._states:
            values = list(_LEVEL_COLOUR)
            colours = [rgb(_LEVEL_COLOUR[value]) for value in values]
            self._canvas.fix(path, self._canvas.sdk.StateConfiguration(values=values, colors=colours))
        self._states[role] = state
        self._canvas.draw(path, self._canvas.sdk.StateChange(state=state))
        return True

    def _summarise(self, now_ns: int) -> None:
        if self._summary_ns is not None and 0 <= now_ns - self._summary_ns < _SUMMARY_NS:
            return
        self._summary_ns = now_ns
        rows = [self._row(role) for role in sorted(self._states)]
        head = "| process | is | rate | oldest input | says |\n|---|---|---|---|---|\n"
        document = self._canvas.sdk.TextDocument(head + "\n".join(rows), media_type="text/markdown")
        self._canvas.draw(SUMMARY, document)

    def _row(self, role: str) -> str:
        status = self._statuses.get(role)
        if status is None:
            return f"| **{role}** | {self._states[role]} | | | |"
        ages = [age for key, text in status.values.items() if "age_ms" in key and (age := _number(text)) is not None]
        rate = _number(status.values.get("rate_hz", ""))
        cells = (
            f"**{role}**",
            self._states[role],
            "" if rate is None else f"{rate:.0f} Hz",
            f"{max(ages):.0f} ms" if ages else "",
            status.summary.replace("|", "/"),
        )
        return f"| {' | '.join(cells)} |"


def _number(text: str) -> float | None:
    """Return the finite number in `text`; None if it is none."""
    try:
        value = float(text)
    except ValueError:
        return None
    return value if math.isfinite(value) else None


def _place(role: str, key: str) -> tuple[tuple[str, ...], str]:
    """Return where a value of a status is plotted, part by part, and its unit."""
    if key == "rate_hz":
        return (*RATE.split("/"), role), " [Hz]"
    if key == "age_ms":
        return (*AGE.split("/"), role, "frame"), " [ms]"
    if key.startswith("age_ms.") or key.endswith("_age_ms"):
        return (*AGE.split("/"), role, key.removeprefix("age_ms.").removesuffix("_age_ms")), " [ms]"
    return (*FIGURE.split("/"), role, key), ""
