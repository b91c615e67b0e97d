"""Forecasters as a running node uses them: one window at a time, the same numbers with less work.

At batch size one the arithmetic is small and the calls are many: here are fewer of them. Tests hold the numbers
equal to those of the modules. The classes keep copies of the weights: later training does not reach them.
"""

from __future__ import annotations

from typing import NamedTuple, cast

import torch
from torch import Tensor, nn
from torch.nn.functional import gelu, layer_norm

from anticipation.motion import (
    COORDINATES,
    HORIZON,
    INPUT_GAIN,
    DctMlpForecaster,
    Forecast,
    LstmForecaster,
    MixerBlock,
    MlpForecaster,
    ResidualBlock,
    with_centre,
)
from bridge.messages import KEYPOINTS


def fast_forecast(forecaster: Forecast) -> Forecast:
    """Return a quicker equal of `forecaster` for windows (1, 15, 13, 2), or itself if there is none."""
    if isinstance(forecaster, LstmForecaster):
        return FastLstm(forecaster)
    if isinstance(forecaster, DctMlpForecaster):
        return FastDctMlp(forecaster)
    if isinstance(forecaster, MlpForecaster):
        return FastMlp(forecaster)
    return forecaster


class FastLstm:
    """`LstmForecaster` in evaluation mode for one window: (1, 15, 13, 2) -> (1, 15, 13, 2).

    Matrix-vector products instead of the general recurrent kernels, whose set-up costs more than a step;
    a layer's input products are taken for the whole window at once.
    """

    def __init__(self, network: LstmForecaster) -> None:
        hidden = network.lstm.hidden_size
        # torch orders the gates input, forget, cell, output; with the cell last, one sigmoid serves the other three
        order = torch.cat([torch.arange(hidden) + k * hidden for k in (0, 1, 3, 2)])
        with torch.no_grad():
            self._layers = [
                _Layer(
                    getattr(network.lstm, f"weight_ih_l{k}")[order],
                    getattr(network.lstm, f"weight_hh_l{k}")[order],
                    (getattr(network.lstm, f"bias_ih_l{k}") + getattr(network.lstm, f"bias_hh_l{k}"))[order],
                )
                for k in range(network.lstm.num_layers)
            ]
            self._head = network.head.weight.clone()
            self._bias = network.head.bias.clone()
        self._hidden = hidden
        self._rollout = network.mode == "rollout"
        self._residual = network.residual

    def __call__(self, window: Tensor) -> Tensor:
        """Forecast (1, 15, 13, 2) from a window (1, 15, 13, 2)."""
        poses = window[0, :, :KEYPOINTS].reshape(-1, COORDINATES)  # (15, 24)
        state = [(window.new_zeros(self._hidden), window.new_zeros(self._hidden)) for _ in self._layers]
        hidden = self._advance(poses, state)
        last = poses[-1]
        if not self._rollout:
            future = torch.addmv(self._bias, self._head, hidden).view(HORIZON, COORDINATES)
            return _frames(future + last if self._residual else future, window)
        futures = []
        for step in range(HORIZON):
            if step:
                hidden = self._advance(last[None], state)
            pose = torch.addmv(self._bias, self._head, hidden)
            last = last + pose if self._residual else pose
            futures.append(last)
        return _frames(torch.stack(futures), window)

    def _advance(self, inputs: Tensor, state: list[tuple[Tensor, Tensor]]) -> Tensor:
        """Feed inputs (S, 24), update `state` in place and return the last layer's newest hidden vector."""
        for k, layer in enumerate(self._layers):
            entering = torch.addmm(layer.bias, inputs, layer.weight_input.T)  # (S, 4 hidden)
            hidden, cell = state[k]
            outputs = []
            for gates in entering:
                gates = torch.addmv(gates, layer.weight_hidden, hidden)  # noqa: PLW2901 (the same gates, complete)
                enter, forget, leave = gates[: 3 * self._hidden].sigmoid_().view(3, self._hidden)
                cell = torch.addcmul(forget * cell, enter, gates[3 * self._hidden :].tanh_())
                hidden = leave * cell.tanh()
                outputs.append(hidden)
            state[k] = (hidden, cell)
            inputs = torch.stack(outputs)
        return inputs[-1]


class _Layer(NamedTuple):
    """One recurrent layer, gates in the order input, forget, output, cell."""

    weight_input: Tensor  # (4 hidden, entering)
    weight_hidden: Tensor  # (4 hidden, hidden)
    bias: Tensor  # (4 hidden,)


