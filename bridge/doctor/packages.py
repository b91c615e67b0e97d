"""Python, the packages that Surefoot needs, and the optional ones."""

from __future__ import annotations

import platform
from collections.abc import Callable, Iterator, Mapping
from importlib.metadata import PackageNotFoundError, version
from typing import Final

from packaging.requirements import Requirement
from packaging.specifiers import SpecifierSet

from bridge.config.surefoot import SurefootConfig
from bridge.doctor.finding import Finding, Level, Patient
from bridge.doctor.needs import NAME, PURPOSES, Needs, needs
from bridge.plugin import parse_plugin

PYTHON: Final = "python"
PACKAGES: Final = "packages"
EXTRAS: Final = "extras"
_SELDOM: Final = ("dev", "docs", "mutate", "bench")  # for those who work on Surefoot itself


def check_python(patient: Patient) -> Iterator[Finding]:
    """Whether this Python is one that Surefoot runs on."""
    del patient
    yield judge_python(platform.python_version(), needs().python)


def judge_python(running: str, needed: str) -> Finding:
    """Return the finding for version `running` where `needed` (a specifier) is asked for."""
    if running in SpecifierSet(needed, prereleases=True):
        return Finding(PYTHON, Level.GOOD, f"Python {running} (needed: {needed or 'any'})")
    return Finding(
        PYTHON,
        Level.BROKEN,
        f"Python {running}, needed: {needed}",
        "install a newer one, then: make clean && make PYTHON=python3.11 test",
    )


def check_packages(patient: Patient) -> Iterator[Finding]:
    """Whether every package that is always needed is there in a version that will do."""
    del patient
    yield from judge_packages(needs(), installed)


def installed(name: str) -> str:
    """Return the version of a package, '' if it is not installed."""
    try:
        return version(name)
    except PackageNotFoundError:
        return ""


def judge_packages(need: Needs, find: Callable[[str], str]) -> Iterator[Finding]:
    """Give a finding for each package that is missing or of a wrong version, or one that all is well.

    Args:
        need: what is needed.
        find: from a package's name to its version, '' if it is not there.
    """
    lacking = [(one, find(one.name)) for one in need.packages if not _serves(one, find(one.name))]
    if not need.packages:
        yield Finding(PACKAGES, Level.BROKEN, f"needs are written {need.source}", "pip install -e .")
    elif not lacking:
        yield Finding(PACKAGES, Level.GOOD, f"all {len(need.packages)} are there, as {need.source} asks for")
    for one, found in lacking:
        yield Finding(
            PACKAGES,
            Level.BROKEN,
            f"{one.name} {found} is installed, needed: {one.specifier}" if found else f"{one.name} is not installed",
            f"pip install '{one}'",
        )


def check_extras(patient: Patient) -> Iterator[Finding]:
    """Which optional packages are there, and whether the configuration needs one that is not."""
    yield from judge_extras(needs(), installed, wanted_extras(patient.config))


def wanted_extras(config: SurefootConfig) -> Mapping[str, str]:
    """Return the extras that a configuration cannot do without, with the setting that needs them."""
    wanted: dict[str, str] = {}
    source = config.perception.source.uri
    pictures = source and source != "wire" and ".npz:" not in source and parse_plugin(source) is None
    if "perception" in config.launch.roles and pictures and config.perception.estimator in {"movenet", "yolo"}:
        wanted[config.perception.estimator] = (
            f"perception.estimator = {config.perception.estimator} with perception.source.uri = {source}"
        )
    if config.mpc.solver == "piqp":
        wanted["solvers"] = "mpc.solver = piqp"
    return wanted


def judge_extras(need: Needs, find: Callable[[str], str], wanted: Mapping[str, str]) -> Iterator[Finding]:
    """Give a finding for each extra that is not whole, and one for those that are."""
    lacking = {name: [one for one in _flat(need, name) if not _serves(one, find(one.name))] for name in need.extras}
    whole = [name for name, missing in lacking.items() if not missing]
    if whole:
        yield Finding(EXTRAS, Level.GOOD, f"installed: {', '.join(whole)}")
    for name, missing in lacking.items():
        if not missing:
            continue
        level, purpose = Level.NOTE, PURPOSES.get(name, "what its name says")
        if name in wanted:
            level, purpose = Level.BROKEN, wanted[name]
        elif name in _SELDOM:
            purpose = f"{purpose}; only to work on Surefoot itself"
        packages = ", ".join(dict.fromkeys(one.name for one in missing))
        yield Finding(EXTRAS, level, f"{name} is not installed ({packages}), for: {purpose}", install(name))


def install(extra: str) -> str:
    """Return the command that installs an extra."""
    return f"pip install '{NAME}[{extra}]'"


def _flat(need: Needs, extra: str) -> Iterator[Requirement]:
    """Give the requirements of an extra, those of the extras it consists of included."""
    for one in need.extras.get(extra, ()):
        if one.name == NAME:
            for other in sorted(one.extras):
                yield from _flat(need, other)
        else:
            yield one


def _serves(one: Requirement, found: str) -> bool:
    if one.marker is not None and not one.marker.evaluate({"extra": ""}) and "extra" not in str(one.marker):
        return True  # not for this platform
    return bool(found) and found in SpecifierSet(str(one.specifier), prereleases=True)
