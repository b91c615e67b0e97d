"""Simulated clips: what their facts make of each frame, and that they are learnt from beside the recordings."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from anticipation_people import falling

from anticipation.checkpoint import SHIPPED, load
from anticipation.shipped import weights
from anticipation.training import simulated
from anticipation.training.clips import FALL, STABLE, TRANSIENT, UNLABELLED, Arrays
from anticipation.training.corpus import SIMULATED_CALM, SIMULATED_EVENT, SIMULATED_MOTION, Corpus, shares
from anticipation.training.samples import clean
from bridge.config.perception import CleaningConfig
from bridge.errors import SourceError

FPS = 30.0
FRAMES = 240
SHOWS_S = 4.0


def facts(**changes: object) -> Arrays:
    """Return the facts of somebody who walks, is disturbed at 3.9 s and held by the harness from 4.6 s on."""
    time_s = np.arange(FRAMES) / FPS
    made = {
        "keypoints": np.ones((FRAMES, 12, 3)), "fps": np.array(FPS), "image_size": np.array([320.0, 320.0]),
        "fall": np.array(1.0), "drop_m": 0.02 + 0.2 * np.clip((time_s - 4.5) / 0.4, 0.0, 1.0),
        "lowered_m": np.array(0.0), "load_weights": 1.0 * (time_s > 4.6), "disturbed_s": np.array(3.9),
        "visible_s": np.array(SHOWS_S), "touched_s": np.array(np.inf), "impact_s": np.array(1.3),
    }  # fmt: skip
    return Arrays(Path("made up"), {**made, **{name: np.asarray(value) for name, value in changes.items()}})  # type: ignore[arg-type]


def hanging_from(moment_s: float) -> np.ndarray:
    return 1.2 * (np.arange(FRAMES) / FPS >= moment_s)


def first(labels: np.ndarray, state: int) -> float:
    return float(np.argmax(labels == state) / FPS)


def test_a_fall_goes_through_the_three_states_in_order() -> None:
    labels = simulated.labels(facts())
    assert first(labels, TRANSIENT) == pytest.approx(SHOWS_S, abs=1 / FPS)
    assert first(labels, FALL) == pytest.approx(4.5, abs=2 / FPS)
    assert (np.diff(labels) >= 0).all()
    assert labels[-1] == FALL


def test_who_hangs_in_a_stiff_harness_has_fallen_without_coming_down() -> None:
    labels = simulated.labels(facts(drop_m=np.full(FRAMES, 0.02)))
    assert first(labels, FALL) == pytest.approx(4.6, abs=2 / FPS)


def test_nothing_is_known_before_it_shows() -> None:
    labels = simulated.labels(facts(visible_s=np.inf))
    assert (labels[: round(4.55 * FPS)] == STABLE).all()
    assert (labels[round(4.7 * FPS) :] == UNLABELLED).all()


def test_who_was_put_back_on_their_feet_carries_no_label() -> None:
    time_s = np.arange(FRAMES) / FPS
    held = (time_s > 4.6) & (time_s < 6.0)
    labels = simulated.labels(facts(load_weights=1.0 * held, drop_m=np.where(held, 0.1, 0.02)))
    assert (labels[time_s > 6.1] == UNLABELLED).all()
    assert (labels[held] == FALL).all()


def test_who_is_kept_up_is_transient_for_a_while_and_then_nothing() -> None:
    labels = simulated.labels(facts(load_weights=np.zeros(FRAMES), drop_m=np.full(FRAMES, 0.02)))
    assert set(labels[round(4.1 * FPS) : round(5.3 * FPS)]) == {TRANSIENT}
    assert labels[-1] == UNLABELLED
    assert FALL not in labels


def test_a_seat_that_was_meant_is_no_descent() -> None:
    time_s = np.arange(FRAMES) / FPS
    sitting = 0.2 * np.clip((time_s - 3.0) / 1.0, 0.0, 1.0)
    drop = sitting + 0.2 * np.clip((time_s - 4.5) / 0.4, 0.0, 1.0)
    labels = simulated.labels(facts(drop_m=drop, lowered_m=0.2))
    assert first(labels, FALL) == pytest.approx(4.5, abs=2 / FPS)


def test_a_survived_stumble_is_stable_and_an_accident_is_not_sold_as_that() -> None:
    stumble = simulated.labels(facts(fall=0.0, load_weights=np.zeros(FRAMES), drop_m=np.full(FRAMES, 0.03)))
    assert (stumble == STABLE).all()
    for changes in ({"touched_s": 6.0, "load_weights": np.zeros(FRAMES)}, {"load_weights": hanging_from(6.0)}):
        accident = simulated.labels(facts(fall=0.0, **changes))
        assert set(accident[: round(4.4 * FPS)]) == {STABLE}
        assert set(accident[round(4.6 * FPS) :]) == {UNLABELLED}


def test_a_folder_of_clips_is_read_and_a_missing_one_named(tmp_path: Path) -> None:
    with pytest.raises(SourceError, match="surefoot clips"):
        simulated.read(tmp_path)
    with pytest.raises(SourceError, match="not a folder"):
        simulated.read(tmp_path / "nowhere")
    np.savez(tmp_path / "fall-0003.npz", allow_pickle=False, **facts())
    (clip,) = simulated.read(tmp_path)
    assert clip.name == "simulated/fall-0003"
    assert (clip.width, clip.height, clip.fps) == (320, 320, FPS)
    assert clip.labels is not None
    assert set(clip.labels) == {STABLE, TRANSIENT, FALL}


def test_falls_to_come_and_quiet_moments_are_learnt_each_with_its_share(tmp_path: Path) -> None:
    keypoints, states = falling(1)
    down = np.clip(np.arange(len(states)) - int(np.argmax(states == 0)), 0, 30) / 60
    shows_s = float(np.argmax(states == 0) / FPS)
    zeros = np.zeros(len(states))
    np.savez(tmp_path / "fall-0000.npz", allow_pickle=False, **facts(
        keypoints=keypoints, drop_m=down, load_weights=zeros, disturbed_s=shows_s - 0.1, visible_s=shows_s,
    ))  # fmt: skip
    calm = np.concatenate([keypoints[:20]] * 4)
    np.savez(tmp_path / "non_fall-0000.npz", allow_pickle=False, **facts(
        keypoints=calm, drop_m=zeros[:80], load_weights=zeros[:80], fall=0.0,
    ))  # fmt: skip
    tracks = tuple(clean(clip, CleaningConfig()) for clip in simulated.read(tmp_path))
    learnt = shares(Corpus((), (), (), (), (), simulated=tracks), ())
    ((_, motion),) = learnt.motion
    (eventful, event), (quiet, rest) = learnt.gait
    assert (motion, event, rest) == (SIMULATED_MOTION, SIMULATED_EVENT, SIMULATED_CALM)
    assert len(eventful) > 10
    assert len(quiet) > 10
    assert np.isin(eventful.labels, [TRANSIENT, FALL]).any(axis=1).all()
    assert np.isin(quiet.labels, [STABLE, UNLABELLED]).all()
    assert set(eventful.track) == {0}


def test_shipped_weights_have_names_and_say_what_they_learnt_from(tmp_path: Path) -> None:
    assert weights("") == weights("default") == SHIPPED
    assert weights(str(tmp_path / "mine.safetensors")) == tmp_path / "mine.safetensors"
    assert simulated.SOURCE in load(weights("simulated")).provenance.data
    assert simulated.SOURCE not in load(weights("")).provenance.data
