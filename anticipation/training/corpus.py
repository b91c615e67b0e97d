"""Everything the networks learn from, cleaned and cut, with what is kept for testing."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Final, Literal

import numpy as np

from anticipation.training import mocap, oumvlp, upfall, urfd
from anticipation.training.clips import STABLE, UNLABELLED, Clip
from anticipation.training.samples import Samples, Track, clean, cut
from anticipation.training.splits import Indices, grouped_folds
from bridge.config.perception import CleaningConfig
from bridge.errors import SourceError

Tested = Literal["alphapose", "movenet", "both"]

DAILY_STRIDE: Final = 3  # daily activities last a minute: every third window says enough
MOCAP_STRIDE: Final = 2
OUMVLP_CLIPS: Final = 2000  # sequences of a second taken of each estimator
OWN_SHARE: Final = 0.2  # of a batch, where there are recordings of the user's own
SIMULATED_MOTION: Final = 0.6  # beside 1 for all people: of the forecaster's batches, where there are simulated clips
SIMULATED_EVENT: Final = 1.0  # of the classifier's: windows with a simulated fall in them or half a second ahead
SIMULATED_CALM: Final = 0.6  # and the others
MOCAP_KEPT: Final = 0.15  # share of the mocap clips that no network learns from


@dataclass(frozen=True, slots=True)
class Corpus:
    """Cleaned tracks by what they show."""

    falls: tuple[Track, ...]  # URFD, by both estimators
    staged: tuple[Track, ...]  # UP-Fall, activities 1 to 5
    daily: tuple[Track, ...]  # UP-Fall, activities 6 to 11, and adl-40
    walks: tuple[Track, ...]  # mocap for training
    kept_walks: tuple[Track, ...]  # mocap for testing
    own: tuple[Track, ...] = ()  # the user's recordings
    simulated: tuple[Track, ...] = ()  # of people in the simulator's harness

    @property
    def people(self) -> tuple[Track, ...]:
        """Every track of a filmed person: what the folds divide."""
        return self.falls + self.staged + self.daily + self.own


@dataclass(frozen=True, slots=True)
class Shares:
    """Samples to learn from, with the share of a batch that each source fills."""

    motion: list[tuple[Samples, float]]  # for the forecaster
    gait: list[tuple[Samples, float]]  # for the classifier
    walks: Samples


def read_corpus(
    folder: Path, mocap_clips: int, seed: int, own: tuple[Track, ...] = (), simulated: Sequence[Clip] = ()
) -> Corpus:
    """Read, clean and sort all recordings; walks of OUMVLP-Pose too, where they are there.

    They are cleaned as the defaults say, whatever a configuration says of the system that runs: what is learnt from
    and what is tested are the same for everybody.

    Raises:
        SourceError: a file is missing or damaged.
    """

    def cleaned(clips: Sequence[Clip]) -> tuple[Track, ...]:
        return tuple(clean(clip, CleaningConfig()) for clip in clips)

    staged = upfall.read(folder)
    walks = cleaned(mocap.read(folder, mocap_clips, seed))
    for estimator in oumvlp.ESTIMATORS:
        if oumvlp.is_there(folder, estimator):
            walks += cleaned(oumvlp.read(folder, estimator, OUMVLP_CLIPS, seed))
    groups = sorted({track.group for track in walks})
    kept = set(np.random.default_rng(seed).permutation(groups)[: max(1, round(MOCAP_KEPT * len(groups)))])
    return Corpus(
        falls=cleaned([*urfd.read_falls(folder, "alphapose"), *urfd.read_falls(folder, "movenet")]),
        staged=cleaned([clip for clip in staged if upfall.is_fall(clip)]),
        daily=cleaned([*(clip for clip in staged if not upfall.is_fall(clip)), *urfd.read_daily(folder)]),
        walks=tuple(track for track in walks if track.group not in kept),
        kept_walks=tuple(track for track in walks if track.group in kept),
        own=own,
        simulated=cleaned(simulated),
    )


def people_folds(corpus: Corpus, folds: int, seed: int) -> list[tuple[Indices, Indices]]:
    """Divide `corpus.people` into folds by group, URFD falls and the rest each evenly.

    Raises:
        SourceError: there are fewer recordings than folds.
    """
    falls = len(corpus.falls)
    try:
        first = grouped_folds([track.group for track in corpus.falls], folds, seed)
        second = grouped_folds([track.group for track in corpus.people[falls:]], folds, seed)
    except ValueError as error:
        raise SourceError(f"research data is too little: {error}") from error
    return [
        (np.concatenate([a, c + falls]), np.concatenate([b, d + falls]))
        for (a, b), (c, d) in zip(first, second, strict=True)
    ]


def shares(corpus: Corpus, chosen: Sequence[Track]) -> Shares:
    """Weigh the sources: most of a batch are URFD falls, tracked by AlphaPose more than by the less certain MoveNet."""
    names = {track.name for track in chosen}

    def some(tracks: Sequence[Track], stride: int = 1) -> Samples:
        return cut([track for track in tracks if track.name in names], stride)

    falls = [track for track in corpus.falls if track.name in names]
    alphapose = cut([track for track in falls if track.name.endswith("alphapose")])
    movenet = cut([track for track in falls if track.name.endswith("movenet")])
    staged, daily = some(corpus.staged), some(corpus.daily, DAILY_STRIDE)
    walks = cut(corpus.walks, MOCAP_STRIDE)
    own = (some(corpus.own), OWN_SHARE)
    motion = [own, (alphapose, 0.4), (movenet, 0.2), (staged, 0.15), (daily, 0.05), (walks, 0.2)]
    gait = [
        (_labelled(own[0]), OWN_SHARE),
        (alphapose, 0.55),
        (movenet, 0.2),
        (staged, 0.1),
        (daily, 0.1),
        (walks, 0.05),
    ]
    if corpus.simulated:  # not divided into folds: what is tested in the simulator is made from other seeds
        everything = cut(corpus.simulated)
        motion.append((everything, SIMULATED_MOTION))
        eventful = ((everything.labels != STABLE) & (everything.labels != UNLABELLED)).any(axis=1)
        gait.append((everything.take(np.flatnonzero(eventful)), SIMULATED_EVENT))
        gait.append((_labelled(everything.take(np.flatnonzero(~eventful))), SIMULATED_CALM))
    return Shares(_there(motion), _there(gait), walks)


def _labelled(samples: Samples) -> Samples:
    """Leave out samples that say nothing of the state."""
    return samples.take(np.flatnonzero((samples.labels != UNLABELLED).any(axis=1)))


def _there(weighted: list[tuple[Samples, float]]) -> list[tuple[Samples, float]]:
    return [(samples, share) for samples, share in weighted if len(samples)]


def tested(corpus: Corpus, indices: Indices, keypoints: Tested) -> list[Track]:
    """Return the URFD falls among `indices` as the chosen estimator tracked them."""
    people = corpus.people
    return [
        people[index]
        for index in indices
        if people[index] in corpus.falls and (keypoints == "both" or people[index].name.endswith(keypoints))
    ]
