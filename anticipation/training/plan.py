"""How much is learnt from how much: one plan for real use, one small enough for a test."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Final, Literal

from anticipation.training.fitting import Recipe

ForecasterName = Literal["lstm", "dct_mlp"]


@dataclass(frozen=True, slots=True)
class Plan:
    """Sizes of the data drawn and of each fit."""

    forecaster: ForecasterName
    mocap_clips: int
    pretrain: Recipe  # forecaster on mocap
    finetune: Recipe  # forecaster on filmed people
    classifier: Recipe  # on forecast windows
    baseline: Recipe  # the networks it is compared with

    def seeded(self, seed: int) -> Plan:
        """Return the plan with `seed` in every recipe."""
        return replace(
            self,
            pretrain=replace(self.pretrain, seed=seed),
            finetune=replace(self.finetune, seed=seed),
            classifier=replace(self.classifier, seed=seed),
            baseline=replace(self.baseline, seed=seed),
        )

    def lasting(self, epochs: int) -> Plan:
        """Return the plan with another number of epochs for the classifier."""
        return replace(self, classifier=replace(self.classifier, epochs=epochs))


FULL: Final = {
    "dct_mlp": Plan(
        forecaster="dct_mlp",
        mocap_clips=600,
        pretrain=Recipe(epochs=12, draws=5120),
        finetune=Recipe(epochs=16, draws=2048),
        classifier=Recipe(epochs=16, draws=2048),
        baseline=Recipe(epochs=16, draws=2048),
    ),
    "lstm": Plan(
        forecaster="lstm",
        mocap_clips=600,
        pretrain=Recipe(epochs=8, draws=8192),
        finetune=Recipe(epochs=4, draws=2048),
        classifier=Recipe(epochs=16, draws=2048),
        baseline=Recipe(epochs=16, draws=2048),
    ),
}

QUICK: Final = {
    "dct_mlp": Plan(
        forecaster="dct_mlp",
        mocap_clips=8,
        pretrain=Recipe(epochs=2, draws=128, batch=64),
        finetune=Recipe(epochs=2, draws=128, batch=64),
        classifier=Recipe(epochs=8, draws=192, batch=32, rate=3e-3),
        baseline=Recipe(epochs=2, draws=128, batch=32, rate=3e-3),
    ),
    "lstm": Plan(
        forecaster="lstm",
        mocap_clips=8,
        pretrain=Recipe(epochs=1, draws=64, batch=32),
        finetune=Recipe(epochs=1, draws=64, batch=32),
        classifier=Recipe(epochs=8, draws=192, batch=32, rate=3e-3),
        baseline=Recipe(epochs=2, draws=128, batch=32, rate=3e-3),
    ),
}


def plan_for(forecaster: ForecasterName, seed: int, quick: bool, epochs: int | None = None) -> Plan:
    """Return the plan that the options ask for."""
    plan = (QUICK if quick else FULL)[forecaster].seeded(seed)
    return plan if epochs is None else plan.lasting(epochs)
