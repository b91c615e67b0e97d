"""`surefoot tune` as a user runs it: recordings in; table, JSON, picture, page and TOML out."""

from __future__ import annotations

import json
import re
from pathlib import Path

import pytest
from controller_tuning_streams import watched

from bridge.cli import main
from bridge.clock import NS
from bridge.codec import encode
from bridge.config.load import load_config
from bridge.record.writer import BagWriter
from bridge.topics import FALL_HORIZON
from bridge.transport.interface import Sample
from controller.tuning.cases import Case, Fall

VARY = ("--vary", "probability_full=0.5:0.95:4", "--vary", "probability_onset=0.1,0.3")


def record(case: Case, folder: Path, falls: str) -> None:
    """Write the horizons of a made-up case as a recording, with a list of falls beside it."""
    writer = BagWriter(folder / f"{case.name}.mcap", "surefoot", (FALL_HORIZON,))
    for number, stamp_ns in enumerate(case.horizons.stream.stamp_ns.tolist()):
        sample = Sample(encode(FALL_HORIZON, case.horizons.message(number)), number, b"a" * 16, stamp_ns + NS // 100)
        writer.write(FALL_HORIZON, sample)
    writer.finish()
    (folder / f"{case.name}.falls.csv").write_text(f"recording,onset_s,impact_s,over_s\n{case.name},{falls}\n")


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("walks")
    for number in range(3):
        begin = 2.0 + 0.2 * number
        spans = [(begin, begin + 0.4, 0.6), (begin + 0.4, 5.0, 0.99)]
        record(watched(5.0, spans, (Fall(begin, begin + 0.8),), f"fall{number}"), folder, f"{begin},{begin + 0.8},")
        record(watched(5.0, [(2.0, 2.3, 0.5)], (), f"day{number}"), folder, ",,")
    return folder


@pytest.fixture
def config(tmp_path: Path) -> Path:
    file = tmp_path / "C.toml"
    file.write_text("# mine\n[intervention]\nprobability_full = 0.55  # too soon\nprobability_onset = 0.1\n")
    return file


def test_everything_that_can_come_out(
    folder: Path, config: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    outputs = {name: tmp_path / name for name in ("tuned.toml", "tuned.png", "tuned.html", "tuned.json")}
    words = ["--out", "tuned.toml", "--plot", "tuned.png", "--report", "tuned.html", "--json", "tuned.json"]
    placed = [str(outputs[word]) if word in outputs else word for word in words]
    assert main(["tune", str(folder), "--config", str(config), *VARY, "--budget", "1 in 10 h", *placed]) == 0
    said = capsys.readouterr()
    assert "recommended" in said.out
    assert "3 of 3" in said.out
    assert "cannot show it" in said.out
    assert "do not react" in said.err
    document = json.loads(outputs["tuned.json"].read_text())
    values = document["recommended"]["values"]
    tuned = load_config(outputs["tuned.toml"]).intervention
    assert tuned.model_dump() == values
    assert document["recommended"]["needless"] == 0
    assert document["present"]["needless"] > 0
    assert document["budget"]["shown_kept"] is False
    assert document["budget"]["hours_needed"] == pytest.approx(30.0, rel=0.01)
    assert len(document["recordings"]) == 6
    assert document["held_out"]["falls"] == 3
    text = outputs["tuned.toml"].read_text()
    assert "# mine\n" in text
    assert re.search(r"probability_full = 0\.\d+  # was 0\.55; too soon\n", text)
    assert outputs["tuned.png"].read_bytes().startswith(b"\x89PNG")
    page = outputs["tuned.html"].read_text()
    assert "fall2.mcap" in page
    assert "http" not in re.sub(r"data:image/png;base64,[A-Za-z0-9+/=]*", "", page)  # nothing is fetched


def test_json_alone_on_stdout_is_json_alone(folder: Path, config: Path, capsys: pytest.CaptureFixture[str]) -> None:
    words = ["tune", str(folder), "--config", str(config), *VARY, "--json", "-"]
    assert main(words) == 0
    first = capsys.readouterr().out
    assert json.loads(first)["question"]["budget_per_hour"] == pytest.approx(0.1)
    assert main(words) == 0
    assert capsys.readouterr().out == first


def test_set_values_end_up_in_the_file(folder: Path, config: Path, tmp_path: Path) -> None:
    out = tmp_path / "out.toml"
    words = ["--set", "intervention.release_per_s=0.5", "--out", str(out)]
    assert main(["tune", str(folder), "--config", str(config), *VARY, *words]) == 0
    assert load_config(out).intervention.release_per_s == 0.5
    assert main(["tune", str(folder), "--config", str(config), *VARY, *words]) == 2
    assert main(["tune", str(folder), "--config", str(config), *VARY, *words, "--force"]) == 0


def test_a_study(folder: Path, config: Path, capsys: pytest.CaptureFixture[str]) -> None:
    words = ["--method", "study", "--trials", "12", "--vary", "probability_full=0.3:0.98", "--seed", "3"]
    assert main(["tune", str(folder), "--config", str(config), *words, "--json", "-"]) == 0
    document = json.loads(capsys.readouterr().out)
    assert 2 < document["tried"] <= 13
    assert len(document["folds"]) == 2


@pytest.mark.parametrize(
    ("words", "said"),
    [
        (["no.mcap"], "no.mcap: no such recording"),
        (["WALKS", "--budget", "never"], "--budget never: expected such as '1 in 10 h'"),
        (["WALKS", "--vary", "probability_ful=0.1:0.2"], "--vary probability_ful=0.1:0.2: no key of [intervention]"),
        (["WALKS", "--falls", "no.csv"], "no.csv: cannot be read"),
        (["WALKS", "--plot", "."], "--plot .: cannot be written: it is a folder"),
        (["WALKS", "--json", "C.toml/x"], "--json C.toml/x: cannot be written"),
    ],
)
def test_what_is_wrong_is_one_line(
    words: list[str], said: str, folder: Path, config: Path, capsys: pytest.CaptureFixture[str],
    monkeypatch: pytest.MonkeyPatch,
) -> None:  # fmt: skip
    monkeypatch.chdir(config.parent)
    assert main(["tune", *(str(folder) if word == "WALKS" else word for word in words), "--config", str(config)]) == 2
    error = capsys.readouterr().err
    assert said in error
    assert len(error.strip().splitlines()) == 1
    assert [path.name for path in config.parent.iterdir()] == ["C.toml"]
