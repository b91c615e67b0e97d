"""Made-up cases: courses of horizons that come near and leave again, loads, faults; and simple ones to count on."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from bridge.clock import NS
from bridge.messages import STEPS, GaitState
from controller.tuning.cases import Case, Fall, Felt, Horizons, stream
from controller.tuning.replay import STATES, Run

START_NS = 1_795_334_344_860_158_123
PERIOD_NS = 10_000_000


def wandering(rng: np.random.Generator, count: int, scale: float, memory: int = 20) -> np.ndarray:
    steps = rng.normal(size=count + memory)
    return scale * np.convolve(steps, np.ones(memory) / memory**0.5, "valid")[:count]


def course(seed: int, seconds: float = 6.0) -> Case:
    """Return a case in which much happens: doubtful horizons, invalid ones, gaps, clocks apart, pulls and descents."""
    rng = np.random.default_rng(seed)
    count = int(seconds * 30)
    stamps = START_NS + (np.arange(count) * NS / 30).astype(np.int64) + rng.integers(-(10**6), 10**6, count)
    clock_ahead = seed % 4 == 1
    late = rng.integers(10**6, 6 * 10**7, count) - (40_000_000 if clock_ahead else 0)
    if seed % 3 == 1:  # a link that is slow for a while
        late[count // 3 : count // 3 + 20] += 300_000_000
    arrivals = np.maximum.accumulate(stamps + late)
    ahead = np.cumsum(np.repeat(wandering(rng, count, 20.0)[:, None], STEPS, axis=1) / 30, axis=1)
    distance = 4.5 + wandering(rng, count, 1.5)[:, None] + 0.8 * ahead
    near = -distance
    odds = np.stack([np.full_like(near, 2.0), 0.5 * near + 2, 1.5 * near + 3], axis=2)
    odds = np.exp(odds + 0.1 * rng.normal(size=(count, STEPS, 3)))
    faults = [""] * count
    for begin in rng.integers(0, count, rng.integers(0, 4)).tolist():
        for place in range(begin, min(count, begin + int(rng.integers(1, 30)))):
            faults[place] = "horizon is not valid: nobody in view"
    horizons = Horizons(
        stream("fall_horizon", arrivals.tolist(), stamps.tolist(), faults),
        odds / odds.sum(axis=2, keepdims=True),
        distance,
        np.gradient(distance, 1 / 30, axis=1),
        np.clip(0.75 + wandering(rng, count, 0.25), 0.0, 1.0),
        np.full(count, 1 / 30),
    )
    if seed % 3 == 0 or clock_ahead:  # nothing comes for a while
        arrivals[count // 2 : count // 2 + 12] = arrivals[count // 2 + 12]
        horizons = replace(
            horizons, stream=stream("fall_horizon", arrivals.tolist(), stamps.tolist(), horizons.stream.faults)
        )
    felt = rng.random() < 0.7
    turns = int(seconds * 100)
    return Case(
        f"course-{seed}",
        f"course-{seed}",
        START_NS,
        PERIOD_NS,
        turns,
        horizons,
        _felt(rng, "wrench", np.clip(wandering(rng, turns, 190.0, 100) + 40.0, -100.0, 900.0)) if felt else None,
        _felt(rng, "odom", wandering(rng, turns, 0.22, 100)) if felt else None,
        (Fall(0.4 * seconds, 0.5 * seconds, 0.7 * seconds),),
    )


def _felt(rng: np.random.Generator, key: str, values: np.ndarray) -> Felt:
    stamps = START_NS + np.arange(len(values)) * PERIOD_NS
    faults = [""] * len(values)
    if rng.random() < 0.5:
        begin = int(rng.integers(0, len(values)))
        for place in range(begin, min(len(values), begin + 20)):
            faults[place] = f"{key} is not finite"
    return Felt(stream(key, (stamps + 400_000).tolist(), stamps.tolist(), faults), values)


def watched(
    seconds: float,
    fall_probability: Sequence[tuple[float, float, float]],
    falls: tuple[Fall, ...] = (),
    name: str = "c",
) -> Case:
    """Return a case of a steady person, but for spans (from, to, probability of fall) at which a fall is seen."""
    count = int(seconds * 30)
    times_s = np.arange(count) / 30
    fall = np.full(count, 0.01)
    for begin_s, end_s, probability in fall_probability:
        fall[(times_s >= begin_s) & (times_s < end_s)] = probability
    probabilities = np.stack([1 - fall, np.zeros(count), fall], axis=1)[:, None].repeat(STEPS, axis=1)
    stamps = (START_NS + (times_s * NS).astype(np.int64)).tolist()
    distance = np.full((count, STEPS), 5.0) + 1e-6 * (np.arange(count) % 2)[:, None]  # nothing is twice the same
    horizons = Horizons(
        stream("fall_horizon", stamps, stamps, [""] * count), probabilities, distance, np.zeros_like(distance),
        np.ones(count), np.full(count, 1 / 30),
    )  # fmt: skip
    return Case(name, name, START_NS, PERIOD_NS, int(seconds * 100), horizons, falls=falls)


def run_of(spans: Sequence[tuple[float, GaitState]], seconds: float, falls: tuple[Fall, ...] = ()) -> Run:
    """Return a run that is in the states of `spans` from their times on, soft in RECOVER."""
    case = watched(seconds, (), falls)
    state = np.full(case.ticks, STATES.index(GaitState.FOLLOW), np.int8)
    for begin_s, which in spans:
        state[round(begin_s * 100) :] = STATES.index(which)
    stiffening = (state == STATES.index(GaitState.ARREST)).astype(np.float64)
    return Run(case, state, stiffening, np.zeros(case.ticks), np.zeros(case.ticks), ())
