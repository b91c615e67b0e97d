"""Run as a program: small fits in forked processes that are killed again and again, or that work as a team.

    python anticipation_fit_worker.py kill FOLDER       one run left alone, one killed until it is through
    python anticipation_fit_worker.py team FOLDER       one run alone, one by two processes
    python anticipation_fit_worker.py pause FOLDER      one run by two processes, one that they stop and go on with
    python anticipation_fit_worker.py train FOLDER DATA `surefoot train`, left alone and killed

The program itself runs no network, so that a fork of it is as good as a new process and costs no import.
"""

import json
import os
import random
import signal
import socket
import sys
import traceback
from pathlib import Path

import sklearn.covariance
import sklearn.decomposition  # noqa: F401 (imported here once, not in every fork)
import torch
import torch._dynamo
from anticipation_people import falling
from safetensors.torch import save_file

from anticipation import checkpoint
from anticipation.gait_state import DirectedGraphNetwork
from anticipation.motion import DctMlpForecaster
from anticipation.training import descent, fitting, journal
from anticipation.training.clips import Clip
from anticipation.training.commands import train
from anticipation.training.journal import Journal
from anticipation.training.run import Run
from anticipation.training.samples import clean, cut
from anticipation.training.team import joined
from bridge.config.perception import CleaningConfig

RECIPE = fitting.Recipe(epochs=6, draws=66, batch=33)  # 33 rows do not divide by two


def samples():
    tracks = []
    for seed in range(2):
        keypoints, labels = falling(seed)
        clip = Clip(f"fall-{seed}", str(seed), keypoints, 30.0, labels + 1, 320, 240, "made", "none")
        tracks.append(clean(clip, CleaningConfig()))
    return cut(tracks)


SAMPLES = samples()


class PausedError(Exception):
    """As many epochs as were wanted are done, and kept."""


def fit(folder, dropout, pause_after=None):
    """Fit a forecaster and, on its forecasts, a classifier; write both to `result`."""

    def progress(loss):
        losses.append(loss)
        if len(losses) == pause_after:
            raise PausedError

    with joined(torch.device("cpu")) as (team, device):
        book = Journal(folder / "run", {"seed": 0}, team)
        run = Run(device, team, book)
        torch.manual_seed(1)
        forecaster = DctMlpForecaster(8, 1, dropout).to(torch.get_default_dtype())
        classifier = DirectedGraphNetwork(widths=(4, 4, 4), dropout=dropout)
        losses = []
        shares = [(SAMPLES, 1.0)]
        fitting.fit_forecaster(forecaster, shares, RECIPE, progress, run.named("forecaster"))
        fitting.fit_classifier(classifier, shares, RECIPE, forecaster, progress, run.named("classifier"))
        weights = {f"f/{k}": v for k, v in forecaster.state_dict().items()}
        weights |= {f"c/{k}": v for k, v in classifier.state_dict().items()}
        save_file(weights, folder / f"result-{team.rank}")
        (folder / f"losses-{team.rank}").write_text(json.dumps(losses))
        book.close()


def forked(work):
    """Do `work` in a process of its own; returns its number."""
    process = os.fork()
    if process == 0:
        try:
            work()
        except BaseException:  # noqa: BLE001 (a fork must not go on with the program)
            traceback.print_exc()
            os._exit(1)
        os._exit(0)
    return process


def telling(pipe):
    """Write a byte at every batch, and before and after every file takes its name."""
    tell = lambda: os.write(pipe, b".")  # noqa: E731

    def wrapped(function):
        def call(*arguments, **options):
            tell()
            result = function(*arguments, **options)
            tell()
            return result

        return call

    descent.augment = wrapped(descent.augment)
    checkpoint.os.fsync = wrapped(os.fsync)
    journal.write_whole = wrapped(journal.write_whole)


def kill_until_through(work, seed, longest):
    """Repeat `work`, killing it after a random number of events, until it comes to its end; returns the kills."""
    draw = random.Random(seed)
    for kills in range(200):
        reader, writer = os.pipe()

        def told(writer=writer):
            telling(writer)
            work()

        process = forked(told)
        os.close(writer)
        wait = draw.randint(1, longest)
        while wait and os.read(reader, 1):
            wait -= 1
        os.kill(process, signal.SIGKILL)
        _, status = os.waitpid(process, 0)
        os.close(reader)
        if os.WIFEXITED(status):
            assert os.WEXITSTATUS(status) == 0
            return kills
    raise AssertionError("never through")


def finished(process):
    assert os.waitpid(process, 0)[1] == 0, "a process failed"


def as_a_team(folder, *options, paused=False):
    """Fit in two processes; with `paused` they must stop on their way."""
    with socket.socket() as probe:
        probe.bind(("127.0.0.1", 0))
        os.environ.update(MASTER_ADDR="127.0.0.1", MASTER_PORT=str(probe.getsockname()[1]), WORLD_SIZE="2")

    def member(rank):
        os.environ["RANK"] = rank
        try:
            fit(folder, *options)
        except PausedError:
            os._exit(7)

    for process in [forked(lambda rank=rank: member(rank)) for rank in "01"]:
        assert os.waitpid(process, 0)[1] == ((7 << 8) if paused else 0), "a process failed"


def main(mode, folder, *rest):
    torch.set_num_threads(1)
    alone, other = folder / "alone", folder / "other"
    alone.mkdir()
    other.mkdir()
    if mode == "kill":
        finished(forked(lambda: fit(alone, 0.5)))
        print(kill_until_through(lambda: fit(other, 0.5), seed=3, longest=40))
    elif mode == "team":
        torch.set_default_dtype(torch.float64)  # so that only a mistake makes a difference
        finished(forked(lambda: fit(alone, 0.0)))
        as_a_team(other, 0.0)
    elif mode == "pause":
        as_a_team(alone, 0.5)
        as_a_team(other, 0.5, RECIPE.epochs + descent.GRAPH_FROZEN + 1, paused=True)  # in the classifier's fit
        as_a_team(other, 0.5)
    elif mode == "train":
        options = {"data": Path(rest[0]), "quick": True, "folds": 2, "epochs": 2, "logged": False}
        finished(forked(lambda: train(**options, out=alone / "weights")))
        print(kill_until_through(lambda: train(**options, out=other / "weights"), seed=5, longest=150))


if __name__ == "__main__":
    main(sys.argv[1], Path(sys.argv[2]), *sys.argv[3:])
