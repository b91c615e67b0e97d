"""One anticipated fall, end to end in simulated time, as a picture.

    python -m benchmarks.anticipated_fall --out docs/images/anticipated_fall.png

The shipped recording of a walk that ends in a fall goes through perception, anticipation, intervention, MPC, gate and a
drive without a robot, in lock-step. The person's weight comes into the harness 0.8 s after the fall's onset (assumed:
the recorded person lies after 1 s). Drawn are the horizon's risk, the stiffening profile made of it, the rendered
damping and stiffness, what the plans predicted of base and column against what came, and the energy tank.
"""

from __future__ import annotations

import argparse
from importlib import import_module, resources
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.figure import Figure

from bridge.clock import NS
from bridge.config.load import load_config
from bridge.inbox import Inbox
from bridge.launch.picture import FALL, INK, STATE_COLOUR
from bridge.lockstep import LockStep
from bridge.messages import STEP_S, FallHorizon, Odometry, SupportCommand, Wrench
from bridge.node import Node, NodeContext
from bridge.topics import FALL_HORIZON
from controller.admittance_controller import AdmittanceController
from controller.interface import Decision
from controller.intervention.risk import assess_risk
from controller.node import ControllerNode

CLIP = "walk-stumble-fall"
START_NS = 1_000 * NS
BEFORE_S, AFTER_S = 1.0, 2.5  # of the onset, in the picture
PULL_AFTER_S = 0.8  # from the onset until the harness is taut
PLAN_EVERY = 10  # turns between the plans that are drawn
VELOCITY, HEIGHT = "#00868b", "#2b7a4b"


class Turn(NamedTuple):
    """What one turn of the controller saw, planned and said."""

    time_s: float
    state: str
    profile: np.ndarray  # (N,)
    damping: np.ndarray  # (4,)
    stiffness: np.ndarray  # (4,)
    velocity: float  # of the base, measured [m/s]
    height: float  # of the column, measured [m]
    planned_velocity: np.ndarray  # (N,) at the end of each stage [m/s]
    planned_height: np.ndarray  # (N,) [m]
    tank_j: float


class Witness:
    """The MPC controller, with every turn of it kept."""

    turns: list[Turn] = []  # noqa: RUF012 (the node is made by name; this is where its maker finds what it kept)

    def __init__(self, inner: AdmittanceController) -> None:
        self._inner = inner

    def step(self, now_ns: int, odometry: Odometry, wrench: Wrench, decision: Decision) -> SupportCommand:
        """Let the controller answer, and keep what it did."""
        command = self._inner.step(now_ns, odometry, wrench, decision)
        plan = self._inner.last_plan if command.solver == "mpc" else None
        nothing = np.full(len(decision.profile), np.nan)
        Witness.turns.append(
            Turn(
                (now_ns - START_NS) / NS,
                decision.state.value,
                decision.profile.copy(),
                command.damping.copy(),
                command.stiffness.copy(),
                float(odometry.velocity[0]),
                float(odometry.position[2]),
                nothing if plan is None else plan.velocity[:, 0].copy(),
                nothing if plan is None else float(odometry.position[2]) + plan.displacement[:, 3],
                self._inner._admittance.tank.energy_j,
            )
        )
        return command

    def reset(self) -> None:
        """As the controller."""
        self._inner.reset()


def create(context: NodeContext) -> Node:
    """Return the controller's node around a witnessed controller."""
    config = context.config
    inner = AdmittanceController(config.walker, config.admittance, config.mpc, 1.0 / config.controller.rate_hz)
    return ControllerNode(context, Witness(inner))


