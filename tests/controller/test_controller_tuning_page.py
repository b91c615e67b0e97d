"""The tuning page without a page: values, curves, words, saving."""

from __future__ import annotations

import math
import tomllib
from itertools import pairwise
from pathlib import Path

import numpy as np
import pytest
from controller_tuning_page_cases import CONFIG, THRESHOLDS, candidates, made_up, recordings, walker
from hypothesis import given, settings
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays

from bridge.config.intervention import InterventionConfig
from bridge.config.load import load_config
from bridge.config.surefoot import SurefootConfig
from bridge.errors import SurefootError
from controller.tuning.page import words
from controller.tuning.page.bench import Bench
from controller.tuning.page.draft import Draft
from controller.tuning.page.knobs import KNOBS
from controller.tuning.page.layout import Layout
from controller.tuning.page.palette import DAY, NIGHT
from controller.tuning.page.timeline_chart import timeline_options
from controller.tuning.page.trace import bands, thin
from controller.tuning.page.tradeoff_chart import tradeoff_options
from controller.tuning.replay import replay
from controller.tuning.score import score_one


@pytest.fixture
def file(tmp_path: Path) -> Path:
    path = tmp_path / "walker.toml"
    path.write_text(CONFIG)
    return path


@pytest.fixture
def bench(file: Path) -> Bench:
    return Bench(recordings(), load_config(file), file, file)


def test_every_threshold_has_one_knob_within_its_bounds_and_around_its_default() -> None:
    assert set(KNOBS) == set(InterventionConfig.model_fields)
    for key, knob in KNOBS.items():
        assert knob.low <= getattr(InterventionConfig(), key) <= knob.high
        for end in (knob.low, knob.high):  # each end alone is a value that the config's own bounds allow
            _, refusal = Draft.of(SurefootConfig()).change(**{key: end}).check()
            assert "input should" not in refusal, refusal
        assert knob.meaning


def test_a_cue_that_is_switched_off_far_outside_is_within_its_sliders_reach() -> None:
    assert KNOBS["distance_onset_sd"].reach(-19.0) == (-19.0, 5.0)


@pytest.mark.parametrize(
    ("values", "refusal"),
    [
        ({"probability_onset": 1.2}, "intervention.probability_onset = 1.2: input should be less than or equal to 1"),
        ({"probability_onset": 0.95}, "intervention: probability_onset = 0.95 must be below probability_full = 0.8"),
        ({"rise_per_s": None}, "intervention.rise_per_s = None: input should be a valid number"),
        ({"steps_used": 2.5}, "intervention.steps_used = 2.5: input should be a valid integer"),
        ({"release_per_s": math.nan}, "intervention.release_per_s = nan: input should be a finite number"),
    ],
)
def test_a_bad_value_is_refused_in_the_words_of_the_config(values: dict[str, float | None], refusal: str) -> None:
    accepted, said = Draft.of(walker()).change(**values).check()
    assert accepted is None
    assert said.startswith(refusal)


def test_a_draft_names_what_differs_from_the_file() -> None:
    draft = Draft.of(walker())
    assert draft.changed == {}
    moved = draft.change(rise_per_s=9.0)
    assert moved.changed == {"rise_per_s": (8.0, 9.0)}
    assert moved.change(rise_per_s=8.0).changed == {}


@given(
    arrays(np.float64, st.integers(1, 3000), elements=st.floats(-5, 5) | st.just(math.nan)),
    st.integers(10, 200),
)
@settings(max_examples=40, deadline=None)
def test_a_thinned_curve_keeps_its_extremes_its_order_and_little_more(value: np.ndarray, most: int) -> None:
    time_s = np.arange(len(value)) * 0.01
    points = thin(time_s, value, most)
    assert len(points) <= most
    times = [point[0] for point in points]
    assert times == sorted(times)
    known = value[np.isfinite(value)]
    kept = [point[1] for point in points if point[1] is not None]
    if len(known):
        assert min(kept) == pytest.approx(known.min(), abs=1e-3)
        assert max(kept) == pytest.approx(known.max(), abs=1e-3)
    else:
        assert not kept


