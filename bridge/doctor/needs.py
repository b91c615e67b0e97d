"""What Surefoot needs of Python and of packages: by pyproject.toml where there is one, else as installed."""

from __future__ import annotations

import tomllib
from collections.abc import Mapping
from importlib.metadata import PackageNotFoundError, metadata, requires
from pathlib import Path
from typing import Any, Final, NamedTuple

from packaging.requirements import Requirement

NAME: Final = "surefoot"
PURPOSES: Final[Mapping[str, str]] = {
    "movenet": "poses from camera pictures with MoveNet",
    "yolo": "poses from camera pictures with YOLOv8-Pose",
    "video": "cameras and video files with an estimator of your own",
    "solvers": "the solver piqp",
    "view": "surefoot view",
    "train": "TensorBoard beside surefoot train",
    "export": "surefoot export",
    "campaign": "Parquet files of surefoot campaign",
    "cluster": "surefoot campaign on a Dask cluster",
    "tune": "surefoot tune",
    "docs": "make docs",
    "dev": "make test, make lint",
    "mutate": "make mutate",
    "bench": "make bench",
}


class Needs(NamedTuple):
    """Requirements by PEP 508."""

    python: str  # a version specifier
    packages: tuple[Requirement, ...]
    extras: Mapping[str, tuple[Requirement, ...]]
    source: str  # where they are written


def needs(folder: Path | None = None) -> Needs:
    """Return what the Surefoot in `folder` needs; None: the one that runs.

    A checkout's pyproject.toml counts before the metadata of an installation made from it some time ago.
    """
    root = Path(__file__).parents[2] if folder is None else folder
    file = root / "pyproject.toml"
    if file.is_file():
        project: dict[str, Any] = tomllib.loads(file.read_text(encoding="utf-8")).get("project", {})
        if project.get("name") == NAME:
            extras = project.get("optional-dependencies", {})
            return Needs(
                project["requires-python"],
                tuple(map(Requirement, project["dependencies"])),
                {name: tuple(map(Requirement, lines)) for name, lines in extras.items()},
                str(file),
            )
    return _installed()


def _installed() -> Needs:
    try:
        about, lines = metadata(NAME), requires(NAME) or []
    except PackageNotFoundError:
        return Needs("", (), {}, "nowhere: surefoot is not installed")
    every = [Requirement(line) for line in lines]
    named = {
        name: tuple(one for one in every if one.marker is not None and one.marker.evaluate({"extra": name}))
        for name in about.get_all("Provides-Extra") or []
    }
    always = tuple(one for one in every if one.marker is None or one.marker.evaluate({"extra": ""}))
    return Needs(str(about["Requires-Python"] or ""), always, named, "the installed package")
