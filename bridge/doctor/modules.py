"""Whether the processes' code can be imported, with everything it brings along."""

from __future__ import annotations

import json
import subprocess
import sys
from collections.abc import Iterator, Mapping
from typing import Final

from bridge.doctor.finding import Finding, Level, Patient
from bridge.errors import ConfigError
from bridge.plugin import is_file, require_place

MODULES: Final = "modules"
# what the controller imports only once it runs: CasADi, a solver, Pinocchio
_LATER: Final[Mapping[str, str]] = {"controller.node": "controller.admittance_controller"}
_IMPORT: Final = """\
import importlib, json, sys
failed = {}
for name in sys.argv[1:]:
    try:
        importlib.import_module(name)
    except BaseException as error:
        failed[name] = f"{type(error).__name__}: {error}"
print(json.dumps(failed))
"""


def check_modules(patient: Patient) -> Iterator[Finding]:
    """Whether the module of every role that runs here can be imported."""
    launch = patient.config.launch
    yield from judge_modules({role: launch.modules[role] for role in launch.roles})


def judge_modules(modules: Mapping[str, str]) -> Iterator[Finding]:
    """Give a finding for each role of `modules` (role -> dotted name or file) that could not be started."""
    dotted: dict[str, str] = {}  # what is imported -> role
    failed: dict[str, str] = {}  # role -> why
    for role, place in modules.items():
        try:
            require_place(place)
        except ConfigError as error:
            failed[role] = str(error)
            continue
        if not is_file(place):  # a file is a program: it is there, and imports nothing until it runs
            dotted |= dict.fromkeys((place, _LATER.get(place, place)), role)
    for name, why in imported(list(dotted)).items():
        failed.setdefault(dotted[name], f"{name}: {why}")
    for role, why in failed.items():
        mend = f"set launch.modules.{role}, or: pip install -e . (surefoot doctor --only packages)"
        yield Finding(MODULES, Level.BROKEN, f"{role} cannot start: {' '.join(why.split())}", mend)
    if len(failed) < len(modules):
        good = ", ".join(role for role in modules if role not in failed)
        yield Finding(MODULES, Level.GOOD, f"can be imported: {good}")


def imported(names: list[str]) -> dict[str, str]:
    """Import modules in a process of its own; return those that failed and why."""
    done = subprocess.run(  # noqa: S603 (ourselves)
        [sys.executable, "-c", _IMPORT, *names], capture_output=True, text=True, timeout=120, check=False
    )
    if done.returncode != 0:
        last = done.stderr.strip().splitlines()[-1:] or [""]
        return dict.fromkeys(names, f"the interpreter ended with {done.returncode} {last[0]}".strip())
    failed: dict[str, str] = json.loads(done.stdout.splitlines()[-1])
    return failed
