"""Batch norm over the rows of all processes; torch's own (`SyncBatchNorm`) runs on GPUs only."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
from typing import Any, Final

import torch
import torch.distributed as dist
from torch import Tensor, nn

from anticipation.training.team import Team

NORM_DIMENSIONS: Final = (0, 2, 3)  # of (B, C, H, W): all but the channel


class _Sum(torch.autograd.Function):
    """Sum over the processes; the gradient is summed as well."""

    @staticmethod
    def forward(_context: Any, value: Tensor) -> Tensor:
        summed = value.clone()
        dist.all_reduce(summed)
        return summed

    @staticmethod
    def backward(_context: Any, *gradients: Tensor) -> Tensor:
        summed = gradients[0].clone()
        dist.all_reduce(summed)
        return summed


class WholeBatchNorm(nn.BatchNorm2d):
    """`BatchNorm2d` whose mean and variance are those of the whole batch."""

    def forward(self, x: Tensor) -> Tensor:
        """Normalise (B, C, H, W)."""
        if not self.training:
            return super().forward(x)
        count = _sum(x.new_tensor(x.numel() / x.shape[1]))
        mean = _sum(x.sum(NORM_DIMENSIONS)) / count
        centred = x - mean[:, None, None]
        variance = _sum(centred.square().sum(NORM_DIMENSIONS)) / count
        if self.running_mean is not None and self.running_var is not None and self.num_batches_tracked is not None:
            with torch.no_grad():
                self.num_batches_tracked.add_(1)
                self.running_mean.lerp_(mean, self.momentum or 0.0)
                self.running_var.lerp_(variance * count / (count - 1), self.momentum or 0.0)
        scale = self.weight / torch.sqrt(variance + self.eps)
        return centred * scale[:, None, None] + self.bias[:, None, None]


def _sum(value: Tensor) -> Tensor:
    summed: Tensor = _Sum.apply(value)  # type: ignore[no-untyped-call]
    return summed


@contextmanager
def whole_batch_norms(network: nn.Module, team: Team) -> Iterator[None]:
    """Let the batch norms of a network see the whole batch while it is fitted; parameters and buffers stay the same."""
    norms = [module for module in network.modules() if type(module) is nn.BatchNorm2d] if team.size > 1 else []
    for norm in norms:
        norm.__class__ = WholeBatchNorm
    try:
        yield
    finally:
        for norm in norms:
            norm.__class__ = nn.BatchNorm2d
