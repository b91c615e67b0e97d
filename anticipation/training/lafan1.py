"""LaFAN1 (Harvey et al. 2020) through virtual cameras: acted falls in 3-D, and what looks like one and is none.

Its licence (CC BY-NC-ND 4.0) allows no derivatives, so no network learns from it here: it is there to be tested on.
"""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any, Final, NamedTuple

import numpy as np

from anticipation.training.cameras import draw_camera
from anticipation.training.clips import FALL, STABLE, TRANSIENT, UNLABELLED, Clip, Labels, load_arrays, required
from anticipation.training.detector import observe
from anticipation.training.lafan1_review import VERDICTS, Seen, Verdict
from bridge.errors import SourceError
from bridge.messages import Floats

LICENCE: Final = "CC BY-NC-ND 4.0"
FPS: Final = 30.0
BEFORE: Final = 60  # frames shown before the onset
AFTER: Final = 60  # and after the contact
DOWN_M: Final = 0.45  # the trunk's middle is lower: on the ground. It is 1.1 m standing, 0.6 m squatting
FALLING: Final = 30  # frames before lying that URFD calls falling


class Contact(NamedTuple):
    """A ground contact that the heuristic found: frames in its file."""

    file: str
    onset: int
    ground: int
    recover: int


class Descent(NamedTuple):
    """How somebody came down."""

    speed: float  # the pelvis's fastest descent, mean of three frames [m/s]
    tilt: float  # of the trunk against the vertical, a third of a second after the contact [rad]
    shoulders: float  # lowest height of their middle within a second of the contact [m]
    pelvis: float  # the same of the hips' [m]

    @property
    def like_a_fall(self) -> bool:
        """Whether it meets the criteria of `lafan1_review`."""
        flat = self.speed >= 1.0 and self.tilt >= np.radians(75.0)
        lying = self.speed >= 1.2 and self.shoulders < 0.35
        return flat or lying or (self.speed >= 1.6 and self.pelvis < 0.3)


def read_contacts(folder: Path) -> list[tuple[Contact, Verdict]]:
    """Read the contacts that were reviewed, each with its verdict; one that is not in the review is left out.

    Raises:
        SourceError: the file is missing or not what it should be.
    """
    path = required(folder, "mocap/lafan1_ground_events.json")
    reviewed = {(verdict.file, verdict.ground): verdict for verdict in VERDICTS}
    try:
        found: dict[str, list[dict[str, Any]]] = json.loads(path.read_text())
        contacts = [
            Contact(file, int(event["onset"]), int(event["ground"]), int(event["recover"]))
            for file, events in sorted(found.items())
            for event in events
        ]
    except (OSError, ValueError, KeyError, TypeError, AttributeError) as error:
        raise SourceError(f"research data '{path}' cannot be read: {error!r}") from error
    verdicts = [(contact, reviewed.get((contact.file, contact.ground))) for contact in contacts]
    return [(contact, verdict) for contact, verdict in verdicts if verdict is not None]


def read_falls(folder: Path, cameras: int, seed: int) -> list[Clip]:
    """Read the falls, each through some cameras; labelled as URFD's, from the motion itself.

    Raises:
        SourceError: a file is missing or damaged.
    """
    return _read_contacts(folder, Seen.FALL, cameras, seed)


def read_others(folder: Path, cameras: int, seed: int) -> list[Clip]:
    """Read the contacts that are no fall: sitting and lying down, kneeling, crawling, squat jumps.

    Frames on the ground carry no label: a window of somebody lying is the same whichever way they came down.

    Raises:
        SourceError: a file is missing or damaged.
    """
    return _read_contacts(folder, Seen.NO_FALL, cameras, seed)


def measure(points: Floats, contact: Contact) -> Descent:
    """Measure how somebody came down in a file's points (T, 12, 3) [m]."""
    hips, trunk = points[:, 6:8].mean(axis=1), points[:, 0:2].mean(axis=1) - points[:, 6:8].mean(axis=1)
    rate = np.convolve(np.gradient(hips[:, 2]) * FPS, np.ones(3) / 3, mode="same")
    tilt = np.arccos(np.clip(trunk[:, 2] / np.linalg.norm(trunk, axis=1), -1.0, 1.0))
    near = slice(contact.onset, contact.ground + 30)
    return Descent(
        speed=float(-rate[contact.onset : contact.ground + 10].min()),
        tilt=float(tilt[min(contact.ground + 10, len(tilt) - 1)]),
        shoulders=float(points[near, 0:2, 2].mean(axis=1).min()),
        pelvis=float(hips[near, 2].min()),
    )


def on_ground(points: Floats) -> np.ndarray[tuple[int], np.dtype[np.bool_]]:
    """Tell for each frame of points (T, 12, 3) [m] whether the trunk is on the ground, (T,)."""
    return np.asarray(points[:, (0, 1, 6, 7), 2].mean(axis=1) < DOWN_M)


def label(points: Floats, onset: int, fell: bool) -> Labels:
    """Label points (T, 12, 3) [m] in which somebody begins to go down at frame `onset`, (T,).

    A fall is stable until the onset, falling for the last second before the trunk is on the ground (not before the
    onset), and a fall while it is there. Without a fall: stable, but for frames on the ground, which carry no label.
    """
    down = on_ground(points)
    index = np.arange(len(points))
    if not fell:
        return np.where(down, UNLABELLED, STABLE)
    later = down & (index >= onset)
    first = int(np.argmax(later)) if later.any() else len(points)
    risen = ~down & (index >= first)
    last = int(np.argmax(risen)) if risen.any() else len(points)
    labels = np.full(len(points), UNLABELLED, dtype=np.int64)
    labels[: min(onset, first)] = STABLE
    labels[max(onset, first - FALLING) : first] = TRANSIENT
    labels[first:last] = FALL
    return labels


def _read_contacts(folder: Path, seen: Seen, cameras: int, seed: int) -> list[Clip]:
    rng = np.random.default_rng(seed)
    motions = load_arrays(required(folder, "mocap/lafan1.npz"))
    contacts = read_contacts(folder)
    clips = []
    for contact, verdict in contacts:
        if verdict.seen is not seen:
            continue
        before = [
            other.recover for other, _ in contacts if other.file == contact.file and other.recover < contact.onset
        ]
        start = max(0, contact.onset - BEFORE, *before)
        points = motions[contact.file][start : contact.ground + AFTER]
        labels = label(points, contact.onset - start, seen is Seen.FALL)
        name = f"{contact.file}/{contact.ground}"
        clips += [_seen(f"{name}/{index}", f"lafan1/{name}", points, labels, rng) for index in range(cameras)]
    return clips


def _seen(name: str, group: str, points: Floats, labels: Labels, rng: np.random.Generator) -> Clip:
    camera = draw_camera(rng)
    keypoints = observe(camera.project(points), rng)
    return Clip(name, group, keypoints, FPS, labels, camera.width, camera.image_height, "LaFAN1", LICENCE)
