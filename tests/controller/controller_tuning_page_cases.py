"""Made-up recordings for the tests of the tuning page, and a page that shows them: `python FILE C.toml`."""

from __future__ import annotations

import sys
import tomllib
from dataclasses import replace
from pathlib import Path

import numpy as np

from bridge.config.load import load_config, parse_config
from bridge.config.surefoot import SurefootConfig
from controller.tuning.cases import Case, Fall, Horizons, stream
from controller.tuning.page.bench import Bench, Candidate
from controller.tuning.replay import replay
from controller.tuning.score import Outcome, score

FRAME_S = 1.0 / 30.0
THRESHOLDS = {  # those that the recordings are made for, whatever the defaults are
    "distance_onset_sd": 1.5,
    "distance_full_sd": -0.5,
    "approach_onset_s": 0.8,
    "approach_full_s": 0.3,
    "approach_far_sd": 3.5,
    "approach_near_sd": 2.0,
    "credible_onset": 0.3,
    "credible_full": 0.7,
    "unconfirmed_most": 0.7,
    "probability_full": 0.8,
    "rise_per_s": 8.0,
    "release_per_s": 1.0,
    "arrest_per_s": 20.0,
    "probability_onset": 0.4,
}
CONFIG = "\n".join(
    (
        "# our walker",
        "version = 1",
        "",
        "[intervention]",
        *(f"{key} = {value}" for key, value in THRESHOLDS.items()),
    )
).replace("probability_onset = 0.4", "probability_onset = 0.4  # tried in March")
CONFIG += "\n\n[supervisor]\nguard_on = 0.25\narrest_on = 0.8\n"
BUDGET_PER_H = 30.0


def made_up(
    name: str,
    length_s: float,
    falls_s: tuple[float, ...] = (),
    dips: tuple[tuple[float, float], ...] = (),
    depth: float = 2.6,
    slow_s: float = 0.25,
) -> Case:
    """Return somebody who walks steadily, comes nearer the boundary by `dips` (when, how much), and falls.

    A fall ends 2 `depth` nearer, or past the boundary, and takes about `slow_s`.
    """
    at_s = np.arange(round(length_s / FRAME_S)) * FRAME_S
    ahead_s = at_s[:, None] + np.arange(16) * FRAME_S
    distance = 2.6 + 0.3 * np.sin(2.0 * np.pi * ahead_s / 1.1)
    for when_s, nearer in dips:
        distance -= nearer * np.exp(-(((ahead_s - when_s) / 0.35) ** 2))
    for when_s in falls_s:
        distance -= depth * (1.0 + np.tanh((ahead_s - when_s - 0.5) / slow_s))
    fall = 0.5 * (1.0 - np.tanh((distance + 0.5) / 0.7))
    transient = 0.5 * (1.0 - fall) * (1.0 - np.tanh((distance - 1.2) / 0.6))
    stamps_ns = np.round(at_s * 1e9).astype(np.int64)
    horizons = Horizons(
        stream("fall_horizon", stamps_ns + 10_000_000, stamps_ns, [""] * len(at_s)),
        np.stack([1.0 - fall - transient, transient, fall], axis=-1),
        distance,
        np.gradient(distance, FRAME_S, axis=1),
        np.full(len(at_s), 0.95),
        np.full(len(at_s), FRAME_S),
    )
    known = tuple(Fall(when_s, when_s + 0.9) for when_s in falls_s)
    return Case(name, name, 0, 10_000_000, round(length_s * 100), horizons, falls=known)


def walker() -> SurefootConfig:
    """Return what CONFIG says."""
    return parse_config(tomllib.loads(CONFIG), "walker.toml")


def recordings() -> list[Case]:
    """Return two falls and two daily deeds, of which one comes near the boundary."""
    return [
        made_up("falls.npz:stumble", 14.0, (11.0,), ((6.5, 2.2),)),
        made_up("falls.npz:faint", 8.0, (4.0,)),
        made_up("daily.npz:sitting down", 20.0, (), ((6.0, 4.2), (14.0, 3.1))),
        made_up("daily.npz:walking", 20.0),
    ]


def candidates() -> list[Candidate]:
    """Return what a study might have tried."""
    return [
        Candidate({"probability_onset": 0.3, "probability_full": 0.6}, Outcome(2, 2, 0, (0.42, 0.40), 2, 0.011)),
        Candidate({"probability_onset": 0.5, "probability_full": 0.9}, Outcome(2, 1, 0, (0.30,), 0, 0.011), True),
    ]


def many_recordings() -> list[Case]:
    """Return what makes a picture: falls after strides of all kinds, deeds of all kinds."""
    draw = np.random.default_rng(7)
    falls = [
        made_up(
            f"falls.npz:fall-{number:02d}",
            8.0,
            (float(draw.uniform(3, 6)),),
            ((1.5, float(draw.uniform(0, 2))),),
            float(draw.uniform(1.45, 2.4)),
            float(draw.uniform(0.15, 0.5)),
        )
        for number in range(15)
    ]
    deeds = [
        made_up(
            f"daily.npz:deed-{number:02d}",
            60.0,
            (),
            tuple((at_s + float(draw.uniform(-2, 2)), float(draw.uniform(1.5, 3.8))) for at_s in range(6, 58, 9)),
        )
        for number in range(8)
    ]
    return [recordings()[0], *falls, *deeds]


def tried(cases: list[Case], config: SurefootConfig) -> list[Candidate]:
    """Return settings at random with what they really come to."""
    draw = np.random.default_rng(1)
    found = []
    for _ in range(16):
        onset = round(float(draw.uniform(0.05, 0.65)), 2)
        values = {"probability_onset": onset, "probability_full": round(onset + float(draw.uniform(0.1, 0.29)), 2)}
        intervention = config.intervention.model_copy(update=values)
        found.append(Candidate(values, score(replay(case, intervention, config.supervisor) for case in cases)))
    kept = [each for each in found if each.outcome.per_hour <= BUDGET_PER_H]
    best = max(kept, key=lambda each: each.outcome.caught)
    return [replace(each, recommended=each is best) for each in found]


if __name__ == "__main__":
    from controller.tuning.page.serve import serve

    config = Path(sys.argv[1])
    loaded = load_config(config)
    shown = many_recordings() if "many" in sys.argv else recordings()
    candidates_ = tried(shown, loaded) if "many" in sys.argv else candidates()
    bench = Bench(shown, loaded, config, config, candidates=candidates_, budget_per_h=BUDGET_PER_H)
    raise SystemExit(serve(bench, 0))
