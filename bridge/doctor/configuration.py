"""The configuration: that it loads, that its limits fit together, and that the files it names are there."""

from __future__ import annotations

import importlib
import shlex
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any, Final

from bridge.config.load import load_config, parse_text, read_text
from bridge.config.surefoot import SurefootConfig
from bridge.config.version import VERSION, version_of
from bridge.doctor.finding import Finding, Level, Patient
from bridge.errors import ConfigError, SurefootError
from bridge.plugin import parse_plugin

CONFIG: Final = "config"
SOURCE: Final = "source"


def check_config(patient: Patient) -> Iterator[Finding]:
    """Whether the configuration can be used."""
    path = patient.config_path
    name = "built-in values" if path is None else str(path)
    try:
        config = load_config(path, patient.overrides)
        # by its name: the bridge imports no other package
        check_limits: Callable[[SurefootConfig], Any] = importlib.import_module("controller.limits").check_limits
        check_limits(config)
    except ConfigError as error:
        mend = "correct the value" if path is None else f"surefoot config --check {shlex.quote(str(path))}"
        yield Finding(CONFIG, Level.BROKEN, str(error), mend)
        return
    yield Finding(CONFIG, Level.GOOD, f"{name}: every key is known, every value in range")
    if path is not None:
        version = version_of(parse_text(read_text(path), name), name)
        if version < VERSION:
            quoted = shlex.quote(str(path))
            yield Finding(
                CONFIG,
                Level.NOTE,
                f"{name}: is of version {version}, read as {VERSION}",
                f"surefoot config --migrate {quoted} --out {quoted} --force",
            )


def check_source(patient: Patient) -> Iterator[Finding]:
    """Whether what perception looks at, and the estimator it looks with, are there."""
    config = patient.config
    spec, estimator = config.perception.source.uri, config.perception.estimator
    if "perception" not in config.launch.roles:
        return
    if not spec:
        yield Finding(SOURCE, Level.NOTE, "perception.source.uri is not set", "surefoot up --source camera:0")
        return
    trouble = _missing(spec)
    if trouble:
        yield Finding(SOURCE, Level.BROKEN, f"perception.source.uri = {spec}: {trouble}", "surefoot up --source SPEC")
    else:
        yield Finding(SOURCE, Level.GOOD, f"perception.source.uri = {spec}")
    weights = {"movenet": config.perception.movenet.weights, "yolo": config.perception.yolo.model}.get(estimator)
    if weights is not None and ".npz:" not in spec and spec != "wire" and not Path(weights).is_file():
        key = {"movenet": "perception.movenet.weights", "yolo": "perception.yolo.model"}[estimator]
        text = f"{key} = {weights}: no such file" if weights else f"{key} is not set"
        yield Finding(SOURCE, Level.BROKEN, text, f"surefoot up --set {key}=FILE")


def _missing(spec: str) -> str:
    """Return why a source cannot be there, '' if nothing speaks against it."""
    kind, _, rest = spec.partition(":")
    if kind == "camera" and rest.isdigit():
        device = Path(f"/dev/video{rest}")
        return "" if device.exists() else f"there is no {device}"
    if "://" in spec or spec == "wire":
        return ""
    file = Path(f"{spec.partition('.npz:')[0]}.npz" if ".npz:" in spec else spec)
    if parse_plugin(spec) is not None and ".npz:" not in spec:
        return ""  # code of one's own: its process will say
    return "" if file.exists() else f"{file}: no such file"


def loaded(path: Path | None, overrides: tuple[str, ...]) -> SurefootConfig:
    """Return the configuration to examine by; the built-in values where it cannot be read, which a check will say."""
    try:
        return load_config(path, overrides)
    except SurefootError:
        return SurefootConfig()
