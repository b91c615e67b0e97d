"""The thresholds on the page: for each a slider, a number field, and the way back to the file's value."""

from __future__ import annotations

from collections.abc import Callable

from nicegui import ui
from nicegui.events import ValueChangeEventArguments

from controller.tuning.page.draft import Draft, Entered
from controller.tuning.page.knobs import GROUPS, Knob

Told = Callable[[str, Entered], None]  # key and new value
Heard = Callable[[ValueChangeEventArguments[float | None]], None]
DIGITS = 6  # a slider's steps are decimal fractions, its floats are not


class KnobPanel:
    """Sliders and fields of every threshold; tells `changed(key, value)` what a person sets."""

    def __init__(self, draft: Draft, changed: Told) -> None:
        self._changed = changed
        self._quiet = False  # while the page itself sets a value
        self._rows: dict[str, _Row] = {}
        for group in GROUPS:
            with ui.element("section").classes("group"):
                with ui.element("div").classes("group-head"):
                    ui.label(group.title).classes("group-title")
                    ui.label(group.question).classes("quiet")
                for knob in group.knobs:
                    self._rows[knob.key] = _Row(knob, draft, self._set)

    def show(self, draft: Draft) -> None:
        """Set every slider and field to the values of `draft`, and mark what differs from the file."""
        self._quiet = True
        try:
            for key, row in self._rows.items():
                row.show(draft, key)
        finally:
            self._quiet = False

    def blame(self, keys: set[str]) -> None:
        """Mark the fields of `keys` as what the config does not accept."""
        for key, row in self._rows.items():
            row.blame(key in keys)

    def _set(self, key: str, value: Entered) -> None:
        if not self._quiet:
            self._changed(key, value)


class _Slider(ui.slider):
    LOOPBACK = False  # the thumb follows the finger; it does not wait for the server


class _Row:
    def __init__(self, knob: Knob, draft: Draft, changed: Told) -> None:
        self._knob = knob
        value = draft.values[knob.key]
        number = 0.0 if value is None else value
        self._ends = low, high = knob.reach(number)
        with ui.element("div").classes("knob") as self._frame:
            with ui.element("div").classes("knob-head"):
                ui.element("i").classes(f"swatch swatch-{knob.key}")
                with ui.label(knob.label).classes("knob-name"):
                    ui.tooltip(f"{knob.key}: {knob.meaning}").classes("meaning")
                self._back = ui.button(on_click=lambda: changed(knob.key, self._file)).props("flat dense no-caps")
                self._back.classes("back").props(f'aria-label="{knob.key}: back to the value of the file"')
                self._field = (
                    ui.number(value=value, step=knob.step, suffix=knob.unit, on_change=self._typed(changed))
                    .props(f'dense outlined debounce=350 input-class="field" aria-label="{knob.key}"')
                    .classes("knob-field")
                    .mark(f"field {knob.key}")
                )
            self._slider = (
                _Slider(min=low, max=high, step=knob.step, value=number, on_change=self._dragged(changed))
                .props(f'thumb-size="22px" track-size="4px" aria-label="{knob.key}" data-key="{knob.key}"')
                .mark(f"slider {knob.key}")
            )
        self._file: Entered = value
        self.show(draft, knob.key)

    def show(self, draft: Draft, key: str) -> None:
        value = draft.values[key]
        self._file = getattr(draft.base.intervention, key)
        if value is not None:
            if self._field.value != value:
                self._field.set_value(value)
            bounded = min(max(value, self._ends[0]), self._ends[1])
            if self._slider.value != bounded:
                self._slider.set_value(bounded)
        differs = value != self._file
        self._back.set_text(f"was {self._file:g}")
        self._back.set_visibility(differs)
        self._frame.classes(add="changed" if differs else "", remove="" if differs else "changed")

    def blame(self, blamed: bool) -> None:
        self._frame.classes(add="refused" if blamed else "", remove="" if blamed else "refused")

    def _typed(self, changed: Told) -> Heard:
        return lambda event: changed(self._knob.key, event.value)

    def _dragged(self, changed: Told) -> Heard:
        return lambda event: changed(self._knob.key, round(event.value or 0.0, DIGITS))
