"""One fit, epoch by epoch: Adam with step decay, the last epochs' weights averaged, kept after every epoch."""

from __future__ import annotations

import hashlib
from collections.abc import Callable, Iterator, Sequence
from dataclasses import asdict, dataclass
from typing import Any, Final, Literal, NamedTuple

import numpy as np
import torch
from torch import Tensor, nn
from torch.optim.swa_utils import AveragedModel

from anticipation.training.augmentation import augment
from anticipation.training.journal import Saved
from anticipation.training.run import Run
from anticipation.training.samples import Samples
from anticipation.training.whole_batch_norm import whole_batch_norms
from bridge.errors import SurefootError

DECAY_EVERY: Final = 16  # epochs (paper, III.B)
DECAY: Final = 0.3
LOWEST: Final = 0.1  # share of the rate at which a cosine ends
AVERAGED: Final = 0.4  # the last share of the epochs whose weights are averaged
GRAPH_FROZEN: Final = 4  # epochs before the incidence may learn (Shi et al. 2019 freeze it at first)
STEEPEST: Final = 5.0  # longest gradient that is followed

SharesOfBatch = Sequence[tuple[Samples, float]]
Progress = Callable[[float], None]
"""Called after each epoch with its mean loss."""


@dataclass(frozen=True, slots=True)
class Recipe:
    """How long and from what a network learns."""

    epochs: int
    draws: int  # samples an epoch
    batch: int = 128
    rate: float = 1e-3  # Adam's learning rate at the start (paper, III.B)
    seed: int = 0
    augmented: bool = True
    noise: float = 1.0  # of the augmentation, in its own units
    weight_decay: float = 0.0  # decoupled (Loshchilov and Hutter, ICLR 2019); 0 is plain Adam
    schedule: Literal["step", "cosine"] = "step"  # the paper's steps, or down to a tenth along a cosine


class Batch(NamedTuple):
    """This process's rows of a batch."""

    whole: int  # rows of all processes together
    poses: Tensor  # (B, 30, 13, 2)
    known: Tensor  # (B, 30)
    labels: Tensor  # (B, 16)

    @property
    def device(self) -> torch.device:
        """Where the rows are."""
        return self.poses.device


class Fit(NamedTuple):
    """What is fitted, and how its loss is found."""

    network: nn.Module
    loss: Callable[[nn.Module, Batch], Tensor]  # of the network, or of what stands in for it, on a batch
    generators: Sequence[torch.Generator] = ()  # that the loss draws from
    thaw: Callable[[bool], None] | None = None  # lets what was frozen at first learn too
    others: Sequence[nn.Module] = ()  # networks that the loss asks, whose weights stay


