"""Campaigns: what is measured, what is kept, and that stopping, workers and machines change nothing."""

from __future__ import annotations

import json
import os
import subprocess
import sys
import time
import warnings
from pathlib import Path
from typing import Any

import numpy as np
import pyarrow.parquet
import pytest
from campaign_results import measured, quick, trace

from bridge.cli import main
from bridge.config.surefoot import SurefootConfig
from bridge.errors import ConfigError, SurefootError
from simulation.campaign import workers
from simulation.campaign.campaign import Plan, run_campaign
from simulation.campaign.job import Job, perform
from simulation.campaign.statistics import percentile, share
from simulation.campaign.summary import summarise
from simulation.scenarios.scenario import Scenario

ASKED = {
    "falls", "falls_arrested", "non_falls", "needless_arrests", "tip_overs", "pelvis_drop_p95_m",
    "peak_force_median_n", "lead_median_s",
}  # fmt: skip
REPO = Path(__file__).resolve().parents[2]


def plan(falls: int = 3, non_falls: int = 2, **changes: Any) -> Plan:
    return Plan(falls, non_falls, 7, SurefootConfig(), **changes)


def files(folder: Path) -> dict[str, bytes]:
    names = ("summary.json", "results.parquet", "index.html", *(f"trials/{p.name}" for p in folder.glob("trials/*")))
    return {name: (folder / name).read_bytes() for name in names}


@pytest.mark.parametrize(
    ("drop_m", "touched", "held"), [(0.08, False, True), (0.12, False, False), (0.08, True, False)]
)
def test_a_fall_is_arrested_by_little_drop_and_no_contact(drop_m: float, touched: bool, held: bool) -> None:
    m = measured(drop_m, 1.3, touched=touched)
    assert m.arrested_fall is held
    assert m.pelvis_drop_m == pytest.approx(drop_m, abs=1e-6)
    assert m.peak_force_n == pytest.approx(1000.0)


def test_who_means_to_come_down_drops_from_there() -> None:
    assert measured(0.25, lowered_m=0.2).pelvis_drop_m == pytest.approx(0.05, abs=1e-6)


@pytest.mark.parametrize("earlier_s", [0.15, -0.08])
def test_leads_are_positive_before_the_descent(earlier_s: float) -> None:
    m = measured(0.09, stiff_s=1.2 - earlier_s)
    assert m.lead_s == pytest.approx(earlier_s, abs=0.03)
    assert m.foreseen_lead_s == pytest.approx(0.1, abs=0.06)
    assert m.unsteady_lead_s == m.foreseen_lead_s
    assert m.seen_lead_s == pytest.approx(-0.3, abs=0.06)
    assert m.arrest_s == pytest.approx(0.2 - earlier_s, abs=0.01)


def test_a_stiffening_before_the_disturbance_counts_from_the_disturbance() -> None:
    assert measured(0.09, stiff_s=0.5).lead_s == pytest.approx(0.2, abs=0.03)


def test_nothing_happened_is_no_number() -> None:
    m = measured(0.0)
    assert np.isnan([m.descent_s, m.lead_s, m.arrest_s]).all()


def test_who_hangs_or_lies_has_gone_down() -> None:
    assert measured(0.09).hung_s == pytest.approx(0.65, abs=0.02)  # half of the weight from 1.35 to 2 s
    assert measured(0.09).went_down
    assert measured(0.05, 1.3, touched=True, down_s=1.9).went_down
    assert not measured(0.09, down_s=1.8).went_down
    assert not measured(0.0, kind="non_fall").went_down


def test_a_non_fall_that_falls_over_the_walker_is_drawn_again(monkeypatch: pytest.MonkeyPatch) -> None:
    asked: list[tuple[str, str]] = []

    def trial(scenario: Scenario, arm: str, config: SurefootConfig, keep: Path | None = None) -> Any:
        asked.append((scenario.title, arm))
        hangs = scenario.title == asked[0][0]
        return measured(0.09 if hangs else 0.0, kind="non_fall"), trace(0.0)

    monkeypatch.setattr("simulation.campaign.job.run_trial", trial)
    job = Job("non_fall", 0, 7, ("none", "reactive"), SurefootConfig())
    result = perform(job)
    assert result["scenario"]["rejected_draws"] == 1
    first, second = asked[0][0], asked[1][0]
    assert first != second == result["scenario"]["title"]
    assert asked == [(first, "none"), (second, "none"), (second, "reactive")]


def test_intervals() -> None:
    assert share(0, 300).low == pytest.approx(0.0, abs=1e-12)
    assert share(0, 300).high == pytest.approx(0.01264, abs=1e-4)  # Wilson: z^2 / (n + z^2)
    assert share(95, 100).low < 0.95 < share(95, 100).high
    values = list(np.random.default_rng(1).normal(5.0, 1.0, 400))
    median = percentile([*values, float("nan")], 50)
    assert median.low < 5.0 < median.high
    assert median.high - median.low < 0.5
    assert np.isnan(percentile([], 50)).all()


def test_the_summary_has_what_was_asked_for() -> None:
    arms = ("none", "reactive", "anticipatory")
    results = [quick(job) for job in plan().jobs()]
    summary = summarise(results, arms)
    assert set(summary["arms"]) == set(arms)
    for numbers in summary["arms"].values():
        assert set(numbers) >= ASKED
        assert (numbers["falls"], numbers["non_falls"]) == (3, 2)
    assert summary["rejected_draws"] == 5
    assert len(summary["targets"]) == 5


