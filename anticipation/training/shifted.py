"""DGNN-only: the paper's baseline, which learns the future's label from the present's window (II.D).

The paper trains one network for each shift. Here the shifts share one network and have a head each,
which costs a sixth.
"""

from __future__ import annotations

import torch
from torch import Tensor, nn

from anticipation.gait_state import CLASS_COUNT, DirectedGraphNetwork
from anticipation.motion import WINDOW
from anticipation.training.measures import STEPS


class ShiftedNetwork(nn.Module):
    """Logits of the states now and 100, ..., 500 ms ahead: (B, T >= 15, 13, 2) -> (B, 6, 3), from the newest
    window, of which it looks at the keypoints alone."""

    def __init__(self) -> None:
        super().__init__()
        self.trunk = DirectedGraphNetwork()
        self.heads = nn.ModuleList(nn.Linear(self.trunk.head.in_features, CLASS_COUNT) for _ in STEPS)

    def set_graph_trainable(self, trainable: bool) -> None:
        """Let the incidence offsets learn, or freeze them."""
        self.trunk.set_graph_trainable(trainable)

    def forward(self, frames: Tensor) -> Tensor:
        """Logits (B, 6, 3) of the last 15 of frames (B, T, 13, 2)."""
        pooled = self.trunk.dropout(self.trunk.embedding(frames[:, -WINDOW:])[:, -1])  # (B, 128)
        return torch.stack([head(pooled) for head in self.heads], dim=1)
