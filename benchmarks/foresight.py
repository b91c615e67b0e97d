"""What it is worth to know of a fall early: simulated falls with a clairvoyant in vision's place.

    python -m benchmarks.foresight --falls 24 --json runs/bench/foresight.json --figure runs/bench/foresight.png

Each fall is performed once by the controller with a horizon that never says anything, so that harness load and descent
alone arrest it; that tells when the descent begins. Then again with a horizon that says 'fall' from a given time before
that on, but never before the disturbance: nobody can know of that. Controller, walker, harness and person are those of
a campaign; perception and anticipation do not run.
"""

from __future__ import annotations

import argparse
import json
from collections.abc import Sequence
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
from joblib import Parallel, delayed
from matplotlib.figure import Figure

from bridge.clock import NS
from bridge.config.load import load_config
from bridge.config.surefoot import SurefootConfig
from bridge.lockstep import LockStep
from bridge.messages import STEPS, FallHorizon, NodeStatus
from bridge.node import Factory, Node, NodeContext
from bridge.outbox import Outbox
from bridge.topics import FALL_HORIZON
from simulation.campaign.arms import configured
from simulation.campaign.measures import Measures, measure
from simulation.campaign.trace import Recorder
from simulation.campaign.trial import AFTER_CONTACT_S, START_NS, TURN_NS
from simulation.node import SimulationNode, performing
from simulation.scenarios.drawing import draw_checked
from simulation.scenarios.scenario import Performance, Scenario

BLIND = float("nan")
LEADS_S = (BLIND, -0.1, 0.0, 0.1, 0.2, 0.3, 0.5)
SLACKS_M = (0.02, 0.06)
FRAME_S = 1 / 30


class Trial(NamedTuple):
    """One fall with one lead."""

    fall: int
    family: str
    slack_m: float
    lead_s: float  # NaN: vision says nothing
    had_s: float  # lead that was left of it after the disturbance
    arrested: bool
    drop_m: float
    peak_n: float
    weights: float


class Clairvoyant:
    """Says 'stable' until `from_s` on the scenario's clock, then 'fall', at every step."""

    period_s: float | None = FRAME_S

    def __init__(self, context: NodeContext, performance: Performance, from_s: float) -> None:
        self._out = Outbox(context.transport, FALL_HORIZON)
        self._performance, self._from_s, self._turn = performance, from_s, 0

    def step(self, now_ns: int) -> None:
        self._turn += 1
        falls = self._performance.time_s >= self._from_s  # never, of what is not a number
        alive = 1e-6 * (self._turn % 7)  # what repeats itself to the digit counts as stuck
        state = np.zeros((STEPS, 3))
        state[:, 2 if falls else 0] = 1.0
        self._out.send(
            FallHorizon(
                stamp_ns=now_ns,
                probabilities=state,
                distance=np.full(STEPS, (-2.0 if falls else 5.0) + alive),
                distance_rate=np.zeros(STEPS),
                time_to_boundary=np.full(STEPS, np.inf),
                centre_distance=np.ones((STEPS, 3)),
                plane=np.zeros((STEPS, 2)),
                forecast_px=np.full((STEPS, 12, 2), 50.0),
                quality=1.0,
            )
        )

    def wait(self) -> None: ...

    def status(self, now_ns: int) -> NodeStatus:
        return NodeStatus(stamp_ns=now_ns, role="anticipation", level=0, summary="knows")

    def finished(self) -> bool:
        return False

    def close(self) -> None: ...


def perform(scenario: Scenario, config: SurefootConfig, slack_m: float, from_s: float) -> tuple[Measures, float]:
    """Return what became of a fall, and when it was disturbed [s]."""
    performance = Performance(scenario, slack_m=slack_m)
    recorder = Recorder(START_NS)
    performance.watchers.append(recorder.note)
    made: list[SimulationNode] = []

    def clairvoyant(context: NodeContext) -> Node:
        return Clairvoyant(context, performance, from_s)

    anticipation: Factory = clairvoyant
    stack = LockStep(
        configured(config, "anticipatory", scenario.seed),
        {
            "anticipation": (anticipation, {}),
            "drive": (performing(performance, made.append), {}),
            "controller": ("controller.node", {}),
        },
        START_NS,
    )
    standing_m = performance.world.person.pelvis_height_m
    end_s = scenario.duration_s
    try:
        for turn in range(round(scenario.duration_s * NS / TURN_NS)):
            stack.advance_to(START_NS + turn * TURN_NS)
            recorder.command = made[0].executed
            if recorder.touched:
                end_s = min(end_s, performance.world.time_s + AFTER_CONTACT_S)
            if performance.world.time_s > end_s:
                break
    finally:
        stack.close()
    measures = measure(scenario, recorder.trace(), performance.disturbed_s, standing_m)
    return measures, performance.disturbed_s or BLIND


