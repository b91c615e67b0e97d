"""The format of a checkpoint's header: what is known, what is migrated, what is refused. Reads no networks.

Format 1 knew nothing of the centre's velocity: its networks see other inputs, so that only training makes them anew.
"""

from __future__ import annotations

import json
from collections.abc import Callable, Mapping
from pathlib import Path
from typing import Any, Final

from bridge.errors import CheckpointError

FORMAT: Final = 2
HEADER: Final = "surefoot"  # entry of the safetensors metadata
Step = Callable[[Mapping[str, Any]], dict[str, Any]]

STEPS: Final[Mapping[int, Step]] = {}  # from format N to N + 1, where the header alone has changed
OTHER_NETWORKS: Final = {1: "its networks do not see the velocity of the body's centre"}


def read_header(metadata: Mapping[str, str] | None, path: Path) -> dict[str, Any]:
    """Return the header in the metadata of the safetensors file `path`, as the present format has it.

    Raises:
        CheckpointError: there is none, it is damaged, or of a format that is not read.
    """
    text = (metadata or {}).get(HEADER)
    if text is None:
        raise CheckpointError(f"{path}: a safetensors file, but not a checkpoint of Surefoot (no '{HEADER}' header)")
    try:
        header = json.loads(text)
    except json.JSONDecodeError as error:
        raise CheckpointError(f"{path}: header is not JSON ({error})") from None
    if not isinstance(header, dict):
        raise CheckpointError(f"{path}: header is no table")
    return migrated(header, path)


def migrated(
    header: Mapping[str, Any], path: Path, steps: Mapping[int, Step] = STEPS, latest: int = FORMAT
) -> dict[str, Any]:
    """Return `header` as format `latest` has it; the one given stays as it is.

    Raises:
        CheckpointError: it is newer, or of a format whose networks can only be trained anew.
    """
    found = header.get("format")
    if not isinstance(found, int) or isinstance(found, bool) or found < 1:
        raise CheckpointError(f"{path}: checkpoint format is {found}, expected a number from 1 to {latest}")
    if found > latest:
        raise CheckpointError(
            f"{path}: checkpoint format is {found}, this Surefoot reads up to {latest}: upgrade Surefoot"
        )
    new = dict(header)
    for version in range(found, latest):
        if version not in steps:
            why = OTHER_NETWORKS.get(version, "its networks are others")
            raise CheckpointError(
                f"{path}: checkpoint format is {found}, this Surefoot reads {latest}: {why};"
                " make it again with `surefoot train`"
            )
        new = {**steps[version](new), "format": version + 1}
    return new