def draw_batches(
    shares: SharesOfBatch, recipe: Recipe, generator: torch.Generator
) -> Iterator[tuple[Tensor, Tensor, Tensor]]:
    """Yield one epoch of (poses (B, 30, 13, 2), known (B, 30), labels (B, 16)).

    Each source fills its share of every batch, so that batch norm sees the same mixture throughout.
    """
    total = sum(share for _, share in shares)
    for _ in range(max(1, recipe.draws // recipe.batch)):
        poses, known, labels = [], [], []
        for samples, share in shares:
            count = max(1, round(recipe.batch * share / total))
            index = torch.randint(len(samples), (count,), generator=generator).numpy()
            poses.append(samples.frames[index])
            known.append(samples.known[index])
            labels.append(samples.labels[index])
        yield (
            torch.from_numpy(np.concatenate(poses)),
            torch.from_numpy(np.concatenate(known)),
            torch.from_numpy(np.concatenate(labels)),
        )


def descend(fit: Fit, shares: SharesOfBatch, recipe: Recipe, progress: Progress, run: Run) -> None:
    """Run Adam with step decay; leave the mean of the last epochs' weights in the network, in evaluation mode.

    The mean lies where the loss is flat (Izmailov et al., "Averaging Weights Leads to Wider Optima and Better
    Generalization", UAI 2018): with 20 falls to learn from, one epoch's weights are a draw.

    Raises:
        SurefootError: the journal's state of this fit began otherwise, or the processes have different data.
    """
    for network in (fit.network, *fit.others):
        network.to(run.device)
    try:
        with whole_batch_norms(fit.network, run.team):
            _Descent(fit, shares, recipe, run).go(progress)
    finally:
        for network in (fit.network, *fit.others):
            network.to("cpu")
    fit.network.eval()


class _Descent:
    """The state of a fit between two epochs."""

    def __init__(self, fit: Fit, shares: SharesOfBatch, recipe: Recipe, run: Run) -> None:
        self._fit, self._shares, self._recipe, self._run = fit, shares, recipe, run
        self._fingerprint = self._agreed_fingerprint()
        self._drawn = torch.Generator().manual_seed(recipe.seed)
        # dropout draws from the global generator, and no two processes may draw the same
        torch.manual_seed(recipe.seed + 7919 * run.team.rank)
        fit.network.train()
        self._optimizer = torch.optim.AdamW(
            fit.network.parameters(), lr=recipe.rate, weight_decay=recipe.weight_decay
        )  # without decay of the weights it is Adam
        self._schedule = _schedule(self._optimizer, recipe)
        self._averaged = AveragedModel(fit.network, use_buffers=True)
        self._losses: list[float] = []

    def go(self, progress: Progress) -> None:
        """Do the epochs that are left."""
        if self._run.journal is not None:
            self._run.journal.begin(self._run.fit)
            saved = self._run.journal.read(self._run.fit, self._fingerprint)
            if saved is not None:
                self._restore(saved)
        for loss in self._losses:
            progress(loss)
        begin = len(self._losses)
        for epoch in range(begin, self._recipe.epochs):
            if self._fit.thaw is not None and epoch >= GRAPH_FROZEN:
                self._fit.thaw(True)
            if epoch in (begin, GRAPH_FROZEN):  # what is thawed before this has its gradients shared
                model = self._run.team.parallel(self._fit.network)
            rate = float(self._schedule.get_last_lr()[0])
            self._losses.append(self._epoch(model))
            self._schedule.step()
            if epoch >= min((1.0 - AVERAGED) * self._recipe.epochs, self._recipe.epochs - 1):
                self._averaged.update_parameters(self._fit.network)
            if self._run.journal is not None:
                self._run.journal.write(self._run.fit, self._state())
            if self._run.log is not None:
                self._run.log.note(self._run.fit, epoch, self._losses[-1], rate)
            progress(self._losses[-1])
        self._fit.network.load_state_dict(self._averaged.module.state_dict())

    def _epoch(self, model: nn.Module) -> float:
        """Go once through the draws; return the mean loss."""
        team, device = self._run.team, self._run.device
        losses = []
        for drawn, known, labels in draw_batches(self._shares, self._recipe, self._drawn):
            poses = augment(drawn, self._drawn, self._recipe.noise) if self._recipe.augmented else drawn
            own = (team.own(rows).to(device) for rows in (poses, known, labels))
            loss = self._fit.loss(model, Batch(len(poses), *own))
            self._optimizer.zero_grad(set_to_none=True)
            torch.autograd.backward(loss)
            nn.utils.clip_grad_norm_(self._fit.network.parameters(), STEEPEST)
            self._optimizer.step()
            losses.append(loss.detach())
        return float(team.total(torch.stack(losses).mean().cpu()).item()) / team.size

    def _agreed_fingerprint(self) -> str:
        """Say in one number what the fit starts from.

        Raises:
            SurefootError: the processes of the team do not start from the same.
        """
        if self._run.journal is None and self._run.team.size == 1:
            return ""
        found = fingerprint(self._fit, self._shares, self._recipe, self._run)
        leader = self._run.team.from_leader(found.encode())
        if leader != found.encode():
            raise SurefootError(
                f"process {self._run.team.rank} has other data or settings than process 0: "
                "every machine needs the same research data and the same command"
            )
        return found

    def _generators(self) -> list[torch.Generator]:
        return [self._drawn, *self._fit.generators]

    def _state(self) -> Saved:
        optimizer = self._optimizer.state_dict()
        tensors = {f"network/{name}": value for name, value in self._fit.network.state_dict().items()}
        tensors |= {f"averaged/{name}": value for name, value in self._averaged.state_dict().items()}
        for index, state in optimizer["state"].items():
            tensors |= {f"optimizer/{index}/{name}": value for name, value in state.items()}
        tensors |= {f"generator/{index}": one.get_state() for index, one in enumerate(self._generators())}
        tensors["dropout/cpu"] = self._run.team.gather(torch.get_rng_state())
        if self._run.device.type == "cuda":
            tensors["dropout/cuda"] = self._run.team.gather(torch.cuda.get_rng_state(self._run.device))
        facts: dict[str, Any] = {
            "fingerprint": self._fingerprint,
            "epoch": len(self._losses),
            "losses": self._losses,
            "rates": optimizer["param_groups"],
            "schedule": self._schedule.state_dict(),
        }
        return Saved(tensors, facts)

    def _restore(self, saved: Saved) -> None:
        def part(prefix: str) -> dict[str, Tensor]:
            return {
                name.removeprefix(prefix): value for name, value in saved.tensors.items() if name.startswith(prefix)
            }

        self._fit.network.load_state_dict(part("network/"))
        self._averaged.load_state_dict(part("averaged/"))
        moments: dict[int, dict[str, Tensor]] = {}
        for name, value in part("optimizer/").items():
            number, _, kind = name.partition("/")
            moments.setdefault(int(number), {})[kind] = value
        self._optimizer.load_state_dict({"state": moments, "param_groups": saved.facts["rates"]})
        self._schedule.load_state_dict(saved.facts["schedule"])
        for index, generator in enumerate(self._generators()):
            generator.set_state(saved.tensors[f"generator/{index}"])
        rank = self._run.team.rank
        # a clone, because torch reads a state from the start of its storage, and the second row's is the first's
        torch.set_rng_state(saved.tensors["dropout/cpu"][rank].clone())
        if self._run.device.type == "cuda":
            torch.cuda.set_rng_state(saved.tensors["dropout/cuda"][rank].clone(), self._run.device)
        self._losses = [float(loss) for loss in saved.facts["losses"]]


def _schedule(optimizer: torch.optim.Optimizer, recipe: Recipe) -> torch.optim.lr_scheduler.LRScheduler:
    if recipe.schedule == "cosine":
        lowest = LOWEST * recipe.rate
        return torch.optim.lr_scheduler.CosineAnnealingLR(optimizer, max(1, recipe.epochs), eta_min=lowest)
    return torch.optim.lr_scheduler.StepLR(optimizer, DECAY_EVERY, DECAY)


def fingerprint(fit: Fit, shares: SharesOfBatch, recipe: Recipe, run: Run) -> str:
    """Digest of all that the result of a fit depends on but the code: weights, data, settings, torch, processes."""
    digest = hashlib.sha256(repr((asdict(recipe), run.team.size, run.device.type, torch.__version__)).encode())
    for network in (fit.network, *fit.others):
        for name, value in network.state_dict().items():
            digest.update(name.encode())
            digest.update(value.detach().cpu().contiguous().numpy().tobytes())
    for samples, share in shares:
        digest.update(repr((share, samples.frames.shape)).encode())
        for array in (samples.frames, samples.known, samples.labels):
            digest.update(np.ascontiguousarray(array).data)
    return digest.hexdigest()
