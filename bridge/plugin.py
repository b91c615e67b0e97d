"""Code of one's own, named by text: a module or a file of Python, and what is wanted of it.

    my_package.cameras:frames      a module that Python finds: installed, or in a folder on PYTHONPATH
    lab/depth_camera.py:frames     a file, from the working directory

Who writes the configuration or the command line decides what runs; nothing that comes over the wire is named so.
"""

from __future__ import annotations

import difflib
import importlib
import importlib.util
import re
import sys
from collections.abc import Callable
from pathlib import Path
from types import ModuleType
from typing import Any, Final, NamedTuple

from bridge.errors import ConfigError, SurefootError

_PLUGIN: Final = re.compile(r"^(?!.*\.npz:)(?P<place>.+\.py|[A-Za-z_]\w*(\.[A-Za-z_]\w*)*):(?P<name>[A-Za-z_]\w*)$")


class Plugin(NamedTuple):
    """Where something is found: `PLACE:NAME`."""

    place: str  # dotted module, or path of a .py file
    name: str


def parse_plugin(text: str) -> Plugin | None:
    """Return what `text` names, or None if it has another form than `module:name` or `file.py:name`."""
    match = _PLUGIN.match(text)
    return None if match is None else Plugin(match["place"], match["name"])


def is_file(place: str) -> bool:
    """Whether `place` is the path of a file and not the name of a module."""
    return place.endswith(".py")


def load_plugin(plugin: Plugin, what: str) -> Callable[..., Any]:
    """Return the function or class that `plugin` names; `what` is what errors call it.

    Raises:
        ConfigError: no such file, module or name, or it fails while it is imported; one line says which.
    """
    try:
        module = load_module(plugin.place)
    except ConfigError as error:
        raise ConfigError(f"{what}: {error}") from error
    found = getattr(module, plugin.name, None)
    if callable(found):
        wanted: Callable[..., Any] = found
        return wanted
    names = [name for name, value in vars(module).items() if callable(value) and not name.startswith("_")]
    nearest = difflib.get_close_matches(plugin.name, names, n=1, cutoff=0.5)
    hint = f"; did you mean '{nearest[0]}'?" if nearest else ""
    how = "is no function or class" if hasattr(module, plugin.name) else "is not there"
    raise ConfigError(f"{what}: {plugin.place}: '{plugin.name}' {how}{hint}")


def load_module(place: str) -> ModuleType:
    """Import the module or the file `place`.

    A file finds its neighbours, after everything that is installed.

    Raises:
        ConfigError: it is not there, or fails while it is imported.
    """
    require_place(place)
    try:
        return _import_file(Path(place)) if is_file(place) else importlib.import_module(place)
    except SurefootError:
        raise
    except Exception as error:  # whatever its author did not foresee
        raise ConfigError(f"{place} fails when it is imported: {type(error).__name__}: {error}") from error


def require_place(place: str) -> None:
    """Raise unless there is a module or file `place`; its own code is not run, that of the packages it lies in is.

    Raises:
        ConfigError: there is none; says what to do.
    """
    if is_file(place):
        if not Path(place).is_file():
            raise ConfigError(f"no such file: {place} (from {Path.cwd()})")
        return
    try:
        found = place in sys.modules or importlib.util.find_spec(place) is not None
    except (ImportError, ValueError):
        found = False
    if not found:
        raise ConfigError(
            f"no module '{place}': install it, put its folder on PYTHONPATH, or name its file, such as ./NAME.py"
        )


def _import_file(path: Path) -> ModuleType:
    path = path.resolve()
    name = f"surefoot_plugin.{path.stem}"
    loaded = sys.modules.get(name)
    if loaded is not None and loaded.__file__ == str(path):
        return loaded
    if str(path.parent) not in sys.path:
        sys.path.append(str(path.parent))
    spec = importlib.util.spec_from_file_location(name, path)
    assert spec is not None
    assert spec.loader is not None
    module = importlib.util.module_from_spec(spec)
    sys.modules[name] = module  # dataclasses look themselves up there
    try:
        spec.loader.exec_module(module)
    except BaseException:
        del sys.modules[name]
        raise
    return module
