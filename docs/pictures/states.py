"""The supervisor's states and every transition it makes, found by asking it."""

from __future__ import annotations

import itertools
from typing import Any, Final

import numpy as np
from matplotlib.figure import Figure
from paper import bare, sheet

from bridge.clock import NS
from bridge.colours import INK, STATE_COLOUR
from bridge.config.supervisor import SupervisorConfig
from bridge.messages import GaitState
from controller.intervention.supervisor import Evidence, Since, Status, advance

PLACES: Final = {
    GaitState.DISARMED: (0.0, 1.0), GaitState.FOLLOW: (2.6, 1.0), GaitState.GUARD: (5.2, 1.0),
    GaitState.ARREST: (7.8, 1.0), GaitState.RECOVER: (7.8, -1.3), GaitState.SAFE_STOP: (1.3, -1.3),
}  # fmt: skip
LONG_NS: Final = 1_000 * NS  # since when everything that holds has held
BOW: Final = {
    (GaitState.FOLLOW, GaitState.ARREST): -0.3, (GaitState.DISARMED, GaitState.ARREST): -0.34,
    (GaitState.SAFE_STOP, GaitState.ARREST): 0.06, (GaitState.ARREST, GaitState.SAFE_STOP): 0.06,
    (GaitState.ARREST, GaitState.RECOVER): 0.3, (GaitState.RECOVER, GaitState.ARREST): 0.3,
    (GaitState.SAFE_STOP, GaitState.RECOVER): 0.1, (GaitState.RECOVER, GaitState.SAFE_STOP): 0.1,
}  # fmt: skip


SAID: Final = {
    (GaitState.DISARMED, GaitState.FOLLOW): "inputs good",
    (GaitState.DISARMED, GaitState.ARREST): "inputs good, somebody hangs in the harness",
    (GaitState.FOLLOW, GaitState.GUARD): "a fall is\npossible",
    (GaitState.GUARD, GaitState.FOLLOW): "risk low",
    (GaitState.GUARD, GaitState.ARREST): "a fall is near",
    (GaitState.FOLLOW, GaitState.ARREST): "harness load, descent, a fall at once",
    (GaitState.ARREST, GaitState.RECOVER): "quiet\nfor 1 s",
    (GaitState.RECOVER, GaitState.ARREST): "a fall\nagain",
    (GaitState.RECOVER, GaitState.FOLLOW): "support released",
    (GaitState.SAFE_STOP, GaitState.RECOVER): "inputs good again",
    (GaitState.SAFE_STOP, GaitState.ARREST): "inputs good, the fall goes on",
}


ALONG: Final = {  # where on its way a label stands, if not in the middle
    (GaitState.SAFE_STOP, GaitState.ARREST): 0.25,
    (GaitState.RECOVER, GaitState.FOLLOW): 0.25,
}


def transitions() -> set[tuple[GaitState, GaitState]]:
    """Return every transition that the state machine makes, over all combinations of evidence."""
    config = SupervisorConfig()
    found: set[tuple[GaitState, GaitState]] = set()
    choices = itertools.product(
        GaitState, ("", "input lost"), (0.0, 1.0), (0.0, 1.0), (0.0, 500.0), (0.0, 0.5), (False, True)
    )
    for state, fault, near, ahead, load, descent, relaxed in choices:
        evidence = Evidence(fault, near, max(near, ahead), "near", "foreseen", load, descent, relaxed)
        held = Since(*[0] * len(Since()))
        after = advance(Status(state, "", 0, held), evidence, LONG_NS, config)
        if after.state is not state:
            found.add((state, after.state))
    return found


def draw_states() -> Figure:
    """Return the picture."""
    figure = sheet("The supervisor: six states, and every way between them", 11, 5.4)
    axes: Any = figure.add_axes((0.01, 0.02, 0.98, 0.88))
    bare(axes)
    found = transitions()
    for source, target in sorted(found):
        quiet = target is GaitState.SAFE_STOP
        both = (target, source) in found
        bow = BOW.get((source, target), 0.14 if both else 0.0)
        start, end = np.array(PLACES[source]), np.array(PLACES[target])
        arrow = {
            "arrowstyle": "-|>", "mutation_scale": 15, "shrinkA": 30, "shrinkB": 30, "lw": 1.1 if quiet else 1.7,
            "color": "#8a8a8a" if quiet else INK, "linestyle": (0, (3, 2)) if quiet else "-",
            "connectionstyle": f"arc3,rad={bow}",
        }  # fmt: skip
        axes.annotate("", end, start, arrowprops=arrow)
        if not quiet and (source, target) in SAID:
            across = np.array([end[1] - start[1], start[0] - end[0]])
            share = ALONG.get((source, target), 0.5)
            at = start + share * (end - start) + 2 * share * (1 - share) * bow * across
            axes.text(
                *at, SAID[source, target], fontsize=9, ha="center", va="center", color=INK,
                bbox={"facecolor": "white", "edgecolor": "none", "pad": 1.2},
            )  # fmt: skip
    for state, place in PLACES.items():
        axes.text(
            *place, state.value, fontsize=12, fontweight="bold", ha="center", va="center", color=INK,
            bbox={"boxstyle": "round,pad=0.6", "facecolor": STATE_COLOUR[state.value], "edgecolor": INK},
        )  # fmt: skip
    words = "dashed: an input is missing, stale, stuck or broken"
    axes.text(-0.6, -2.15, words, fontsize=9.5, color="#666666", va="center")
    axes.set_xlim(-0.9, 8.8)
    axes.set_ylim(-2.4, 2.6)
    return figure
