"""Fit the forecaster and the classifier: Adam, step decay, fixed seeds, one thread.

Every epoch draws samples with replacement, each source with its share, so that 1,800 windows of
falls are not drowned by 60,000 of walking.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from typing import Final

import numpy as np
import torch
from numpy.typing import NDArray
from torch import Tensor, nn
from torch.optim.swa_utils import AveragedModel

from anticipation.gait_state import DirectedGraphNetwork
from anticipation.motion import HORIZON, WINDOW, Forecast
from anticipation.training.augmentation import augment
from anticipation.training.clips import UNLABELLED
from anticipation.training.measures import STEPS
from anticipation.training.samples import Samples
from anticipation.training.shifted import ShiftedNetwork

DECAY_EVERY: Final = 16  # epochs (paper, III.B)
DECAY: Final = 0.3
SMOOTH_L1_AT: Final = 0.05  # where the loss turns from square to absolute [body lengths]
AVERAGED: Final = 0.4  # the last share of the epochs whose weights are averaged
GRAPH_FROZEN: Final = 4  # epochs before the incidence may learn (Shi et al. 2019 freeze it at first)


@dataclass(frozen=True, slots=True)
class Recipe:
    """How long and from what a network learns."""

    epochs: int
    draws: int  # samples an epoch
    batch: int = 128
    rate: float = 1e-3  # Adam's learning rate at the start (paper, III.B)
    seed: int = 0
    augmented: bool = True


Progress = Callable[[float], None]
"""Called after each epoch with its mean loss."""


def silent(loss: float) -> None:
    """Report nothing."""
    del loss


def draw_batches(
    shares: Sequence[tuple[Samples, float]], recipe: Recipe, generator: torch.Generator
) -> Iterator[tuple[Tensor, Tensor, Tensor]]:
    """Yield one epoch of (poses (B, 30, 12, 2), known (B, 30), labels (B, 16)).

    Each source fills its share of every batch, so that batch norm sees the same mixture throughout.
    """
    total = sum(share for _, share in shares)
    for _ in range(max(1, recipe.draws // recipe.batch)):
        poses, known, labels = [], [], []
        for samples, share in shares:
            count = max(1, round(recipe.batch * share / total))
            index = torch.randint(len(samples), (count,), generator=generator).numpy()
            poses.append(samples.poses[index])
            known.append(samples.known[index])
            labels.append(samples.labels[index])
        yield (
            torch.from_numpy(np.concatenate(poses)),
            torch.from_numpy(np.concatenate(known)),
            torch.from_numpy(np.concatenate(labels)),
        )


def fit_forecaster(
    network: nn.Module, shares: Sequence[tuple[Samples, float]], recipe: Recipe, progress: Progress = silent
) -> None:
    """Fit a forecaster to the futures that are known, with smooth L1."""

    def loss(poses: Tensor, known: Tensor, labels: Tensor) -> Tensor:
        del labels
        error = nn.functional.smooth_l1_loss(
            network(poses[:, :WINDOW]), poses[:, WINDOW:], beta=SMOOTH_L1_AT, reduction="none"
        )
        there = known[:, WINDOW:, None, None].expand_as(error)
        return error[there].mean()

    _descend(network, loss, shares, recipe, progress)


def fit_classifier(
    network: DirectedGraphNetwork,
    shares: Sequence[tuple[Samples, float]],
    recipe: Recipe,
    forecast: Forecast | None = None,
    progress: Progress = silent,
) -> None:
    """Fit a classifier with cross-entropy, one window of each sample at a time.

    With `forecast` the window ends a random number of steps after the present, and what lies after the present is
    foreseen: the network learns the forecaster's mistakes along with the person's motion. A quarter of the windows
    end at the present. Without, all do.
    """

    def loss(poses: Tensor, known: Tensor, labels: Tensor) -> Tensor:
        del known
        seen = poses[:, :WINDOW]
        if forecast is None:
            return cross_entropy(network(seen), labels[:, :1])
        with torch.no_grad():
            frames = torch.cat((seen, forecast(seen)), dim=1)
        ends = torch.randint(-(HORIZON // 3), HORIZON + 1, (len(frames),), generator=steps).clamp(min=0)
        rows = torch.arange(len(frames))[:, None]
        windows = frames[rows, ends[:, None] + torch.arange(WINDOW)]
        return cross_entropy(network(windows), labels.gather(1, ends[:, None]))

    steps = torch.Generator().manual_seed(recipe.seed)
    network.set_graph_trainable(False)
    _descend(network, loss, shares, recipe, progress, network.set_graph_trainable)


def fit_shifted(
    network: ShiftedNetwork, shares: Sequence[tuple[Samples, float]], recipe: Recipe, progress: Progress = silent
) -> None:
    """Fit DGNN-only: the window seen, the labels of the present and of each shift."""

    def loss(poses: Tensor, known: Tensor, labels: Tensor) -> Tensor:
        del known
        return cross_entropy(network(poses[:, :WINDOW]), labels[:, list(STEPS)])

    network.set_graph_trainable(False)
    _descend(network, loss, shares, recipe, progress, network.set_graph_trainable)


def cross_entropy(logits: Tensor, labels: Tensor) -> Tensor:
    """Mean cross-entropy of logits (B, T, 3) over the labels (B, T) that are known."""
    return nn.functional.cross_entropy(logits.flatten(0, 1), labels.flatten(), ignore_index=UNLABELLED)


def _descend(
    network: nn.Module,
    loss_of: Callable[[Tensor, Tensor, Tensor], Tensor],
    shares: Sequence[tuple[Samples, float]],
    recipe: Recipe,
    progress: Progress,
    thaw: Callable[[bool], None] | None = None,
) -> None:
    """Run Adam with step decay; leave the mean of the last epochs' weights in the network, in evaluation mode.

    The mean lies where the loss is flat (Izmailov et al., "Averaging Weights Leads to Wider Optima and Better
    Generalization", UAI 2018): with 20 falls to learn from, one epoch's weights are a draw.
    """
    generator = torch.Generator().manual_seed(recipe.seed)
    torch.manual_seed(recipe.seed)  # dropout draws from the global generator
    optimizer = torch.optim.Adam(network.parameters(), lr=recipe.rate)
    schedule = torch.optim.lr_scheduler.StepLR(optimizer, DECAY_EVERY, DECAY)
    network.train()
    averaged = AveragedModel(network, use_buffers=True)
    for epoch in range(recipe.epochs):
        if thaw is not None and epoch == GRAPH_FROZEN:
            thaw(True)
        losses = []
        for poses, known, labels in draw_batches(shares, recipe, generator):
            loss = loss_of(augment(poses, generator) if recipe.augmented else poses, known, labels)
            optimizer.zero_grad(set_to_none=True)
            torch.autograd.backward(loss)
            nn.utils.clip_grad_norm_(network.parameters(), 5.0)
            optimizer.step()
            losses.append(loss.item())
        schedule.step()
        if epoch >= (1.0 - AVERAGED) * recipe.epochs:
            averaged.update_parameters(network)
        progress(float(np.mean(losses)))
    network.load_state_dict(averaged.module.state_dict())
    network.eval()


@torch.no_grad()
def apply(network: Callable[[Tensor], Tensor], frames: NDArray[np.float32], batch: int = 256) -> NDArray[np.float32]:
    """Run a network over arrays (M, ...) in batches."""
    parts = [network(torch.from_numpy(frames[first : first + batch])).numpy() for first in range(0, len(frames), batch)]
    return np.concatenate(parts)