def run(overrides: list[str]) -> tuple[np.ndarray, np.ndarray, float]:
    """Run the recording; return the frames' times (F,), the risk of each one's horizon (F, 16), and the onset [s]."""
    file = Path(str(resources.files("simulation"))) / "demo" / f"{CLIP}.npz"
    with np.load(file) as arrays:
        label, fps = arrays[f"{CLIP}/label"], float(arrays[f"{CLIP}/fps"])
    onset_s = float(np.argmax(label == 0) / fps)
    config = load_config(None, overrides)
    pull = {"script": "fall", "event_s": f"{onset_s + PULL_AFTER_S}", "column_height_m": "1.0"}
    nodes = {
        "perception": ("perception.node", {"source": f"{file}:{CLIP}"}),
        "anticipation": ("anticipation.node", {}),
        "drive": ("simulation.drive.node", pull),
        "controller": ("benchmarks.anticipated_fall", {}),
    }
    system = LockStep(config, nodes, START_NS)
    horizons: Inbox[FallHorizon] = Inbox(system.hub.transport(), FALL_HORIZON, max_age_s=float("inf"))
    times, risks = [], []
    try:
        for frame in range(len(label)):
            system.advance_to(START_NS + round(frame / fps * NS))
            system.settle()
            seen = horizons.read(system.clock.now_ns())
            if seen.ok and seen.message is not None:
                times.append(frame / fps)
                risks.append(assess_risk(seen.message, config.intervention).total)
    finally:
        system.close()
    return np.array(times), np.array(risks), onset_s


def draw(times: np.ndarray, risks: np.ndarray, onset_s: float, stage_s: float) -> Figure:
    """Return the picture; time counts from the onset of the fall."""
    from_s, to_s = onset_s - BEFORE_S, onset_s + AFTER_S
    turns = [turn for turn in Witness.turns if from_s <= turn.time_s <= to_s]
    clock = np.array([turn.time_s for turn in turns]) - onset_s
    figure = Figure(figsize=(11.0, 11.6), facecolor="white", dpi=100)
    figure.suptitle("One anticipated fall", x=0.09, ha="left", y=0.985, fontsize=13.5, fontweight="bold", color=INK)
    grid = figure.add_gridspec(
        7, 2, height_ratios=(0.25, 1, 1, 1, 1, 1, 0.8), width_ratios=(1, 0.016), wspace=0.03, hspace=0.2,
        left=0.09, right=0.90, top=0.952, bottom=0.048,
    )  # fmt: skip
    panels = [figure.add_subplot(grid[row, 0]) for row in range(7)]
    band, risk, profile, rendered, velocity, height, tank = panels
    for panel in panels:
        panel.set_xlim(-BEFORE_S, AFTER_S)
        panel.tick_params(labelbottom=panel is tank, labelsize=9, colors=INK)
        for side in ("top", "right"):
            panel.spines[side].set_visible(False)
        if panel is not band:
            panel.axvline(0.0, color=FALL, linewidth=1.1, linestyle=(0, (1, 1.5)))
            panel.axvline(PULL_AFTER_S, color="#777777", linewidth=1.1, linestyle=(0, (1, 1.5)))
    _states(band, clock, [turn.state for turn in turns])
    inside = (times >= from_s) & (times <= to_s)
    ahead = np.arange(risks.shape[1]) * STEP_S * 1e3
    colours = risk.pcolormesh(
        times[inside] - onset_s, ahead, risks[inside].T, cmap="YlOrRd", vmin=0, vmax=1, rasterized=True
    )
    stages = np.arange(len(turns[0].profile)) * stage_s * 1e3
    profiles = np.array([turn.profile for turn in turns]).T
    profile.pcolormesh(clock, stages, profiles, cmap="YlOrRd", vmin=0, vmax=1, rasterized=True)
    for axes, text in ((risk, "risk of the horizon\n[ms ahead]"), (profile, "stiffening profile\n[ms ahead]")):
        axes.set_ylabel(text, fontsize=10)
    figure.colorbar(colours, cax=figure.add_subplot(grid[1:3, 1])).ax.tick_params(labelsize=8.5)
    _rendered(rendered, clock, turns)
    _motion(velocity, clock, turns, "velocity", "planned_velocity", stage_s, VELOCITY)
    velocity.set_ylabel("base, forward\n[m/s]", fontsize=10)
    _motion(height, clock, turns, "height", "planned_height", stage_s, HEIGHT)
    height.set_ylabel("column height\n[m]", fontsize=10)
    tank.plot(clock, [turn.tank_j for turn in turns], color="#8a5a20", linewidth=1.6)
    tank.set_ylim(bottom=0.0)
    tank.set_ylabel("energy tank\n[J]", fontsize=10)
    tank.set_xlabel("time since the onset of the fall [s]; grey: the harness pulls", fontsize=10)
    return figure


