"""From a configuration to the settings that may be proposed."""

from __future__ import annotations

import math
from collections.abc import Callable
from typing import Final, NamedTuple

import numpy as np
from annotated_types import Ge, Le
from numpy.typing import NDArray

from bridge.config.admittance import AdmittanceConfig
from bridge.config.personal import PersonalConfig
from bridge.config.surefoot import SurefootConfig
from bridge.errors import ConfigError
from bridge.messages import Floats
from controller.personal.space import DIGITS, Parameter, Space
from controller.personal.stability import coasting_s, phase_margin

_LOOKS: Final = 2048
_LEAST_SHARE: Final = 0.01  # of the box: a search needs room


class _Axis(NamedTuple):
    """What is rendered along one axis in free walking."""

    mass: str  # keys of [admittance]
    damping: str
    damping_arrest: str  # the most that `damping` may be
    stiffness: str  # key of [personal]: what a person is coupled with


AXES: Final = {
    "forward": _Axis(
        "mass_horizontal_kg",
        "damping_free_forward_ns_m",
        "damping_arrest_horizontal_ns_m",
        "coupling_stiffness_n_m",
    ),
    "left": _Axis(
        "mass_horizontal_kg",
        "damping_free_left_ns_m",
        "damping_arrest_horizontal_ns_m",
        "coupling_stiffness_n_m",
    ),
    "yaw": _Axis(
        "inertia_yaw_kg_m2",
        "damping_free_yaw_nms_rad",
        "damping_arrest_yaw_nms_rad",
        "coupling_stiffness_nm_rad",
    ),
}


def space_of(config: SurefootConfig, axes: tuple[str, ...]) -> Space:
    """Return what may be proposed for `axes` of `AXES`.

    Each value lies within `personal.span` of the present one, within its key's own bounds, and a damping at most where
    an arrest begins. What is left of this box is what `_Rendered` calls safe along every axis, those included whose
    mass changes along.

    Raises:
        ConfigError: the present setting is not safe itself, or next to nothing is.
    """
    admittance, personal = config.admittance, config.personal
    keys = dict.fromkeys(key for axis in axes for key in (AXES[axis].mass, AXES[axis].damping))
    parameters = tuple(_parameter(admittance, key, personal.span) for key in keys)
    rendered = _Rendered(admittance, personal, tuple(keys))
    present = np.array([parameter.present for parameter in parameters])
    trouble = rendered.trouble(present)
    if trouble:
        raise ConfigError(trouble)
    space = Space(parameters, rendered.safe)
    if len(space.draw(_LOOKS, np.random.default_rng(0))) < _LOOKS * _LEAST_SHARE:
        raise ConfigError(
            f"next to nothing within personal.span = {personal.span:g} of the present setting may be rendered: "
            "see personal.coast_max_s and the coupling stiffnesses"
        )
    return space


class _Rendered:
    """Mass and damping of every axis for values of some keys, and what is wrong with them."""

    def __init__(self, admittance: AdmittanceConfig, personal: PersonalConfig, keys: tuple[str, ...]) -> None:
        self._admittance, self._personal, self._keys = admittance, personal, keys

    def safe(self, values: Floats) -> NDArray[np.bool_]:
        """Return whether values (P, d) may be rendered, (P,)."""
        good = np.ones(len(values), dtype=bool)
        for axis in self._touched():
            mass, damping = self._of(axis.mass, values), self._of(axis.damping, values)
            good &= coasting_s(mass, damping) <= self._personal.coast_max_s
            good &= phase_margin(mass, damping, self._stiffness(axis), self._personal.loop_delay_s) >= 0.0
        return good

    def trouble(self, values: Floats) -> str:
        """Return what is wrong with one setting (d,), '' if nothing."""
        for axis in self._touched():
            mass, damping = self._of(axis.mass, values[None]), self._of(axis.damping, values[None])
            names = f"admittance.{axis.mass} = {mass[0]:g} with admittance.{axis.damping} = {damping[0]:g}"
            coast = coasting_s(mass, damping)[0]
            if coast > self._personal.coast_max_s:
                return f"{names} coasts for {coast:.2f} s, limit personal.coast_max_s = {self._personal.coast_max_s:g}"
            if phase_margin(mass, damping, self._stiffness(axis), self._personal.loop_delay_s)[0] < 0.0:
                return (
                    f"{names} begins to swing with a person coupled by personal.{axis.stiffness} = "
                    f"{self._stiffness(axis):g}: more damping is needed"
                )
        return ""

    def _touched(self) -> list[_Axis]:
        return [axis for axis in AXES.values() if axis.mass in self._keys or axis.damping in self._keys]

    def _of(self, key: str, values: Floats) -> Floats:
        if key in self._keys:
            column: Floats = values[:, self._keys.index(key)]
            return column
        return np.full(len(values), float(getattr(self._admittance, key)))

    def _stiffness(self, axis: _Axis) -> float:
        return float(getattr(self._personal, axis.stiffness))


def _parameter(admittance: AdmittanceConfig, key: str, span: float) -> Parameter:
    present = float(getattr(admittance, key))
    metadata = AdmittanceConfig.model_fields[key].metadata
    least = [float(str(bound.ge)) for bound in metadata if isinstance(bound, Ge)]
    most = [float(str(bound.le)) for bound in metadata if isinstance(bound, Le)]
    most += [float(getattr(admittance, axis.damping_arrest)) for axis in AXES.values() if axis.damping == key]
    return Parameter(
        key, max(_rounded(present / span, math.ceil), *least), min(_rounded(present * span, math.floor), *most), present
    )


def _rounded(value: float, towards: Callable[[float], int]) -> float:
    """Return `value` with as many digits as proposals have."""
    size = DIGITS - 1 - math.floor(math.log10(value))
    return towards(round(value * 10.0**size, 6)) / 10.0**size
