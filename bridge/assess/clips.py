"""The clips to assess: whatever the keypoint-file source reads live, all of it checked before anything runs."""

from __future__ import annotations

from collections.abc import Sequence
from importlib import import_module
from pathlib import Path
from typing import NamedTuple

from bridge.config.perception import SourceConfig
from bridge.errors import SourceError


class Clip(NamedTuple):
    """One recording of one person."""

    name: str
    path: Path
    stamps_ns: list[int]  # time of each frame since the first [ns]


def read_clips(paths: Sequence[Path], config: SourceConfig) -> list[Clip]:
    """Return every clip of every file.

    Raises:
        SourceError: a file is missing or unreadable, holds no clip or a bad one, or two clips share a name.
    """
    reader = import_module("perception.sources.keypoint_file")
    clips: dict[str, Clip] = {}
    for path in paths:
        names: list[str] = reader.clip_names(path)
        if not names:
            raise SourceError(f"{path}: no clip in it, expected arrays NAME/keypoints and NAME/fps")
        for name in names:
            if name in clips:
                raise SourceError(f"{path}: clip '{name}' is also in {clips[name].path}")
            clips[name] = Clip(name, path, reader.read_clip(path, name, config).stamps_ns)
    return list(clips.values())
