"""The transient plane: where a gait is on its way from stable to fall, and how fast (paper, II.E and discussion).

Feature vectors are projected on a plane by principal component analysis. The plane is scaled so that
the pooled within-class covariance is the identity: one unit is one within-class standard deviation [sd].
Multinomial logistic regression cuts the plane into the three class regions; its boundaries are straight lines,
so the fall region is the intersection of two half-planes and the signed distance to it is exact.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Final, Literal, NamedTuple, Self, TypeAlias, get_args

import numpy as np
from numpy.typing import NDArray

from bridge.messages import CLASSES, STEP_S, Floats

Features: TypeAlias = Literal["window", "folded", "embedding"]
FALL: Final = CLASSES.index("fall")
REACH: Final = 100.0  # distances beyond +-100 sd say nothing more and are cut there [sd]


def fold(poses: NDArray[np.floating]) -> NDArray[np.floating]:
    """Return relative poses (..., 12, 2) folded along the body's vertical: |x|, y.

    A fall to the left and the same fall to the right become one. A linear map of the plain coordinates
    cannot do that: what it learns of falls to one side, it expects of falls to that side only.
    """
    folded = np.array(poses)
    np.abs(folded[..., 0], out=folded[..., 0])
    return folded


class Transition(NamedTuple):
    """Where each of S successive steps lies in the plane, and where it is going."""

    plane: Floats  # (S, 2) [sd]
    distance: Floats  # (S,) signed distance to the fall region, positive outside [sd]
    distance_rate: Floats  # (S,) [sd/s]
    time_to_boundary: Floats  # (S,) [s]; 0 inside, inf when not closing
    centre_distance: Floats  # (S, 3) distance to each class centre [sd]


class _Wedge(NamedTuple):
    """The fall region: what lies inside of two lines."""

    normals: Floats  # (2, 2) unit normals, pointing out
    offsets: Floats  # (2,) inside is normal @ point <= offset
    corner: Floats  # (2,) where the lines meet; inf where they are parallel


@dataclass(frozen=True)
class TransientPlane:
    """An affine map to the plane, three class centres and three linear scores.

    `features` says what it was fitted on: `window` (the 15 x 24 relative coordinates of a window, flattened),
    `folded` (the same after `fold`), or `embedding` (the classifier's 128 pooled features).
    """

    features: Features
    projection: Floats  # (D, 2)
    offset: Floats  # (2,)
    centres: Floats  # (3, 2) [sd]
    weights: Floats  # (3, 2) class scores are weights @ point + biases; the largest wins
    biases: Floats  # (3,)
    _wedge: _Wedge = field(init=False, repr=False, compare=False)

    def __post_init__(self) -> None:
        if self.features not in get_args(Features):
            raise ValueError(f"plane features are '{self.features}', expected one of {', '.join(get_args(Features))}")
        shapes = {"projection": (-1, 2), "offset": (2,), "centres": (3, 2), "weights": (3, 2), "biases": (3,)}
        for name, shape in shapes.items():
            array = np.array(getattr(self, name), dtype=np.float64)
            if array.ndim != len(shape) or array.shape[1:] != shape[1:] or (array.shape[0] != shape[0] != -1):
                raise ValueError(f"plane {name} has shape {array.shape}, expected {shape}")
            if not np.isfinite(array).all():
                raise ValueError(f"plane {name} is not finite")
            array.flags.writeable = False
            object.__setattr__(self, name, array)
        normals, offsets = self._fall_normals()
        if (np.abs(normals).max(axis=1) < 1e-9).any():
            raise ValueError("plane has no boundary around the fall region: the classes do not spread over it")
        parallel = abs(np.linalg.det(normals)) < 1e-9
        corner = np.full(2, np.inf) if parallel else np.linalg.solve(normals, offsets).astype(np.float64)
        object.__setattr__(self, "_wedge", _Wedge(normals, offsets, corner))

    @classmethod
    def fit(cls, features: NDArray[np.floating], labels: NDArray[np.integer], kind: Features) -> Self:
        """Fit on features (N, D) and labels (N,) in 0..2 (stable, transient, fall).

        Classes are weighted equally, so that the share of each in the recordings does not move the boundaries.

        Raises:
            ValueError: a class is missing or the classes do not spread over the plane.
        """
        # Only fitting needs scikit-learn: a running node does not pay a second of start-up for it.
        from sklearn.decomposition import PCA  # noqa: PLC0415
        from sklearn.linear_model import LogisticRegression  # noqa: PLC0415

        if set(np.unique(labels)) != {0, 1, 2}:
            raise ValueError(f"plane needs labels 0, 1 and 2, got {sorted(set(np.unique(labels).tolist()))}")
        X = np.asarray(features, dtype=np.float64)
        mean, scale = X.mean(axis=0), X.std(axis=0)
        scale = np.where(scale > 1e-9, scale, 1.0)
        pca = PCA(n_components=2, svd_solver="covariance_eigh").fit((X - mean) / scale)
        axes = pca.components_.T / scale[:, None]  # (D, 2)
        points = (X - mean) @ axes
        spread = np.mean([np.cov(points[labels == k], rowvar=False) for k in range(3)], axis=0)
        variances, directions = np.linalg.eigh(spread)
        whiten = directions / np.sqrt(variances) @ directions.T  # symmetric: keeps the axes' orientation
        projection = axes @ whiten
        points = (X - mean) @ projection
        regression = LogisticRegression(class_weight="balanced").fit(points, labels)
        return cls(
            features=kind,
            projection=projection,
            offset=-mean @ projection,
            centres=np.array([points[labels == k].mean(axis=0) for k in range(3)]),
            weights=regression.coef_,
            biases=regression.intercept_,
        )

    @classmethod
    def from_arrays(cls, arrays: Mapping[str, NDArray[np.float64]], features: Features) -> Self:
        """Rebuild a plane from what `arrays` returned."""
        return cls(features=features, **{name: arrays[name] for name in _ARRAYS})

    def arrays(self) -> dict[str, Floats]:
        """Return the arrays that make the plane, by name."""
        return {name: getattr(self, name) for name in _ARRAYS}

    def project(self, features: NDArray[np.floating]) -> Floats:
        """Project features (S, D) to points (S, 2) [sd]."""
        return features @ self.projection + self.offset

    def regions(self, points: Floats) -> NDArray[np.int64]:
        """Class whose region each point (S, 2) lies in: (S,)."""
        scores: Floats = points @ self.weights.T + self.biases
        classes: NDArray[np.int64] = scores.argmax(axis=1)
        return classes

    def signed_distance(self, points: Floats) -> Floats:
        """Signed distance (S,) of points (S, 2) to the fall region, positive outside [sd].

        Inside, the nearer of the two lines counts. Outside, the nearest point of the region is the foot on one
        of the lines where that foot belongs to the region, and else the corner where the lines meet.
        """
        normals, offsets, corner = self._wedge
        beyond = points @ normals.T - offsets  # (S, 2) signed distance to each line, positive outside
        feet = points[:, None] - beyond[..., None] * normals  # (S, 2, 2)
        across = feet @ normals.T - offsets  # (S, foot, line)
        kept = np.stack((across[:, 0, 1], across[:, 1, 0]), axis=1) <= 0
        to_corner = np.hypot(points[:, 0] - corner[0], points[:, 1] - corner[1])
        outside = np.minimum(np.where(kept, np.abs(beyond), np.inf).min(axis=1), to_corner)
        deepest = beyond.max(axis=1)
        distance: Floats = np.where(deepest <= 0, deepest, outside).clip(-REACH, REACH)
        return distance

    def transition(self, features: NDArray[np.floating], step_s: float = STEP_S) -> Transition:
        """Describe S successive steps, `step_s` seconds apart, from their features (S, D)."""
        points = self.project(features)
        distance = self.signed_distance(points)
        rate = np.gradient(distance, step_s)
        closing = (distance > 0) & (rate < 0)
        time_left = np.where(distance > 0, np.inf, 0.0)
        np.divide(distance, -rate, out=time_left, where=closing)
        away = points[:, None] - self.centres  # (S, 3, 2)
        centre_distance = np.hypot(away[..., 0], away[..., 1])
        return Transition(points, distance, rate, time_left, centre_distance)

    def _fall_normals(self) -> tuple[Floats, Floats]:
        """Unit normals (2, 2) and offsets (2,) of the lines between the fall region and the other two."""
        others = [k for k in range(len(CLASSES)) if k != FALL]
        normals = self.weights[others] - self.weights[FALL]
        length = np.linalg.norm(normals, axis=1)
        length = np.where(length > 0, length, 1.0)
        return normals / length[:, None], (self.biases[FALL] - self.biases[others]) / length


_ARRAYS: Final = ("projection", "offset", "centres", "weights", "biases")
