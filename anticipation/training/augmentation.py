"""What the same motion could have looked like: mirrored, larger, tilted, noisier, with a point held.

All on frames (B, T, 13, 2), whole samples at once, so that past, future and labels stay those of one motion.
"""

from __future__ import annotations

from typing import Final

import torch
from torch import Tensor

from anticipation.mirror import mirrored
from anticipation.motion import ROWS

SCALE: Final = 0.12  # standard deviation of the log of the scale, per axis: body length and foreshortening
TILT: Final = 0.10  # standard deviation of the camera's roll [rad]
OFFSET: Final = 0.02  # standard deviation of a point's offset through a sample [body lengths]
JITTER: Final = 0.006  # standard deviation from frame to frame [body lengths]
UNSTEADY: Final = 0.015  # standard deviation of the centre's velocity from frame to frame [body lengths in 0.2 s]
HOLD: Final = 0.15  # probability that one point stands still for some frames
LONGEST_HOLD: Final = 8  # frames


def augment(poses: Tensor, generator: torch.Generator, noise: float = 1.0) -> Tensor:
    """Return a changed copy of frames (B, T, 13, 2), with `noise` times the offsets and jitter said above."""
    batch, frames = poses.shape[:2]

    def normal(*shape: int) -> Tensor:
        return torch.randn(*shape, generator=generator)

    def uniform(*shape: int) -> Tensor:
        return torch.rand(*shape, generator=generator)

    poses = torch.where(uniform(batch, 1, 1, 1) < 0.5, mirrored(poses), poses)
    common, each = SCALE * normal(batch, 1, 1, 1), 0.5 * SCALE * normal(batch, 1, 1, 2)
    poses = poses * torch.exp(common + each)
    angle = TILT * normal(batch)
    turn = torch.stack([angle.cos(), -angle.sin(), angle.sin(), angle.cos()], dim=1).reshape(batch, 1, 2, 2)
    poses = poses @ turn.mT
    moved = OFFSET * normal(batch, 1, 12, 2) + JITTER * normal(batch, frames, 12, 2)
    poses = poses + noise * torch.cat((moved, UNSTEADY * normal(batch, frames, 1, 2)), dim=2)
    return _hold(poses, uniform)


def _hold(poses: Tensor, uniform: object) -> Tensor:
    """Let one point of some samples stand still, as a lost point does when it is carried on."""
    draw = uniform  # one generator for all draws keeps a seed reproducible
    assert callable(draw)
    batch, frames = poses.shape[:2]
    point = (draw(batch) * 12).long()
    first = (draw(batch) * (frames - LONGEST_HOLD)).long()
    length = (draw(batch) * LONGEST_HOLD).long() * (draw(batch) < HOLD)
    time = torch.arange(frames)
    inside = (time >= first[:, None]) & (time < (first + length)[:, None])  # (B, T)
    chosen = torch.nn.functional.one_hot(point, ROWS).bool()  # (B, 13), never the last
    held = poses[torch.arange(batch), first]  # (B, 13, 2)
    mask = (inside[:, :, None] & chosen[:, None, :])[..., None]
    return torch.where(mask, held[:, None], poses)