def test_bands_cover_the_recording_without_gap_or_overlap() -> None:
    time_s, state = np.arange(6) * 0.5, np.array(["A", "A", "B", "B", "B", "A"])
    found = bands(time_s, state)
    assert [band.state for band in found] == ["A", "B", "A"]
    assert (found[0].start_s, found[-1].end_s) == (0.0, 2.5)
    assert all(one.end_s == other.start_s for one, other in pairwise(found))
    assert bands(time_s[:0], state[:0]) == []


def test_the_list_says_what_was_needless_what_caught_a_fall_and_what_was_missed() -> None:
    config = walker()
    stumble, _, sitting, walking = recordings()

    def verdicts(case, intervention):
        run = replay(case, intervention, config.supervisor)
        return [line.verdict for line in words.happenings(run, score_one(run)) if line.verdict]

    assert verdicts(stumble, config.intervention) == ["caught"]
    assert verdicts(sitting, config.intervention) == ["needless"]
    assert verdicts(walking, config.intervention) == []
    assert verdicts(stumble, config.intervention.model_copy(update={"steps_used": 0})) == ["missed"]


def test_the_timeline_draws_states_curves_thresholds_and_falls() -> None:
    config = walker()
    case = recordings()[0]
    run = replay(case, config.intervention, config.supervisor)
    options = timeline_options(run, config, DAY, Layout(wide=True), "distance_onset_sd")
    by_name = {series["name"]: series for series in options["series"]}
    band = by_name["marks 0"]["markArea"]["data"]
    assert {area[0]["name"] for area in band} == {"DISARMED", "FOLLOW", "GUARD", "ARREST"}
    assert band[-1][1]["xAxis"] == pytest.approx(case.duration_s, abs=0.02)
    lines = by_name["marks 1"]["markLine"]["data"]
    assert {line["xAxis"] for line in lines if "xAxis" in line} == {11.0, 11.9}
    bold = [line["label"]["formatter"] for line in lines if line.get("lineStyle", {}).get("width") == 2.4]
    assert bold == ["distance_onset_sd 1.5"]
    assert max(value for _, value in by_name["stiffening"]["data"]) == 1.0
    night = timeline_options(run, config, NIGHT, Layout(wide=False), "")
    assert len(night["series"]) == len(options["series"]), "a chart of other length would lose its zoom"


def test_horizons_that_nobody_may_use_are_gaps_and_their_quality_is_zero() -> None:
    case = made_up("cut", 2.0)
    faults = tuple("horizon is invalid" if index >= 30 else "" for index in range(60))
    horizons = case.horizons
    broken = type(case)(
        "cut", "cut", 0, case.period_ns, case.ticks,
        type(horizons)(
            type(horizons.stream)("h", horizons.stream.arrival_ns, horizons.stream.stamp_ns, faults),
            *(getattr(horizons, name) for name in ("probabilities", "distance", "distance_rate", "quality", "step_s")),
        ),
    )  # fmt: skip
    config = walker()
    run = replay(broken, config.intervention, config.supervisor)
    options = timeline_options(run, config, DAY, Layout(wide=True), "")
    by_name = {series["name"]: series["data"] for series in options["series"]}
    assert all((value is None) == (time_s > 1.005) for time_s, value in by_name["distance, now"])
    assert by_name["quality"][-1][1] == 0.0


def test_the_trade_off_keeps_its_place_when_nothing_can_be_counted(bench: Bench) -> None:
    scores = bench.score(bench.config.intervention, lambda _: None, lambda: False)
    assert scores is not None
    tried = [words.point(f"candidate {index}", one.outcome) for index, one in enumerate(candidates())]
    now = words.point("on this page", scores.outcome)
    unknown = words.point("as in the file", None)
    options = tradeoff_options(tried, unknown, now, 60.0, DAY)
    panels = [series["data"] for series in options["series"]]
    assert [len(points) for points in panels] == [2, 1, 1, 2, 1, 1]
    assert panels[1][0]["value"] == ["-", "-"]
    assert panels[2][0]["value"] == [pytest.approx(scores.outcome.per_hour), 100.0]


