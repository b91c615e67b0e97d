"""`surefoot data`: what is there, what is missing, what is damaged."""

import json

import numpy as np
import pytest
from anticipation_people import falling, make_data

from anticipation.training.clips import Clip
from anticipation.training.inventory import FILES, check, take_stock
from bridge.cli import main


@pytest.fixture
def data(tmp_path, monkeypatch):
    monkeypatch.setenv("COLUMNS", "200")
    monkeypatch.delenv("SUREFOOT_DATA", raising=False)
    folder = tmp_path / "data"
    folder.mkdir()
    make_data(folder)
    return folder


def test_what_is_there_is_counted_with_its_licence(data, tmp_path, capsys):
    out = tmp_path / "new" / "stock.json"
    assert main(["data", "--data", str(data), "--json", str(out)]) == 0
    page = capsys.readouterr().out
    assert "CC BY-NC-SA 4.0" in page
    stock = json.loads(out.read_text())
    sources = {source["name"]: source for source in stock["sources"]}
    falls = sources["URFD falls, AlphaPose"]
    assert falls["clips"] == 8
    assert sum(falls["classes"].values()) == falls["frames"]
    assert min(falls["classes"][name] for name in ("stable", "transient", "fall")) > 0
    assert sources["UP-Fall daily"]["classes"]["fall"] == 0
    missing = {file["path"] for file in stock["missing"]}
    assert missing == {file.path for file in FILES} - {
        "urfd/falls.npz", "urfd/adls.npz", "upfall/subject1_cam1.npz", "mocap/bandai_namco.npz", "mocap/cmu.npz",
    }  # fmt: skip
    assert "lafan1.npz (motion capture with falls" in page


def test_nothing_there_is_one_line_and_exit_code_2(tmp_path, capsys, monkeypatch):
    monkeypatch.delenv("SUREFOOT_DATA", raising=False)
    assert main(["data"]) == 2
    assert "SUREFOOT_DATA" in capsys.readouterr().err
    assert main(["data", "--data", str(tmp_path)]) == 2
    assert "urfd/falls.npz" in capsys.readouterr().err


@pytest.mark.parametrize("damage", ["cut off", "infinite", "label", "other labels", "flat"])
def test_damage_is_named_and_the_check_fails(data, capsys, damage):
    path = data / "urfd" / "falls.npz"
    with np.load(path) as archive:
        arrays = dict(archive)
    if damage == "infinite":
        arrays["fall-03/movenet"][4, 4, 0] = np.inf
    elif damage == "label":
        arrays["fall-03/label"][4] = 7
    elif damage == "flat":
        arrays["fall-03/movenet"] = arrays["fall-03/movenet"][:, :8]
    np.savez(path, **arrays)
    if damage == "cut off":
        path.write_bytes(path.read_bytes()[:5000])
    elif damage == "other labels":
        rows = [f"fall-03,{frame + 1},{label}" for frame, label in enumerate(arrays["fall-03/label"][::-1])]
        (data / "urfd" / "labels_falls.csv").write_text("sequence,frame,label\n" + "\n".join(rows) + "\n")
    assert main(["data", "--data", str(data)]) == 1
    page = capsys.readouterr().out
    assert "damaged:" in page
    assert "falls.npz" in page or "fall-03" in page


def test_own_recordings_are_counted_and_their_problems_named(data, tmp_path, capsys):
    own = tmp_path / "own"
    own.mkdir()
    np.savez(own / "a.npz", **{"walk/keypoints": falling(0)[0]})
    assert main(["data", "--data", str(data), "--own", str(own)]) == 1  # no labels.csv
    assert "labels.csv" in capsys.readouterr().out
    (own / "labels.csv").write_text("clip,onset_s,lying_s\na.npz:walk,,\n")
    assert main(["data", "--data", str(data), "--own", str(own)]) == 0


def test_a_clip_is_checked():
    good = np.concatenate([np.zeros((9, 12, 2)), np.ones((9, 12, 1))], axis=-1)

    def said(keypoints, fps=30.0, labels=None):
        return " ".join(check(Clip("clip", "group", keypoints, fps, labels, 320, 240, "made", "none")))

    assert said(good) == ""
    half = good.copy()
    half[3, 3, 0] = np.nan
    assert "one coordinate" in said(half)
    assert "confidences" in said(good * [1, 1, 90])
    assert "frames a second" in said(good, fps=1.0)
    assert "labels [3]" in said(good, labels=np.full(9, 3))
    assert "no keypoint" in said(good * np.nan)
    assert "no frame" in said(good[:0])


@pytest.mark.data
def test_the_research_data_is_as_it_should_be(data_dir):
    stock = take_stock(data_dir)
    assert stock.problems == []
    assert {file.path for file in stock.missing} <= {"oumvlp"}
    falls = next(source for source in stock.sources if source.name == "URFD falls, AlphaPose")
    assert falls.classes["transient"] == 24 * 30
