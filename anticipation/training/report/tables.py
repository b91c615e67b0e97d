"""The tables of the page, as text in cells."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any, Final, NamedTuple

import numpy as np

from anticipation.training.evaluation.scores import CONSTANT, SHIPPED, ZERO
from anticipation.training.report import paper

Results = Mapping[str, Any]

KINDS: Final = {"accuracy": "accuracy", "macro_f1": "macro-F1"}
ERROR_MS: Final = (100, 200, 300, 400, 500)


class Table(NamedTuple):
    """Cells under a head; the first column names the row."""

    title: str
    head: Sequence[str]
    rows: Sequence[Sequence[str]]
    note: str = ""


def table_2(results: Results) -> Table:
    """Forecast error (the paper's Table 2), ours in body lengths over all frames and while falling."""
    at = [results["error_horizons_ms"].index(ms) for ms in ERROR_MS]
    rows = []
    for kind, title in (("all_body", "all frames"), ("falling_body", "while falling")):
        for name, parts in results["forecast_error"][kind].items():
            rows.append([f"{name}, {title}", *_mean_and_spread(parts, at)])
    rows.append(
        ["paper, its protocol and normalisation", *(
            f"{mean:.3f} ± {spread:.3f}" for mean, spread in zip(paper.ERROR[1:], paper.ERROR_SPREAD[1:], strict=True)
        )]
    )  # fmt: skip
    return Table(
        "Table 2. Forecast error [body lengths]",
        ["forecast", *(f"{ms} ms" for ms in ERROR_MS)],
        rows,
        "Mean distance of the twelve keypoints in coordinates relative to the upper-body centre; mean ± sd over parts. "
        "A body length is shoulder to ankle. The paper does not say by what it normalises.",
    )


def against_naive(results: Results) -> Table:
    """Forecast error while falling over that of the best forecast without learning."""
    at = [results["error_horizons_ms"].index(ms) for ms in ERROR_MS]
    errors = {
        name: np.array(parts, dtype=np.float64)[:, at]
        for name, parts in results["forecast_error"]["falling_body"].items()
    }
    best = np.minimum(np.nanmean(errors[ZERO], axis=0), np.nanmean(errors[CONSTANT], axis=0))
    ratio = np.nanmean(errors[SHIPPED], axis=0) / best
    by_part = errors[SHIPPED] / np.minimum(errors[ZERO], errors[CONSTANT])
    return Table(
        "Forecast error while falling, over that of the best naive forecast",
        ["", *(f"{ms} ms" for ms in ERROR_MS)],
        [
            ["all parts", *(f"{each:.2f}" for each in ratio)],
            [
                "smallest and largest part",
                *(
                    f"{low:.2f} to {high:.2f}"
                    for low, high in zip(by_part.min(axis=0), by_part.max(axis=0), strict=True)
                ),
            ],
        ],
    )


def table_3(results: Results, table: str, kind: str, title: str, with_paper: bool = False) -> Table:
    """Accuracy or macro-F1 over the horizon, ours and the simpler ways, beside the paper's own numbers."""
    content = results["tables"][table]
    rows = [[name, *_mean_and_spread(parts)] for name, parts in content[kind].items()]
    if with_paper:
        for name, values in paper.ACCURACY.items():
            rows.append([f"paper, its protocol: {name}", *("–" if each is None else f"{each:.3f}" for each in values)])
    tested, excluded = content["tested_frames"], content["excluded_frames"]
    note = (
        f"{content['clips']} clips, {tested} labelled frames tested, {excluded} "
        f"({excluded / max(1, tested + excluded):.1%}) left out"
    )
    why = "without a horizon" if table == "urfd_every_horizon" else "whose window of 15 frames is not whole"
    why += " or was learnt" if results["protocol"] == "paper" else ""
    return Table(title, _head(results), rows, f"{note} {why}. Mean ± sd over {len(content['parts'])} part(s).")


def by_part(results: Results, table: str, title: str) -> Table:
    """The shipped row part by part, accuracy and macro-F1."""
    content = results["tables"][table]
    rows = [
        [f"{results['parts'][part]}, {name}", *(_number(each) for each in values)]
        for kind, name in KINDS.items()
        for part, values in zip(content["parts"], content[kind][SHIPPED], strict=True)
    ]
    return Table(title, _head(results), rows)


def calibration(results: Results) -> Table:
    """Expected calibration error before and after the temperatures."""
    content = results["calibration"]
    steps = [0, *(results["error_horizons_ms"].index(ms) + 1 for ms in ERROR_MS)]
    rows = [
        [f"{name} the temperature", *(_number(content[f"error_{name}"][step]) for step in steps)]
        for name in ("before", "after")
    ]
    rows.append(
        [
            "temperature (median of the parts)",
            *(f"{each:.2f}" for each in np.median(np.array(content["temperatures"]), axis=0)[steps]),
        ]
    )
    return Table(
        "Expected calibration error",
        ["", *(f"{ms} ms" for ms in (0, *ERROR_MS))],
        rows,
        "Ten bins. Each part's temperatures come from the other parts' held-out falls, so 'after' is a test as well.",
    )


def onset(results: Results) -> Table:
    """The two onsets of each data set, and what a perfect predictor of one would reach under the other."""
    rows = []
    for name, content in results["onset"].items():
        if not content["clips"]:
            continue
        dataset = np.array([clip["dataset_s"] for clip in content["clips"]], dtype=np.float64)
        physical = np.array([clip["physical_s"] for clip in content["clips"]], dtype=np.float64)
        rows.append(
            [
                {"urfd": "URFD", "upfall": "UP-Fall"}[name],
                str(len(dataset)),
                f"{np.median(dataset):.2f} ({dataset.min():.2f} to {dataset.max():.2f})",
                f"{np.nanmedian(physical):.2f} ({np.nanmin(physical):.2f} to {np.nanmax(physical):.2f})",
                _number(content["agreement"]),
            ]
        )
    return Table(
        "Two annotations of onset",
        ["", "falls", "data set's [s before lying]", "physical [s before lying]", "labels agree"],
        rows,
        "Median and range. The last column is the accuracy that a perfect predictor of one annotation would have under "
        "the other: what lies above it is the annotation, not the person.",
    )


def events(results: Results) -> Table:
    """Falls foreseen by the whole system."""
    rows = []
    for name, title in (("urfd", "URFD"), ("upfall", "UP-Fall"), ("all", "together")):
        content = results["events"][name]
        if not content["falls"]:
            continue
        low, high = content["share_interval"]
        share = f"{content['foreseen']} ({content['share']:.0%}, {low:.0%} to {high:.0%})"
        counts = [str(content[name]) for name in ("early", "early_physical", "late")]
        times = [_seconds(content[name]) for name in ("median_lead", "fifth_percentile_lead")]
        rows.append([title, str(content["falls"]), share, *counts, *times])
    return Table(
        "Falls foreseen before the first lying frame, with no alarm before onset",
        ["", "falls", "foreseen (95 % interval)", "alarm before data set's onset", "alarm before physical onset",
         "too late", "median lead", "5th percentile"],
        rows,
        "By networks that had not seen the fall, through the whole system. An alarm is GUARD or ARREST. "
        "Leads are those of the falls foreseen.",
    )  # fmt: skip


def daily(results: Results) -> Table:
    """Interventions where nobody falls."""
    rows = []
    for each in results["daily"]:
        low, high = each["interval"]
        counts = [str(each[name]) for name in ("clips_with_any", "clips_with_arrest", "interventions")]
        rate = f"{each['per_hour']:.1f} ({low:.1f} to {high:.1f})"
        above = f"{each['frames_above']} of {each['frames']}"
        minutes = f"{60 * each['hours']:.1f}"
        rows.append([each["activity"], str(each["clips"]), minutes, *counts, rate, above, str(each["clips_stopped"])])
    return Table(
        "Interventions where nobody falls",
        ["activity", "clips", "minutes", "clips with GUARD or ARREST", "with ARREST", "interventions",
         "per hour (exact 95 %)", "frames with p(fall) > ½ at 500 ms", "clips with SAFE_STOP"],
        rows,
        "By networks that had not seen the clip, through the whole system. SAFE_STOP means that nobody is to be seen.",
    )  # fmt: skip


def transient(results: Results) -> Table:
    """Planes compared."""
    rows = [
        [
            each["name"], str(len(each["correlations"])), _number(each["median"]), _number(each["worst_tenth"]),
            "–" if each["share"] is None else f"{each['share']:.0%}", _number(each["accuracy"]),
            _number(None if each["accuracy"] is None else each["classifier"] - each["accuracy"]),
        ]
        for each in results["transient"]
    ]  # fmt: skip
    return Table(
        "Distance to the fall boundary in the last second of held-out falls",
        ["plane", "falls", "median Spearman", "worst tenth", "falls with ≥ 0.8", "accuracy of regions",
         "lost against classifier"],
        rows,
        "Spearman's correlation of the distance with the time to the first lying frame: 1 where it shrinks at every "
        "tick. Accuracy at the present step, same ticks for plane and classifier.",
    )  # fmt: skip


def across(grouped: Results, cross: Results) -> Table:
    """Macro-F1 of each data set by networks that knew it, and by networks that knew only the other."""
    rows = []
    for name, title in (("upfall", "UP-Fall"), ("urfd", "URFD")):
        if name not in grouped["tables"] or name not in cross["tables"]:
            continue
        own, other = (
            np.array(each["tables"][name]["pooled"]["macro_f1"][SHIPPED], dtype=np.float64) for each in (grouped, cross)
        )
        rows += [
            [f"{title}, other recordings of it learnt", *(_number(each) for each in own)],
            [f"{title}, never learnt", *(_number(each) for each in other)],
            ["drop", *(_number(each) for each in own - other)],
        ]
    return Table(
        "Another data set, never learnt from: macro-F1",
        _head(grouped),
        rows,
        "All parts' frames together. Both kinds of network know the mocap walks.",
    )


def experiment(content: Mapping[str, Any]) -> Table:
    """An experiment that was run apart."""
    rows = []
    for row in content["rows"]:
        spread = row.get("spread") or [None] * len(row["values"])
        cells = [
            _number(value) if sd is None else f"{_number(value)} ± {_number(sd)}"
            for value, sd in zip(row["values"], spread, strict=True)
        ]
        rows.append([row["name"], *cells])
    return Table(content["title"], [content.get("unit", ""), *content["columns"]], rows, content.get("note", ""))


def _head(results: Results) -> list[str]:
    return ["", *(f"{ms} ms" for ms in results["horizons_ms"])]


def _mean_and_spread(parts: Sequence[Sequence[float | None]], at: Sequence[int] | None = None) -> list[str]:
    values = np.array(parts, dtype=np.float64)
    values = values if at is None else values[:, at]
    cells = []
    for column in values.T:
        known = column[np.isfinite(column)]
        spread = f" ± {known.std():.3f}" if len(known) > 1 else ""
        cells.append(f"{known.mean():.3f}{spread}" if len(known) else "–")
    return cells


def _number(value: float | None) -> str:
    return "–" if value is None or not np.isfinite(value) else f"{value:.3f}"


def _seconds(value: float | None) -> str:
    return "–" if value is None else f"{1000 * value:.0f} ms"
