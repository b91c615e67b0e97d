"""The page: every table and picture is there, and it can be drawn again from what is stored."""

import json
import re
from dataclasses import replace
from html.parser import HTMLParser

import numpy as np
import pytest
from anticipation_records import made_predictions
from PIL import Image

from anticipation.training.evaluation import records
from anticipation.training.evaluation.command import evaluate
from anticipation.training.evaluation.results import results_of
from anticipation.training.report.folder import read_experiment
from anticipation.training.report.targets import targets
from bridge.errors import SourceError, SurefootError

SMALL = 200_000  # bytes: what a picture in docs may take
TITLES = (
    "Targets",
    "Table 2. Forecast error",
    "Forecast error while falling, over that of the best naive forecast",
    "Table 3. Accuracy, URFD falls",
    "Macro-F1, URFD falls",
    "As shipped, part by part",
    "UP-Fall falls: accuracy",
    "every frame with a horizon",
    "Expected calibration error",
    "Two annotations of onset",
    "physical onset: accuracy",
    "Falls foreseen before the first lying frame",
    "Interventions where nobody falls",
    "Distance to the fall boundary in the last second",
    "Another data set, never learnt from",
    "Learning curve",
)
ROWS = ("zero velocity + DGNN", "DGNN only, shifted labels", "majority class", "paper, its protocol: LSTM + DGNN")
EXPERIMENT = {
    "title": "Learning curve", "note": "n", "columns": ["4", "8"], "x": [4, 8], "unit": "accuracy",
    "rows": [{"name": "a", "values": [0.5, 0.6], "spread": [0.1, 0.1]}],
}  # fmt: skip


def stored(folder, protocol="grouped", **options):
    """Write predictions as an evaluation of that protocol would, and return them."""
    made = made_predictions(**options)
    made = records.Predictions({**made.meta, "protocol": protocol}, made.records, made.planes)
    records.save(made, folder / f"{protocol}.npz")
    return made


class Page(HTMLParser):
    """Text, pictures and links of a page."""

    def __init__(self, text):
        super().__init__()
        self.images, self.links, self.anchors, self.text = [], [], [], ""
        self.feed(text)

    def handle_starttag(self, tag, attrs):
        named = dict(attrs)
        self.images += [named["src"]] if tag == "img" else []
        self.links += [named["href"]] if tag == "a" else []
        self.anchors += [named["id"]] if "id" in named else []

    def handle_data(self, data):
        self.text += data


@pytest.fixture(scope="module")
def report(tmp_path_factory):
    """What the command draws, with no research data, from predictions of two protocols."""
    source, folder = tmp_path_factory.mktemp("stored"), tmp_path_factory.mktemp("page")
    made = stored(source)
    stored(source, "cross", wrong=0.4)
    (source / "curve.json").write_text(json.dumps(EXPERIMENT))
    with pytest.MonkeyPatch.context() as patch:
        patch.delenv("SUREFOOT_DATA", raising=False)
        evaluate(stored=source, out=folder, json=folder / "n.json", experiments=[source / "curve.json"])
    return folder, Page((folder / "index.html").read_text()), made


def test_the_page_names_every_table_and_row(report):
    _, page, _ = report
    for title in (*TITLES, *ROWS):
        assert title in page.text, title
    assert "None" not in page.text
    assert not re.search(r"\bnan\b", page.text)


def test_the_page_stands_alone(report):
    folder, page, _ = report
    assert len(set(page.images)) == len(page.images) >= 8
    for name in page.images:
        assert "/" not in name
        assert (folder / name).stat().st_size < SMALL
        with Image.open(folder / name) as image:
            pixels = np.asarray(image.convert("L"))
        assert min(pixels.shape) > 150
        assert pixels.std() > 5  # something is drawn
    assert {link.removeprefix("#") for link in page.links} <= set(page.anchors)
    assert "http" not in (folder / "index.html").read_text()


def test_the_drop_across_data_sets_is_that_of_the_numbers(report):
    folder, page, _ = report
    own, other = (json.loads((folder / f"{name}.json").read_text()) for name in ("grouped", "cross"))
    one, two = (each["tables"]["urfd"]["pooled"]["macro_f1"]["as shipped"][0] for each in (own, other))
    drop = one - two
    assert drop > 0.2
    assert f"{drop:.3f}" in page.text
    assert "missed" in page.text


def test_without_the_live_pass_nothing_is_said_of_events():
    made = made_predictions()
    ticked = [replace(record, frames=None) for record in made.records if record.ticks is not None]
    results = results_of(replace(made, records=ticked))
    assert "events" not in results
    assert "daily" not in results
    said = {row[0]: row[2:] for row in targets({"grouped": results}).rows}
    assert [name for name, cells in said.items() if "intervention" in name and cells == ["not measured", ""]]


def test_stored_predictions_come_back_as_they_were(tmp_path):
    made = stored(tmp_path)
    again = records.load(tmp_path / "grouped.npz")
    assert again.meta == made.meta
    assert results_of(again) == results_of(made)
    for one, other in zip(made.records, again.records, strict=True):
        assert (one.name, one.group, one.kind, one.part) == (other.name, other.group, other.kind, other.part)
        assert (one.ticks is None) == (other.ticks is None)
        if one.ticks is not None:
            assert (one.ticks.forecast == other.ticks.forecast).all()
            assert list(one.ticks.rows) == list(other.ticks.rows)


def test_command_writes_the_numbers_of_what_is_stored(report):
    folder, _, made = report
    expected = json.loads(json.dumps(results_of(made)))
    assert json.loads((folder / "n.json").read_text()) == expected
    assert json.loads((folder / "grouped.json").read_text()) == expected


@pytest.mark.parametrize("damage", ["missing", "truncated", "other format"])
def test_what_cannot_be_read_is_one_line(tmp_path, damage):
    path = tmp_path / "grouped.npz"
    if damage == "truncated":
        stored(tmp_path)
        path.write_bytes(path.read_bytes()[:5000])
    if damage == "other format":
        np.savez(path, meta=np.frombuffer(b'{"format": 99}', dtype=np.uint8))
    with pytest.raises(SurefootError) as failure:
        evaluate(stored=tmp_path, out=tmp_path)
    assert "\n" not in str(failure.value)
    assert "grouped" in str(failure.value)


@pytest.mark.parametrize(
    "spoilt", ["{", "[]", '{"title": "a", "columns": ["1"]}', json.dumps({**EXPERIMENT, "columns": ["1"]})]
)
def test_an_experiment_that_cannot_be_shown_is_named(tmp_path, spoilt):
    path = tmp_path / "curve.json"
    path.write_text(spoilt)
    with pytest.raises(SourceError, match=r"curve\.json"):
        read_experiment(path)
    path.write_text(json.dumps(EXPERIMENT))
    assert read_experiment(path)["title"] == "Learning curve"