def fall(number: int, seed: int, config: SurefootConfig) -> list[Trial]:
    """Return one drawn fall with every slack and every lead; none that never came down."""
    scenario = draw_checked("fall", number, seed).scenario
    trials: list[Trial] = []
    for slack_m in SLACKS_M:
        blind, disturbed_s = perform(scenario, config, slack_m, BLIND)
        for lead_s in LEADS_S:
            descent_s = blind.descent_s if np.isfinite(blind.descent_s) else 0.0
            after_s = max(descent_s - lead_s, 0.0)  # the disturbance
            m = blind if np.isnan(lead_s) else perform(scenario, config, slack_m, disturbed_s + after_s)[0]
            trials.append(
                Trial(
                    number, scenario.family, slack_m, lead_s, descent_s - after_s, m.arrested_fall, m.pelvis_drop_m,
                    m.peak_force_n, m.peak_force_weights,
                )
            )  # fmt: skip
    return trials


def table(trials: Sequence[Trial]) -> list[dict[str, Any]]:
    """Return one row for each slack and lead."""
    rows = []
    for slack_m in SLACKS_M:
        blind = {t.fall: t.peak_n for t in trials if t.slack_m == slack_m and np.isnan(t.lead_s)}
        for lead_s in LEADS_S:
            some = [t for t in trials if t.slack_m == slack_m and (t.lead_s == lead_s or np.isnan(t.lead_s + lead_s))]
            some = [t for t in some if np.isnan(t.lead_s) == np.isnan(lead_s)]
            drops = [t.drop_m for t in some]
            rows.append(
                {
                    "slack_m": slack_m,
                    "lead_s": None if np.isnan(lead_s) else lead_s,
                    "falls": len(some),
                    "arrested": sum(t.arrested for t in some),
                    "drop_median_m": float(np.median(drops)),
                    "drop_p95_m": float(np.percentile(drops, 95)),
                    "peak_median_n": float(np.median([t.peak_n for t in some])),
                    "peak_median_weights": float(np.median([t.weights for t in some])),
                    "peak_ratio_median": float(np.median([t.peak_n / blind[t.fall] for t in some])),
                }
            )
    return rows


def figure(rows: Sequence[dict[str, Any]], path: Path) -> None:
    """Draw arrested falls, drop and peak force over the lead."""
    fig = Figure(figsize=(10.5, 3.2), layout="constrained")
    axes = fig.subplots(1, 3)
    whats = ("falls held", "pelvis drop, 95th percentile [m]", "peak force, median [body weights]")
    for slack_m, colour in zip(SLACKS_M, ("#00868b", "#c0392b"), strict=True):
        mine = [row for row in rows if row["slack_m"] == slack_m]
        known = [row for row in mine if row["lead_s"] is not None]
        blind = next(row for row in mine if row["lead_s"] is None)
        leads = [1e3 * row["lead_s"] for row in known]

        def values(row: dict[str, Any]) -> tuple[float, float, float]:
            return row["arrested"] / row["falls"], row["drop_p95_m"], row["peak_median_weights"]

        for axis, now, before in zip(axes, zip(*map(values, known), strict=True), values(blind), strict=True):
            axis.plot(leads, now, "o-", color=colour, label=f"{1e2 * slack_m:.0f} cm of slack")
            axis.axhline(before, color=colour, linestyle=":", linewidth=1)
    for axis, what in zip(axes, whats, strict=True):
        axis.set_title(what, fontsize=10)
        axis.set_xlabel("fall known before its descent [ms]")
        axis.spines[["top", "right"]].set_visible(False)
    axes[0].set_ylim(0, 1.03)
    axes[1].axhline(0.10, color="#555555", linewidth=0.8)
    axes[0].legend(frameon=False, title="dotted: load and descent alone", fontsize=8, title_fontsize=8)
    path.parent.mkdir(parents=True, exist_ok=True)
    fig.savefig(path, dpi=110)


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--falls", type=int, default=24)
    parser.add_argument("--seed", type=int, default=101)
    parser.add_argument("--jobs", type=int, default=1)
    parser.add_argument("--set", action="append", default=[], metavar="SECTION.KEY=VALUE")
    parser.add_argument("--json", type=Path)
    parser.add_argument("--figure", type=Path)
    given = parser.parse_args()
    config = load_config(None, ["admittance.take_up_reach_m=0.12", *given.set])
    done = Parallel(n_jobs=given.jobs)(delayed(fall)(number, given.seed, config) for number in range(given.falls))
    rows = table([trial for trials in done for trial in trials])
    print(
        "slack [m] | known before the descent [s] | held | drop median, p95 [m] | peak median [N, weights] | of blind"
    )
    for row in rows:
        lead = "never" if row["lead_s"] is None else f"{row['lead_s']:+.1f}"
        print(
            f"{row['slack_m']:.2f} | {lead:>5} | {row['arrested']}/{row['falls']} | {row['drop_median_m']:.3f}, "
            f"{row['drop_p95_m']:.3f} | {row['peak_median_n']:.0f}, {row['peak_median_weights']:.2f} | "
            f"{row['peak_ratio_median']:.2f}"
        )
    if given.json is not None:
        given.json.parent.mkdir(parents=True, exist_ok=True)
        given.json.write_text(json.dumps({"seed": given.seed, "rows": rows}, indent=1), encoding="utf-8")
    if given.figure is not None:
        figure(rows, given.figure)


if __name__ == "__main__":
    main()
