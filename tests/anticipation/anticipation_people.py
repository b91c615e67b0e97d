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


def make_data(folder):
    """Write files laid out like the research data into a folder."""
    for name in ("urfd", "upfall", "mocap"):
        (folder / name).mkdir()
    falls = {}
    for number in range(8):
        keypoints, labels = falling(number)
        falls[f"fall-{number:02d}/alphapose"] = falls[f"fall-{number:02d}/movenet"] = keypoints
        falls[f"fall-{number:02d}/label"] = labels
    np.savez(folder / "urfd" / "falls.npz", **falls)
    still, _ = falling(99)
    np.savez(folder / "urfd" / "adls.npz", **{"adl-40/movenet": still[:25], "adl-40/label": np.full(20, -1)})
    clips = {}
    for activity in range(1, 12):
        keypoints, labels = falling(activity, fps=14.0, scale=200.0)
        if activity > 5:
            keypoints, labels = np.concatenate([keypoints[:12]] * 4), np.full(48, -1)
        name = f"activity{activity:02d}-trial1-cam1"
        clips |= {f"{name}/movenet": keypoints, f"{name}/label": labels, f"{name}/fps": np.array(14.0)}
    np.savez(folder / "upfall" / "subject1_cam1.npz", **clips)
    np.savez(folder / "mocap" / "cmu.npz", **{f"00{i}_01": walking(i) for i in range(3)})
    bandai = {f"dataset-1_{kind}_normal_00{i}": walking(i + 9) for kind in ("walk", "wave") for i in range(3)}
    np.savez(folder / "mocap" / "bandai_namco.npz", **bandai)
