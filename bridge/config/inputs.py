"""`[inputs]`: what every reader of the wire holds its inputs to."""

from __future__ import annotations

from pydantic import Field

from bridge.config.section import Section


class InputsConfig(Section):
    """What no living sensor does; the ages that are allowed stand in `[supervisor]`."""

    stuck_after_s: float = Field(default=0.3, ge=0, le=10)
    """An input that says exactly the same for longer, under new stamps, is a fault [s]; 0 = never."""
