"""Training and evaluation, on people made of twelve points that stand, fall over and lie."""

import json
from types import SimpleNamespace

import numpy as np
import pytest
import torch
import typer
from anticipation_people import falling, make_data
from typer.testing import CliRunner

from anticipation import checkpoint
from anticipation.gait_state import DirectedGraphNetwork
from anticipation.motion import HORIZON, WINDOW, DctMlpForecaster, LstmForecaster, zero_velocity
from anticipation.training import fitting, production
from anticipation.training.augmentation import augment
from anticipation.training.clips import Clip
from anticipation.training.commands import train
from anticipation.training.evaluation.command import Protocol, evaluate
from anticipation.training.measures import calibration_error, temperatures
from anticipation.training.plan import RecipeName, plan_for
from anticipation.training.samples import clean, cut
from bridge.config.perception import CleaningConfig
from bridge.errors import SurefootError


@pytest.fixture(scope="module")
def made_data(tmp_path_factory):
    """A folder laid out like the research data."""
    folder = tmp_path_factory.mktemp("data")
    make_data(folder)
    return folder


@pytest.fixture(scope="module")
def samples():
    tracks = []
    for seed in range(5):
        keypoints, labels = falling(seed)
        clip = Clip(f"fall-{seed}", str(seed), keypoints, 30.0, labels + 1, 320, 240, "made", "none")
        tracks.append(clean(clip, CleaningConfig()))
    return cut(tracks)


def fit(network, samples, seed=0, forecast=None):
    losses = []
    recipe = fitting.Recipe(epochs=3, draws=128, batch=32, rate=3e-3, seed=seed)
    if isinstance(network, DirectedGraphNetwork):
        fitting.fit_classifier(network, [(samples, 1.0)], recipe, forecast, losses.append)
    else:
        fitting.fit_forecaster(network, [(samples, 1.0)], recipe, losses.append)
    return losses


@pytest.mark.parametrize("kind", [DirectedGraphNetwork, DctMlpForecaster])
def test_training_repeats_for_a_seed_and_lowers_the_loss(kind, samples):
    runs = []
    for seed in (0, 0, 1):
        torch.manual_seed(7)
        network = kind()
        losses = fit(network, samples, seed, zero_velocity)
        assert losses[-1] < losses[0]
        assert not network.training
        runs.append(torch.cat([value.flatten() for value in network.state_dict().values()]))
    assert torch.equal(runs[0], runs[1])
    assert not torch.equal(runs[0], runs[2])


def test_augmentation_keeps_shape_and_changes_whole_samples_alike():
    poses = torch.randn(1, 1, 13, 2).expand(64, WINDOW + HORIZON, 13, 2).contiguous()
    changed = augment(poses, torch.Generator().manual_seed(0))
    assert changed.shape == poses.shape
    assert torch.isfinite(changed).all()
    within = changed.std(dim=1).median()
    between = changed.mean(dim=1).std(dim=0).median()
    assert within < 0.1 < between


def test_temperature_undoes_overconfidence():
    rng = np.random.default_rng(0)
    logits = rng.normal(size=(6000, 1, 3)) * 1.5
    chance = np.exp(logits[:, 0]) / np.exp(logits[:, 0]).sum(axis=1, keepdims=True)
    labels = (rng.random((6000, 1)) > chance.cumsum(axis=1)).sum(axis=1)[:, None]
    found = temperatures(logits * 2.5, labels)
    assert abs(found[0] - 2.5) < 0.3
    assert calibration_error(chance, labels[:, 0]) < 0.03


def commands():
    app = typer.Typer()
    app.command()(train)
    app.command()(evaluate)
    return app


def test_evaluate_prints_and_writes_what_beats_chance(made_data, tmp_path):
    out = tmp_path / "report" / "numbers.json"
    options = ["evaluate", "--data", str(made_data), "--quick", "--folds", "2", "--no-live", "--no-baselines"]
    result = CliRunner().invoke(commands(), [*options, "--json", str(out)], catch_exceptions=False)
    assert result.exit_code == 0
    assert "majority class" in result.output
    numbers = json.loads(out.read_text())
    table = numbers["tables"]["urfd"]
    shipped = np.mean(table["accuracy"][numbers["shipped"]], axis=0)
    majority = np.mean(table["accuracy"]["majority class"], axis=0)
    assert shipped[0] > majority[0] + 0.1
    assert len(numbers["temperature"]) == HORIZON + 1
    assert table["tested_frames"] > 0
    assert len(table["accuracy"][numbers["shipped"]]) == 2


def test_train_writes_a_checkpoint_that_loads(made_data, tmp_path):
    out = tmp_path / "weights.safetensors"
    options = ["train", "--data", str(made_data), "--quick", "--folds", "2", "--out", str(out)]
    result = CliRunner().invoke(commands(), options, catch_exceptions=False)
    assert result.exit_code == 0
    loaded = checkpoint.load(out)
    assert "non-commercial" in loaded.provenance.licence
    assert (loaded.temperature > 0).all()


