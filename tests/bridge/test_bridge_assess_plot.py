"""Pictures of assessed clips: every threshold is in them, whatever the clip."""

from __future__ import annotations

from itertools import pairwise
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from bridge.assess.plot import draw, spread, write_plots
from bridge.assess.run import Assessment
from bridge.cli import main
from bridge.config.load import load_config
from bridge.config.surefoot import SurefootConfig
from bridge.errors import SurefootError

REPO = Path(__file__).resolve().parents[2]
DRAWN = (
    *("distance_onset_sd", "distance_full_sd", "approach_far_sd", "approach_near_sd", "probability_onset"),
    *("probability_full", "credible_onset", "credible_full", "unconfirmed_most", "trusted_quality", "unknown_risk"),
    *("guard_on", "guard_off", "arrest_on", "arrest_off"),
)


def assessment(frames: int = 60, known: bool = True) -> Assessment:
    random = np.random.default_rng(0)
    empty = np.nan if not known else 1.0
    probabilities = random.dirichlet(np.ones(3), (frames, 16)) * empty
    distance = (3.0 + random.normal(0, 1, (frames, 16))) * empty
    states = np.array(["DISARMED"] * 10 + ["FOLLOW"] * 20 + ["GUARD"] * 10 + ["ARREST"] * (frames - 40))
    one = random.random(frames) * empty
    return Assessment(probabilities, distance, one, states, one, random.random((frames, 16)) * empty)


def words(figure: Any) -> list[str]:
    return [text.get_text() for axes in figure.axes for text in axes.texts]


def test_every_threshold_is_named_with_its_value() -> None:
    config = SurefootConfig()
    shown = words(draw("a walk", np.arange(60) / 30.0, assessment(), config))
    for key in DRAWN:
        section = config.intervention if hasattr(config.intervention, key) else config.supervisor
        assert f"{key} {getattr(section, key):g}" in shown


def test_a_threshold_that_is_out_of_reach_does_not_squeeze_the_panel() -> None:
    config = load_config(None, ["intervention.distance_onset_sd=-18.0", "intervention.distance_full_sd=-19.0"])
    figure = draw("a walk", np.arange(60) / 30.0, assessment(), config)
    assert figure.axes[1].get_ylim()[0] > -5.0
    assert not any("distance_onset_sd" in word for word in words(figure))


@pytest.mark.parametrize("result", [assessment(known=False), assessment(frames=41)])
def test_a_clip_of_which_nothing_is_known_and_a_short_one(tmp_path: Path, result: Assessment) -> None:
    times = np.arange(len(result.state)) / 30.0
    write_plots({"fall-01/alphapose": result}, {"fall-01/alphapose": times}, SurefootConfig(), tmp_path / "new")
    assert [path.name for path in (tmp_path / "new").iterdir()] == ["fall-01-alphapose.png"]


def test_a_folder_that_cannot_be_made_is_named(tmp_path: Path) -> None:
    (tmp_path / "file").write_text("")
    with pytest.raises(SurefootError, match="--plot .*file/pictures: cannot be written"):
        write_plots({"a": assessment()}, {"a": np.arange(60.0)}, SurefootConfig(), tmp_path / "file" / "pictures")


def test_the_command_draws_every_clip(tmp_path: Path) -> None:
    with np.load(REPO / "simulation" / "demo" / "walk-stumble-fall.npz") as archive:
        keypoints = archive["walk-stumble-fall/keypoints"][:45]
    clip = tmp_path / "clip.npz"
    np.savez(clip, **{"one/keypoints": keypoints, "one/fps": 30.0, "two/keypoints": keypoints, "two/fps": 30.0})
    assert main(["assess", str(clip), "--out", str(tmp_path / "o.npz"), "--plot", str(tmp_path / "p")]) == 0
    assert sorted(path.name for path in (tmp_path / "p").iterdir()) == ["one.png", "two.png"]
    with np.load(tmp_path / "o.npz") as archive:
        risk = archive["one/risk"]
    assert risk.shape == (45, 16)
    known = risk[np.isfinite(risk)]
    assert len(known)
    assert ((known >= 0) & (known <= 1)).all()


@settings(max_examples=60, deadline=None)
@given(st.lists(st.floats(0, 1), max_size=8))
def test_labels_keep_apart_and_in_order(places: list[float]) -> None:
    moved = spread(sorted(places), 0.1)
    assert len(moved) == len(places)
    assert all(later - earlier >= 0.1 - 1e-9 for earlier, later in pairwise(moved))


def test_labels_with_room_stay_where_they_are() -> None:
    assert spread([0.1, 0.5, 0.9], 0.1) == pytest.approx([0.1, 0.5, 0.9])
