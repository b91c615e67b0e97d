"""The arrows of the architecture: which package may import which, and where the heavy libraries may appear."""

from __future__ import annotations

import ast
from pathlib import Path

import pytest

REPO = Path(__file__).resolve().parent.parent
PACKAGES = ("perception", "anticipation", "bridge", "controller", "simulation")

# importing package -> what it may import of the others, as dotted prefixes
ALLOWED = {
    "bridge": (),
    "perception": ("bridge",),
    "anticipation": ("bridge", "perception.skeleton", "perception.cleaning", "perception.features"),
    "controller": ("bridge",),
    "simulation": ("bridge", "perception.skeleton", "controller.walker", "controller.gate"),
}
# library -> where it may be imported, as paths relative to the repository
CONFINED = {
    "zenoh": ("bridge/",),
    "casadi": ("controller/mpc/",),
    "osqp": ("controller/mpc/",),
    "daqp": ("controller/mpc/",),
    "piqp": ("controller/mpc/",),
    "pinocchio": ("controller/walker.py",),
    "nicegui": ("controller/tuning/page/",),
    "pickle": (),
}
WIRE = ("bridge.transport", "bridge.inbox", "bridge.outbox", "bridge.node")


def sources() -> list[Path]:
    return [path for package in PACKAGES for path in sorted((REPO / package).rglob("*.py"))]


def imports(path: Path) -> set[str]:
    """Return every dotted name that a file imports, `from a import b` as `a.b`, at any depth of the code."""
    found: set[str] = set()
    for node in ast.walk(ast.parse(path.read_text(encoding="utf-8"))):
        if isinstance(node, ast.Import):
            found |= {alias.name for alias in node.names}
        elif isinstance(node, ast.ImportFrom):
            assert node.level == 0, f"{path} uses a relative import"
            found |= {f"{node.module}.{alias.name}" for alias in node.names}
    return found


def under(name: str, prefix: str) -> bool:
    return name == prefix or name.startswith(prefix + ".")


@pytest.mark.parametrize("package", PACKAGES)
def test_arrows_go_one_way(package: str) -> None:
    files = [path for path in sources() if path.relative_to(REPO).parts[0] == package]
    assert files, f"{package} is empty"
    for path in files:
        for name in imports(path):
            top = name.split(".")[0]
            if top in PACKAGES and top != package:
                assert any(under(name, prefix) for prefix in ALLOWED[package]), f"{path} imports {name}"


@pytest.mark.parametrize("library", CONFINED)
def test_heavy_libraries_stay_where_they_belong(library: str) -> None:
    for path in sources():
        if any(under(name, library) for name in imports(path)):
            place = path.relative_to(REPO).as_posix()
            assert any(place.startswith(home) for home in CONFINED[library]), f"{place} imports {library}"


def test_only_nodes_touch_the_wire() -> None:
    for path in sources():
        if path.name == "node.py" or path.relative_to(REPO).parts[0] == "bridge":
            continue
        # a Reading is a plain value that an inbox hands over; everything else of the wire is for nodes
        touched = {name for name in imports(path) if any(under(name, wire) for wire in WIRE)} - {"bridge.inbox.Reading"}
        assert not touched, f"{path} imports {sorted(touched)}"


def test_a_forbidden_arrow_would_be_seen(tmp_path: Path) -> None:
    offender = tmp_path / "offender.py"
    offender.write_text("def f():\n    from controller.walker import Walker\n    import zenoh.handlers\n")
    assert imports(offender) == {"controller.walker.Walker", "zenoh.handlers"}
    assert not any(under("perception.pipeline", prefix) for prefix in ALLOWED["anticipation"])


@pytest.mark.parametrize("path", sources(), ids=lambda path: str(path.relative_to(REPO)))
def test_no_module_is_a_drawer(path: Path) -> None:
    assert path.stem not in {"utils", "util", "helpers", "helper", "common", "misc"}
