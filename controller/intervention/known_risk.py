"""What is known of the person's risk, over time: an aging horizon, and one that cannot be trusted."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from bridge.clock import NS
from bridge.config.intervention import InterventionConfig
from bridge.messages import STEPS, FallHorizon, Floats
from controller.intervention.risk import Risk, assess_risk, describe, looked_at


class _Curve(NamedTuple):
    """Risk over absolute time."""

    times_s: Floats  # (16,) after `start_ns`
    risk: Floats  # (16,)
    start_ns: int

    def at(self, now_ns: int, ahead_s: Floats) -> Floats:
        """Return the risk `ahead_s` after now, held past both ends."""
        age_s = (now_ns - self.start_ns) / NS
        return np.interp(ahead_s + age_s, self.times_s, self.risk)


class KnownRisk:
    """The risk over the time ahead, from the newest horizon and the newest trusted one.

    A horizon of low quality may raise the risk, as far as what is not confirmed may
    (`unconfirmed_most`), but not lower it below what the last trusted horizon foresaw: unknown is
    not stable. That memory is limited in time; after it the risk has a floor (`unknown_risk`)
    until a trusted horizon comes.
    """

    def __init__(self, config: InterventionConfig) -> None:
        self._config = config
        self._received: FallHorizon | None = None  # whole, for who looks at more of it later
        self._horizon: FallHorizon | None = None  # as far as it is looked at
        self._risk: Risk | None = None
        self._newest: _Curve | None = None
        self._trusted: _Curve | None = None

    def reconfigure(self, config: InterventionConfig) -> None:
        """Judge by other thresholds from now on, the newest horizon included."""
        self._config = config
        if self._received is not None and self._newest is not None:
            self.update(self._received, self._newest.start_ns)

    def update(self, horizon: FallHorizon, start_ns: int) -> None:
        """Take a horizon whose step 0 lies at `start_ns` on the reader's clock."""
        self._received = horizon
        horizon = looked_at(horizon, max(self._config.steps_used, 1))
        self._horizon, self._risk = horizon, assess_risk(horizon, self._config)
        times_s = np.linspace(0.0, (STEPS - 1) * horizon.step_s, STEPS)
        trusted = horizon.quality >= self._config.trusted_quality
        total = self._risk.total if trusted else np.minimum(self._risk.total, self._config.unconfirmed_most)
        self._newest = _Curve(times_s, total, start_ns)
        if trusted:
            self._trusted = self._newest

    def ahead(self, now_ns: int, ahead_s: Floats) -> Floats:
        """Return the risk `ahead_s` [s] after now, same shape, in [0, 1]."""
        if self._newest is None:
            return np.full(ahead_s.shape, self._config.unknown_risk)
        risk = self._newest.at(now_ns, ahead_s)
        if self._newest is self._trusted:
            return risk
        return np.maximum(risk, self._remembered(now_ns, ahead_s))

    def words(self, now_ns: int, ahead_s: float, risk: float) -> str:
        """Say why the risk `ahead_s` after now is what it is."""
        if self._horizon is None or self._risk is None or self._newest is None:
            return "no horizon yet"
        curve = self._newest
        since_start_s = ahead_s + (now_ns - curve.start_ns) / NS
        if risk > curve.at(now_ns, np.array([ahead_s]))[0] + 1e-9:
            return (
                f"horizon quality {self._horizon.quality:.2f}, limit {self._config.trusted_quality:.2f}: "
                "not known to be stable"
            )
        step = min(max(round(since_start_s / self._horizon.step_s), 0), STEPS - 1)
        return describe(self._horizon, self._risk, step, ahead_s)

    def _remembered(self, now_ns: int, ahead_s: Floats) -> Floats:
        trusted = self._trusted
        if trusted is not None and (now_ns - trusted.start_ns) / NS <= self._config.unknown_hold_s:
            return trusted.at(now_ns, ahead_s)
        return np.full(ahead_s.shape, self._config.unknown_risk)
