"""`surefoot assess`: the public contract of its arrays, and bad input that leaves nothing behind."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from bridge.assess.clips import read_clips
from bridge.cli import main
from bridge.config.perception import SourceConfig
from bridge.errors import SourceError
from bridge.messages import GaitState

REPO = Path(__file__).resolve().parents[2]
STATES = {state.value for state in GaitState}


@pytest.fixture(scope="module")
def recording() -> np.ndarray:
    """Keypoints of the shipped demo recording, 30 fps."""
    with np.load(REPO / "simulation" / "demo" / "walk-stumble-fall.npz") as archive:
        return archive["walk-stumble-fall/keypoints"]


def write(path: Path, **clips: tuple[np.ndarray, float]) -> Path:
    arrays: dict[str, object] = {}
    for name, (keypoints, fps) in clips.items():
        arrays |= {f"{name}/keypoints": keypoints, f"{name}/fps": fps}
    np.savez(path, **arrays)  # type: ignore[arg-type]
    return path


def assess(out: Path, *arguments: str | Path) -> dict[str, np.ndarray]:
    assert main(["assess", *map(str, arguments), "--out", str(out)]) == 0
    with np.load(out) as archive:
        return dict(archive)


def test_every_clip_gets_every_array_on_its_own_frames(tmp_path: Path, recording: np.ndarray) -> None:
    slow = recording[-90::2]
    one = write(tmp_path / "a.npz", walk=(recording[:60], 30.0), slow=(slow, 15.0))
    two = write(tmp_path / "b.npz", fast=(np.repeat(recording[:40], 2, axis=0), 60.0))
    results = assess(tmp_path / "out.npz", one, two)
    assert {name.split("/")[0] for name in results} == {"walk", "slow", "fast"}
    for clip, frames, first in (("walk", 60, 14), ("slow", 45, 7), ("fast", 80, 28)):
        assert results[f"{clip}/probabilities"].shape == (frames, 16, 3)
        assert results[f"{clip}/distance"].shape == (frames, 16)
        assert results[f"{clip}/stiffening"].shape == (frames,)
        assert results[f"{clip}/state"].shape == (frames,)
        assert results[f"{clip}/quality"].shape == (frames,)
        # nothing is known before the first full window of 15 ticks of 1/30 s
        for name in ("probabilities", "distance", "stiffening", "quality"):
            assert np.isnan(results[f"{clip}/{name}"][:first]).all(), name
            assert np.isfinite(results[f"{clip}/{name}"][first + 1 :]).all(), name
        assert set(results[f"{clip}/state"].tolist()) <= STATES
        assert results[f"{clip}/state"][0] == "DISARMED"
        known = results[f"{clip}/probabilities"][first + 1 :]
        np.testing.assert_allclose(known.sum(axis=2), 1.0, atol=1e-6)
        assert (
            (results[f"{clip}/stiffening"][first + 1 :] >= 0) & (results[f"{clip}/stiffening"][first + 1 :] <= 1)
        ).all()


def test_the_same_clip_gives_the_same_numbers(tmp_path: Path, recording: np.ndarray) -> None:
    clip = write(tmp_path / "a.npz", clip=(recording[-100:], 30.0))
    one, two = assess(tmp_path / "1.npz", clip), assess(tmp_path / "2.npz", clip)
    for name in one:
        np.testing.assert_array_equal(one[name], two[name])


def test_the_future_changes_nothing(tmp_path: Path, recording: np.ndarray) -> None:
    other = recording[:80].copy()
    other[60:, :, :2] += 25.0
    both = write(tmp_path / "a.npz", same=(recording[:80], 30.0), other=(other, 30.0))
    results = assess(tmp_path / "out.npz", both)
    for name in ("probabilities", "distance", "stiffening", "quality"):
        np.testing.assert_array_equal(results[f"same/{name}"][:60], results[f"other/{name}"][:60])
    assert not np.array_equal(results["same/probabilities"][60:], results["other/probabilities"][60:])


def test_somebody_who_leaves_the_picture_is_never_stable(tmp_path: Path, recording: np.ndarray) -> None:
    keypoints = recording[:120].copy()
    keypoints[60:] = np.nan
    results = assess(tmp_path / "out.npz", write(tmp_path / "a.npz", clip=(keypoints, 30.0)))
    assert np.isnan(results["clip/probabilities"][85:]).all()
    assert (results["clip/quality"][85:] == 0).all()
    assert (results["clip/state"][85:] == "SAFE_STOP").all()


def test_thresholds_from_the_config_matter(tmp_path: Path, recording: np.ndarray) -> None:
    clip = write(tmp_path / "a.npz", clip=(recording[-150:], 30.0))
    eager = tmp_path / "eager.toml"
    eager.write_text("[intervention]\ndistance_onset_sd = 19.0\ndistance_full_sd = 18.0\n")
    shy = assess(tmp_path / "1.npz", clip)
    bold = assess(tmp_path / "2.npz", clip, "--config", eager)
    np.testing.assert_array_equal(shy["clip/distance"], bold["clip/distance"])
    assert np.nanmean(bold["clip/stiffening"]) > np.nanmean(shy["clip/stiffening"])


GOOD = np.random.default_rng(0).uniform(50, 200, (40, 12, 3)).clip(0, 200)


@pytest.mark.parametrize(
    ("arrays", "says"),
    [
        (
            {"a/keypoints": GOOD[:, :8], "a/fps": 30.0},
            "'a/keypoints' is float64 (40, 8, 3), expected numbers (frames, 12",
        ),
        ({"a/keypoints": GOOD[:0], "a/fps": 30.0}, "'a/keypoints' holds no frame"),
        (
            {"a/keypoints": np.full((9, 12, 3), np.nan), "a/fps": 30.0},
            "no keypoint in any of its 9 frames, all are NaN",
        ),
        ({"a/keypoints": GOOD, "a/fps": 0.5}, "'a/fps' is 0.5, expected one number within 1..240"),
        ({"a/keypoints": GOOD, "a/fps": np.nan}, "'a/fps' is nan, expected one number within 1..240"),
        ({"a/keypoints": GOOD.astype(str), "a/fps": 30.0}, "expected numbers"),
        ({"a/fps": 30.0}, "no clip in it, expected arrays NAME/keypoints and NAME/fps"),
    ],
)
def test_bad_clips_are_one_line_and_leave_no_output(
    tmp_path: Path, capsys: pytest.CaptureFixture[str], arrays: dict[str, object], says: str
) -> None:
    path, out = tmp_path / "bad.npz", tmp_path / "out.npz"
    np.savez(path, **arrays)  # type: ignore[arg-type]
    assert main(["assess", str(path), "--out", str(out)]) == 2
    captured = capsys.readouterr()
    assert says in captured.err
    assert "bad.npz" in captured.err
    assert captured.err.count("\n") == 1
    assert list(tmp_path.iterdir()) == [path]


def test_unreadable_files_and_places_are_named(
    tmp_path: Path, capsys: pytest.CaptureFixture[str], recording: np.ndarray
) -> None:
    good = write(tmp_path / "good.npz", a=(recording[:40], 30.0))
    cut = tmp_path / "cut.npz"
    cut.write_bytes(good.read_bytes()[:2000])
    out = tmp_path / "out.npz"
    wrong_config = tmp_path / "c.toml"
    wrong_config.write_text("[intervention]\ndistance_onset = 1\n")
    for arguments, says in (
        ([cut, "--out", out], "cut.npz: not a readable npz file"),
        ([tmp_path / "absent.npz", "--out", out], "absent.npz: no such keypoint file"),
        ([good, good, "--out", out], "clip 'a' is also in"),
        ([good, "--out", tmp_path / "nowhere" / "out.npz"], "no such folder"),
        ([good, "--out", tmp_path / "out.csv"], "expected a file name ending in .npz"),
        ([good, "--out", out, "--config", wrong_config], "did you mean 'intervention.distance_onset_sd'?"),
    ):
        assert main(["assess", *map(str, arguments)]) == 2
        captured = capsys.readouterr()
        assert says in captured.err
        assert captured.err.count("\n") == 1
        assert not out.exists()


def test_pickled_arrays_are_not_loaded(tmp_path: Path) -> None:
    path = tmp_path / "a.npz"
    np.savez(path, **{"a/keypoints": np.array([{"x": 1}], dtype=object), "a/fps": 30.0})  # type: ignore[arg-type]
    with pytest.raises(SourceError, match="array 'a/keypoints' is damaged"):
        read_clips([path], SourceConfig())
