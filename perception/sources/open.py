"""From the text a user gives to the source it means."""

from __future__ import annotations

import re
from collections.abc import Mapping
from pathlib import Path

from bridge.clock import Clock
from bridge.config.perception import SourceConfig
from bridge.errors import SourceError
from bridge.plugin import parse_plugin
from perception.sources.camera import open_camera
from perception.sources.frame import Source
from perception.sources.image_folder import open_folder
from perception.sources.keypoint_file import read_clip, stills
from perception.sources.own import open_own
from perception.sources.playback import Playback
from perception.sources.video_file import open_video

_NPZ = re.compile(r"^(?P<file>.+\.npz)(?::(?P<clip>.*))?$")
_CAMERA = re.compile(r"^camera:(?P<number>\d+)$")
_URL = re.compile(r"^(https?|rtsps?|rtmp|udp|tcp)://")
_FORMS = (
    "FILE.npz:CLIP[/ARRAY], a video file, a folder of images, camera:N, a URL, wire, "
    "or code of your own as module:name or file.py:name"
)


def open_source(spec: str, config: SourceConfig, clock: Clock, options: Mapping[str, str] | None = None) -> Source:
    """Open the source that `spec` names.

    Args:
        spec: `FILE.npz:CLIP[/ARRAY]`, a video file, a folder of images, `camera:N`, a URL, or `module:name`.
        config: crop, pacing, a camera's delay, and what files may lack.
        clock: stamps the frames of cameras.
        options: of the role, for a source of one's own.

    Raises:
        SourceError: one line saying what is wrong with it.
        ConfigError: a source of one's own is not there.
        MissingExtraError: images are to be read and OpenCV is not installed.
    """
    crop = None
    if config.crop_px:
        x, y, width, height = config.crop_px
        crop = (x, y, width, height)
    if not spec:
        raise SourceError(f"no source given: set --source or perception.source.uri to {_FORMS}")
    if (npz := _NPZ.match(spec)) is not None:
        clip = read_clip(Path(npz["file"]), npz["clip"] or "", config)
        return Playback(spec, stills(clip), paced=config.paced)
    if (camera := _CAMERA.match(spec)) is not None:
        return open_camera(int(camera["number"]), crop, clock, config.latency_s)
    if _URL.match(spec):
        return open_camera(spec, crop, clock, config.latency_s)
    if (plugin := parse_plugin(spec)) is not None and plugin.place != "camera":
        if crop is not None:
            raise SourceError(f"source '{spec}': a crop is not applied to a source of your own; cut its images there")
        return open_own(plugin, spec, clock, options or {})
    path = Path(spec)
    if path.is_dir():
        return Playback(spec, open_folder(path, crop, config.fps_hz), paced=config.paced)
    if path.is_file():
        return Playback(spec, open_video(path, crop, config.fps_hz), paced=config.paced)
    raise SourceError(f"source '{spec}': no such file or folder; expected {_FORMS}")
