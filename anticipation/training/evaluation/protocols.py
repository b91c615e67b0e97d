"""Who learns from what, and is tested on what: by recording, by the paper's random windows, across data sets."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any, Final

import numpy as np
from rich.progress import Progress

from anticipation import checkpoint as checkpoints
from anticipation.checkpoint import Checkpoint
from anticipation.training import networks
from anticipation.training.corpus import Corpus, Shares, people_folds, shares
from anticipation.training.evaluation.calibration import cross_fitted
from anticipation.training.evaluation.examination import examine
from anticipation.training.evaluation.live import watch
from anticipation.training.evaluation.recordings import Recording
from anticipation.training.evaluation.records import Predictions, Record
from anticipation.training.evaluation.rivals import fit_rivals
from anticipation.training.plan import Plan
from anticipation.training.production import fold_checkpoint
from anticipation.training.samples import Track, cut
from anticipation.training.splits import random_windows
from bridge.config.surefoot import SurefootConfig
from bridge.errors import SourceError
from bridge.messages import Floats

SHARE_OF_FALLS: Final = 0.6  # of a batch, in the paper's protocol
PLANE: Final = ("centres", "weights", "biases")
CROSSED: Final = (("URFD", "UP-Fall"), ("UP-Fall", "URFD"))  # learnt from, tested on
PAPER: Final = "paper"
NOT_LIVE: Final = (
    "--live: by the paper's protocol every clip was learnt from in part, so the whole system is not run over them; "
    "--protocol grouped or cross"
)


@dataclass(frozen=True, slots=True)
class Study:
    """What an evaluation works on and how much it does."""

    corpus: Corpus
    recordings: Sequence[Recording]
    plan: Plan
    seed: int
    folder: Path  # checkpoints of the parts go there
    config: SurefootConfig  # of the system in the live pass
    progress: Progress
    keypoints: str = "alphapose"  # tracks of the URFD falls that tables are made of
    baselines: bool = True  # fit and test the simpler ways too
    live: bool = True  # run the whole system with the intervention over every clip


class _Parts:
    """Collects what the parts of an evaluation give, in order."""

    def __init__(self, study: Study, pretrained_on: Shares) -> None:
        self._study = study
        self._pretrained = networks.pretrained_forecaster(study.plan, pretrained_on, study.progress)
        self.checkpoints: list[Checkpoint] = []
        self.records: list[Record] = []

    def add(self, name: str, chosen: Sequence[Track], known: Shares, held_out: set[str]) -> None:
        """Fit to `chosen` and examine the recordings of falls whose names are in `held_out`."""
        study = self._study
        fitted = fold_checkpoint(
            study.corpus, chosen, known, self._pretrained, study.plan, study.seed, name, study.progress
        )
        shifted = networks.fitted_shifted(study.plan, known, name, study.progress) if study.baselines else None
        rivals = fit_rivals(fitted, study.corpus, chosen, study.seed) if study.baselines else []
        falls = [each for each in study.recordings if each.kind in {"fall", "staged"} and each.clip.name in held_out]
        self.records += examine(fitted, shifted, rivals, falls, len(self.checkpoints))
        self.checkpoints.append(fitted)

    def calibrated(self) -> None:
        """Give each checkpoint the temperatures that fit what the others said of their falls."""
        temperatures = cross_fitted(self.records, len(self.checkpoints), self._study.keypoints)
        self.checkpoints = [
            replace(fitted, temperature=temperature)
            for fitted, temperature in zip(self.checkpoints, temperatures, strict=True)
        ]

    def planes(self) -> list[dict[str, Floats]]:
        """Return what is needed to draw each plane."""
        return [{name: fitted.plane.arrays()[name] for name in PLANE} for fitted in self.checkpoints]


def grouped(study: Study, folds: int) -> Predictions:
    """Test every recording by networks that have not seen its group."""
    parts = _Parts(study, shares(study.corpus, ()))
    people = study.corpus.people
    for part, (training, test) in enumerate(people_folds(study.corpus, folds, study.seed)):
        chosen = [people[index] for index in training]
        name = f"fold {part + 1}/{folds}"
        parts.add(name, chosen, shares(study.corpus, chosen), {people[index].name for index in test})
    parts.calibrated()
    return _finished(study, parts, "grouped", [f"fold {part + 1}" for part in range(folds)])


def paper(study: Study) -> Predictions:
    """Test on a random fifth of the windows of the same recordings, as the paper may have done.

    Overlapping windows lie on both sides. Only for comparison with numbers obtained that way.
    """
    corpus = study.corpus
    tracks = [track for track in corpus.falls if study.keypoints in {"both", track.name.rpartition("/")[2]}]
    windows = cut(tracks)
    training, test = random_windows(len(windows), study.seed)
    everything = shares(corpus, corpus.people)
    others = shares(corpus, [track for track in corpus.people if track not in corpus.falls])
    half = (windows.take(training), SHARE_OF_FALLS)
    known = replace(others, motion=[half, *others.motion], gait=[half, *others.gait], walks=everything.walks)
    parts = _Parts(study, everything)
    names = [track.name for track in tracks]
    parts.add("random windows", corpus.people, known, set(names))
    kept = np.zeros(len(windows), dtype=np.bool_)
    kept[test] = True
    parts.records = [_thinned(record, kept[windows.track == names.index(record.name)]) for record in parts.records]
    return _finished(replace(study, live=False), parts, "paper", ["random windows"])


def cross(study: Study) -> Predictions:
    """Test each data set by networks that know only the other one and the mocap walks."""
    parts = _Parts(study, shares(study.corpus, ()))
    titles = []
    for own, other in CROSSED:
        chosen = [track for track in study.corpus.people if track.source == own]
        held_out = {each.clip.name for each in study.recordings if each.clip.source == other}
        parts.add(own, chosen, shares(study.corpus, chosen), held_out)
        titles.append(f"{own} and mocap, tested on {other}")
    return _finished(study, parts, "cross", titles)


def observed(predictions: Predictions, study: Study) -> Predictions:
    """Run the whole system over every clip, those without falls included, with the checkpoints in the study's folder.

    Raises:
        SourceError: by this protocol every clip was learnt from; or the study learns from other walks, so that it is
            not known which clips the checkpoints have not seen.
    """
    protocol = str(predictions.meta["protocol"])
    if protocol == PAPER:
        raise SourceError(NOT_LIVE)
    clips = predictions.meta.get("mocap_clips", study.plan.mocap_clips)  # not told before it was stored
    if clips != study.plan.mocap_clips:
        raise SourceError(
            f"the report's networks know {clips} clips of motion capture, this command reads {study.plan.mocap_clips}: "
            "give the same --recipe and --quick again"
        )
    paths = [_path(study.folder, protocol, part) for part in range(len(predictions.meta["parts"]))]
    bare = [replace(record, frames=None) for record in predictions.records if record.ticks is not None]
    return replace(predictions, records=_watched(study, bare, paths, unseen_by(study, protocol, len(paths))))


def unseen_by(study: Study, protocol: str, parts: int) -> dict[str, int]:
    """Return for each recording that is run through the whole system the part whose networks had not seen it."""
    if protocol == "cross":
        titles = {other: part for part, (_, other) in enumerate(CROSSED)}
        return {each.clip.name: titles[each.clip.source] for each in study.recordings if each.clip.source in titles}
    people = study.corpus.people
    part_of: dict[str, int] = {}
    for part, (_, test) in enumerate(people_folds(study.corpus, parts, study.seed)):
        part_of |= {people[index].name: part for index in test}
    # What no network learns from at all is shared out among them.
    others = [each.clip.name for each in study.recordings if each.clip.name not in part_of]
    return part_of | {name: index % parts for index, name in enumerate(others)}


def _finished(study: Study, parts: _Parts, protocol: str, titles: Sequence[str]) -> Predictions:
    paths = []
    for part, fitted in enumerate(parts.checkpoints):
        paths.append(_path(study.folder, protocol, part))
        checkpoints.save(fitted, paths[-1])
    records = parts.records
    if study.live:
        records = _watched(study, records, paths, unseen_by(study, protocol, len(paths)))
    meta: dict[str, Any] = {
        "protocol": protocol,
        "seed": study.seed,
        "parts": list(titles),
        "keypoints": study.keypoints,
        "forecaster": study.plan.forecaster,
        "mocap_clips": study.plan.mocap_clips,
    }
    return Predictions(meta, records, parts.planes())


def _path(folder: Path, protocol: str, part: int) -> Path:
    return folder / f"{protocol}-{part + 1}.safetensors"


def _watched(study: Study, records: Sequence[Record], paths: Sequence[Path], part_of: dict[str, int]) -> list[Record]:
    """Add what the whole system made of every clip, those without falls included."""
    examined = {record.name: record for record in records}
    task = study.progress.add_task("whole system", total=len(part_of), loss="")
    found: list[Record] = []
    for part, path in enumerate(paths):
        ours = [each for each in study.recordings if part_of.get(each.clip.name) == part]
        seen = watch([each.clip for each in ours], path, study.config, lambda: study.progress.update(task, advance=1))
        for (clip, kind), frames in zip(ours, seen, strict=True):
            bare = Record(clip.name, clip.group, clip.source, kind, part)
            found.append(replace(examined.get(clip.name, bare), frames=frames))
    return found


def _thinned(record: Record, kept: np.ndarray[tuple[int, ...], np.dtype[np.bool_]]) -> Record:
    """Return the record with only those tested ticks left whose windows were kept from training."""
    ticks = record.ticks
    assert ticks is not None
    tested = ticks.tested.copy()
    tested[tested] = kept
    return replace(record, ticks=replace(ticks, tested=tested))
