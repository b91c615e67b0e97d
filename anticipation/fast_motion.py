"""Forecasters as a running node uses them: one window at a time, the same numbers with less work.

At batch size one the arithmetic is small and the calls are many: here are fewer of them. Tests hold the numbers
equal to those of the modules. The classes keep copies of the weights: later training does not reach them.
"""

from __future__ import annotations

from typing import NamedTuple, cast

import torch
from torch import Tensor, nn
from torch.nn.functional import gelu, layer_norm

from anticipation.motion import COORDINATES, HORIZON, DctMlpForecaster, Forecast, LstmForecaster, MixerBlock


def fast_forecast(forecaster: Forecast) -> Forecast:
    """Return a quicker equal of `forecaster` for windows (1, 15, 12, 2), or itself if there is none."""
    if isinstance(forecaster, LstmForecaster):
        return FastLstm(forecaster)
    if isinstance(forecaster, DctMlpForecaster):
        return FastDctMlp(forecaster)
    return forecaster


class FastLstm:
    """`LstmForecaster` in evaluation mode for one window: (1, 15, 12, 2) -> (1, 15, 12, 2).

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
        """Forecast (1, 15, 12, 2) from a window (1, 15, 12, 2)."""
        poses = window.reshape(-1, COORDINATES)  # (15, 24)
        state = [(window.new_zeros(self._hidden), window.new_zeros(self._hidden)) for _ in self._layers]
        hidden = self._advance(poses, state)
        last = poses[-1]
        if not self._rollout:
            future = torch.addmv(self._bias, self._head, hidden).view(HORIZON, COORDINATES)
            return (future + last if self._residual else future).view(window.shape)
        futures = []
        for step in range(HORIZON):
            if step:
                hidden = self._advance(last[None], state)
            pose = torch.addmv(self._bias, self._head, hidden)
            last = last + pose if self._residual else pose
            futures.append(last)
        return torch.stack(futures).view(window.shape)

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
    """`DctMlpForecaster` in evaluation mode for one window: (1, 15, 12, 2) -> (1, 15, 12, 2)."""

    def __init__(self, network: DctMlpForecaster) -> None:
        with torch.no_grad():
            self._basis = network.basis.clone()
            self._enter = _linear(network.enter)
            self._leave = _linear(network.leave)
            self._blocks = [_Mixer.of(cast(MixerBlock, block)) for block in network.blocks]

    def __call__(self, window: Tensor) -> Tensor:
        """Forecast (1, 15, 12, 2) from a window (1, 15, 12, 2)."""
        poses = window.reshape(-1, COORDINATES)  # (15, 24)
        bias, weight = self._enter
        x = torch.addmm(bias, self._basis @ poses, weight)  # (15, width)
        shape = x.shape[1:]
        for block in self._blocks:
            x = torch.addmm(x, block.time, layer_norm(x, shape, *block.norm_time)).add_(block.time_bias)
            mixed = torch.addmm(block.space_bias, layer_norm(x, shape, *block.norm_space), block.space)
            x.add_(gelu(mixed))
        bias, weight = self._leave
        return torch.addmm(poses[-1], self._basis.T, torch.addmm(bias, x, weight)).view(window.shape)


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
