"""One open page: thresholds on one side, what they do on the other."""

from __future__ import annotations

import asyncio
from typing import Any, Final

from nicegui import background_tasks, ui
from nicegui.events import EChartPointClickEventArguments, GenericEventArguments

from bridge.config.intervention import InterventionConfig
from bridge.errors import SurefootError
from controller.tuning.page import words
from controller.tuning.page.bench import Bench, Scores
from controller.tuning.page.draft import Draft, Entered
from controller.tuning.page.knob_panel import KnobPanel
from controller.tuning.page.layout import Layout
from controller.tuning.page.palette import DAY, NIGHT
from controller.tuning.page.results import HappeningList, Tiles
from controller.tuning.page.timeline_chart import timeline_options
from controller.tuning.page.timeline_marks import PANELS
from controller.tuning.page.tradeoff_chart import HEIGHT_PX, RECOMMENDED, tradeoff_options
from controller.tuning.replay import Run
from controller.tuning.score import score_one

ALL, MISSED, NEEDLESS = "all", "missed", "needless"
LOOK: Final = """
if (!window.surefootLook) {
  window.surefootLook = true;
  const dark = matchMedia('(prefers-color-scheme: dark)'), wide = matchMedia('(min-width: 760px)');
  const tell = () => emitEvent('look', {dark: dark.matches, wide: wide.matches});
  dark.addEventListener('change', tell);
  wide.addEventListener('change', tell);
}
emitEvent('look', {dark: matchMedia('(prefers-color-scheme: dark)').matches,
                   wide: matchMedia('(min-width: 760px)').matches});
"""


