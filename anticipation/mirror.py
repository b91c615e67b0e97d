"""The same motion seen in a mirror: left and right exchanged."""

from __future__ import annotations

import torch
from torch import Tensor

from perception.skeleton import MIRROR

_SWAP = torch.cat((torch.from_numpy(MIRROR.copy()).long(), torch.tensor([len(MIRROR)])))  # the centre stays
_FLIP = torch.tensor([-1.0, 1.0])


def mirrored(poses: Tensor) -> Tensor:
    """Return frames (..., 13, 2), or poses (..., 12, 2), with x negated and left and right keypoints exchanged."""
    return poses[..., _SWAP[: poses.shape[-2]], :] * _FLIP
