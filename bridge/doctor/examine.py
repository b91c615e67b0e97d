"""Every check in one table; one that crashes is itself a finding."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from typing import Final

from bridge.doctor.building import COMPILER, RENDERING, check_compiler, check_rendering
from bridge.doctor.certificates import CERTIFICATES, check_certificates
from bridge.doctor.clock import CLOCK, check_clock
from bridge.doctor.configuration import CONFIG, SOURCE, check_config, check_source
from bridge.doctor.finding import Check, Finding, Level, Patient
from bridge.doctor.machine import CORES, DISK, REALTIME, check_cores, check_disk, check_realtime
from bridge.doctor.modules import MODULES, check_modules
from bridge.doctor.packages import EXTRAS, PACKAGES, PYTHON, check_extras, check_packages, check_python
from bridge.doctor.weights import WEIGHTS, check_weights
from bridge.doctor.wire import WIRE, check_wire

CHECKS: Final[Mapping[str, Check]] = {
    PYTHON: check_python,
    PACKAGES: check_packages,
    EXTRAS: check_extras,
    MODULES: check_modules,
    CONFIG: check_config,
    SOURCE: check_source,
    WEIGHTS: check_weights,
    CERTIFICATES: check_certificates,
    WIRE: check_wire,
    CLOCK: check_clock,
    CORES: check_cores,
    REALTIME: check_realtime,
    DISK: check_disk,
    COMPILER: check_compiler,
    RENDERING: check_rendering,
}


def examine(patient: Patient, checks: Mapping[str, Check], names: Sequence[str]) -> Iterator[Finding]:
    """Give the findings of the `checks` called `names`, each as soon as it is there."""
    for name in names:
        try:
            yield from checks[name](patient)
        except Exception as error:  # noqa: BLE001 (a check that cannot be made is a finding, whatever it died of)
            text = f"the check itself failed: {type(error).__name__}: {' '.join(str(error).split())[:200]}"
            yield Finding(name, Level.BROKEN, text, f"surefoot doctor --only '{name}'; pip install -e . if it persists")
