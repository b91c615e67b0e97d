"""Forecasters: shapes, what an untrained one says, and symmetries that hold whatever the weights."""

import numpy as np
import pytest
import torch
from hypothesis import given, settings
from hypothesis import strategies as st

from anticipation.motion import (
    BASELINES,
    FORECASTERS,
    HORIZON,
    WINDOW,
    DctMlpForecaster,
    LstmForecaster,
    MlpForecaster,
    constant_velocity,
    cosine_basis,
    zero_velocity,
)

SMALL = {"lstm": {"hidden": 16}, "dct_mlp": {"width": 16, "blocks": 2}, "mlp": {"width": 16, "blocks": 2}}
EVERY = [
    LstmForecaster("direct", 16),
    LstmForecaster("rollout", 16),
    LstmForecaster("rollout", 16, residual=False),
    DctMlpForecaster(16, 2),
    MlpForecaster(16, 2),
]


@pytest.mark.parametrize("forecast", [*EVERY, *BASELINES.values()])
@pytest.mark.parametrize("batch", [1, 5])
def test_half_a_second_in_half_a_second_out(forecast, batch):
    future = forecast(torch.randn(batch, WINDOW, 13, 2))
    assert future.shape == (batch, HORIZON, 13, 2)
    assert torch.isfinite(future).all()


@pytest.mark.parametrize("name", FORECASTERS)
def test_settings_rebuild_the_same_network(name):
    network = FORECASTERS[name](**SMALL[name])
    again = FORECASTERS[name](**network.settings)
    again.load_state_dict(network.state_dict())
    window = torch.randn(2, WINDOW, 13, 2)
    assert torch.equal(network.eval()(window), again.eval()(window))


@pytest.mark.parametrize("forecaster", EVERY)
def test_windows_do_not_influence_each_other(forecaster):
    windows = torch.randn(3, WINDOW, 13, 2)
    forecaster.eval()
    torch.testing.assert_close(forecaster(windows)[1:2], forecaster(windows[1:2]), atol=1e-6, rtol=0)
    forecaster.train()


@pytest.mark.parametrize("forecaster", EVERY)
def test_every_parameter_learns(forecaster):
    torch.manual_seed(0)
    if isinstance(
        forecaster, DctMlpForecaster | MlpForecaster
    ):  # its last layer starts at zero and would hide the others
        torch.nn.init.normal_(forecaster.leave.weight)
    forecaster.zero_grad()
    forecaster(torch.randn(8, WINDOW, 13, 2)).pow(2).sum().backward()
    silent = [name for name, p in forecaster.named_parameters() if p.grad is None or not p.grad.abs().sum() > 0]
    assert silent == []


def test_the_paper_s_sizes():
    network = LstmForecaster("rollout")
    assert network.lstm.input_size == 24
    assert (network.lstm.hidden_size, network.lstm.num_layers) == (512, 2)
    assert (network.head.in_features, network.head.out_features) == (512, 24)
    assert network.dropout.p == 0.5


def test_rollout_feeds_its_output_back():
    """Rolling on from what was foreseen is the same as having foreseen it in one go."""
    network = LstmForecaster("rollout", 16).eval()
    window = torch.randn(1, WINDOW, 12, 2)
    future = network(window)
    poses = torch.cat((window, future[:, :1]), dim=1).flatten(2)
    hidden, _ = network.lstm(poses)
    second = poses[:, -1] + network.head(hidden[:, -1])
    torch.testing.assert_close(future[:, 1].flatten(1), second)


def test_an_untrained_small_network_holds_the_last_pose():
    window = torch.randn(3, WINDOW, 13, 2)
    torch.testing.assert_close(DctMlpForecaster().eval()(window), zero_velocity(window).clone())
    torch.testing.assert_close(MlpForecaster().eval()(window)[:, :, :12], zero_velocity(window)[:, :, :12].clone())


@pytest.mark.parametrize("forecast", [*EVERY[:4], *BASELINES.values()])
def test_what_knows_of_coordinates_alone_lets_the_centre_go_on(forecast):
    """At the velocity between the last three frames, whatever the keypoints do; and it needs no centre."""
    window = torch.randn(2, WINDOW, 13, 2)
    if isinstance(forecast, torch.nn.Module):
        forecast.eval()
    future = forecast(window)
    torch.testing.assert_close(future[:, :, 12], window[:, -2:, 12].mean(dim=1, keepdim=True).expand(-1, HORIZON, -1))
    assert torch.equal(forecast(window[:, :, :12]), future[:, :, :12])


@given(st.integers(0, 2**31 - 1))
@settings(deadline=None, max_examples=20)
def test_constant_velocity_continues_a_straight_line_exactly(seed):
    generator = torch.Generator().manual_seed(seed)
    start, slope = torch.randn(2, 4, 1, 12, 2, generator=generator, dtype=torch.float64)
    line = start + slope * torch.arange(WINDOW + HORIZON, dtype=torch.float64).reshape(1, -1, 1, 1)
    torch.testing.assert_close(constant_velocity(line[:, :WINDOW]), line[:, WINDOW:])


def test_constant_velocity_rests_on_three_frames():
    window = torch.randn(1, WINDOW, 12, 2)
    other = window.clone()
    other[:, :-3] += 1.0
    assert torch.equal(constant_velocity(window), constant_velocity(other))


@pytest.mark.parametrize("frames", [1, 15, 16])
def test_cosine_basis_is_orthonormal(frames):
    basis = cosine_basis(frames)
    torch.testing.assert_close(basis @ basis.T, torch.eye(frames), atol=1e-6, rtol=0)


def test_cosine_basis_is_scipy_s():
    from scipy.fft import dct

    x = np.random.default_rng(0).normal(size=(15, 4)).astype(np.float32)
    np.testing.assert_allclose(cosine_basis(15).numpy() @ x, dct(x, axis=0, norm="ortho"), atol=1e-5)


def test_an_unknown_mode_is_named():
    with pytest.raises(ValueError, match="sideways"):
        LstmForecaster("sideways")
