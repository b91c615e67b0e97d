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
from anticipation.outlook import Outlook
from anticipation.training import fitting
from anticipation.training.corpus import Shares
from anticipation.training.plan import Plan
from anticipation.training.run import ALONE, Run
from anticipation.training.shifted import ShiftedNetwork
from bridge.command_line.output import progress as bars


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
    with bars(*columns, transient=False) if shown else Progress(disable=True) as progress:
        yield progress


def _reporter(progress: Progress, what: str, epochs: int) -> fitting.Progress:
    task = progress.add_task(what, total=epochs, loss="")

    def report(loss: float) -> None:
        progress.update(task, advance=1, loss=f"loss {loss:.4f}")

    return report


def pretrained_forecaster(plan: Plan, shares: Shares, progress: Progress, run: Run = ALONE) -> nn.Module:
    """Build the plan's forecaster and fit it to people who walk."""
    torch.manual_seed(plan.pretrain.seed)
    network: nn.Module = FORECASTERS[plan.forecaster](**plan.settings)
    name = f"walking: {plan.forecaster}"
    report = _reporter(progress, name, plan.pretrain.epochs)
    fitting.fit_forecaster(network, [(shares.walks, 1.0)], plan.pretrain, report, run.named(name))
    return network


def tuned_forecaster(
    pretrained: nn.Module, plan: Plan, shares: Shares, name: str, progress: Progress, run: Run = ALONE
) -> nn.Module:
    """Fit a copy of a pre-trained forecaster to people who fall."""
    network = copy.deepcopy(pretrained)
    name = f"{name}: {plan.forecaster}"
    report = _reporter(progress, name, plan.finetune.epochs)
    fitting.fit_forecaster(network, shares.motion, plan.finetune, report, run.named(name))
    return network.requires_grad_(False)


def fitted_classifier(
    plan: Plan, shares: Shares, forecast: Forecast, name: str, progress: Progress, run: Run = ALONE
) -> DirectedGraphNetwork:
    """Fit the classifier, on forecast windows if the plan says so."""
    recipe = plan.classifier
    torch.manual_seed(recipe.seed)
    network = DirectedGraphNetwork(centre=plan.centre)
    name = f"{name}: dgnn{' on forecasts' if plan.on_forecasts else ''}"
    report = _reporter(progress, name, recipe.epochs)
    foreseen = forecast if plan.on_forecasts else None
    fitting.fit_classifier(network, shares.gait, recipe, foreseen, report, run.named(name))
    return network.requires_grad_(False)


def fitted_outlook(plan: Plan, shares: Shares, name: str, progress: Progress, run: Run = ALONE) -> Outlook | None:
    """Fit the second opinion, if the plan has one."""
    if plan.outlook is None:
        return None
    torch.manual_seed(plan.outlook.seed)
    network = Outlook()
    name = f"{name}: outlook"
    report = _reporter(progress, name, plan.outlook.epochs)
    fitting.fit_outlook(network, shares.gait, plan.outlook, report, run.named(name))
    return network.requires_grad_(False)


def fitted_shifted(plan: Plan, shares: Shares, name: str, progress: Progress, run: Run = ALONE) -> ShiftedNetwork:
    """Fit the paper's baseline, DGNN-only."""
    torch.manual_seed(plan.baseline.seed)
    network = ShiftedNetwork()
    name = f"{name}: dgnn, shifted labels"
    report = _reporter(progress, name, plan.baseline.epochs)
    fitting.fit_shifted(network, shares.gait, plan.baseline, report, run.named(name))
    return network.requires_grad_(False)
