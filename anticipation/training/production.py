"""The checkpoint that is shipped: networks fitted to every recording, calibrated on recordings held out."""

from __future__ import annotations

import json
import math
from collections.abc import Mapping, Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any, Final

import numpy as np
from rich.progress import Progress
from torch import nn

from anticipation.checkpoint import Checkpoint, Provenance
from anticipation.motion import COORDINATES, WINDOW
from anticipation.quality import PoseStatistics
from anticipation.training import oumvlp, own, simulated
from anticipation.training.corpus import Corpus, Shares, people_folds, shares, tested
from anticipation.training.fitting import apply
from anticipation.training.measures import temperatures
from anticipation.training.networks import fitted_classifier, fitted_outlook, pretrained_forecaster, tuned_forecaster
from anticipation.training.plan import Plan
from anticipation.training.run import ALONE, Run
from anticipation.training.samples import Track, cut
from anticipation.transient import TransientPlane, fold
from bridge.errors import SourceError
from bridge.messages import STEPS, Floats
from perception.skeleton import MIRROR

LICENCE: Final = (
    "research, non-commercial: learnt from URFD (CC BY-NC-SA 4.0), UP-Fall (research use), "
    "Bandai Namco Research Motiondataset (CC BY-NC 4.0) and CMU mocap (free for all uses)"
)
FURTHER: Final = {  # where they were there, each with what its owner asks
    oumvlp.SOURCE: f"OUMVLP-Pose ({oumvlp.LICENCE})",
    own.SOURCE: "own recordings (as their owner allows)",
    simulated.SOURCE: f"simulated people ({simulated.LICENCE})",
}
DATA: Final = ("URFD", "UP-Fall", "Bandai Namco Research Motiondataset", "CMU mocap")
PLANE_DAILY: Final = 500  # windows of daily activities the plane is fitted to
PLANE_WALKS: Final = 2000  # windows of mocap
POSES: Final = 20_000  # poses that describe what a person looks like


def make_checkpoint(
    corpus: Corpus,
    plan: Plan,
    folds: int,
    seed: int,
    evaluation: Mapping[str, Any] | None,
    progress: Progress,
    run: Run = ALONE,
) -> Checkpoint:
    """Fit the networks that are shipped.

    The temperatures come from `evaluation` (what `surefoot evaluate --json` wrote), or else from one fold
    that a first pair of networks has not seen. The networks then learn from everything.
    """
    everything = shares(corpus, corpus.people)
    pretrained = pretrained_forecaster(plan, everything, progress, run)
    if evaluation is None:
        training, test = people_folds(corpus, folds, seed)[0]
        chosen = [corpus.people[index] for index in training]
        known = shares(corpus, chosen)
        first = fold_checkpoint(corpus, chosen, known, pretrained, plan, seed, "calibration", progress, run)
        held_out = cut(tested(corpus, test, "both"))
        temperature = temperatures(apply(first.logits, held_out.frames[:, :WINDOW]), held_out.labels)
    else:
        temperature = np.array(evaluation["temperature"], dtype=np.float64)
    made = fold_checkpoint(corpus, corpus.people, everything, pretrained, plan, seed, "all recordings", progress, run)
    protocol = "not evaluated" if evaluation is None else str(evaluation["protocol"])
    metrics = {} if evaluation is None else _summary(evaluation)
    provenance = replace(made.provenance, protocol=protocol, metrics=metrics)
    return replace(made, temperature=temperature, provenance=provenance)


def fold_checkpoint(
    corpus: Corpus,
    chosen: Sequence[Track],
    known: Shares,
    pretrained: nn.Module,
    plan: Plan,
    seed: int,
    name: str,
    progress: Progress,
    run: Run = ALONE,
) -> Checkpoint:
    """Fit everything a checkpoint holds to the people in `chosen` and to the mocap walks alone; temperatures are 1.

    Args:
        corpus: where `chosen` and the walks come from.
        chosen: tracks of the people that may be learnt from.
        known: their samples, weighed.
        pretrained: forecaster that knows the walks; it is not changed.
        plan: how much is learnt.
        seed: of whatever is drawn.
        name: what the progress bars call it.
        progress: where they are shown.
        run: where and how the fits are done.
    """
    forecaster = tuned_forecaster(pretrained, plan, known, name, progress, run)
    return Checkpoint(
        forecaster=forecaster,
        classifier=fitted_classifier(plan, known, forecaster, name, progress, run),
        plane=_plane(corpus, chosen, seed),
        statistics=_statistics(known, seed),
        temperature=np.ones(STEPS),
        mirrored=plan.mirrored,
        outlook=fitted_outlook(plan, known, name, progress, run),
        provenance=_provenance((*chosen, *corpus.walks, *corpus.simulated), f"{name}: for evaluation only"),
    )


