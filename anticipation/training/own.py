"""A folder of one's own recordings, to train on beside the research data.

    FOLDER/*.npz       keypoints as `surefoot up --source FILE.npz:CLIP` reads them: NAME/keypoints, NAME/DETECTOR or
                       NAME, (N, 12, 3) x px, y px, confidence, NaN where not found; NAME/fps, else 30 Hz
    FOLDER/*.mcap      what `surefoot record` wrote: its keypoints, cleaned as they were when it ran
    FOLDER/labels.csv  clip,onset_s,lying_s and, if wanted, up_s,person

A clip is called FILE.npz:NAME or FILE.mcap. With `onset_s` (balance is lost) and `lying_s` (on the floor), seconds from
its first frame, it is a fall; with both empty, daily life. What is not in the list is motion without a label, which
only the forecaster learns from. `person` keeps all clips of somebody on one side of a split.
"""

from __future__ import annotations

import difflib
from collections.abc import Callable, Mapping
from functools import partial
from pathlib import Path
from typing import Final, NamedTuple, TypeVar

import numpy as np

from anticipation.centre import centre_velocity
from anticipation.motion import ROWS
from anticipation.training.clips import UNLABELLED, Clip, load_arrays
from anticipation.training.own_labels import Label, label_track, read_labels
from anticipation.training.samples import Track, clean
from bridge.config.perception import CleaningConfig
from bridge.errors import SourceError, SurefootError
from bridge.messages import KEYPOINTS, STEP_S, KeypointStatus
from bridge.messages import Keypoints as Message
from bridge.record.reader import Recording
from bridge.topics import KEYPOINTS as KEYPOINTS_TOPIC
from perception.features import relative, upper_body_centre

LABELS: Final = "labels.csv"
SOURCE: Final = "own"
FPS: Final = 30.0
LONGEST_GAP: Final = 30 * 60  # ticks without a message that are filled with nothing
_T = TypeVar("_T")
_BESIDE: Final = ("fps", "image_size", "label", "held")


class Own(NamedTuple):
    """What the folder holds."""

    tracks: tuple[Track, ...]
    problems: tuple[str, ...]  # one line for each thing that cannot be used


def read_own(folder: Path, cleaning: CleaningConfig) -> Own:
    """Read a folder; what cannot be read is named and left out.

    Raises:
        SourceError: there is no such folder.
    """
    if not folder.is_dir():
        raise SourceError(f"no recordings in '{folder}': not a folder (--own)")
    problems: list[str] = []
    labels: Mapping[str, Label] = _attempt(problems, lambda: read_labels(folder / LABELS), {})
    tracks: list[Track] = []
    for path in sorted(path for path in folder.iterdir() if path.suffix in (".npz", ".mcap")):
        read = (
            partial(_read_npz, path, cleaning, problems)
            if path.suffix == ".npz"
            else partial(_read_mcap, path, problems)
        )
        tracks += _attempt(problems, read, [])
    names = [track.name for track in tracks]
    for name in labels:
        unreadable = any(problem.startswith(str(folder / name.partition(":")[0])) for problem in problems)
        if name not in names and not unreadable:
            nearest = difflib.get_close_matches(name, names, n=1, cutoff=0.0)
            hint = f"; the nearest is '{nearest[0]}'" if nearest else ""
            problems.append(f"{folder / LABELS}: there is no clip '{name}'{hint}")
    labelled = [_attempt(problems, partial(_labelled, track, labels.get(track.name)), None) for track in tracks]
    if not tracks and not problems:
        problems.append(f"{folder}: no recording (.npz or .mcap)")
    return Own(tuple(track for track in labelled if track is not None), tuple(problems))


def _attempt(problems: list[str], read: Callable[[], _T], instead: _T) -> _T:
    """Return what `read` gives, or note why it cannot."""
    try:
        return read()
    except SurefootError as error:
        problems.append(str(error))
        return instead


