"""How far the input resembles what the networks were trained on: 1 as in training, 0 not to be relied on.

Three causes lower it, each a factor in 0..1: keypoints that were not measured, more than one person in
view, and poses unlike any in training.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any, Final, NamedTuple, Self

import numpy as np
from numpy.typing import NDArray

from bridge.config.anticipation import QualityConfig
from bridge.messages import KEYPOINTS, Floats, KeypointStatus
from perception.skeleton import LINKS

_TRIMMED: Final = 0.05  # share of the training poses left out as detector errors
_RARE: Final = 0.97  # quantile of the training poses that still counts as seen
_SIZE_STEP: Final = math.log(1.25)  # a skeleton a quarter larger or smaller than any seen is one unit stranger

_WEIGHT: Final = np.zeros(3)
_WEIGHT[KeypointStatus.MEASURED] = 1.0
_WEIGHT[KeypointStatus.FILLED] = 0.5  # continued along a line: better than nothing, worse than seen


@dataclass(frozen=True)
class PoseStatistics:
    """What poses looked like in training: a Gaussian over coordinates and link lengths, and the range of sizes.

    A pose is described by its 24 relative coordinates and its 12 link lengths (36 numbers, body lengths).
    A skeleton that collapsed into one point lies in the middle of that cloud, so the size, the sum of the
    link lengths, is judged by itself.
    """

    mean: Floats  # (36,)
    whitening: Floats  # (36, 36): the distance of a pose is |(x - mean) @ whitening| / 6, about 1 in training
    limit: float  # distance that three training poses in a hundred exceed
    sizes: Floats  # (2,) smallest and largest sum of link lengths, but for three poses in a hundred [body lengths]

    def __post_init__(self) -> None:
        for name, shape in (("mean", (36,)), ("whitening", (36, 36)), ("sizes", (2,))):
            array = np.array(getattr(self, name), dtype=np.float64)
            if array.shape != shape:
                raise ValueError(f"pose statistics: {name} has shape {array.shape}, expected {shape}")
            if not np.isfinite(array).all():
                raise ValueError(f"pose statistics: {name} is not finite")
            array.flags.writeable = False
            object.__setattr__(self, name, array)
        if not 0 < self.limit < np.inf:
            raise ValueError(f"pose statistics: limit is {self.limit}, expected a positive number")
        if not 0 < self.sizes[0] <= self.sizes[1]:
            raise ValueError(f"pose statistics: sizes are {self.sizes}, expected two positive rising numbers")

    @classmethod
    def fit(cls, poses: NDArray[np.floating]) -> Self:
        """Fit on relative coordinates (N, 12, 2) of whole skeletons, N >= 100.

        Fitted twice: poses far from the first fit are detector errors and are left out of the second.
        The covariance is shrunk towards a multiple of the identity (Ledoit and Wolf, 2004).

        Raises:
            ValueError: too few poses, or some are not finite.
        """
        X = _describe(np.asarray(poses, dtype=np.float64).reshape(-1, KEYPOINTS, 2))
        if len(X) < 100 or not np.isfinite(X).all():
            raise ValueError(f"pose statistics need 100 finite poses or more, got {int(np.isfinite(X).all(1).sum())}")
        distance = _distance(X, *_gaussian(X))
        mean, whitening = _gaussian(X[distance <= np.quantile(distance, 1.0 - _TRIMMED)])
        limit = np.quantile(_distance(X, mean, whitening), _RARE)
        sizes = np.quantile(_size(X), ((1.0 - _RARE) / 2, (1.0 + _RARE) / 2))
        return cls(mean=mean, whitening=whitening, limit=float(limit), sizes=sizes)

    @classmethod
    def from_arrays(cls, arrays: Mapping[str, NDArray[np.float64]]) -> Self:
        """Rebuild from what `arrays` returned."""
        return cls(
            mean=arrays["mean"], whitening=arrays["whitening"], limit=float(arrays["limit"]), sizes=arrays["sizes"]
        )

    def arrays(self) -> dict[str, NDArray[np.float64]]:
        """Return the arrays by name."""
        return {"mean": self.mean, "whitening": self.whitening, "limit": np.array(self.limit), "sizes": self.sizes}

    @property
    def mean_pose(self) -> Floats:
        """Mean relative coordinates (12, 2)."""
        return self.mean[: 2 * KEYPOINTS].reshape(KEYPOINTS, 2)

    def strangeness(self, poses: NDArray[np.floating]) -> Floats:
        """How unlike those in training each pose (N, 12, 2) is: (N,), 3 % of those are beyond 1.

        The larger of the distance from the Gaussian and of what the size lacks or exceeds.
        """
        X = _describe(poses)
        size = np.maximum(_size(X), 1e-6)
        beyond = np.log(np.maximum(self.sizes[0] / size, size / self.sizes[1])) / _SIZE_STEP
        by_size = np.where(beyond > 0, 1.0 + beyond, 0.0)
        strangeness: Floats = np.maximum(_distance(X, self.mean, self.whitening) / self.limit, by_size)
        return strangeness


def _gaussian(X: Floats) -> tuple[Floats, Floats]:
    """Mean and whitening matrix of the rows of X."""
    from sklearn.covariance import ledoit_wolf  # noqa: PLC0415 (only fitting needs it)

    covariance, _ = ledoit_wolf(X)
    return X.mean(axis=0), np.linalg.cholesky(np.linalg.inv(covariance))


def _describe(poses: NDArray[np.floating]) -> Floats:
    bones = poses[:, LINKS[:, 1]] - poses[:, LINKS[:, 0]]
    return np.concatenate((poses.reshape(len(poses), -1), np.hypot(bones[..., 0], bones[..., 1])), axis=1)


def _size(X: Floats) -> Floats:
    size: Floats = X[:, 2 * KEYPOINTS :].sum(axis=1)
    return size


def _distance(X: Floats, mean: Floats, whitening: Floats) -> Floats:
    distance: Floats = np.linalg.norm((X - mean) @ whitening, axis=1) / np.sqrt(len(mean))
    return distance


def measured_share(status: NDArray[np.uint8]) -> float:
    """Share of keypoints that were measured, a filled one counting half: status (..., 12) -> 0..1."""
    return float(_WEIGHT[status].mean())


class Quality(NamedTuple):
    """The three factors, each 0..1."""

    seen: float  # keypoints were measured
    known: float  # poses are like those in training
    alone: float  # one person in view

    @property
    def total(self) -> float:
        """Their product."""
        return self.seen * self.known * self.alone

    @property
    def cause(self) -> str:
        """What lowers the quality most, in words."""
        causes = (
            (self.seen, "too few keypoints were measured"),
            (self.known, "the poses are unlike any seen in training"),
            (self.alone, "several people are in view"),
        )
        return min(causes)[1]


def judge(config: QualityConfig, status: NDArray[Any], strangeness: Floats, people: int) -> Quality:
    """Judge a window.

    Args:
        config: where each factor begins to fall and where it reaches 0.
        status: (15, 12) KeypointStatus.
        strangeness: (15,) from `PoseStatistics.strangeness`; the strangest third counts, because a skeleton that
            broke for a moment moves in ways no person does.
        people: how many people the detector saw in the newest frame.
    """
    return Quality(
        seen=_ramp(measured_share(status), config.measured_share_zero, config.measured_share_full),
        known=_ramp(
            float(np.sort(strangeness)[-max(1, len(strangeness) // 3) :].mean()),
            config.strangeness_zero,
            config.strangeness_full,
        ),
        alone=1.0 if people <= 1 else config.several_people,
    )


def _ramp(value: float, zero: float, full: float) -> float:
    """0 at `zero`, 1 at `full`, straight between and constant beyond."""
    return min(1.0, max(0.0, (value - zero) / (full - zero)))
