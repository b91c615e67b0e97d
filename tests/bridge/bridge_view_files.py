"""Reading `.rrd` files back, and recordings whose horizons belong to the shipped plane."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
from bridge_recordings import Event, walk

from anticipation.plane_file import read_plane
from bridge.codec import encode
from bridge.messages import FallHorizon, Message

PLANE = read_plane("")


class Row(NamedTuple):
    """One row of an entity; `stamp` and `arrival` are None for what is static."""

    stamp_ns: int | None
    arrival_ns: int | None
    trial_ns: int | None
    values: dict[str, Any]  # component, without its archetype -> list


class Rrd:
    """All rows by entity, in the order of their stamps, and the layout's views by name."""

    def __init__(self, path: Path) -> None:
        from rerun.chunk import RrdReader

        reader = RrdReader(path)
        self.timelines: set[str] = set()
        self.rows: dict[str, list[Row]] = {}
        for chunk in reader.stream():
            self.timelines |= set(chunk.timeline_names)
            batch = chunk.to_record_batch()
            times = {
                name: batch.column(name).cast("int64").to_pylist() if name in batch.schema.names else None
                for name in ("stamp", "arrival", "trial")
            }
            names = [name for name in batch.schema.names if ":" in name]
            columns = {name.partition(":")[2]: batch.column(name).to_pylist() for name in names}
            for index in range(batch.num_rows):
                values = {name: column[index] for name, column in columns.items() if column[index] is not None}
                at = [None if time is None else time[index] for time in times.values()]
                self.rows.setdefault(chunk.entity_path, []).append(Row(*at, values))
        for rows in self.rows.values():
            rows.sort(key=lambda row: row.stamp_ns or 0)
        self.views: dict[str, str] = {}
        for store in reader.blueprints():
            for chunk in reader.stream(store=store):
                batch = chunk.to_record_batch()
                if "ViewBlueprint:display_name" in batch.schema.names:
                    names = batch.column("ViewBlueprint:display_name").to_pylist()
                    classes = batch.column("ViewBlueprint:class_identifier").to_pylist()
                    self.views.update({name[0]: kind[0] for name, kind in zip(names, classes, strict=True)})

    def drawn(self, entity: str, component: str) -> list[Row]:
        """Return the rows of an entity that hold `component`."""
        return [row for row in self.rows.get(entity, []) if component in row.values]

    def static(self, entity: str) -> list[Row]:
        return [row for row in self.rows.get(entity, []) if row.stamp_ns is None]

    def curve(self, entity: str) -> np.ndarray:
        return np.array([row.values["scalars"] for row in self.drawn(entity, "scalars")], dtype=float)

    def events(self) -> list[str]:
        return [row.values["text"][0] for row in self.drawn("/events", "text")]


def on_plane(horizon: FallHorizon) -> FallHorizon:
    """Return `horizon` on its way from stable to fall in the shipped plane, with the distances of that plane."""
    share = np.linspace(0.2, 0.6, 16)[:, None]
    points = (1.0 - share) * PLANE.centres[0] + share * PLANE.centres[2]
    away = points[:, None] - PLANE.centres
    return replace(
        horizon,
        plane=points,
        distance=PLANE.signed_distance(points),
        centre_distance=np.hypot(away[..., 0], away[..., 1]),
        forecast_px=horizon.forecast_px + np.arange(16.0)[:, None, None],
    )


def with_message(event: Event, message: Message) -> Event:
    payload = encode(event.topic, message)
    return Event(event.topic, message, event.sample._replace(payload=payload))


def foreseen(duration_s: float) -> list[Event]:
    """Return the made-up walk with horizons that belong to the shipped plane."""
    return [
        with_message(event, on_plane(event.message)) if isinstance(event.message, FallHorizon) else event
        for event in walk(duration_s)
    ]
