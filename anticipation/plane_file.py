"""The transient plane of a checkpoint, for those who only draw it: read without PyTorch and without the networks."""

from __future__ import annotations

from typing import Final

from safetensors import SafetensorError, safe_open

from anticipation.checkpoint_format import read_header
from anticipation.shipped import weights
from anticipation.transient import TransientPlane
from bridge.errors import CheckpointError

_PREFIX: Final = "plane/"


def read_plane(checkpoint: str) -> TransientPlane:
    """Return the plane in the file `checkpoint`, or of the weights of that name that come with the package.

    Raises:
        CheckpointError: missing, damaged, or without a plane.
    """
    path = weights(checkpoint)
    if not path.is_file():
        raise CheckpointError(f"{path}: no such checkpoint")
    try:
        with safe_open(path, framework="np") as file:
            header = read_header(file.metadata(), path)
            names = [name for name in file.keys() if name.startswith(_PREFIX)]  # noqa: SIM118 (no mapping)
            arrays = {name.removeprefix(_PREFIX): file.get_tensor(name) for name in names}
        return TransientPlane.from_arrays(arrays, header["plane"]["features"])
    except (SafetensorError, OSError) as error:
        raise CheckpointError(f"{path}: not a whole safetensors file ({error})") from None
    except (KeyError, TypeError, ValueError) as error:
        raise CheckpointError(f"{path}: holds no transient plane that this version reads ({error})") from None