def _labelled(track: Track, label: Label | None) -> Track:
    """Give a track the labels that the user gave its clip.

    Raises:
        SourceError: a time lies beyond the clip's end.
    """
    if label is None:
        return track
    duration_s = len(track.frames) * STEP_S
    times = [time for time in (label.onset_s, label.lying_s, label.up_s) if time is not None]
    if times and times[-1] > duration_s:
        raise SourceError(f"{LABELS}: '{track.name}' lasts {duration_s:.1f} s, a label is at {times[-1]:.1f} s")
    group = f"{SOURCE}/{label.person}" if label.person else track.group
    labels = label_track(len(track.frames), label)
    return Track(track.name, group, track.source, track.frames, track.whole, track.body_px, labels)


def _read_npz(path: Path, cleaning: CleaningConfig, problems: list[str]) -> list[Track]:
    """Read the clips of a keypoint file; one that has another shape is named."""
    arrays = load_arrays(path)
    tracks = []
    for key in sorted(arrays):
        base, _, kind = key.rpartition("/")
        whole = f"{base}/keypoints"  # where it is there, the other arrays of the clip belong to it
        if base and (kind in _BESIDE or (whole in arrays and key != whole)):
            continue
        name = f"{path.name}:{base if kind == 'keypoints' else key}"
        fps = float(arrays[f"{base or key}/fps"].flat[0]) if f"{base or key}/fps" in arrays else FPS
        keypoints = arrays[key]
        if keypoints.shape[1:] != (KEYPOINTS, 3) or len(keypoints) == 0 or not 1.0 <= fps <= 240.0:
            problems.append(f"{path}: '{key}' has shape {keypoints.shape} at {fps:g} Hz, expected (N, {KEYPOINTS}, 3)")
            continue
        clip = Clip(name, f"{SOURCE}/{path.name}", keypoints, fps, None, 0, 0, SOURCE, SOURCE)
        tracks.append(clean(clip, cleaning))
    return tracks


def _read_mcap(path: Path, problems: list[str]) -> list[Track]:
    """Read the keypoints of a recording, which were cleaned when they were recorded."""
    recording = Recording(path)
    messages = [message for _, message, _ in recording.messages([KEYPOINTS_TOPIC]) if isinstance(message, Message)]
    if recording.damage:
        problems.append(f"{path}: not whole, read as far as it goes ({recording.damage})")
    if not messages:
        raise SourceError(f"{path}: no keypoints in it")
    return [track_of(messages, path.name)]


def track_of(messages: list[Message], name: str) -> Track:
    """Lay messages on the 30 Hz grid; ticks without a valid one are not whole.

    Raises:
        SourceError: there is a gap of a minute or longer.
    """
    messages = sorted(messages, key=lambda message: message.stamp_ns)
    ticks = np.array([round((message.stamp_ns - messages[0].stamp_ns) * 1e-9 / STEP_S) for message in messages])
    if np.diff(ticks, prepend=0).max() >= LONGEST_GAP:
        raise SourceError(f"{name}: a gap of {np.diff(ticks).max() * STEP_S:.0f} s, limit {LONGEST_GAP * STEP_S:.0f} s")
    count = int(ticks[-1]) + 1
    positions, body = np.full((count, KEYPOINTS, 2), np.nan), np.full(count, np.nan)
    whole = np.zeros(count, dtype=bool)
    for tick, message in zip(ticks, messages, strict=True):
        there = message.valid and message.body_length_px > 0 and (message.status != KeypointStatus.LOST).all()
        if there and np.isfinite(message.position_px).all():
            positions[tick], body[tick], whole[tick] = message.position_px, message.body_length_px, True
    centres = upper_body_centre(positions)
    before = np.concatenate([np.full((1, 2), np.nan), centres[:-1]])
    frames = np.full((count, ROWS, 2), np.nan)
    frames[whole, :KEYPOINTS] = relative(positions[whole], body[whole])
    frames[:, KEYPOINTS] = centre_velocity(centres, before, body)
    labels = np.full(count, UNLABELLED, dtype=np.int64)
    return Track(name, f"{SOURCE}/{name}", SOURCE, frames, whole, body, labels)
