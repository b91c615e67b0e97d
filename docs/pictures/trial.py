"""The recording that ships, through perception, anticipation and intervention in simulated time."""

from __future__ import annotations

from functools import cache
from typing import Final, NamedTuple

import numpy as np

from bridge.clock import NS
from bridge.config.surefoot import SurefootConfig
from bridge.inbox import Inbox
from bridge.launch.clip import CLIP, shipped_recording
from bridge.lockstep import LockStep
from bridge.messages import FallHorizon, SupportCommand
from bridge.topics import FALL_HORIZON, SUPPORT_COMMAND

START_NS: Final = 1_000 * NS


class Trial(NamedTuple):
    """What was said at each frame, from the first valid horizon on."""

    config: SurefootConfig
    time_s: np.ndarray  # (F,) since the onset of the fall [s]
    horizons: list[FallHorizon]  # (F,)
    commands: list[SupportCommand]  # (F,)

    def at(self, time_s: float) -> int:
        """Return the frame nearest to a time since the onset."""
        return int(np.abs(self.time_s - time_s).argmin())


@cache
def perform() -> Trial:
    """Run the recording once."""
    file, config = shipped_recording(), SurefootConfig()
    with np.load(file) as arrays:
        label, fps = arrays[f"{CLIP}/label"], float(arrays[f"{CLIP}/fps"])
    onset = int(np.argmax(label == 0))
    nodes = {
        "perception": ("perception.node", {"source": f"{file}:{CLIP}"}),
        "anticipation": ("anticipation.node", {}),
        "drive": ("simulation.drive.node", {"script": "zero"}),
        "controller": ("controller.node", {"controller": "log"}),
    }
    system = LockStep(config, nodes, START_NS)
    wire = system.hub.transport()
    horizons: Inbox[FallHorizon] = Inbox(wire, FALL_HORIZON, max_age_s=float("inf"))
    commands: Inbox[SupportCommand] = Inbox(wire, SUPPORT_COMMAND, max_age_s=float("inf"))
    trial = Trial(config, np.zeros(0), [], [])
    times = []
    try:
        for frame in range(len(label)):
            system.advance_to(START_NS + round(frame / fps * NS))
            system.settle()
            now_ns = system.clock.now_ns()
            seen, said = horizons.read(now_ns), commands.read(now_ns)
            if seen.ok and seen.message is not None and said.message is not None:
                times.append((frame - onset) / fps)
                trial.horizons.append(seen.message)
                trial.commands.append(said.message)
    finally:
        system.close()
    return trial._replace(time_s=np.array(times))
