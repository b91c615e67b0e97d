"""Small networks with random weights, for tests that care about the machinery and not about the answers."""

from functools import cache

import numpy as np
import torch

from anticipation.checkpoint import Checkpoint, Provenance
from anticipation.gait_state import DirectedGraphNetwork
from anticipation.motion import MlpForecaster
from anticipation.outlook import Outlook
from anticipation.quality import PoseStatistics
from anticipation.transient import TransientPlane
from bridge.messages import Keypoints, KeypointStatus

STANDING = np.array(  # l/r shoulder, elbow, wrist, hip, knee, ankle; about one body length tall, y down
    [
        (0.10, -0.16), (-0.10, -0.16), (0.14, 0.02), (-0.14, 0.02), (0.15, 0.18), (-0.15, 0.18),
        (0.07, 0.16), (-0.07, 0.16), (0.08, 0.46), (-0.08, 0.46), (0.08, 0.74), (-0.08, 0.74),
    ]
)  # fmt: skip


def poses(count: int, seed: int = 0) -> np.ndarray:
    """Standing figures turned by up to a right angle, of varied size, with noise: (count, 12, 2)."""
    random = np.random.default_rng(seed)
    angle = random.uniform(-np.pi / 2, np.pi / 2, count)
    turn = np.array([[np.cos(angle), -np.sin(angle)], [np.sin(angle), np.cos(angle)]]).transpose(2, 0, 1)
    size = random.uniform(0.9, 1.1, (count, 1, 1))
    return (STANDING @ turn) * size + random.normal(0, 0.02, (count, 12, 2))


@cache
def random_plane(features: str) -> TransientPlane:
    """A plane fitted on three clouds along a bent line."""
    random = np.random.default_rng(0)
    labels = np.arange(300) % 3
    seen = random.normal(size=(300, 128 if features == "embedding" else 360))
    seen[:, 0] += 40 * labels
    seen[:, 1] += 40 * (labels == 1)
    return TransientPlane.fit(seen, labels, features)


@cache
def pose_statistics() -> PoseStatistics:
    """What `poses` looks like."""
    return PoseStatistics.fit(poses(500))


def random_checkpoint(seed: int = 0, features: str = "window") -> Checkpoint:
    """A checkpoint of the shipped kind whose networks were never trained."""
    torch.manual_seed(seed)
    classifier = DirectedGraphNetwork(centre=True)
    outlook = Outlook(16)
    forecaster = MlpForecaster(32, 2)
    torch.nn.init.normal_(forecaster.leave.weight, std=0.01)
    return Checkpoint(
        forecaster=forecaster.eval(),
        classifier=classifier.eval(),
        outlook=outlook.eval(),
        plane=random_plane(features),
        statistics=pose_statistics(),
        temperature=np.linspace(1.0, 1.5, 16),
        provenance=Provenance(("made up",), "none", "none", {"accuracy": [0.3, 0.4]}),
    )


START_NS = 1_000_000_000_000
PERIOD_NS = 33_333_333


def message(tick: int, pose: np.ndarray = STANDING, **changes: object) -> Keypoints:
    """A message of tick `tick`: `pose` in body lengths, 100 px long, around (160, 120)."""
    position = pose * 100 + (160, 120)
    values = {
        "stamp_ns": START_NS + tick * PERIOD_NS,
        "position_px": position,
        "confidence": np.where(np.isfinite(position[:, 0]), 0.9, 0.0),
        "status": np.where(np.isfinite(position[:, 0]), KeypointStatus.MEASURED, KeypointStatus.LOST),
        "body_length_px": 100.0,
        "image_width": 320,
        "image_height": 240,
    }
    return Keypoints(**(values | changes))


def lost(tick: int, keypoints: list[int], pose: np.ndarray = STANDING, **changes: object) -> Keypoints:
    """A message in which some keypoints are lost."""
    pose = np.array(pose, dtype=float)
    pose[keypoints] = np.nan
    return message(tick, pose, **changes)


def nobody(tick: int, reason: str = "nobody in view") -> Keypoints:
    """A message that is not valid."""
    return lost(tick, list(range(12)), valid=False, reason=reason, people=0, body_length_px=np.nan)