def _states(band: Any, clock: np.ndarray, states: list[str]) -> None:
    begins = [0, *(k for k in range(1, len(states)) if states[k] != states[k - 1])]
    for begin, end in zip(begins, [*begins[1:], len(states) - 1], strict=True):
        band.axvspan(clock[begin], clock[end], facecolor=STATE_COLOUR[states[begin]], edgecolor="white")
        if clock[end] - clock[begin] > 0.05 * len(states[begin]):
            middle = 0.5 * (clock[begin] + clock[end])
            band.text(middle, 0.5, states[begin], ha="center", va="center", fontsize=8.5, color=INK)
    band.set_ylim(0, 1)
    band.set_yticks([0.5], ["state"])
    band.tick_params(axis="both", length=0)
    band.spines[["left", "bottom"]].set_visible(False)


def _rendered(axes: Any, clock: np.ndarray, turns: list[Turn]) -> None:
    """Damping and stiffness, forward and of the column; the column's over ten."""
    twin = axes.twinx()
    for side, name, colour, unit in ((axes, "damping", VELOCITY, "N s/m"), (twin, "stiffness", FALL, "N/m")):
        values = np.array([getattr(turn, name) for turn in turns])
        side.plot(clock, values[:, 0], color=colour, linewidth=1.6, label=f"{name}, forward")
        side.plot(clock, values[:, 3] / 10, color=colour, linewidth=1.4, linestyle="--", label=f"{name}, column / 10")
        side.set_ylim(0.0, 1.42 * float(max(values[:, 0].max(), values[:, 3].max() / 10)))
        side.set_ylabel(f"{name} [{unit}]", fontsize=10, color=colour)
        side.tick_params(labelsize=9, colors=colour)
        side.legend(loc="upper left" if side is axes else "upper right", fontsize=8.5, ncols=2, edgecolor="none")
    twin.spines[["top", "left"]].set_visible(False)


def _motion(
    axes: Any, clock: np.ndarray, turns: list[Turn], name: str, planned: str, stage_s: float, colour: str
) -> None:
    ahead = stage_s * np.arange(1, len(turns[0].profile) + 1)
    for k in range(0, len(turns), PLAN_EVERY):
        label = "planned, every 100 ms" if k == 0 else None
        axes.plot(clock[k] + ahead, getattr(turns[k], planned), color=colour, linewidth=0.9, alpha=0.75, label=label)
    axes.plot(clock, [getattr(turn, name) for turn in turns], color=INK, linewidth=1.9, label="what came")
    low, high = axes.get_ylim()
    axes.set_ylim(low, high + 0.22 * (high - low))
    axes.legend(loc="upper right", fontsize=8.5, ncols=2, edgecolor="none", framealpha=0.8)


def main() -> None:
    """Run, draw, and say what is in the picture in numbers."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--out", type=Path, default=Path("runs/bench/anticipated_fall.png"))
    parser.add_argument("--set", action="append", default=[], metavar="SECTION.KEY=VALUE")
    arguments = parser.parse_args()
    # the lock-step makes its node from the module by name, which is not the one that runs as the main program
    this: Any = import_module("benchmarks.anticipated_fall")

    times, risks, onset_s = this.run(arguments.set)
    config = load_config(None, arguments.set)
    figure = this.draw(times, risks, onset_s, config.mpc.stage_s)
    arguments.out.parent.mkdir(parents=True, exist_ok=True)
    canvas: Any = FigureCanvasAgg(figure)
    part = arguments.out.with_name(arguments.out.name + ".part")
    with part.open("wb") as file:
        canvas.print_png(file)
    part.replace(arguments.out)
    turns = [turn for turn in this.Witness.turns if turn.time_s >= onset_s - BEFORE_S]
    stiff = next(turn.time_s for turn in turns if turn.profile[0] >= 0.99)
    drop = turns[0].height - min(turn.height for turn in turns)
    tank = min(turn.tank_j for turn in turns)
    print(
        f"stiff {stiff - onset_s:.2f} s after the onset, {onset_s + PULL_AFTER_S - stiff:.2f} s before the harness "
        f"pulls; the column gave {100 * drop:.1f} cm; the tank held {tank:.1f} J at least"
    )


if __name__ == "__main__":
    main()
