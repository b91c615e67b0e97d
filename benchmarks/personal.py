"""How near to what a simulated person likes `surefoot personalise` comes, beside proposals drawn at random.

    python -m benchmarks.personal --people 32 --json runs/bench/personal.json

A person has an optimum somewhere in the box of proposals and a discomfort that grows with the distance from it, along
each parameter at a rate of their own. What they feel carries noise; what differs too little feels the same.
"""

from __future__ import annotations

import argparse
import json
import sys
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from bridge.config.surefoot import SurefootConfig
from bridge.messages import Floats
from controller.personal.proposals import space_of
from controller.personal.search import (
    COMPARISONS_PER_PARAMETER,
    Plan,
    Question,
    first_settings,
    liked,
    next_question,
)
from controller.personal.space import Space
from controller.personal.surrogate import Answer, Felt

CHARACTERS = {"sure": (0.0, 0.0), "attentive": (0.05, 0.03), "wavering": (0.10, 0.05)}  # noise, too little to feel
AXES = {"forward": ("forward",), "forward, left": ("forward", "left"), "all": ("forward", "left", "yaw")}


@dataclass(frozen=True)
class Person:
    """Somebody who likes one setting best. Discomforts are in sides of the box."""

    optimum: Floats  # (d,) values
    rates: Floats  # (d,) how fast discomfort grows along each parameter
    noise: float  # standard deviation of what is felt of a difference
    same: float  # least difference that is felt

    def answer(self, space: Space, first: Floats, second: Floats, rng: np.random.Generator) -> Felt:
        lead = self._discomfort(space, second) - self._discomfort(space, first) + self.noise * rng.normal()
        if abs(lead) <= self.same:
            return Felt.SAME
        return Felt.FIRST if lead > 0 else Felt.SECOND

    def _discomfort(self, space: Space, values: Floats) -> float:
        apart = space.unit(values) - space.unit(self.optimum)
        return float(np.sqrt(np.sum(self.rates * apart**2)))


def people(space: Space, character: str, count: int, seed: int = 0) -> Iterator[Person]:
    rng = np.random.default_rng((seed, 17))
    noise, same = CHARACTERS[character]
    optima = space.draw(64 * count, rng)
    for k in range(count):
        yield Person(optima[k], rng.uniform(0.5, 2.0, len(space.parameters)), noise, same)


def off(values: Floats, person: Person) -> float:
    """Return the root mean square over the parameters of |ln(value / optimum)|: 0.1 is 10 % off."""
    return float(np.sqrt(np.mean(np.log(values / person.optimum) ** 2)))


def searched(space: Space, person: Person, comparisons: int, seed: int) -> Floats:
    """Return the setting that the search ends with."""
    rng = np.random.default_rng((seed, 1))
    settings, answers = first_settings(space), list[Answer]()
    for _ in range(comparisons):
        asked: Question = next_question(space, Plan(comparisons, seed), settings, answers)
        settings = asked.settings
        felt = person.answer(space, settings[asked.a], settings[asked.b], rng)
        answers.append(Answer(asked.a, asked.b, felt))
    best: Floats = settings[liked(space, settings, answers)]
    return best


def drawn(space: Space, person: Person, comparisons: int, seed: int) -> Floats:
    """Return what stays if each proposal is drawn at random and kept where it felt better."""
    rng = np.random.default_rng((seed, 1))
    best = space.present
    for new in space.draw(64 * comparisons, np.random.default_rng((seed, 2)))[:comparisons]:
        if person.answer(space, new, best, rng) is Felt.FIRST:
            best = new
    return best


def main() -> int:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--people", type=int, default=32)
    parser.add_argument("--json", type=Path)
    given = parser.parse_args()
    rows = []
    print("axes           comparisons  person     off: search p50  p90   at random p50  p90   at the start p50")
    for name, axes in AXES.items():
        space = space_of(SurefootConfig(), axes)
        comparisons = COMPARISONS_PER_PARAMETER * len(space.parameters)
        for character in CHARACTERS:
            asked = list(people(space, character, given.people))
            offs = {
                "search": [off(searched(space, p, comparisons, k), p) for k, p in enumerate(asked)],
                "random": [off(drawn(space, p, comparisons, k), p) for k, p in enumerate(asked)],
                "start": [off(space.present, p) for p in asked],
            }
            row = {key: [float(np.quantile(value, q)) for q in (0.5, 0.9)] for key, value in offs.items()}
            rows.append({"axes": name, "comparisons": comparisons, "person": character, **row})
            print(
                f"{name:<14} {comparisons:>11}  {character:<10} {row['search'][0]:>15.0%} {row['search'][1]:>4.0%}"
                f"   {row['random'][0]:>13.0%} {row['random'][1]:>4.0%}   {row['start'][0]:>16.0%}"
            )
    if given.json is not None:
        given.json.parent.mkdir(parents=True, exist_ok=True)
        given.json.write_text(json.dumps({"people": given.people, "rows": rows}, indent=2) + "\n", encoding="utf-8")
    return 0


if __name__ == "__main__":
    sys.exit(main())