def read_evaluation(path: Path, plan: Plan) -> dict[str, Any]:
    """Read what `surefoot evaluate --json` wrote of networks that learn by `plan`.

    Raises:
        SourceError: missing, not JSON, without usable temperatures, or of another forecaster.
    """
    try:
        report = json.loads(path.read_text())
    except (OSError, ValueError) as error:
        raise SourceError(f"evaluation '{path}' cannot be read: {error}") from error
    if not isinstance(report, dict) or not isinstance(report.get("protocol"), str):
        raise SourceError(f"evaluation '{path}' names no protocol: write it with surefoot evaluate --json")
    given = report.get("temperature")
    if not isinstance(given, list) or len(given) != STEPS or not all(_is_temperature(each) for each in given):
        raise SourceError(f"evaluation '{path}' has no {STEPS} positive temperatures: write it with --json")
    if report.get("forecaster") != plan.forecaster:
        raise SourceError(
            f"evaluation '{path}' is of the forecaster {report.get('forecaster')}, and {plan.forecaster} is to be "
            "trained: evaluate the same --recipe"
        )
    return report


def _is_temperature(value: object) -> bool:
    return isinstance(value, int | float) and not isinstance(value, bool) and 0.0 < value < math.inf


def _summary(evaluation: Mapping[str, Any]) -> dict[str, Any]:
    """What a checkpoint says of its evaluation: how it was done, and the accuracy of each fold."""
    kept = {name: evaluation[name] for name in ("protocol", "seed", "keypoints", "horizons_ms") if name in evaluation}
    table = evaluation.get("tables", {}).get("urfd", {})
    for kind in ("accuracy", "macro_f1"):
        if evaluation.get("shipped") in table.get(kind, {}):
            kept[kind] = table[kind][evaluation["shipped"]]
    return kept


def _provenance(learnt: Sequence[Track], protocol: str) -> Provenance:
    """Name the data sets that were learnt from, with the licence of each."""
    sources = {track.source for track in learnt}
    further = [name for name in FURTHER if name in sources]
    licence = LICENCE + "".join(f"; {FURTHER[name]}" for name in further)
    return Provenance((*DATA, *further), licence, protocol)


def _plane(corpus: Corpus, chosen: Sequence[Track], seed: int) -> TransientPlane:
    """Fit the plane to windows of the URFD falls, with some of daily life and of walks to keep the boundary off them.

    Its features are the windows themselves, folded and with their mirror images, so that left and right count alike:
    over the last second before lying the distance to the fall region then falls steadily (docs/anticipation.md),
    which it does not on the classifier's pooled features.
    """
    rng = np.random.default_rng(seed)
    names = {track.name for track in chosen}
    features, labels = [], []
    falls, staged, daily = (
        [track for track in tracks if track.name in names] for tracks in (corpus.falls, corpus.staged, corpus.daily)
    )
    for tracks, most in ((falls or staged, None), (daily, PLANE_DAILY), (corpus.walks, PLANE_WALKS)):
        samples = cut(tracks)
        rows = np.flatnonzero(samples.labels[:, 0] >= 0)
        if most is not None and most < len(rows):
            rows = np.sort(rng.choice(rows, most, replace=False))
        folded = fold(samples.poses[rows, :WINDOW])
        for side in (folded, folded[..., MIRROR, :]):
            features.append(side.reshape(len(rows), WINDOW * COORDINATES))
            labels.append(samples.labels[rows, 0])
    return TransientPlane.fit(np.concatenate(features), np.concatenate(labels), "folded")


def _statistics(known: Shares, seed: int) -> PoseStatistics:
    """Describe the poses of all sources, each with its share."""
    rng = np.random.default_rng(seed)
    total = sum(share for _, share in known.gait)
    poses: list[Floats] = []
    for samples, share in known.gait:
        rows = rng.integers(len(samples), size=round(POSES * share / total))
        poses.append(samples.poses[rows, WINDOW - 1].astype(np.float64))
    return PoseStatistics.fit(np.concatenate(poses))
