"""`surefoot export`."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import torch
import typer

from anticipation.checkpoint import load
from anticipation.export import TOLERANCE
from anticipation.export import export as export_graph
from bridge.command_line.options import JsonOption
from bridge.command_line.output import STDOUT, note, require_writable, result, status, write_json


def export(
    out: Annotated[
        Path, typer.Option("--out", metavar="FOLDER", help="Folder to write surefoot.onnx and surefoot.json to.")
    ],
    checkpoint: Annotated[
        Path | None,
        typer.Option(
            "--checkpoint", metavar="FILE", help="Checkpoint to export; default: the shipped one.", show_default=False
        ),
    ] = None,
    json: JsonOption = None,
) -> None:
    """Write the networks as one ONNX graph, and compare it with PyTorch.

    The graph goes from a window of relative coordinates to calibrated probabilities for now and the next half second,
    and the foreseen motion; surefoot.json beside it names inputs, outputs, shapes, units and orders.

    Example: surefoot export --checkpoint mine.safetensors --out deploy
    """
    if json is not None:
        require_writable(json)
    torch.set_num_threads(1)
    with status("exporting and comparing"):
        made = export_graph(load(checkpoint), out, str(checkpoint or "shipped with surefoot"))
    if json is not None:
        write_json(json, {**made._asdict(), "tolerance": TOLERANCE})
    if json != STDOUT:
        for name, difference in made.differences.items():
            agreed = f"at most {difference:.1e} from PyTorch over {made.windows} windows, limit {TOLERANCE:.0e}"
            result(f"{name}: {agreed}")
    note(f"wrote {made.graph} ({made.graph.stat().st_size / 1e6:.1f} MB) and {made.about}")
