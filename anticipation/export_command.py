"""`surefoot export`."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import torch
import typer
from rich.console import Console

from anticipation import checkpoint
from anticipation.export import TOLERANCE
from anticipation.export import export as export_graph


def export(
    out: Annotated[Path, typer.Option(help="Folder to write surefoot.onnx and surefoot.json to.")],
    weights: Annotated[
        Path | None,
        typer.Option("--weights", help="Checkpoint to export; default: the shipped one.", show_default=False),
    ] = None,
) -> None:
    """Write the networks as one ONNX graph, and compare it with PyTorch.

    The graph goes from a window of relative coordinates to calibrated probabilities for now and the next half second,
    and the foreseen motion; surefoot.json beside it names inputs, outputs, shapes, units and orders.

    Examples: `surefoot export --out deploy`, `surefoot export --weights mine.safetensors --out deploy`.
    """
    torch.set_num_threads(1)
    made = export_graph(checkpoint.load(weights), out, str(weights or "shipped with surefoot"))
    console = Console()
    for name, difference in made.differences.items():
        agreed = f"at most {difference:.1e} from PyTorch over {made.windows} windows, limit {TOLERANCE:.0e}"
        console.print(f"{name}: {agreed}")
    console.print(f"wrote {made.graph} ({made.graph.stat().st_size / 1e6:.1f} MB) and {made.about}", markup=False)
