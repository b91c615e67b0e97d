"""The states to come, read from the present alone: a small second opinion beside forecast and classifier.

The classifier judges windows that the forecaster has foreseen; this network judges all sixteen steps from the window
that was seen, as the paper's DGNN-only does for one. They err differently, and the mean of their logits errs less.
"""

from __future__ import annotations

from typing import Final

import torch
from torch import Tensor, nn

from anticipation.gait_state import CLASS_COUNT
from anticipation.motion import HORIZON, ROWS, WINDOW, Settings

JUDGED: Final = HORIZON + 1  # the present and every step ahead


class Outlook(nn.Module):
    """Logits of the present and the next fifteen steps: (B, 15, 13, 2) -> (B, 16, 3)."""

    def __init__(self, width: int = 64, dropout: float = 0.5) -> None:
        super().__init__()
        self.settings: Settings = {"width": width, "dropout": dropout}
        entering = WINDOW * ROWS * 2
        self.enter_norm = nn.BatchNorm1d(entering)
        self.enter = nn.Linear(entering, width, bias=False)
        self.first_norm = nn.BatchNorm1d(width)
        self.middle = nn.Linear(width, width, bias=False)
        self.second_norm = nn.BatchNorm1d(width)
        self.dropout = nn.Dropout(dropout)
        self.head = nn.Linear(width, JUDGED * CLASS_COUNT)

    def forward(self, window: Tensor) -> Tensor:
        """Logits (B, 16, 3) of windows (B, 15, 13, 2)."""
        x = self.enter(self.enter_norm(window.flatten(1)))
        x = self.dropout(torch.relu(self.first_norm(x)))
        x = self.dropout(torch.relu(self.second_norm(self.middle(x))))
        logits: Tensor = self.head(x).view(-1, JUDGED, CLASS_COUNT)
        return logits


class FastOutlook:
    """`Outlook` in evaluation mode with its norms folded in; it keeps copies of the weights."""

    def __init__(self, network: Outlook) -> None:
        with torch.no_grad():
            scale, shift = _affine(network.enter_norm)
            norm, offset = _affine(network.first_norm)
            weight = network.enter.weight * norm[:, None]
            self._enter = (weight * scale).T.contiguous(), weight @ shift + offset
            norm, offset = _affine(network.second_norm)
            self._middle = (network.middle.weight * norm[:, None]).T.contiguous(), offset
            self._head = network.head.weight.T.contiguous(), network.head.bias.clone()

    def __call__(self, window: Tensor) -> Tensor:
        """Logits (B, 16, 3) of windows (B, 15, 13, 2)."""
        x = window.flatten(1)
        for weight, bias in (self._enter, self._middle):
            x = torch.addmm(bias, x, weight).relu_()
        weight, bias = self._head
        return torch.addmm(bias, x, weight).view(-1, JUDGED, CLASS_COUNT)


def _affine(norm: nn.BatchNorm1d) -> tuple[Tensor, Tensor]:
    """Batch norm in evaluation mode as x * scale + shift, each (C,)."""
    assert norm.running_mean is not None and norm.running_var is not None  # noqa: PT018
    scale = norm.weight / torch.sqrt(norm.running_var + norm.eps)
    return scale, norm.bias - norm.running_mean * scale
