"""Made-up recordings for the tests of the tuning page, and a page that shows them: `python FILE C.toml`."""

from __future__ import annotations

import sys
from pathlib import Path

import numpy as np

from bridge.config.load import load_config
from controller.tuning.cases import Case, Fall, Horizons, stream
from controller.tuning.page.bench import Bench, Candidate
from controller.tuning.score import Outcome

FRAME_S = 1.0 / 30.0


def made_up(
    name: str, length_s: float, falls_s: tuple[float, ...] = (), dips: tuple[tuple[float, float], ...] = ()
) -> Case:
    """Return somebody who walks steadily, comes nearer the boundary by `dips` (when, how much), and falls."""
    at_s = np.arange(round(length_s / FRAME_S)) * FRAME_S
    ahead_s = at_s[:, None] + np.arange(16) * FRAME_S
    distance = 2.6 + 0.3 * np.sin(2.0 * np.pi * ahead_s / 1.1)
    for when_s, depth in dips:
        distance -= depth * np.exp(-(((ahead_s - when_s) / 0.35) ** 2))
    for when_s in falls_s:
        distance -= 2.6 * (1.0 + np.tanh((ahead_s - when_s - 0.5) / 0.25))
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


if __name__ == "__main__":
    from controller.tuning.page.serve import serve

    config = Path(sys.argv[1])
    raise SystemExit(
        serve(Bench(recordings(), load_config(config), config, config, candidates=candidates(), budget_per_h=60.0), 0)
    )
