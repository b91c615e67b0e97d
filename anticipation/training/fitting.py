"""Fit the forecaster and the classifier: what each learns from a batch. How the learning goes on is in `descent`.

Every epoch draws samples with replacement, each source with its share, so that 1,800 windows of
falls are not drowned by 60,000 of walking.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Final

import numpy as np
import torch
from numpy.typing import NDArray
from torch import Tensor, nn

from anticipation.gait_state import DirectedGraphNetwork
from anticipation.motion import HORIZON, WINDOW, Forecast
from anticipation.outlook import Outlook
from anticipation.training.clips import UNLABELLED
from anticipation.training.descent import Batch, Fit, Progress, Recipe, SharesOfBatch, descend
from anticipation.training.measures import STEPS
from anticipation.training.run import ALONE, Run
from anticipation.training.shifted import ShiftedNetwork
from anticipation.training.team import Team

__all__ = ["Progress", "Recipe", "apply", "fit_classifier", "fit_forecaster", "fit_outlook", "fit_shifted"]

SMOOTH_L1_AT: Final = 0.05  # where the loss turns from square to absolute [body lengths]


def silent(loss: float) -> None:
    """Report nothing."""
    del loss


def fit_forecaster(
    network: nn.Module, shares: SharesOfBatch, recipe: Recipe, progress: Progress = silent, run: Run = ALONE
) -> None:
    """Fit a forecaster to the futures that are known, with smooth L1."""

    def loss(model: nn.Module, batch: Batch) -> Tensor:
        error = nn.functional.smooth_l1_loss(
            model(batch.poses[:, :WINDOW]), batch.poses[:, WINDOW:], beta=SMOOTH_L1_AT, reduction="none"
        )
        there = batch.known[:, WINDOW:, None, None].expand_as(error)
        return run.team.mean(error, there)

    descend(Fit(network, loss), shares, recipe, progress, run)


def fit_classifier(
    network: DirectedGraphNetwork,
    shares: SharesOfBatch,
    recipe: Recipe,
    forecast: Forecast | None = None,
    progress: Progress = silent,
    run: Run = ALONE,
) -> None:
    """Fit a classifier with cross-entropy, one window of each sample at a time.

    With `forecast` the window ends a random number of steps after the present, and what lies after the present is
    foreseen: the network learns the forecaster's mistakes along with the person's motion. A quarter of the windows
    end at the present. Without, all do.
    """

    def loss(model: nn.Module, batch: Batch) -> Tensor:
        seen = batch.poses[:, :WINDOW]
        if forecast is None:
            return cross_entropy(model(seen), batch.labels[:, :1], run.team)
        with torch.no_grad():
            frames = torch.cat((seen, forecast(seen)), dim=1)
        ends = torch.randint(-(HORIZON // 3), HORIZON + 1, (batch.whole,), generator=steps).clamp(min=0)
        ends = run.team.own(ends).to(batch.device)
        rows = torch.arange(len(frames), device=batch.device)[:, None]
        windows = frames[rows, ends[:, None] + torch.arange(WINDOW, device=batch.device)]
        return cross_entropy(model(windows), batch.labels.gather(1, ends[:, None]), run.team)

    steps = torch.Generator().manual_seed(recipe.seed)
    network.set_graph_trainable(False)
    others = [forecast] if isinstance(forecast, nn.Module) else []
    descend(Fit(network, loss, [steps], network.set_graph_trainable, others), shares, recipe, progress, run)


def fit_outlook(
    network: Outlook, shares: SharesOfBatch, recipe: Recipe, progress: Progress = silent, run: Run = ALONE
) -> None:
    """Fit the second opinion: the window seen, the labels of the present and of all steps ahead."""

    def loss(model: nn.Module, batch: Batch) -> Tensor:
        return cross_entropy(model(batch.poses[:, :WINDOW]), batch.labels, run.team)

    descend(Fit(network, loss), shares, recipe, progress, run)


def fit_shifted(
    network: ShiftedNetwork, shares: SharesOfBatch, recipe: Recipe, progress: Progress = silent, run: Run = ALONE
) -> None:
    """Fit DGNN-only: the window seen, the labels of the present and of each shift."""

    def loss(model: nn.Module, batch: Batch) -> Tensor:
        return cross_entropy(model(batch.poses[:, :WINDOW]), batch.labels[:, list(STEPS)], run.team)

    network.set_graph_trainable(False)
    descend(Fit(network, loss, thaw=network.set_graph_trainable), shares, recipe, progress, run)


def cross_entropy(logits: Tensor, labels: Tensor, team: Team) -> Tensor:
    """Mean cross-entropy of logits (B, T, 3) over the labels (B, T) that are known."""
    each = nn.functional.cross_entropy(logits.mT, labels, ignore_index=UNLABELLED, reduction="none")
    return team.mean(each, labels != UNLABELLED)


@torch.no_grad()
def apply(network: Callable[[Tensor], Tensor], frames: NDArray[np.float32], batch: int = 256) -> NDArray[np.float32]:
    """Run a network over arrays (M, ...) in batches."""
    parts = [network(torch.from_numpy(frames[first : first + batch])).numpy() for first in range(0, len(frames), batch)]
    return np.concatenate(parts)
