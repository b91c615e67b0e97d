"""Configuration of `surefoot up`."""

from __future__ import annotations

from typing import Any, Final, Self

from pydantic import Field, field_validator, model_validator

from bridge.config.section import Section

DEFAULT_MODULES: Final = {
    "perception": "perception.node",
    "anticipation": "anticipation.node",
    "controller": "controller.node",
    "drive": "simulation.drive.node",
}


class LaunchConfig(Section):
    """Which processes run here and how they are looked after."""

    roles: tuple[str, ...] = ("perception", "anticipation", "controller", "drive")
    """Roles started on this machine, in this order; leave out those that run elsewhere."""

    modules: dict[str, str] = Field(default_factory=lambda: dict(DEFAULT_MODULES))
    """Python module (`python -m MODULE`) or file (`lab/drive.py`, from the working directory) that runs each role; name
    your own to replace one, the rest keep theirs."""

    options: dict[str, dict[str, str | bool | int | float]] = Field(default_factory=dict)
    """What each role is given as `--option NAME=VALUE`, such as { drive = { port = "/dev/ttyUSB0" } }: a place for
    the settings of your own nodes."""

    restart: bool = True
    """Start a process again when it died."""

    restart_limit: int = Field(default=5, ge=0, le=100)
    """Give up on a role after this many restarts within `restart_window_s`."""

    restart_window_s: float = Field(default=30.0, gt=0, le=3600)
    """Span over which restarts are counted [s]."""

    stop_timeout_s: float = Field(default=3.0, gt=0, le=60)
    """How long a process may take to stop before it is killed [s]."""

    ready_timeout_s: float = Field(default=30.0, gt=0, le=600)
    """Perception begins once the others are up, so that none misses the start of a file, or after this long [s]."""

    log_dir: str = Field(default="runs/logs", min_length=1)
    """Folder for what the processes write, one `ROLE.log` each; older text moves to `ROLE.log.1`."""

    @field_validator("modules", mode="before")
    @classmethod
    def _add_defaults(cls, value: Any) -> Any:
        return {**DEFAULT_MODULES, **value} if isinstance(value, dict) else value

    @model_validator(mode="after")
    def _check_roles(self) -> Self:
        if not self.roles:
            raise ValueError("roles is empty, so there is nothing to start")
        for role in self.roles:
            if self.roles.count(role) > 1:
                raise ValueError(f"roles names '{role}' more than once")
            if role not in self.modules:
                raise ValueError(f"roles names '{role}', but modules.{role} is not set")
        for role in self.options:
            if role not in self.modules:
                raise ValueError(f"options names '{role}', which is no role; known: {', '.join(self.modules)}")
        return self

    def options_of(self, role: str) -> dict[str, str]:
        """Return the options of `role` as a command line would give them."""
        return {name: _text(value) for name, value in self.options.get(role, {}).items()}


def _text(value: str | float) -> str:
    return str(value).lower() if isinstance(value, bool) else str(value)
