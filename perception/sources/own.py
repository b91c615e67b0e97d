"""A source of one's own, named `module:name` or `file.py:name`.

The named function is called with a clock and the options of the role, and returns an iterator of `Frame` (a
generator function is one line to write) or, for who wants to pace frames himself, a `Source`.
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import Final

from bridge.clock import Clock
from bridge.errors import SourceError, SurefootError
from bridge.plugin import Plugin, load_plugin
from perception.sources.frame import Source
from perception.sources.live import Live

_SOURCE: Final = ("name", "gives_images", "finished", "next", "wait", "close")


def open_own(plugin: Plugin, spec: str, clock: Clock, options: Mapping[str, str]) -> Source:
    """Open what `plugin` names.

    Args:
        plugin: where it is found.
        spec: what errors and messages call it.
        clock: stamps its frames.
        options: `launch.options.perception` and the command line, for it to read.

    Raises:
        ConfigError: there is no such thing.
        SourceError: it fails, gives no frame, or something that is none; one line says which.
    """
    make = load_plugin(plugin, f"source '{spec}'")
    try:
        made = make(clock, options)
        if hasattr(made, "__next__"):
            return Live(spec, made, clock)
    except SurefootError:
        raise
    except Exception as error:  # whatever its author did not foresee
        raise SourceError(f"source '{spec}' fails: {type(error).__name__}: {error}") from error
    missing = [name for name in _SOURCE if not hasattr(made, name)]
    if missing:
        raise SourceError(
            f"source '{spec}' gives a {type(made).__name__}, expected an iterator of frames, or a Source "
            f"(it has no {', '.join(missing)})"
        )
    source: Source = made
    return source
