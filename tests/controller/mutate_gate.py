"""Mutation run of the safety gate: every change of its code is noticed by a test, or explained.

    python tests/controller/mutate_gate.py        (make mutate; about ten minutes on one core)

Works in a temporary copy. First every line and branch of the gate must be covered by the gate's own tests. Then mutmut
changes one thing at a time; a mutant that no test kills must stand in `gate_equivalent_mutants.toml` with the reason
why it behaves like the original, and what stands there must still survive.
"""

from __future__ import annotations

import re
import shutil
import subprocess
import sys
import tempfile
import tomllib
from pathlib import Path
from typing import NamedTuple

HERE = Path(__file__).resolve().parent
REPO = HERE.parents[1]
EXPLAINED = HERE / "gate_equivalent_mutants.toml"
GATE = "controller/gate.py"
# It reads the imports of the file, among which mutmut writes one of its own.
NOT_ON_MUTANTS = "tests/controller/test_controller_gate.py::TestIndependence"
PROJECT = f"""
[tool.mutmut]
source_paths = ["controller", "bridge"]
only_mutate = ["{GATE}"]
pytest_add_cli_args = ["-p", "no:cacheprovider", "--hypothesis-seed=0", "--deselect", "{NOT_ON_MUTANTS}"]
pytest_add_cli_args_test_selection = ["tests/controller"]
use_git_change_detection = false
use_setproctitle = false
[tool.coverage.run]
branch = true
include = ["{GATE}"]
"""


class Mutant(NamedTuple):
    """One change of one line."""

    where: str  # function
    was: str
    becomes: str


def main() -> int:
    """Return 0 if the gate is covered and every mutant killed or explained."""
    with tempfile.TemporaryDirectory(prefix="surefoot-mutate-") as folder:
        project = Path(folder)
        copy_project(project)
        tests = [sys.executable, "-m", "coverage", "run", "-m", "pytest", "-q", "-p", "no:cacheprovider", "tests"]
        if run(project, *tests) or run(
            project, sys.executable, "-m", "coverage", "report", "--show-missing", "--fail-under=100"
        ):
            print("the gate's tests do not pass, or leave a line or branch of it out", file=sys.stderr)
            return 1
        if run(project, sys.executable, "-m", "mutmut", "run", "--max-children", "1"):
            print("mutmut failed", file=sys.stderr)
            return 1
        counts, survivors = results(project)
    explained = read_explanations()
    for mutant in survivors - explained.keys():
        print(f"SURVIVED, unexplained: {mutant.where}\n  - {mutant.was}\n  + {mutant.becomes}", file=sys.stderr)
    for mutant in explained.keys() - survivors:
        print(f"explained, but no longer there or killed: {mutant.where}\n  + {mutant.becomes}", file=sys.stderr)
    for mutant in survivors & explained.keys():
        print(f"equivalent: {mutant.where}: {mutant.becomes}\n  {explained[mutant]}")
    print(
        f"{sum(counts.values())} mutants of {GATE}: " + ", ".join(f"{n} {word}" for word, n in sorted(counts.items()))
    )
    return int(survivors != explained.keys())


def copy_project(to: Path) -> None:
    """Lay out what the gate and its tests need."""
    for package in ("bridge", "controller"):
        shutil.copytree(REPO / package, to / package, ignore=shutil.ignore_patterns("__pycache__"))
    tests = to / "tests" / "controller"
    tests.mkdir(parents=True)
    for pattern in ("test_controller_gate*.py", "controller_gates.py", "controller_messages.py"):
        for file in HERE.glob(pattern):
            shutil.copy(file, tests)
    (to / "pyproject.toml").write_text(PROJECT, encoding="utf-8")


def run(project: Path, *command: str) -> int:
    """Run `command` in the project; what it says goes to stderr."""
    return subprocess.run(command, cwd=project, stdout=sys.stderr, check=False).returncode


def ask(project: Path, *words: str) -> str:
    """Return what mutmut answers."""
    command = [sys.executable, "-m", "mutmut", *words]
    return subprocess.run(command, cwd=project, capture_output=True, text=True, check=True).stdout


def results(project: Path) -> tuple[dict[str, int], set[Mutant]]:
    """Return how many mutants ended how, and those that were not killed; one that never ends is killed by the clock."""
    counts: dict[str, int] = {}
    survivors = set()
    for name, status in re.findall(
        r"^\s*(controller\.gate\.\S+): (.+)$", ask(project, "results", "--all", "true"), re.M
    ):
        counts[status] = counts.get(status, 0) + 1
        if status not in ("killed", "timeout"):
            survivors.add(as_mutant(name, ask(project, "show", name)))
    return counts, survivors


def as_mutant(name: str, difference: str) -> Mutant:
    """Return the mutant with the lines that changed, without their indentation."""
    lines = [line for line in difference.splitlines() if re.match(r"[-+](?![-+])", line)]
    was, becomes = ("\n".join(line[1:].strip() for line in lines if line[0] == sign) for sign in "-+")
    where = re.sub(r"__mutmut_\d+$", "", name.removeprefix("controller.gate."))
    return Mutant(where.replace("xǁ", "").replace("ǁ", ".").removeprefix("x_"), was, becomes)


def read_explanations() -> dict[Mutant, str]:
    """Return why each explained mutant behaves like the original."""
    table = tomllib.loads(EXPLAINED.read_text(encoding="utf-8"))
    return {Mutant(entry["where"], entry["was"], entry["becomes"]): entry["why"] for entry in table["equivalent"]}


if __name__ == "__main__":
    raise SystemExit(main())
