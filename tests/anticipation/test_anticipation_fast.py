"""The quick networks give the numbers of the modules they were made from."""

import pytest
import torch
from test_anticipation_gait_state import shaken

from anticipation.fast_gait_state import FastDirectedGraph
from anticipation.fast_motion import fast_forecast
from anticipation.gait_state import DirectedGraphNetwork
from anticipation.motion import DctMlpForecaster, LstmForecaster, MlpForecaster, zero_velocity
from anticipation.outlook import FastOutlook, Outlook


@pytest.mark.parametrize(("batch", "frames"), [(1, 15), (1, 30), (2, 30)])
@pytest.mark.parametrize(
    "settings",
    [{}, {"centre": True}, {"widths": (8, 8, 12), "kernels": (3, 5, 9)}, {"widths": (8,), "kernels": (15,)}],
)
def test_the_classifier(settings, batch, frames):
    torch.manual_seed(0)
    network = shaken(DirectedGraphNetwork(**settings))
    with torch.no_grad():
        for name, parameter in network.named_parameters():
            if "offset" in name:
                parameter.normal_(0, 0.3)
    sequence = torch.randn(batch, frames, 13, 2)
    quick = FastDirectedGraph(network)
    with torch.inference_mode():
        judgement = quick(sequence)
        torch.testing.assert_close(judgement.logits, network(sequence), atol=1e-5, rtol=1e-5)
        torch.testing.assert_close(judgement.embedding, network.embedding(sequence), atol=1e-5, rtol=1e-5)


@pytest.mark.parametrize("mode", ["direct", "rollout"])
@pytest.mark.parametrize("residual", [True, False])
def test_the_recurrent_forecaster(mode, residual):
    torch.manual_seed(0)
    network = LstmForecaster(mode, 24, 2, residual=residual).eval()
    for name, parameter in network.named_parameters():
        if "bias" in name:
            torch.nn.init.normal_(parameter)
    window = torch.randn(1, 15, 13, 2)
    with torch.inference_mode():
        torch.testing.assert_close(fast_forecast(network)(window), network(window), atol=1e-5, rtol=1e-5)


@pytest.mark.parametrize("kind", [DctMlpForecaster, MlpForecaster])
def test_the_small_forecasters(kind):
    torch.manual_seed(0)
    network = kind(16, 3).eval()
    for parameter in network.parameters():
        torch.nn.init.normal_(parameter, std=0.5)
    window = torch.randn(1, 15, 13, 2)
    with torch.inference_mode():
        torch.testing.assert_close(fast_forecast(network)(window), network(window), atol=1e-5, rtol=1e-5)


def test_the_outlook():
    torch.manual_seed(0)
    network = shaken(Outlook(16))
    windows = torch.randn(2, 15, 13, 2)
    with torch.inference_mode():
        torch.testing.assert_close(FastOutlook(network)(windows), network(windows), atol=1e-5, rtol=1e-5)


def test_what_is_quick_already_stays_as_it_is():
    assert fast_forecast(zero_velocity) is zero_velocity


def test_later_training_does_not_reach_the_quick_copy():
    network = shaken(DirectedGraphNetwork())
    quick, frames = FastDirectedGraph(network), torch.randn(1, 15, 13, 2)
    with torch.inference_mode():
        before = quick(frames).logits
    with torch.no_grad():
        for parameter in network.parameters():
            parameter.add_(1.0)
    with torch.inference_mode():
        assert torch.equal(quick(frames).logits, before)
