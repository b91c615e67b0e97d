"""Other planes to see the transient state in: what each says of the present, from checkpoints that had not seen it.

Principal components and linear discriminants (Fisher 1936) of the window, plain or folded along the body's vertical,
and of the classifier's pooled features. The plane that is shipped is one of them.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import Final, NamedTuple

import numpy as np
import torch
from numpy.typing import NDArray

from anticipation.checkpoint import Checkpoint
from anticipation.mirror import mirrored
from anticipation.motion import COORDINATES, WINDOW
from anticipation.training.corpus import Corpus
from anticipation.training.fitting import apply
from anticipation.training.samples import Track, cut
from anticipation.transient import TransientPlane, fold
from bridge.messages import KEYPOINTS, Floats

Windows = NDArray[np.float32]

DAILY_WINDOWS: Final = 500  # of daily activities a plane is fitted to, as the shipped one
WALK_WINDOWS: Final = 2000  # of mocap
SHRINKAGE: Final = 0.1  # of the within-class covariance: 360 coordinates of neighbouring windows are all but collinear


class Rival(NamedTuple):
    """A way from a window to a point in the plane."""

    name: str
    features: Callable[[Windows], Floats]  # (M, 15, 13, 2) -> (M, D)
    plane: TransientPlane
    reduce: Callable[[Floats], Floats]  # (M, D) -> what the plane takes

    def judge(self, windows: Windows) -> NDArray[np.float32]:
        """Return signed distance [sd] and region of windows (M, 15, 13, 2): (M, 2)."""
        points = self.plane.project(self.reduce(self.features(windows)))
        return np.stack([self.plane.signed_distance(points), self.plane.regions(points)], axis=1).astype(np.float32)


def fit_rivals(checkpoint: Checkpoint, corpus: Corpus, chosen: Sequence[Track], seed: int) -> list[Rival]:
    """Fit every plane to the people in `chosen` and to the mocap walks."""
    windows, labels = _training(corpus, chosen, seed)
    ways: list[tuple[str, Callable[[Windows], Floats]]] = [
        ("window", _flat),
        ("folded window", _folded),
        ("DGNN embedding", lambda some: _embedded(checkpoint, some)),
    ]
    X = {name: features(windows) for name, features in ways}
    return [
        _fit(f"{reduction.upper()}, {name}", features, X[name], labels, reduction)
        for name, features in ways
        for reduction in ("pca", "lda")
    ]


def _fit(
    name: str, features: Callable[[Windows], Floats], X: Floats, labels: NDArray[np.int64], reduction: str
) -> Rival:
    if reduction == "pca":
        return Rival(name, features, TransientPlane.fit(X, labels, "window"), lambda some: some)
    from sklearn.discriminant_analysis import LinearDiscriminantAnalysis  # noqa: PLC0415 (only fitting needs it)

    lda = LinearDiscriminantAnalysis(solver="eigen", shrinkage=SHRINKAGE, n_components=2, priors=np.full(3, 1 / 3))
    points = lda.fit(X, labels).transform(X)
    return Rival(name, features, TransientPlane.fit(points, labels, "window"), lda.transform)


def _training(corpus: Corpus, chosen: Sequence[Track], seed: int) -> tuple[Windows, NDArray[np.int64]]:
    """Windows and labels with their mirror images: all of the falls, some of daily life and of walks."""
    rng = np.random.default_rng(seed)
    names = {track.name for track in chosen}
    falls, staged, daily = (
        [track for track in tracks if track.name in names] for tracks in (corpus.falls, corpus.staged, corpus.daily)
    )
    windows, labels = [], []
    for tracks, most in ((falls or staged, None), (daily, DAILY_WINDOWS), (corpus.walks, WALK_WINDOWS)):
        samples = cut(tracks)
        rows = np.flatnonzero(samples.labels[:, 0] >= 0)
        if most is not None and most < len(rows):
            rows = np.sort(rng.choice(rows, most, replace=False))
        seen = samples.frames[rows, :WINDOW]
        windows += [seen, mirrored(torch.from_numpy(seen)).numpy()]
        labels += [samples.labels[rows, 0]] * 2
    return np.concatenate(windows), np.concatenate(labels)


def _flat(windows: Windows) -> Floats:
    return windows[:, :, :KEYPOINTS].reshape(len(windows), WINDOW * COORDINATES).astype(np.float64)


def _folded(windows: Windows) -> Floats:
    return _flat(np.asarray(fold(windows), dtype=np.float32))


def _embedded(checkpoint: Checkpoint, windows: Windows) -> Floats:
    def run(some: torch.Tensor) -> torch.Tensor:
        return checkpoint.classifier.embedding(some)[:, -1]

    return apply(run, windows).astype(np.float64)
