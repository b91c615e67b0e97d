"""A run that is killed, and killed again, ends with the very weights it would have had."""

import json
import os
import subprocess
import sys
from pathlib import Path

import pytest
import torch
import typer
from anticipation_people import falling, make_data
from safetensors.torch import load_file

from anticipation.motion import DctMlpForecaster
from anticipation.training import fitting
from anticipation.training.clips import Clip
from anticipation.training.commands import train
from anticipation.training.journal import Journal, Saved
from anticipation.training.run import Run
from anticipation.training.samples import clean, cut
from anticipation.training.team import Team
from bridge.config.perception import CleaningConfig
from bridge.errors import SurefootError

WORKER = Path(__file__).with_name("anticipation_fit_worker.py")


def work(*words):
    """Run the worker; returns what it printed."""
    environment = {**os.environ, "OMP_NUM_THREADS": "1", "COLUMNS": "100"}
    command = [sys.executable, "-W", "error", str(WORKER), *map(str, words)]
    done = subprocess.run(command, capture_output=True, text=True, timeout=280, env=environment, check=False)
    assert done.returncode == 0, done.stderr[-3000:]
    return done.stdout


@pytest.mark.processes
@pytest.mark.timeout(300)
def test_fits_that_are_killed_at_random_end_bit_for_bit_the_same(tmp_path):
    kills = int(work("kill", tmp_path))
    assert kills >= 3
    alone, killed = (load_file(tmp_path / name / "result-0") for name in ("alone", "other"))
    assert alone.keys() == killed.keys()
    for name, value in alone.items():
        assert torch.equal(value, killed[name]), name
    told = [json.loads((tmp_path / name / "losses-0").read_text()) for name in ("alone", "other")]
    assert told[0] == told[1]  # bars and log show the whole run, too


@pytest.mark.processes
@pytest.mark.timeout(300)
def test_surefoot_train_killed_at_random_writes_the_same_file(tmp_path):
    data = tmp_path / "data"
    data.mkdir()
    make_data(data)
    kills = int(work("train", tmp_path, data).split()[-1])
    assert kills >= 1
    alone, killed = ((tmp_path / name / "weights").read_bytes() for name in ("alone", "other"))
    assert alone == killed
    left = {path.name for path in (tmp_path / "other" / "weights.run").iterdir()}
    assert left <= {"lock", "log"}  # the states are gone with the result written


@pytest.mark.processes
@pytest.mark.timeout(300)
def test_two_processes_find_what_one_finds(tmp_path):
    """In double precision, without dropout: rounding apart, the whole batch is the whole batch.

    Sums of 33 x 15 x 26 terms of size one carry an error of about 1e-12; twelve Adam steps, which divide small
    gradients by their own size, let it grow to less than 1e-7. A forgotten row, a statistic of half a batch or a mean
    of means changes the weights by 1e-3 and more.
    """
    work("team", tmp_path)
    first, second = (load_file(tmp_path / "other" / f"result-{rank}") for rank in (0, 1))
    alone = load_file(tmp_path / "alone" / "result-0")
    for name, value in alone.items():
        assert torch.equal(first[name], second[name]), f"{name} differs between the processes"
        assert torch.allclose(first[name], value, rtol=0, atol=1e-6), name


@pytest.mark.processes
@pytest.mark.timeout(300)
def test_two_processes_that_were_stopped_go_on_as_if_they_had_not_been(tmp_path):
    """Stopped after the graph has begun to learn: its gradients are shared, and each draws its own dropout on."""
    work("pause", tmp_path)
    for rank in (0, 1):
        whole, paused = (load_file(tmp_path / name / f"result-{rank}") for name in ("alone", "other"))
        for name, value in whole.items():
            assert torch.equal(value, paused[name]), f"{name} of process {rank}"


def test_torchrun_takes_no_option_of_ours_for_its_own():
    """It reads abbreviations of its own options even behind the command: `--run` could be its `--run-path`."""
    from torch.distributed.run import get_args_parser

    command = typer.main.get_command(train_app())
    options = [name for parameter in command.params for name in (*parameter.opts, *parameter.secondary_opts)]
    assert "--run-folder" in options
    words = ["--no-python", "surefoot", "train", *options]
    assert get_args_parser().parse_args(words).training_script_args == words[2:]


def train_app():
    app = typer.Typer()
    app.command()(train)
    return app


def run_of(folder, settings=None, **options):
    return Run(journal=Journal(folder, settings or {"seed": 0}, Team(), **options), fit="fit")


def test_a_run_with_other_settings_is_refused_and_names_them(tmp_path):
    run_of(tmp_path).journal.close()
    with pytest.raises(SurefootError, match=r"seed 0, now it is 1.*--fresh"):
        run_of(tmp_path, {"seed": 1})
    run_of(tmp_path, {"seed": 1}, fresh=True).journal.close()


def test_two_runs_do_not_share_a_folder(tmp_path):
    first = run_of(tmp_path)
    with pytest.raises(SurefootError, match="another process"):
        run_of(tmp_path)
    first.journal.close()
    run_of(tmp_path).journal.close()


@pytest.mark.parametrize("content", [b"", b"nonsense", b"\x10" + bytes(30)])
def test_a_damaged_state_is_refused(tmp_path, content):
    run = run_of(tmp_path)
    (tmp_path / "fit.safetensors").write_bytes(content)
    with pytest.raises(SurefootError, match="--fresh"):
        run.journal.read("fit", "")
    run.journal.close()


def test_a_state_of_other_data_is_refused(tmp_path):
    run = run_of(tmp_path)
    run.journal.write("fit", Saved({"a": torch.zeros(2)}, {"epoch": 1, "fingerprint": "this"}))
    assert run.journal.read("fit", "this").facts["epoch"] == 1
    with pytest.raises(SurefootError, match="other data"):
        run.journal.read("fit", "that")
    run.journal.close()


def test_a_fit_without_a_name_of_its_own_is_a_mistake(tmp_path):
    run = run_of(tmp_path)
    run.journal.begin("fit")
    with pytest.raises(ValueError, match="name of its own"):
        run.journal.begin("fit")
    run.journal.close()


def test_tensorboard_sees_each_epoch_once_however_often_the_run_began(tmp_path):
    event_accumulator = pytest.importorskip("tensorboard.backend.event_processing.event_accumulator")
    from anticipation.training.log import Log

    for epochs in (range(3), range(2, 5)):  # killed in the third epoch, which is done again
        log = Log(tmp_path)
        for epoch in epochs:
            log.note("all: fit", epoch, 1.0 / (epoch + 1), 1e-3)
        log.close()
    events = event_accumulator.EventAccumulator(str(tmp_path / "all-fit"))
    events.Reload()
    assert [event.step for event in events.Scalars("loss")] == [0, 1, 2, 3, 4]


def test_a_single_epoch_counts(samples_of_falls):
    network = DctMlpForecaster(8, 1)
    before = {name: value.clone() for name, value in network.state_dict().items()}
    fitting.fit_forecaster(network, [(samples_of_falls, 1.0)], fitting.Recipe(epochs=1, draws=32, batch=32))
    assert any(not torch.equal(value, before[name]) for name, value in network.state_dict().items())


@pytest.fixture
def samples_of_falls():
    keypoints, labels = falling(0)
    clip = Clip("fall", "0", keypoints, 30.0, labels + 1, 320, 240, "made", "none")
    return cut([clean(clip, CleaningConfig())])
