"""The folder of recorded clips: what it was made from, and a line about each clip."""

from __future__ import annotations

import hashlib
import json
from collections.abc import Mapping
from pathlib import Path
from typing import Any, Final

from bridge.errors import SurefootError
from simulation.campaign.store import write

PLAN: Final = "clips.json"
TOLD: Final = "clips.jsonl"


class Clips:
    """A folder of clips; opened again it takes more of the same.

    Raises:
        SurefootError: it holds clips of another seed or configuration.
    """

    def __init__(self, folder: Path, made_from: Mapping[str, Any]) -> None:
        self.folder = folder
        plan = {
            "seed": made_from["seed"],
            "config_sha256": hashlib.sha256(str(made_from["config"]).encode()).hexdigest(),
        }
        file = folder / PLAN
        if file.exists():
            there = json.loads(file.read_text(encoding="utf-8"))
            for key, value in plan.items():
                if there.get(key) != value:
                    raise SurefootError(
                        f"{folder} holds clips with {key} = {there.get(key)}, wanted {value}; name another folder with"
                        " --out"
                    )
        folder.mkdir(parents=True, exist_ok=True)
        write(file, plan)

    def tell(self, clip: Mapping[str, Any]) -> None:
        """Add a line about a clip that was recorded."""
        with (self.folder / TOLD).open("a", encoding="utf-8") as file:
            file.write(json.dumps(dict(clip), sort_keys=True) + "\n")