def test_a_campaign_leaves_summary_table_and_page(tmp_path: Path) -> None:
    told: list[tuple[int, int]] = []
    summary = run_campaign(plan(), tmp_path, told=lambda *now: told.append(now), performer=quick)
    assert told == [(done, 5) for done in range(6)]
    table = pyarrow.parquet.read_table(tmp_path / "results.parquet").to_pylist()
    assert len(table) == 5 * 3
    held = sum(row["arrested_fall"] for row in table if row["arm"] == "anticipatory")
    written = json.loads((tmp_path / "summary.json").read_text())
    assert (
        held == summary["arms"]["anticipatory"]["falls_arrested"] == written["arms"]["anticipatory"]["falls_arrested"]
    )
    page = (tmp_path / "index.html").read_text()
    for picture in ("arrested.png", "drop.png", "force.png", "leads.png", "examples.png"):
        assert picture in page
        assert (tmp_path / picture).stat().st_size > 1000
    assert not list(tmp_path.rglob("*.partial"))


def test_how_many_work_on_it_changes_nothing(tmp_path: Path) -> None:
    run_campaign(plan(), tmp_path / "one", performer=quick)
    run_campaign(plan(), tmp_path / "two", processes=2, performer=quick)
    assert files(tmp_path / "one") == files(tmp_path / "two")


def test_what_is_there_is_not_done_again(tmp_path: Path) -> None:
    done: list[str] = []

    def stumbling(job: Job) -> dict[str, Any]:
        if len(done) == 2:
            raise RuntimeError("the power went away")
        done.append(job.name)
        return quick(job)

    with pytest.raises(RuntimeError):
        run_campaign(plan(), tmp_path / "a", performer=stumbling)
    assert sorted(p.stem for p in (tmp_path / "a" / "trials").iterdir()) == sorted(done)

    def rest(job: Job) -> dict[str, Any]:
        assert job.name not in done
        return quick(job)

    run_campaign(plan(), tmp_path / "a", performer=rest)
    run_campaign(plan(), tmp_path / "b", performer=quick)
    assert files(tmp_path / "a") == files(tmp_path / "b")


@pytest.mark.processes
def test_a_killed_campaign_goes_on(tmp_path: Path) -> None:
    script = (
        "from pathlib import Path; from campaign_results import slow;"
        "from bridge.config.surefoot import SurefootConfig;"
        "from simulation.campaign.campaign import Plan, run_campaign;"
        f"run_campaign(Plan(8, 0, 7, SurefootConfig()), Path({str(tmp_path / 'a')!r}), performer=slow)"
    )
    path = os.pathsep.join((str(Path(__file__).parent), str(REPO)))
    process = subprocess.Popen([sys.executable, "-c", script], env={**os.environ, "PYTHONPATH": path})
    deadline = time.monotonic() + 60
    while len(list(tmp_path.glob("a/trials/*.json"))) < 2:
        assert process.poll() is None
        assert time.monotonic() < deadline
        time.sleep(0.02)
    process.kill()
    process.wait()
    assert not (tmp_path / "a" / "summary.json").exists()
    run_campaign(plan(8, 0), tmp_path / "a", performer=quick)
    run_campaign(plan(8, 0), tmp_path / "b", performer=quick)
    assert files(tmp_path / "a") == files(tmp_path / "b")


@pytest.mark.parametrize("changed", [{"falls": 4}, {"seed": 8}, {"arms": ("none",)}])
def test_a_folder_of_another_campaign_is_refused(tmp_path: Path, changed: dict[str, Any]) -> None:
    run_campaign(plan(1, 0), tmp_path, performer=quick)
    with pytest.raises(SurefootError, match=next(iter(changed))):
        run_campaign(plan(1, 0)._replace(**changed), tmp_path, performer=quick)


def test_a_folder_of_another_configuration_is_refused(tmp_path: Path) -> None:
    run_campaign(plan(1, 0), tmp_path, performer=quick)
    other = SurefootConfig.model_validate({"supervisor": {"harness_load_arrest_n": 250.0}})
    with pytest.raises(SurefootError, match="config"):
        run_campaign(plan(1, 0)._replace(config=other), tmp_path, performer=quick)


def test_an_arm_that_is_none(tmp_path: Path) -> None:
    with pytest.raises(ConfigError, match="clairvoyant"):
        run_campaign(plan(arms=("clairvoyant",)), tmp_path, performer=quick)


def test_the_command_says_what_is_wrong(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["campaign", "--arms", "clairvoyant", "--out", str(tmp_path)]) == 2
    assert "clairvoyant" in capsys.readouterr().err


@pytest.mark.processes
def test_a_cluster_of_two_workers_gives_the_same(tmp_path: Path) -> None:
    distributed = pytest.importorskip("distributed")
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        with distributed.LocalCluster(
            n_workers=2, threads_per_worker=1, processes=False, dashboard_address=None, host="127.0.0.1",
            protocol="tcp://",
        ) as cluster:  # fmt: skip
            run_campaign(plan(), tmp_path / "cluster", cluster=cluster.scheduler_address, performer=quick)
    run_campaign(plan(), tmp_path / "here", performer=quick)
    assert files(tmp_path / "cluster") == files(tmp_path / "here")


def test_a_cluster_that_is_not_there(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(workers, "CONNECT_S", 0.5)
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        with pytest.raises(SurefootError, match="no Dask scheduler"):
            list(workers.work(quick, plan().jobs(), 1, "tcp://127.0.0.1:9"))
