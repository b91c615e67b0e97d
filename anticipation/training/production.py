"""The checkpoint that is shipped: networks fitted to every recording, calibrated on recordings held out."""

from __future__ import annotations

import json
from collections.abc import Mapping
from pathlib import Path
from typing import Any, Final

import numpy as np
from rich.progress import Progress
from torch import nn

from anticipation.checkpoint import Checkpoint, Provenance
from anticipation.gait_state import DirectedGraphNetwork
from anticipation.motion import WINDOW
from anticipation.quality import PoseStatistics
from anticipation.training.corpus import Corpus, Shares, people_folds, shares, tested
from anticipation.training.evaluation import predict
from anticipation.training.measures import temperatures
from anticipation.training.networks import fitted_classifier, pretrained_forecaster, tuned_forecaster
from anticipation.training.plan import Plan
from anticipation.training.samples import cut
from anticipation.transient import TransientPlane, fold
from bridge.errors import SourceError
from bridge.messages import STEPS, Floats
from perception.skeleton import MIRROR

LICENCE: Final = (
    "research, non-commercial: learnt from URFD (CC BY-NC-SA 4.0), UP-Fall (research use), "
    "Bandai Namco Research Motiondataset (CC BY-NC 4.0) and CMU mocap (free for all uses)"
)
DATA: Final = ("URFD", "UP-Fall", "Bandai Namco Research Motiondataset", "CMU mocap")
PLANE_DAILY: Final = 500  # windows of daily activities the plane is fitted to
PLANE_WALKS: Final = 2000  # windows of mocap
POSES: Final = 20_000  # poses that describe what a person looks like


def make_checkpoint(
    corpus: Corpus, plan: Plan, folds: int, seed: int, evaluation: Mapping[str, Any] | None, progress: Progress
) -> Checkpoint:
    """Fit the networks that are shipped.

    The temperatures come from `evaluation` (what `surefoot evaluate --json` wrote), or else from one fold
    that a first pair of networks has not seen. The networks then learn from everything.
    """
    everything = shares(corpus, corpus.people)
    pretrained = pretrained_forecaster(plan, everything, progress)
    if evaluation is None:
        training, test = people_folds(corpus, folds, seed)[0]
        known = shares(corpus, [corpus.people[index] for index in training])
        forecaster, classifier = _fit(pretrained, plan, known, "calibration", progress)
        held_out = cut(tested(corpus, test, "both"))
        temperature = temperatures(predict(classifier, forecaster, held_out), held_out.labels)
    else:
        temperature = np.array(evaluation["temperature"], dtype=np.float64)
    forecaster, classifier = _fit(pretrained, plan, everything, "all recordings", progress)
    protocol = "not evaluated" if evaluation is None else str(evaluation["protocol"])
    return Checkpoint(
        forecaster=forecaster,
        classifier=classifier,
        plane=_plane(corpus, seed),
        statistics=_statistics(everything, seed),
        temperature=temperature,
        provenance=Provenance(DATA, LICENCE, protocol, {} if evaluation is None else dict(evaluation)),
    )


def read_evaluation(path: Path) -> dict[str, Any]:
    """Read what `surefoot evaluate --json` wrote.

    Raises:
        SourceError: missing, not JSON, or without temperatures.
    """
    try:
        report = json.loads(path.read_text())
    except (OSError, ValueError) as error:
        raise SourceError(f"evaluation '{path}' cannot be read: {error}") from error
    if not isinstance(report, dict) or len(report.get("temperature", ())) != STEPS or "protocol" not in report:
        raise SourceError(f"evaluation '{path}' has no protocol or not {STEPS} temperatures: write it with --json")
    return report


def _fit(
    pretrained: nn.Module, plan: Plan, known: Shares, name: str, progress: Progress
) -> tuple[nn.Module, DirectedGraphNetwork]:
    forecaster = tuned_forecaster(pretrained, plan, known, name, progress)
    return forecaster, fitted_classifier(plan, known, forecaster, name, progress)


def _plane(corpus: Corpus, seed: int) -> TransientPlane:
    """Fit the plane to windows of the URFD falls, with some of daily life and of walks to keep the boundary off them.

    Its features are the windows themselves, folded and with their mirror images, so that left and right count alike:
    over the last second before lying the distance to the fall region then falls steadily (docs/anticipation.md),
    which it does not on the classifier's pooled features.
    """
    rng = np.random.default_rng(seed)
    features, labels = [], []
    for tracks, most in ((corpus.falls, None), (corpus.daily, PLANE_DAILY), (corpus.walks, PLANE_WALKS)):
        samples = cut(tracks)
        rows = np.flatnonzero(samples.labels[:, 0] >= 0)
        if most is not None and most < len(rows):
            rows = np.sort(rng.choice(rows, most, replace=False))
        folded = fold(samples.poses[rows, :WINDOW])
        for side in (folded, folded[..., MIRROR, :]):
            features.append(side.reshape(len(rows), -1))
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
