"""The processes that share one fit, each with its part of every batch.

Started with `torchrun`, every process reads the same data and draws the same batches; each computes on its own rows,
and gradients, means and batch-norm statistics are those of the whole batch. What comes out is what one process would
have found, up to the order of the sums (and to dropout, whose masks are drawn for each process by itself).
"""

from __future__ import annotations

import os
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass

import torch
import torch.distributed as dist
from torch import Tensor, nn
from torch.nn.parallel import DistributedDataParallel

from bridge.errors import SurefootError


@dataclass(frozen=True, slots=True)
class Team:
    """One process among `size`; the default is a process by itself."""

    rank: int = 0
    size: int = 1

    @property
    def leads(self) -> bool:
        """Whether this process writes files and talks to the user."""
        return self.rank == 0

    def own(self, drawn: Tensor) -> Tensor:
        """Return this process's rows of a tensor that was drawn for the whole batch."""
        return drawn[self.rank :: self.size] if self.size > 1 else drawn

    def mean(self, values: Tensor, there: Tensor) -> Tensor:
        """Mean of `values` where the mask `there` is true, over the rows of all processes.

        What each process returns is its part, scaled so that the mean over the processes, which is what the gradients
        are given, is the mean over the whole batch however unevenly the mask divides it. 0 where nothing is there.
        """
        count = self.total(there.sum().float())
        return torch.where(there, values, 0.0).sum() * self.size / count.clamp(min=1)

    def total(self, value: Tensor) -> Tensor:
        """Sum of a tensor over the processes, without gradient."""
        if self.size == 1:
            return value.detach()
        summed = value.detach().clone()
        dist.all_reduce(summed)
        return summed

    def parallel(self, network: nn.Module) -> nn.Module:
        """Return what to call in place of `network` so that its gradients are the mean over the processes.

        Parameters that are frozen now are left out: call again after thawing them.
        """
        return network if self.size == 1 else DistributedDataParallel(network)

    def gather(self, own: Tensor) -> Tensor:
        """Return the tensors of all processes, which have the same shape, stacked by rank."""
        if self.size == 1:
            return own[None]
        parts = [torch.empty_like(own) for _ in range(self.size)]
        dist.all_gather(parts, own)
        return torch.stack(parts)

    def from_leader(self, content: bytes | None) -> bytes | None:
        """Return the bytes that the leading process gave; what the others give is ignored."""
        if self.size == 1:
            return content
        length = torch.tensor([-1 if content is None or not self.leads else len(content)])
        dist.broadcast(length, 0)
        if length.item() < 0:
            return None
        buffer = torch.empty(int(length.item()), dtype=torch.uint8)
        if self.leads and content is not None:
            buffer.copy_(torch.frombuffer(bytearray(content), dtype=torch.uint8))
        dist.broadcast(buffer, 0)
        return buffer.numpy().tobytes()


@contextmanager
def joined(device: torch.device) -> Iterator[tuple[Team, torch.device]]:
    """Join the processes that `torchrun` started, or stay alone; yields the team and this process's device.

    Raises:
        SurefootError: the other processes cannot be reached.
    """
    size = int(os.environ.get("WORLD_SIZE", "1"))
    if size == 1:
        yield Team(), device
        return
    on_gpu = device.type == "cuda"
    if on_gpu:
        device = torch.device("cuda", int(os.environ.get("LOCAL_RANK", "0")))
        torch.cuda.set_device(device)
    try:
        dist.init_process_group("cuda:nccl,cpu:gloo" if on_gpu else "gloo")
    except (RuntimeError, ValueError) as error:
        raise SurefootError(f"cannot join the {size} processes of this run: {str(error).splitlines()[0]}") from error
    try:
        yield Team(dist.get_rank(), size), device
    finally:
        dist.destroy_process_group()