class FastDctMlp:
    """`DctMlpForecaster` in evaluation mode for one window: (1, 15, 13, 2) -> (1, 15, 13, 2)."""

    def __init__(self, network: DctMlpForecaster) -> None:
        with torch.no_grad():
            self._basis = network.basis.clone()
            self._enter = _linear(network.enter)
            self._leave = _linear(network.leave)
            self._blocks = [_Mixer.of(cast(MixerBlock, block)) for block in network.blocks]

    def __call__(self, window: Tensor) -> Tensor:
        """Forecast (1, 15, 13, 2) from a window (1, 15, 13, 2)."""
        poses = window[0, :, :KEYPOINTS].reshape(-1, COORDINATES)  # (15, 24)
        bias, weight = self._enter
        x = torch.addmm(bias, self._basis @ poses, weight)  # (15, width)
        shape = x.shape[1:]
        for block in self._blocks:
            x = torch.addmm(x, block.time, layer_norm(x, shape, *block.norm_time)).add_(block.time_bias)
            mixed = torch.addmm(block.space_bias, layer_norm(x, shape, *block.norm_space), block.space)
            x.add_(gelu(mixed))
        bias, weight = self._leave
        return _frames(torch.addmm(poses[-1], self._basis.T, torch.addmm(bias, x, weight)), window)


class FastMlp:
    """`MlpForecaster` in evaluation mode for one window: (1, 15, 13, 2) -> (1, 15, 13, 2)."""

    def __init__(self, network: MlpForecaster) -> None:
        with torch.no_grad():
            self._enter = INPUT_GAIN * network.enter.weight, network.enter.bias.clone()
            self._leave = network.leave.weight.clone(), network.leave.bias.clone()
            self._blocks = [_Residual.of(cast(ResidualBlock, block)) for block in network.blocks]

    def __call__(self, window: Tensor) -> Tensor:
        """Forecast (1, 15, 13, 2) from a window (1, 15, 13, 2)."""
        frames = window.view(HORIZON, -1)  # (15, 26)
        weight, bias = self._enter
        x = torch.addmv(bias, weight, torch.cat((frames[:-1] - frames[-1], frames[-1:])).view(-1))
        for block in self._blocks:
            added = torch.addmv(block.first_bias, block.first, layer_norm(x, x.shape, *block.norm))
            x = x + torch.addmv(block.second_bias, block.second, gelu(added))
        weight, bias = self._leave
        return (torch.addmv(bias, weight, x).view_as(frames) + frames[-1]).view(window.shape)


class _Residual(NamedTuple):
    """One `ResidualBlock`; the norm as (weight, bias)."""

    norm: tuple[Tensor, Tensor]
    first: Tensor  # (width, width)
    first_bias: Tensor  # (width,)
    second: Tensor  # (width, width)
    second_bias: Tensor  # (width,)

    @classmethod
    def of(cls, block: ResidualBlock) -> _Residual:
        return cls(
            (block.norm.weight.clone(), block.norm.bias.clone()),
            block.first.weight.clone(),
            block.first.bias.clone(),
            block.second.weight.clone(),
            block.second.bias.clone(),
        )


def _frames(poses: Tensor, window: Tensor) -> Tensor:
    """Foreseen poses (15, 24) as frames (1, 15, 13, 2), with the centre going on as it went."""
    return with_centre(poses.view(1, HORIZON, KEYPOINTS, 2), window)


class _Mixer(NamedTuple):
    """One `MixerBlock`; norms as (weight, bias)."""

    norm_time: tuple[Tensor, Tensor]
    time: Tensor  # (15, 15)
    time_bias: Tensor  # (15, 1)
    norm_space: tuple[Tensor, Tensor]
    space: Tensor  # (width, width)
    space_bias: Tensor  # (width,)

    @classmethod
    def of(cls, block: MixerBlock) -> _Mixer:
        space_bias, space = _linear(block.space)
        return cls(
            (block.norm_time.weight.clone(), block.norm_time.bias.clone()),
            block.time.weight.clone(),
            block.time.bias[:, None].clone(),
            (block.norm_space.weight.clone(), block.norm_space.bias.clone()),
            space,
            space_bias,
        )


def _linear(layer: nn.Linear) -> tuple[Tensor, Tensor]:
    """Bias (out,) and weight (in, out): the order and the layout `addmm` wants."""
    return layer.bias.clone(), layer.weight.T.contiguous()
