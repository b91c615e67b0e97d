"""One safetensors file with everything a predictor needs, described by a JSON header. No pickle.

    forecaster/...   classifier/...   outlook/...    network parameters; there may be no outlook
    plane/...        statistics/...    arrays of the transient plane and of the training poses
    temperature                        (16,) calibration, one per step

The header's entry `surefoot` holds the format version, the class and keypoint order, the architectures
with their settings, and where the weights come from.
"""

from __future__ import annotations

import json
import os
import tempfile
from collections.abc import Mapping
from contextlib import suppress
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any, Final, Literal

import numpy as np
import torch
from safetensors import SafetensorError, safe_open
from safetensors.torch import save as to_bytes
from torch import Tensor, nn

from anticipation.checkpoint_format import FORMAT, HEADER, read_header
from anticipation.gait_state import CLASSIFIERS, DirectedGraphNetwork
from anticipation.mirror import mirrored
from anticipation.motion import BASELINES, FORECASTERS, HORIZON, WINDOW, Forecast
from anticipation.outlook import Outlook
from anticipation.quality import PoseStatistics
from anticipation.shipped import DEFAULT
from anticipation.transient import TransientPlane
from bridge.errors import CheckpointError
from bridge.messages import CLASSES, STEPS, Floats, frozen
from perception.skeleton import NAMES

SHIPPED: Final = DEFAULT
_NETWORKS: Final = ("forecaster", "classifier", "outlook")
_OUTLOOKS: Final = {"outlook": Outlook}


@dataclass(frozen=True)
class Provenance:
    """Where the weights come from, for people who have to decide whether they may use them."""

    data: tuple[str, ...] = ()  # names of the data sets
    licence: str = ""
    protocol: str = ""  # how training and test were split
    metrics: Mapping[str, Any] = field(default_factory=dict)  # whatever JSON can say


@dataclass(frozen=True)
class Checkpoint:
    """The networks with the arrays that belong to them."""

    forecaster: nn.Module | str  # a module registered in FORECASTERS, or a name from BASELINES
    classifier: DirectedGraphNetwork  # registered in CLASSIFIERS
    plane: TransientPlane
    statistics: PoseStatistics
    temperature: Floats  # (16,) logits of step k are divided by temperature[k]
    provenance: Provenance = Provenance()
    outlook: Outlook | None = None  # its logits are averaged with the classifier's
    mirrored: bool = True  # and all logits with those of the mirrored motion

    def __post_init__(self) -> None:
        object.__setattr__(self, "temperature", frozen(self.temperature, (STEPS,), "temperature"))
        if not (np.isfinite(self.temperature) & (self.temperature > 0)).all():
            raise ValueError("temperature is not positive and finite")

    @property
    def forecast(self) -> Forecast:
        """The forecaster as a function (B, 15, 12, 2) -> (B, 15, 12, 2)."""
        return BASELINES[self.forecaster] if isinstance(self.forecaster, str) else self.forecaster

    def logits(self, window: Tensor) -> Tensor:
        """Return what a `Predictor` makes of windows (B, 15, 13, 2) before the temperatures: logits (B, 16, 3).

        The mean of what the classifier says of the windows foreseen and, if there is one, of what the outlook says;
        of the motion and, with `mirrored`, of its mirror image.
        """
        said = []
        for side in (window, mirrored(window)) if self.mirrored else (window,):
            said.append(self.classifier(torch.cat((side, self.forecast(side)), dim=1)))
            if self.outlook is not None:
                said.append(self.outlook(side))
        return torch.stack(said).mean(dim=0)


def save(checkpoint: Checkpoint, path: Path, storage: Literal["float16", "float32"] = "float16") -> None:
    """Write `checkpoint` to `path`: whole or not at all.

    Network matrices are stored as `storage` and restored to float32; vectors, norms and the plane keep their precision.
    """
    arrays: dict[str, Floats] = {"temperature": checkpoint.temperature}
    arrays |= {f"plane/{name}": array for name, array in checkpoint.plane.arrays().items()}
    arrays |= {f"statistics/{name}": array for name, array in checkpoint.statistics.arrays().items()}
    tensors = {name: torch.tensor(np.array(array, order="C")) for name, array in arrays.items()}
    header: dict[str, Any] = {
        "format": FORMAT,
        "classes": list(CLASSES),
        "keypoints": list(NAMES),
        "window": WINDOW,
        "horizon": HORIZON,
        "mirrored": checkpoint.mirrored,
        "plane": {"features": checkpoint.plane.features},
        "data": list(checkpoint.provenance.data),
        "licence": checkpoint.provenance.licence,
        "protocol": checkpoint.provenance.protocol,
        "metrics": dict(checkpoint.provenance.metrics),
    }
    for part in _NETWORKS:
        network = getattr(checkpoint, part)
        header[part] = None if network is None else _describe(network)
        if isinstance(network, nn.Module):
            tensors |= {f"{part}/{name}": _stored(value, storage) for name, value in network.state_dict().items()}
    write_whole(path, to_bytes(tensors, metadata={HEADER: json.dumps(header)}))


