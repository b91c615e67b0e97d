"""How a benchmark says its numbers: percentiles, the machine they were taken on, one report."""

from __future__ import annotations

import json
import os
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np


def percentiles(values_ms: Sequence[float]) -> dict[str, float]:
    """Return count, median, 99th percentile and maximum."""
    p50, p99 = np.percentile(values_ms, [50, 99])
    return {
        "count": len(values_ms),
        "p50_ms": round(float(p50), 3),
        "p99_ms": round(float(p99), 3),
        "max_ms": round(max(values_ms), 3),
    }


def machine() -> dict[str, Any]:
    """Return what numbers of time depend on."""
    return {"cores": os.cpu_count(), "load_1min": round(os.getloadavg()[0], 2)}


def report(result: Mapping[str, Any], file: Path | None) -> None:
    """Print `result`, and write it to `file` where one is named."""
    text = json.dumps(result, indent=2)
    print(text)
    if file is not None:
        file.parent.mkdir(parents=True, exist_ok=True)
        file.write_text(text + "\n")
