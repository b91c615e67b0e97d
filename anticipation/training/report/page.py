"""One HTML page with its pictures beside it, from the protocols that a folder holds."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any, Final

from jinja2 import Environment, PackageLoader, StrictUndefined
from matplotlib.figure import Figure

from anticipation.training.evaluation.records import Predictions
from anticipation.training.evaluation.scores import SHIPPED
from anticipation.training.report import tables
from anticipation.training.report.confusion import confusion
from anticipation.training.report.drawing import DOTS_PER_INCH, write
from anticipation.training.report.experiment import curve
from anticipation.training.report.leads import leads
from anticipation.training.report.over_horizon import accuracy, error
from anticipation.training.report.reliability import reliability
from anticipation.training.report.strip import strip
from anticipation.training.report.tables import Results, Table
from anticipation.training.report.targets import targets
from anticipation.training.report.transient_plane import approach, plane

PAGE: Final = "index.html"
TITLES: Final = {
    "grouped": "By recording",
    "paper": "The paper's protocol",
    "cross": "Across data sets",
}
WHAT: Final = {
    "grouped": "Every number of this section is of recordings whose group (a fall with both its tracks; an UP-Fall "
    "activity and trial) none of the networks had seen.",
    "paper": "A random fifth of overlapping windows, as the paper may have split: neighbours of every test window were "
    "learnt. The numbers say how well a network remembers; they are here only to stand beside the paper's.",
    "cross": "Networks that know one data set of falls and the mocap walks, tested on the other: another room, camera, "
    "person and way of labelling.",
}


@dataclass(frozen=True, slots=True)
class Picture:
    """A file beside the page."""

    file: str
    caption: str
    width: int  # [px]


@dataclass(slots=True)
class Section:
    """A heading with what stands under it."""

    anchor: str
    title: str
    text: str = ""
    pictures: list[Picture] = field(default_factory=list)
    tables: list[Table] = field(default_factory=list)


def write_page(
    folder: Path,
    reports: Mapping[str, Results],
    predictions: Mapping[str, Predictions],
    experiments: Sequence[Mapping[str, Any]] = (),
) -> Path:
    """Write the page and all pictures into `folder`.

    Args:
        folder: where they go; it is there.
        reports: numbers by protocol, from `results_of`.
        predictions: what they were computed from, for the pictures of single falls.
        experiments: tables that were measured apart.
    """
    sections = [Section("targets", "Targets", tables=[targets(reports)])]
    for protocol in (name for name in TITLES if name in reports):
        sections += _protocol(folder, protocol, reports[protocol], predictions[protocol])
    if "cross" in reports and "grouped" in reports:
        sections.append(
            Section("drop", "What a new data set costs", tables=[tables.across(reports["grouped"], reports["cross"])])
        )
    if experiments:
        sections.append(_experiments(folder, experiments))
    environment = Environment(
        loader=PackageLoader("anticipation.training", "report"), autoescape=True, undefined=StrictUndefined
    )
    text = environment.get_template("page.html").render(
        title="How well falls are foreseen",
        introduction="Accuracy at a horizon compares the state foreseen at a frame with the label of the frame so far "
        "ahead. Colours: stable blue, transient orange, fall red, present black, anticipated cyan.",
        sections=sections,
        shipped=SHIPPED,
    )
    path = folder / PAGE
    part = folder / f"{PAGE}.part"
    part.write_text(text, encoding="utf-8")
    part.replace(path)
    return path


def _protocol(folder: Path, protocol: str, results: Results, predictions: Predictions) -> list[Section]:
    """Return the sections of one protocol: everything for the honest one, the main tables for the others."""

    def drawn(name: str, made: Figure | None, caption: str) -> list[Picture]:
        if made is None:
            return []
        path = write(made, folder / f"{protocol}-{name}.png")
        return [Picture(path.name, caption, round(float(made.get_size_inches()[0]) * DOTS_PER_INCH))]

    keypoints = results["keypoints"]
    falls = [
        record
        for record in predictions.of("fall", estimator="" if keypoints == "both" else keypoints)
        if record.ticks is not None
    ]
    have = results["tables"]
    main = Section(protocol, TITLES[protocol], WHAT[protocol])
    main.pictures += drawn("accuracy", accuracy(results), "Accuracy over the horizon (Table 3).")
    main.pictures += drawn("confusion", confusion(have["urfd"]), "Confusion matrices, URFD falls, as shipped.")
    main.tables += [
        tables.table_3(results, "urfd", "accuracy", f"Table 3. Accuracy, URFD falls ({keypoints})", with_paper=True),
        tables.table_3(results, "urfd", "macro_f1", f"Macro-F1, URFD falls ({keypoints})"),
        tables.by_part(results, "urfd", "As shipped, part by part, URFD falls"),
    ]
    for name, title in (
        ("urfd_other_tracks", "URFD falls, the other estimator's tracks"),
        ("urfd_every_horizon", "URFD falls, every frame with a horizon, also with lost keypoints"),
        ("upfall", "UP-Fall falls"),
    ):
        if name in have:
            main.tables += [
                tables.table_3(results, name, kind, f"{title}: {what}") for kind, what in tables.KINDS.items()
            ]
    if "upfall" in have:
        main.tables.append(tables.by_part(results, "upfall", "As shipped, part by part, UP-Fall falls"))
    forecast = Section(f"{protocol}-forecast", f"{TITLES[protocol]}: forecast")
    forecast.pictures += drawn("error", error(results), "Forecast error over the horizon (Fig. 4).")
    forecast.pictures += drawn(
        "strip", strip(falls), "What came and what was foreseen (Fig. 3), relative to the body's centre."
    )
    forecast.tables += [tables.table_2(results), tables.against_naive(results)]
    rest: list[Section] = []
    if "events" in results:
        rest.append(
            _system(protocol, results, drawn("leads", leads(results["events"]), "Every fall: onset, alarms, lying."))
        )
    if protocol == "grouped":
        rest += [
            Section(
                "calibration", "Calibration", "",
                drawn("reliability", reliability(results), "Reliability before and after the temperature."),
                [tables.calibration(results)],
            ),
            Section(
                "transient", "Transient state", "",
                drawn("plane", plane(predictions, falls), "The plane with its regions and one fall's way (Fig. 5).")
                + drawn("approach", approach(falls), "Distance to the fall boundary; each line is a held-out fall."),
                [tables.transient(results)],
            ),
            Section(
                "onset", "Which onset",
                "Every table above goes by the data sets' labels: URFD calls exactly the last second before lying "
                "'falling'. Below, 'transient' begins with the physical onset, found from the motion itself "
                "(evaluation/onset.py); the networks are the same, learnt from the data sets' labels.",
                tables=[
                    tables.onset(results),
                    *(
                        tables.table_3(results, name, kind, f"{title}, physical onset: {what}")
                        for name, title in (("urfd_physical", "URFD falls"), ("upfall_physical", "UP-Fall falls"))
                        if name in have
                        for kind, what in tables.KINDS.items()
                    ),
                ],
            ),
        ]  # fmt: skip
    return [main, forecast, *rest]


def _system(protocol: str, results: Results, pictures: list[Picture]) -> Section:
    return Section(
        f"{protocol}-events",
        f"{TITLES[protocol]}: falls foreseen and interventions",
        "Keypoints through perception, anticipation and the intervention's supervisor as they run live.",
        pictures,
        [tables.events(results), tables.daily(results)],
    )


def _experiments(folder: Path, experiments: Sequence[Mapping[str, Any]]) -> Section:
    section = Section("experiments", "Experiments")
    for number, each in enumerate(experiments, start=1):
        section.tables.append(tables.experiment(each))
        if each.get("x"):
            made = curve(each)
            path = write(made, folder / f"experiment-{number}.png")
            section.pictures.append(Picture(path.name, each["title"], round(made.get_size_inches()[0] * DOTS_PER_INCH)))
    return section