class Board:
    """Builds the page of the present client and keeps it up to date.

    What a person does only changes the draft and rings `_news`. One task per page works it off: the
    newest draft alone, first the recording that is looked at, then all the others.
    """

    def __init__(self, bench: Bench) -> None:
        self._bench = bench
        self._client = ui.context.client
        self._case = bench.cases[0]
        self._touched = ""
        self._layout, self._palette = Layout(wide=True), DAY
        self._asked_for: bool | None = None  # dark or not, as a person set it; None: as the system has it
        self._news = asyncio.Event()
        self._run: Run | None = None
        self._shown: InterventionConfig | None = None  # thresholds of the charts
        self._scores: Scores | None = None
        self._file_scores: Scores | None = None
        try:
            bench.refresh()
            self._unreadable = ""
        except SurefootError as error:
            self._unreadable = str(error)
        self._draft = Draft.of(bench.config)
        self._build()
        self._news.set()
        ui.on("look", self._look)
        self._client.on_connect(lambda: ui.run_javascript(LOOK))
        task = background_tasks.create(self._work(), name="surefoot tune page")
        self._client.on_delete(task.cancel)

    # ---------------------------------------------------------------- what is there

    def _build(self) -> None:
        bench = self._bench
        self._dark = ui.dark_mode(value=False)
        with ui.header().classes("bar"):
            ui.label("Surefoot").classes("brand")
            ui.label("tune").classes("brand-quiet")
            target = "no --config: nothing can be saved" if bench.save_to is None else str(bench.save_to)
            ui.label(f"\u200e{target}\u200e").classes("target")  # cut at its beginning, but read from left to right
            ui.space()
            ui.button(icon="contrast", on_click=self._toggle_dark).props('flat round dense aria-label="dark or light"')
            self._discard = ui.button("Discard", on_click=self._reset).props("flat no-caps").mark("discard")
            self._save = ui.button("Save", on_click=self._write).props("unelevated no-caps").mark("save")
        with ui.element("main").classes("page"):
            with ui.element("div").classes("results"):
                self._banner = ui.label("").classes("banner").props("role=alert").mark("refusal")
                self._tiles = Tiles()
                with ui.element("div").classes("card"):
                    self._build_chooser()
                    self._timeline = ui.echart({}).classes("timeline").mark("timeline")
                    self._happenings = HappeningList()
                with ui.element("div").classes("card"):
                    ui.label("Trade-off over all recordings").classes("card-title")
                    if bench.candidates:
                        ui.label("Click a candidate to take its thresholds; the triangle is recommended.").classes(
                            "quiet"
                        )
                    self._tradeoff = ui.echart({}, on_point_click=self._take_candidate).classes("tradeoff")
                    self._tradeoff.style(f"height: {HEIGHT_PX}px").mark("tradeoff")
            with ui.element("aside").classes("knobs card"):
                self._panel = KnobPanel(self._draft, self._set)
                ui.label(
                    "A running Surefoot with this file takes saved values within half a second, without a jump."
                ).classes("quiet note")
        self._show_draft()

    def _build_chooser(self) -> None:
        with ui.element("div").classes("chooser"):
            self._chooser = (
                ui.select(self._options(ALL), value=self._case.name, with_input=True, on_change=self._choose)
                .props('dense outlined options-dense aria-label="recording" label="Recording"')
                .classes("chooser-select")
                .mark("recording")
            )
            self._filter = (
                ui.toggle({ALL: "all", MISSED: "missed", NEEDLESS: "needless"}, value=ALL, on_change=self._narrow)
                .props('no-caps unelevated padding="5px 10px" size="13px"')
                .classes("filter")
                .mark("filter")
            )

    # ---------------------------------------------------------------- what a person does

    def _set(self, key: str, value: Entered) -> None:
        if self._draft.values[key] == value:
            return
        self._touched = key
        self._draft = self._draft.change(**{key: value})
        self._show_draft()
        self._news.set()

    def _take_candidate(self, event: EChartPointClickEventArguments) -> None:
        if event.series_name != "candidates":
            return
        candidate = self._bench.candidates[event.data_index]
        self._touched = ""
        self._draft = Draft.of(self._draft.base).change(**candidate.values)
        self._show_draft()
        self._news.set()

    def _reset(self) -> None:
        self._touched = ""
        self._draft = Draft.of(self._draft.base)
        self._show_draft()
        self._news.set()

    def _write(self) -> None:
        try:
            done = self._bench.save(self._draft)
        except SurefootError as error:
            close = [{"label": "OK", "color": "white"}]
            ui.notify(f"Nothing written: {error}", type="negative", multi_line=True, actions=close)
            return
        self._draft = Draft.of(self._bench.config)
        self._file_scores = None
        self._show_draft()
        self._news.set()
        ui.notify(done, type="positive", multi_line=True)

    def _choose(self) -> None:
        named = [case for case in self._bench.cases if case.name == self._chooser.value]
        if not named or named[0] is self._case:
            return
        self._case = named[0]
        self._timeline.run_chart_method("dispatchAction", {"type": "dataZoom", "start": 0, "end": 100})
        self._news.set()

    def _narrow(self) -> None:
        options = self._options(self._filter.value)
        if not options:
            ui.notify(f"no recording is {self._filter.value}")
            self._filter.set_value(ALL)
            return
        kept = self._case.name if self._case.name in options else next(iter(options))
        self._chooser.set_options(options, value=kept)

    def _toggle_dark(self) -> None:
        self._asked_for = not self._dark.value
        self._paint(self._asked_for, self._layout)

    def _look(self, event: GenericEventArguments) -> None:
        dark = event.args["dark"] is True if self._asked_for is None else self._asked_for
        self._paint(dark, Layout(wide=event.args["wide"] is True))

    def _paint(self, dark: bool, layout: Layout) -> None:
        palette = NIGHT if dark else DAY
        if (palette, layout) == (self._palette, self._layout):
            return
        self._dark.set_value(dark)
        self._palette, self._layout = palette, layout
        self._draw_timeline()
        self._draw_tradeoff()

    # ---------------------------------------------------------------- what comes of it

    async def _work(self) -> None:
        """Work off what was asked for last, again and again."""
        while True:
            await self._news.wait()
            self._news.clear()
            intervention, _ = self._draft.check()
            if intervention is None:  # the charts stay as they were, and say so
                continue
            case = self._case
            run = await asyncio.to_thread(self._bench.run, case, intervention)
            with self._client:
                self._run, self._shown = run, intervention
                self._draw_timeline()
                self._happenings.show(words.happenings(run, score_one(run, self._bench.by)))
            await self._count(intervention)

    async def _count(self, intervention: InterventionConfig) -> None:
        """Score all recordings, unless something newer is asked for meanwhile."""
        if self._file_scores is None:
            file = await self._score(self._draft.base.intervention)
            if file is None:
                return
            self._file_scores = file
        scores = await self._score(intervention)
        if scores is None:
            return
        self._scores = scores
        with self._client:
            self._tiles.show(scores.outcome, self._file_scores.outcome)
            missed, needless = words.verdicts(list(scores.tallies.values()))
            self._filter.set_options(
                {ALL: "all", MISSED: f"missed {len(missed)}", NEEDLESS: f"needless {len(needless)}"},
                value=self._filter.value,
            )
            self._draw_tradeoff()

    async def _score(self, intervention: InterventionConfig) -> Scores | None:
        done, gone = 0, False

        def told(count: int) -> None:
            nonlocal done
            done = count

        def unwanted() -> bool:
            return gone or self._news.is_set()

        counting = asyncio.ensure_future(asyncio.to_thread(self._bench.score, intervention, told, unwanted))
        try:
            while not (await asyncio.wait({counting}, timeout=0.2))[0]:
                with self._client:
                    self._tiles.counting(done, len(self._bench.cases))
        finally:
            gone = True  # the page is closed, or the server ends: nobody waits for the rest
        return counting.result()

    def _show_draft(self) -> None:
        _, refusal = self._draft.check()
        self._panel.show(self._draft)
        self._panel.blame({key for key in self._draft.values if key in refusal})
        said = self._unreadable or refusal
        self._banner.set_text(f"{said} – the charts show the last accepted values" if said else "")
        self._banner.set_visibility(bool(said))
        changed = len(self._draft.changed)
        self._save.set_text(f"Save {changed}" if changed else "Save")
        self._save.set_enabled(self._bench.save_to is not None and changed > 0)
        self._discard.set_visibility(changed > 0)

    def _options(self, kind: str) -> dict[str, str]:
        names = {case.name for case in self._bench.cases}
        if kind != ALL and self._scores is not None:
            missed, needless = words.verdicts(list(self._scores.tallies.values()))
            names = missed if kind == MISSED else needless
        return {case.name: words.case_words(case) for case in self._bench.cases if case.name in names}

    def _draw_timeline(self) -> None:
        if self._run is None or self._shown is None:
            return
        config = self._bench.config.model_copy(update={"intervention": self._shown})
        self._timeline.style(f"height: {self._layout.total(len(PANELS))}px")
        _redraw(self._timeline, timeline_options(self._run, config, self._palette, self._layout, self._touched))

    def _draw_tradeoff(self) -> None:
        if self._scores is None or self._file_scores is None:
            return
        candidates = [
            words.point(RECOMMENDED if each.recommended else f"candidate {index + 1}", each.outcome)
            for index, each in enumerate(self._bench.candidates)
        ]
        file, now = (
            words.point("as in the file", self._file_scores.outcome),
            words.point("on this page", self._scores.outcome),
        )
        _redraw(self._tradeoff, tradeoff_options(candidates, file, now, self._bench.budget_per_h, self._palette))


def _redraw(chart: Any, options: dict[str, Any]) -> None:
    chart.options.clear()
    chart.options.update(options)
    chart.update()
