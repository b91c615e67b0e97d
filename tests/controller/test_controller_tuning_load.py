"""Cases from what users have: keypoint files, recordings, campaigns. What is replayed is what ran."""

from __future__ import annotations

from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pytest

from bridge.assess.clips import read_clips
from bridge.assess.run import assess_clip
from bridge.config.surefoot import SurefootConfig
from bridge.errors import SourceError
from bridge.lockstep import LockStep
from bridge.messages import GaitState
from bridge.record.reader import Recording
from bridge.topics import FALL_HORIZON, SUPPORT_COMMAND
from controller.tuning.cases import Case, Fall
from controller.tuning.load import case_jobs, load_cases
from controller.tuning.reference import replay_live
from controller.tuning.replay import STATES, replay
from simulation.campaign.recordings import TrialRecording, falls_csv

REPO = Path(__file__).resolve().parents[2]
DEMO = REPO / "simulation" / "demo" / "walk-stumble-fall.npz"
CONFIG = SurefootConfig()
START_NS = 1_000_000_000_000
FIRST, LAST = 270, 400  # of the demo's frames: the fall


@pytest.fixture(scope="module")
def clips(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The end of the shipped demo recording, as two clips; the second has another detector's array beside it."""
    with np.load(DEMO) as demo:
        keypoints, label = demo["walk-stumble-fall/keypoints"], demo["walk-stumble-fall/label"]
    path = tmp_path_factory.mktemp("clips") / "clips.npz"
    part = slice(FIRST, LAST)
    np.savez(
        path,
        **{
            "fall/keypoints": keypoints[part], "fall/fps": 30.0, "fall/label": label[part],
            "walk/alphapose": keypoints[:60], "walk/movenet": keypoints[:60], "walk/fps": 30.0,
        },
    )  # fmt: skip
    return path


@pytest.fixture(scope="module")
def recorded(clips: Path) -> Path:
    """The same fall through the whole stack, recorded as a campaign records its trials."""
    folder = clips.parent / "campaign"
    system = LockStep(
        CONFIG,
        {
            "perception": ("perception.node", {"source": f"{clips}:fall"}),
            "anticipation": ("anticipation.node", {}),
            "drive": ("simulation.drive.node", {"script": "zero"}),
            "controller": ("controller.node", {"controller": "log"}),
        },
        START_NS,
    )
    file = folder / "recordings" / "fall-0000.none.mcap"
    with TrialRecording(file, system, CONFIG.bridge.namespace) as recording:
        for turn in range((LAST - FIRST) * 100 // 30):
            system.advance_to(START_NS + turn * 10_000_000)
        system.close()
        recording.finish(f"recording,onset_s,impact_s,over_s\n{file.name},1.0,2.5,\n")
    (folder / "campaign.json").write_text("{}")
    return folder


def states(case: Case) -> np.ndarray:
    return np.array([STATES[i].value for i in replay(case, CONFIG.intervention, CONFIG.supervisor).state])


def test_a_clip_is_replayed_as_assess_runs_it(clips: Path) -> None:
    (case,) = load_cases([f"{clips}:fall"], CONFIG)
    (clip,) = (clip for clip in read_clips([clips], CONFIG.perception.source) if clip.name == "fall")
    assessed = assess_clip(clip, CONFIG)
    # assess reads the command of the turn that follows a frame
    turns = [-(-offset_ns // case.period_ns) for offset_ns in clip.stamps_ns]
    known = np.isfinite(assessed.stiffening)
    assert {GaitState.FOLLOW, GaitState.ARREST} <= set(assessed.state[known].tolist())
    ours = replay(case, CONFIG.intervention, CONFIG.supervisor)
    np.testing.assert_array_equal(states(case)[turns][known], assessed.state[known])
    np.testing.assert_allclose(ours.stiffening[turns][known], assessed.stiffening[known], atol=1e-9)
    assert case.labelled
    assert len(case.falls) == 1


def test_a_recording_is_replayed_as_it_ran(recorded: Path) -> None:
    (case,) = load_cases([str(recorded)], CONFIG)
    assert case.name == "campaign:fall-0000.none"
    assert case.falls == (Fall(1.0, 2.5),)
    run = replay(case, CONFIG.intervention, CONFIG.supervisor)
    assert run.transitions == replay_live(case, CONFIG.intervention, CONFIG.supervisor).transitions
    file = recorded / "recordings" / "fall-0000.none.mcap"
    commands = [message for _, message, _ in Recording(file).messages([SUPPORT_COMMAND])]
    turns = [(command.stamp_ns - case.start_ns) // case.period_ns for command in commands]
    ran = [command.state.value for command in commands]  # type: ignore[attr-defined]
    assert {"FOLLOW", "ARREST"} <= set(ran)
    agree = np.mean(states(case)[turns] == np.array(ran))
    assert agree > 0.99  # a turn at the very start may be another: the recording begins with its first message
    np.testing.assert_allclose(run.stiffening[turns], [c.stiffening for c in commands], atol=0.1)  # type: ignore[attr-defined]


def test_horizons_are_computed_where_a_recording_has_none(recorded: Path, tmp_path: Path) -> None:
    from bridge.record.writer import BagWriter
    from bridge.topics import KEYPOINTS, ODOMETRY, WRENCH

    seen = recorded / "recordings" / "fall-0000.none.mcap"
    blind = tmp_path / "blind.mcap"
    writer = BagWriter(blind, "surefoot", (KEYPOINTS, WRENCH, ODOMETRY))
    for one in Recording(seen).samples((KEYPOINTS, WRENCH, ODOMETRY)):
        writer.write(one.topic, one.sample)
    writer.finish()
    had, made = load_cases([str(seen), str(blind)], CONFIG)
    again = load_cases([str(seen)], CONFIG, recompute=True)[0]
    good = [not fault for fault in had.horizons.stream.faults]
    np.testing.assert_allclose(made.horizons.distance[good], had.horizons.distance[good], atol=1e-6)
    np.testing.assert_allclose(again.horizons.distance[good], had.horizons.distance[good], atol=1e-6)
    assert not made.labelled


def test_a_campaigns_list_says_when_it_was_too_late() -> None:
    time_s = np.arange(0.0, 4.0, 0.004)
    height = 0.9 - 0.5 * np.clip(time_s - 2.0, 0.0, 1.0)
    trace = SimpleNamespace(time_s=time_s, pelvis_m=height, touched=np.zeros_like(time_s))
    assert falls_csv("a.mcap", trace, 2.0, 0.9).splitlines()[1] == "a.mcap,2.000,2.200,"  # type: ignore[arg-type]
    trace.touched = (time_s > 2.1).astype(float)
    assert falls_csv("a.mcap", trace, 2.0, 0.9).splitlines()[1] == "a.mcap,2.000,2.104,"  # type: ignore[arg-type]
    assert falls_csv("a.mcap", trace, float("nan"), 0.9).splitlines()[1] == "a.mcap,,,"  # type: ignore[arg-type]


def test_a_trial_that_fails_leaves_no_recording(tmp_path: Path) -> None:
    stack = LockStep(CONFIG, {}, START_NS)
    with pytest.raises(RuntimeError), TrialRecording(tmp_path / "a" / "b.mcap", stack, "surefoot"):
        raise RuntimeError
    assert list((tmp_path / "a").iterdir()) == []


def test_names(clips: Path, recorded: Path) -> None:
    def names(*words: str) -> list[str]:
        return [job.name for job in case_jobs(words)]

    assert names(str(clips)) == ["clips.npz:fall", "clips.npz:walk/alphapose"]  # one detector's array of each clip
    assert names(f"{clips}:walk/movenet") == ["clips.npz:walk/movenet"]
    assert names(f"{clips}:*/movenet", f"{clips}:f*") == ["clips.npz:walk/movenet", "clips.npz:fall"]
    assert names(str(recorded / "recordings")) == ["fall-0000.none.mcap"]
    (job,) = case_jobs([f"{clips}:walk/movenet"])
    assert job.group == "clips.npz:walk"  # type: ignore[union-attr]


def test_what_cannot_be_named(clips: Path, recorded: Path, tmp_path: Path) -> None:
    (tmp_path / "campaign.json").write_text("{}")
    (tmp_path / "empty").mkdir()
    for words, said in (
        ([], "no recordings"),
        ([str(tmp_path / "no.mcap")], r"no\.mcap: no such recording"),
        ([str(tmp_path / "no.npz")], r"no\.npz: no such keypoint file"),
        ([f"{clips}:run"], "no clip 'run' in it; it holds fall, walk"),
        ([str(clips), f"{clips}:fall"], "clips.npz:fall is named twice"),
        ([str(tmp_path)], "kept no recordings of its trials; run it with --record none"),
        ([str(tmp_path / "empty")], "neither a campaign nor a folder with"),
    ):
        with pytest.raises(SourceError, match=said):
            case_jobs(words)
    text = tmp_path / "text.mcap"
    text.write_text("no recording")
    with pytest.raises(SourceError, match="not an MCAP file"):
        load_cases([str(text)], CONFIG)


def test_labels_that_do_not_fit(clips: Path, tmp_path: Path) -> None:
    with np.load(clips) as arrays:
        kept = {key: arrays[key] for key in arrays.files if key.startswith("fall/")}
    for label in (np.zeros(3), np.full(LAST - FIRST, 7), np.full(LAST - FIRST, "a")):
        np.savez(tmp_path / "bad.npz", **{**kept, "fall/label": label})
        with pytest.raises(SourceError, match=r"'fall/label' is .*, expected 130 of -1 upright, 0 falling, 1 lying"):
            load_cases([str(tmp_path / "bad.npz")], CONFIG)


def test_horizons_are_kept_and_found_again(clips: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    from controller.tuning import clip_cases

    words, cache = [f"{clips}:walk"], tmp_path / "kept"
    (first,) = load_cases(words, CONFIG, cache=cache)
    made, truly = [], clip_cases.foresee
    monkeypatch.setattr(clip_cases, "foresee", lambda *given: made.append(given) or truly(*given))
    (again,) = load_cases(words, CONFIG, cache=cache)
    assert made == []
    np.testing.assert_array_equal(first.horizons.distance, again.horizons.distance)
    assert first.horizons.stream.faults == again.horizons.stream.faults
    other = CONFIG.model_copy(update={"anticipation": CONFIG.anticipation.model_copy(update={"min_quality": 0.2})})
    load_cases(words, other, cache=cache)
    assert len(made) == 1  # another anticipation has other horizons
    for kept in cache.glob("*.npz"):
        kept.write_bytes(b"damaged")
    load_cases(words, CONFIG, cache=cache)
    assert len(made) == 2


def test_a_topic_that_was_not_recorded_is_a_healthy_walker(recorded: Path, tmp_path: Path) -> None:
    from bridge.record.writer import BagWriter

    seen = tmp_path / "seen.mcap"
    writer = BagWriter(seen, "surefoot", (FALL_HORIZON,))
    for one in Recording(recorded / "recordings" / "fall-0000.none.mcap").samples((FALL_HORIZON,)):
        writer.write(one.topic, one.sample)
    writer.finish()
    (tmp_path / "seen.falls.csv").write_text("recording,onset_s,impact_s,over_s\nother.mcap,1,2,\n")
    with pytest.raises(SourceError, match=r"names 'other\.mcap', expected 'seen\.mcap'"):
        load_cases([str(seen)], CONFIG)
    (tmp_path / "seen.falls.csv").unlink()
    (case,) = load_cases([str(seen)], CONFIG)
    assert (case.pull, case.descent) == (None, None)
    assert "ARREST" in states(case)
