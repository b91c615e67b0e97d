"""People made of twelve points who stand, fall over, lie and walk."""

import numpy as np

BODY_M = np.array(
    [
        [0.2, 1.45], [-0.2, 1.45], [0.25, 1.15], [-0.25, 1.15], [0.27, 0.9], [-0.27, 0.9],
        [0.12, 0.95], [-0.12, 0.95], [0.12, 0.5], [-0.12, 0.5], [0.13, 0.08], [-0.13, 0.08],
    ]
)  # fmt: skip
STAND, GOING, LYING = 30, 30, 30


def falling(seed, fps=30.0, scale=100.0):
    """Keypoints (N, 12, 3) and labels -1, 0, 1 of someone who topples sideways."""
    rng = np.random.default_rng(seed)
    stand = round((STAND + rng.integers(-5, 6)) * fps / 30)
    frames = stand + round((GOING + LYING) * fps / 30)
    tilt = np.clip((np.arange(frames) - stand) / (GOING * fps / 30), 0, 1) ** 1.5 * np.pi / 2 * rng.choice([-1, 1])
    turn = np.stack([np.cos(tilt), np.sin(tilt), -np.sin(tilt), np.cos(tilt)], axis=1).reshape(-1, 2, 2)
    points = np.einsum("nij,kj->nki", turn, BODY_M) * [scale, -scale] + [160, 200]
    points += rng.normal(size=points.shape) * 0.5
    labels = np.full(frames, -1)
    labels[stand:] = 0
    labels[stand + round(GOING * fps / 30) :] = 1
    return np.concatenate([points, np.full((frames, 12, 1), 0.9)], axis=-1), labels


def walking(seed, frames=80):
    """Someone walking, (T, 12, 3) [m], z up."""
    rng = np.random.default_rng(seed)
    time = np.arange(frames) / 30
    points = np.zeros((frames, 12, 3))
    points[:, :, 1] = BODY_M[:, 0]
    points[:, :, 2] = BODY_M[:, 1]
    swing = 0.25 * np.sin(2 * np.pi * time + rng.uniform(0, 6))
    for joint, gain in ((4, -1), (5, 1), (10, 1), (11, -1), (8, 0.5), (9, -0.5)):
        points[:, joint, 0] += gain * swing
    points[:, :, 0] += rng.uniform(0.8, 1.3) * time[:, None]
    return points
