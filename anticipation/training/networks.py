"""Networks made by a plan: built from a seed, pre-trained on mocap, fitted to people."""

from __future__ import annotations

import copy
from collections.abc import Iterator
from contextlib import contextmanager

import torch
from rich.progress import BarColumn, MofNCompleteColumn, Progress, TextColumn, TimeElapsedColumn
from torch import nn

from anticipation.gait_state import DirectedGraphNetwork
from anticipation.motion import FORECASTERS, Forecast
from anticipation.training import fitting
from anticipation.training.corpus import Shares
from anticipation.training.plan import Plan
from anticipation.training.run import ALONE, Run
from anticipation.training.shifted import ShiftedNetwork


@contextmanager
def progress_bars(shown: bool = True) -> Iterator[Progress]:
    """Show one bar for each fit, with its newest loss."""
    columns = (
        TextColumn("{task.description:<32}"),
        BarColumn(bar_width=24),
        MofNCompleteColumn(),
        TextColumn("{task.fields[loss]}"),
        TimeElapsedColumn(),
    )
    with Progress(*columns, disable=not shown) as progress:
        yield progress


def _reporter(progress: Progress, what: str, epochs: int) -> fitting.Progress:
    task = progress.add_task(what, total=epochs, loss="")

    def report(loss: float) -> None:
        progress.update(task, advance=1, loss=f"loss {loss:.4f}")

    return report


def pretrained_forecaster(plan: Plan, shares: Shares, progress: Progress, run: Run = ALONE) -> nn.Module:
    """Build the plan's forecaster and fit it to people who walk."""
    torch.manual_seed(plan.pretrain.seed)
    network: nn.Module = FORECASTERS[plan.forecaster]()
    what = f"{plan.forecaster}: walking"
    report = _reporter(progress, what, plan.pretrain.epochs)
    fitting.fit_forecaster(network, [(shares.walks, 1.0)], plan.pretrain, report, run.named(what))
    return network


def tuned_forecaster(
    pretrained: nn.Module, plan: Plan, shares: Shares, name: str, progress: Progress, run: Run = ALONE
) -> nn.Module:
    """Fit a copy of a pre-trained forecaster to people who fall."""
    network = copy.deepcopy(pretrained)
    what = f"{name}: {plan.forecaster}"
    report = _reporter(progress, what, plan.finetune.epochs)
    fitting.fit_forecaster(network, shares.motion, plan.finetune, report, run.named(what))
    return network.requires_grad_(False)


def fitted_classifier(
    plan: Plan, shares: Shares, forecast: Forecast | None, name: str, progress: Progress, run: Run = ALONE
) -> DirectedGraphNetwork:
    """Fit a classifier, on forecast windows too if a forecast is given."""
    recipe = plan.baseline if forecast is None else plan.classifier
    torch.manual_seed(recipe.seed)
    network = DirectedGraphNetwork()
    what = f"{name}: dgnn{'' if forecast is None else ' on forecasts'}"
    report = _reporter(progress, what, recipe.epochs)
    fitting.fit_classifier(network, shares.gait, recipe, forecast, report, run.named(what))
    return network.requires_grad_(False)


def fitted_shifted(plan: Plan, shares: Shares, name: str, progress: Progress) -> ShiftedNetwork:
    """Fit the paper's baseline, DGNN-only."""
    torch.manual_seed(plan.baseline.seed)
    network = ShiftedNetwork()
    report = _reporter(progress, f"{name}: dgnn, shifted labels", plan.baseline.epochs)
    fitting.fit_shifted(network, shares.gait, plan.baseline, report)
    return network.requires_grad_(False)
