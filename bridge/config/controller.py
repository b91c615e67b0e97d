"""`[controller]`: which controller runs, how fast, and what happens when it is late."""

from __future__ import annotations

from typing import Literal

from pydantic import Field

from bridge.config.section import Section


class ControllerConfig(Section):
    """The control loop."""

    kind: Literal["mpc", "log"] = "mpc"
    """`mpc`: the MPC admittance controller; `log`: a mock that records every call and answers passively."""

    rate_hz: float = Field(default=100.0, ge=20, le=1000)
    """Rate of the loop [Hz]."""

    overrun_s: float = Field(default=0.04, gt=0, le=0.05)
    """A command that took longer to compute than this is replaced by the safe command [s]; the drive waits 60 ms."""

    realtime_priority: int = Field(default=0, ge=0, le=80)
    """Priority of the control loop under SCHED_FIFO (Linux; 20 is usual); 0 = ordinary. Where the system does not
    permit it the loop runs as an ordinary one and says so."""

    log: str = ""
    """File of the logging mock (JSON lines); "" = keep the records in memory only."""

    log_records: int = Field(default=100_000, ge=10, le=10_000_000)
    """Records the mock keeps: in memory the newest; a full or old file is renamed to `FILE.1`, a new one begun."""