def load(path: Path | None = None) -> Checkpoint:
    """Read a checkpoint; None means the weights that come with the package. Networks are returned in evaluation mode.

    Raises:
        CheckpointError: missing, damaged, of another format or order, or with arrays that do not fit.
    """
    path = SHIPPED if path is None else path
    header, tensors = _read(path)
    _require(path, header, "classes", list(CLASSES))
    _require(path, header, "keypoints", list(NAMES))
    _require(path, header, "window", WINDOW)
    _require(path, header, "horizon", HORIZON)
    damaged = [name for name, value in tensors.items() if not torch.isfinite(value).all()]
    if damaged:
        raise CheckpointError(f"{path}: '{damaged[0]}' is not finite")
    try:
        return Checkpoint(
            forecaster=_built(header["forecaster"], FORECASTERS, _part(tensors, "forecaster")),
            classifier=_built(header["classifier"], CLASSIFIERS, _part(tensors, "classifier")),
            plane=TransientPlane.from_arrays(_arrays(tensors, "plane"), header["plane"]["features"]),
            statistics=PoseStatistics.from_arrays(_arrays(tensors, "statistics")),
            temperature=tensors["temperature"].double().numpy(),
            provenance=Provenance(tuple(header["data"]), header["licence"], header["protocol"], header["metrics"]),
            outlook=_built(header["outlook"], _OUTLOOKS, _part(tensors, "outlook")) if header["outlook"] else None,
            mirrored=bool(header["mirrored"]),
        )
    except KeyError as error:
        raise CheckpointError(f"{path}: {error} is missing or not known to this version") from None
    except (ValueError, TypeError, RuntimeError) as error:
        raise CheckpointError(f"{path}: {_one_line(error)}") from None


def _read(path: Path) -> tuple[dict[str, Any], dict[str, Tensor]]:
    if not path.is_file():
        raise CheckpointError(f"{path}: no such checkpoint")
    try:
        with safe_open(path, framework="pt") as file:
            metadata = file.metadata()
            tensors = {name: file.get_tensor(name) for name in file.keys()}  # noqa: SIM118 (no mapping)
    except (SafetensorError, OSError) as error:
        raise CheckpointError(f"{path}: not a whole safetensors file ({_one_line(error)})") from None
    return read_header(metadata, path), tensors


def _require(path: Path, header: Mapping[str, Any], name: str, expected: object) -> None:
    if header.get(name) != expected:
        raise CheckpointError(f"{path}: {name} are {header.get(name)}, expected {expected}")


def _describe(network: nn.Module | str) -> dict[str, Any]:
    if isinstance(network, str):
        return {"name": network}
    for name, kind in (*FORECASTERS.items(), *CLASSIFIERS.items(), *_OUTLOOKS.items()):
        if type(network) is kind:
            return {"name": name, "settings": network.settings}
    raise ValueError(f"{type(network).__name__} is not a registered network")


def _built(description: Mapping[str, Any], registry: Mapping[str, Any], state: dict[str, Tensor]) -> Any:
    name = description["name"]
    if registry is FORECASTERS and name in BASELINES:
        return name
    network: nn.Module = registry[name](**description["settings"])
    network.load_state_dict(state, strict=True)
    return network.eval().requires_grad_(False)


def _stored(value: Tensor, storage: str) -> Tensor:
    wide = value.is_floating_point() and value.ndim >= 2
    return value.detach().cpu().contiguous().to(getattr(torch, storage) if wide else value.dtype)


def _part(tensors: Mapping[str, Tensor], part: str) -> dict[str, Tensor]:
    return {
        name.removeprefix(f"{part}/"): value.float() if value.is_floating_point() else value
        for name, value in tensors.items()
        if name.startswith(f"{part}/")
    }


def _arrays(tensors: Mapping[str, Tensor], part: str) -> dict[str, Floats]:
    prefix = f"{part}/"
    return {name.removeprefix(prefix): value.numpy() for name, value in tensors.items() if name.startswith(prefix)}


def _one_line(error: Exception) -> str:
    lines = [line.strip() for line in str(error).splitlines() if line.strip()]
    return " ".join(lines[:2])


def write_whole(path: Path, content: bytes) -> None:
    """Write to a temporary file beside `path`, flush it to the disk and rename it."""
    path.parent.mkdir(parents=True, exist_ok=True)
    handle, temporary = tempfile.mkstemp(dir=path.parent, prefix=f".{path.name}.")
    try:
        with os.fdopen(handle, "wb") as file:
            file.write(content)
            file.flush()
            os.fsync(file.fileno())
        Path(temporary).chmod(0o644)  # mkstemp's 0o600 would hide shipped weights from other users
        Path(temporary).replace(path)
    except BaseException:
        with suppress(OSError):
            Path(temporary).unlink()
        raise