def test_the_licence_names_everything_that_was_learnt_from():
    def of(*sources):
        track = SimpleNamespace
        return production._provenance([track(source=source) for source in sources], "none")

    usual = of("URFD", "UP-Fall", "cmu", "bandai_namco")
    assert usual.data == production.DATA
    assert usual.licence == production.LICENCE
    more = of("URFD", "own", "OUMVLP-Pose")
    assert more.data == (*production.DATA, "OUMVLP-Pose", "own")
    assert more.licence.startswith(production.LICENCE)
    assert "OUMVLP-Pose (research use, by agreement with Osaka University)" in more.licence
    assert "own recordings" in more.licence
    assert "Apache-2.0" in of("simulated").licence


def test_what_is_learnt_does_not_hang_on_the_configuration_of_who_evaluates(made_data, monkeypatch):
    studies = []

    def run(study, *rest):
        studies.append(study)
        raise SurefootError("enough")

    monkeypatch.setattr("anticipation.training.evaluation.command._run", run)
    for settings in (None, ["perception.cleaning.cutoff_hz=3"]):
        with pytest.raises(SurefootError, match="enough"):
            evaluate(data=made_data, quick=True, set_=settings)
    usual, other = studies
    assert other.config.perception.cleaning.cutoff_hz == 3, "the system that runs live is the user's"
    for one, two in zip(usual.corpus.people, other.corpus.people, strict=True):
        assert np.array_equal(one.frames, two.frames, equal_nan=True)


def test_the_whole_system_is_not_run_over_what_was_learnt(made_data):
    with pytest.raises(SurefootError, match="--live: by the paper's protocol every clip was learnt from in part"):
        evaluate(data=made_data, quick=True, protocol=Protocol.PAPER, live=True)


def test_the_paper_s_recipe_makes_the_paper_s_networks(made_data, tmp_path):
    """LSTM of Table 1 rolled forward, DGNN on coordinates alone, and nothing that the paper does not have."""
    measured = tmp_path / "measured.json"
    measured.write_text(json.dumps({"protocol": "none", "forecaster": "lstm", "temperature": [1.0] * (HORIZON + 1)}))
    out = tmp_path / "weights.safetensors"
    options = ["train", "--data", str(made_data), "--quick", "--recipe", "paper", "--evaluation", str(measured)]
    result = CliRunner().invoke(commands(), [*options, "--no-tensorboard", "--out", str(out)], catch_exceptions=False)
    assert result.exit_code == 0
    made = checkpoint.load(out)
    assert isinstance(made.forecaster, LstmForecaster)
    assert made.forecaster.settings == LstmForecaster("rollout", 512, 2, 0.5, residual=False).settings
    assert made.classifier.settings["widths"] == [16, 32, 64]
    assert not made.classifier.centre
    assert made.outlook is None
    assert not made.mirrored


@pytest.mark.parametrize("recipe", RecipeName)
def test_every_recipe_keeps_the_seed_in_every_fit(recipe):
    plan = plan_for(recipe, 7, quick=False)
    fits = [plan.pretrain, plan.finetune, plan.classifier, plan.baseline, plan.outlook]
    assert {fit.seed for fit in fits if fit is not None} == {7}
    assert plan_for(recipe, 7, quick=False, epochs=3).classifier.epochs == 3


@pytest.mark.parametrize("command", [train, evaluate])
def test_incomplete_data_is_one_line(command, tmp_path):
    with pytest.raises(SurefootError) as failure:
        command(data=tmp_path, quick=True)
    assert "\n" not in str(failure.value)
    assert "SUREFOOT_DATA" in str(failure.value)


GOOD = {"protocol": "grouped", "forecaster": "mlp", "temperature": [1.0] * (HORIZON + 1)}


@pytest.mark.parametrize(
    ("changes", "words"),
    [
        ({"protocol": None}, "names no protocol"),
        ({"temperature": None}, "no 16 positive temperatures"),
        ({"temperature": 1.0}, "no 16 positive temperatures"),
        ({"temperature": [1.0] * HORIZON}, "no 16 positive temperatures"),
        ({"temperature": [1.0] * HORIZON + [0.0]}, "no 16 positive temperatures"),
        ({"temperature": [1.0] * HORIZON + [float("nan")]}, "no 16 positive temperatures"),
        ({"temperature": [1.0] * HORIZON + [float("inf")]}, "no 16 positive temperatures"),
        ({"temperature": [1.0] * HORIZON + ["1"]}, "no 16 positive temperatures"),
        ({"forecaster": "lstm"}, "is of the forecaster lstm, and mlp is to be trained"),
        ({"forecaster": None}, "is of the forecaster None"),
    ],
)
def test_an_evaluation_that_is_none_is_refused_before_training(made_data, tmp_path, changes, words):
    wrong = tmp_path / "wrong.json"
    wrong.write_text(json.dumps(GOOD | changes))
    with pytest.raises(SurefootError, match=rf"wrong\.json' .*{words}"):
        train(data=made_data, evaluated=wrong, quick=True, out=tmp_path / "x.safetensors")
    assert not (tmp_path / "x.safetensors").exists()
