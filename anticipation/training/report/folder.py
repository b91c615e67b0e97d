"""A report's folder: predictions, numbers and networks of each protocol, one page, its pictures."""

from __future__ import annotations

import json
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any, Final

from anticipation.training.evaluation import records
from anticipation.training.evaluation.records import Predictions
from anticipation.training.evaluation.results import results_of
from anticipation.training.report.page import TITLES, write_page
from bridge.errors import SourceError

_EXPERIMENT: Final = ("title", "columns", "rows")


def predictions_path(folder: Path, protocol: str) -> Path:
    """Return where the predictions of a protocol lie."""
    return folder / f"{protocol}.npz"


def stored_predictions(folder: Path, protocol: str) -> Predictions:
    """Read the predictions of a protocol.

    Raises:
        SourceError: they are not in the folder, or damaged.
    """
    path = predictions_path(folder, protocol)
    if not path.is_file():
        there = [name for name in TITLES if predictions_path(folder, name).is_file()]
        raise SourceError(
            f"'{folder}' holds no predictions of protocol '{protocol}', only of: {', '.join(there) or '-'}"
        )
    return records.load(path)


def render(source: Path, folder: Path, experiments: Sequence[Mapping[str, Any]] = ()) -> Path:
    """Compute the numbers of every protocol found in `source` and write them, pictures and page into `folder`.

    Raises:
        SourceError: predictions are damaged.
    """
    folder.mkdir(parents=True, exist_ok=True)
    predictions = {
        name: records.load(predictions_path(source, name))
        for name in TITLES
        if predictions_path(source, name).is_file()
    }
    reports = {name: results_of(each) for name, each in predictions.items()}
    for name, results in reports.items():
        write_json(results, folder / f"{name}.json")
    return write_page(folder, reports, predictions, experiments)


def write_json(results: Mapping[str, Any], path: Path) -> None:
    """Write numbers as JSON, whole or not at all."""
    part = path.with_name(path.name + ".part")
    part.write_text(json.dumps(results, indent=1, allow_nan=False) + "\n")
    part.replace(path)


def read_experiment(path: Path) -> dict[str, Any]:
    """Read an experiment that was run apart: title, columns, rows of name, values and spread.

    Raises:
        SourceError: it cannot be read, or lacks one of these.
    """
    try:
        content = json.loads(path.read_text())
    except (OSError, ValueError) as error:
        raise SourceError(f"experiment '{path}' cannot be read: {error}") from error
    missing = [name for name in _EXPERIMENT if name not in content] if isinstance(content, dict) else list(_EXPERIMENT)
    if missing:
        raise SourceError(f"experiment '{path}' has no '{missing[0]}'")
    for row in content["rows"]:
        if len(row["values"]) != len(content["columns"]):
            raise SourceError(
                f"experiment '{path}': row '{row['name']}' does not have {len(content['columns'])} values"
            )
    found: dict[str, Any] = content
    return found