def test_scoring_stops_when_nobody_wants_it_any_more_and_remembers_what_it_finished(bench: Bench) -> None:
    asked: list[int] = []
    assert bench.score(bench.config.intervention, asked.append, lambda: len(asked) == 2) is None
    assert asked == [0, 1]
    first = bench.score(bench.config.intervention, asked.append, lambda: False)
    asked.clear()
    assert bench.score(bench.config.intervention, asked.append, lambda: False) is first
    assert asked == []


def test_saving_keeps_the_file_and_the_previous_value(bench: Bench, file: Path) -> None:
    said = bench.save(Draft.of(bench.config).change(probability_onset=0.45, steps_used=8.0))
    assert str(file) in said
    text = file.read_text()
    assert tomllib.loads(text)["intervention"] == {**THRESHOLDS, "probability_onset": 0.45, "steps_used": 8}
    assert "0.4" in text
    assert "tried in March" in text
    assert bench.config.intervention.probability_onset == 0.45
    assert Draft.of(bench.config).changed == {}


def test_a_bad_draft_writes_nothing(bench: Bench, file: Path) -> None:
    before = file.read_bytes()
    with pytest.raises(SurefootError, match="probability_onset = 0.9 must be below"):
        bench.save(Draft.of(bench.config).change(probability_onset=0.9))
    assert file.read_bytes() == before
    assert list(file.parent.iterdir()) == [file]


def test_a_file_that_somebody_changed_meanwhile_is_not_overwritten(bench: Bench, file: Path) -> None:
    draft = Draft.of(bench.config).change(rise_per_s=9.0)
    file.write_text(CONFIG.replace("0.4 ", "0.5 "))
    with pytest.raises(SurefootError, match="was changed since this page read it: reload"):
        bench.save(draft)
    assert file.read_text() == CONFIG.replace("0.4 ", "0.5 ")


def test_a_changed_supervisor_is_counted_with_from_the_next_opening_on(bench: Bench, file: Path) -> None:
    def needless() -> int:
        scores = bench.score(bench.config.intervention, lambda _: None, lambda: False)
        assert scores is not None
        return scores.outcome.needless

    assert needless() == 1
    file.write_text(CONFIG.replace("arrest_on = 0.8", "arrest_on = 0.99\narrest_dwell_s = 1"))
    bench.refresh()
    assert needless() == 0
    file.write_text(CONFIG.replace("arrest_on = 0.8", "arrest_on = 8"))
    with pytest.raises(SurefootError, match="arrest_on"):
        bench.refresh()
    assert needless() == 0


def test_saving_elsewhere_leaves_the_file_alone_and_goes_on_there(file: Path, tmp_path: Path) -> None:
    out = tmp_path / "tuned.toml"
    bench = Bench(recordings(), load_config(file), file, out)
    before = file.read_bytes()
    bench.save(Draft.of(bench.config).change(rise_per_s=9.0))
    bench.save(Draft.of(bench.config).change(release_per_s=2.0))
    assert file.read_bytes() == before
    assert tomllib.loads(out.read_text())["intervention"] == {
        **THRESHOLDS, "rise_per_s": 9.0, "release_per_s": 2.0,
    }  # fmt: skip


def test_saving_elsewhere_overwrites_nothing_unasked(file: Path, tmp_path: Path) -> None:
    out = tmp_path / "tuned.toml"
    out.write_text("# somebody's\n")
    bench = Bench(recordings(), load_config(file), file, out)
    with pytest.raises(SurefootError, match="--force"):
        bench.save(Draft.of(bench.config).change(rise_per_s=9.0))
    assert out.read_text() == "# somebody's\n"


def test_without_a_file_there_is_nowhere_to_save() -> None:
    bench = Bench(recordings(), SurefootConfig())
    with pytest.raises(SurefootError, match="nowhere to save: start with --config FILE"):
        bench.save(Draft.of(bench.config).change(rise_per_s=9.0))
