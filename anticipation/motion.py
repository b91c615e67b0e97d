"""Forecasts of human motion: the last half second in, the next half second out.

Every forecaster maps (B, 15, 13, 2) to (B, 15, 13, 2), one frame every 1/30 s, output frame k being k + 1 steps after
the last input frame. Rows 0..11 of a frame are the keypoints relative to the upper-body centre in body lengths, row 12
is that centre's velocity through the image (`anticipation.centre`). The forecasts that know of coordinates alone, the
paper's among them, let the centre go on as it went, and take frames of 12 rows too.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping
from typing import Final, Literal, TypeAlias, get_args

import torch
from torch import Tensor, nn

from bridge.messages import KEYPOINTS

WINDOW: Final = 15  # frames a forecaster and the classifier see (paper, Table 1)
HORIZON: Final = 15  # frames foreseen: half a second at 30 Hz
COORDINATES: Final = 24  # 12 keypoints, x and y
INPUT_GAIN: Final = 4.0  # brings displacements of a tenth of a body length to the scale of the first layer
ROWS: Final = KEYPOINTS + 1  # of a frame: keypoints, and the centre's velocity

Forecast: TypeAlias = Callable[[Tensor], Tensor]
Settings: TypeAlias = Mapping[str, bool | int | float | str | list[int]]
Mode: TypeAlias = Literal["direct", "rollout"]


def zero_velocity(window: Tensor) -> Tensor:
    """Hold the last pose: (B, 15, 13, 2) -> (B, 15, 13, 2)."""
    return with_centre(window[:, -1:, :KEYPOINTS].expand(-1, HORIZON, -1, -1), window)


def constant_velocity(window: Tensor) -> Tensor:
    """Continue the slope of the last three frames: (B, 15, 13, 2) -> (B, 15, 13, 2)."""
    steps = torch.arange(1, HORIZON + 1, device=window.device, dtype=window.dtype).reshape(1, -1, 1, 1)
    poses = window[:, :, :KEYPOINTS]
    return with_centre(poses[:, -1:] + steps * (poses[:, -1:] - poses[:, -3:-2]) / 2, window)


def with_centre(poses: Tensor, window: Tensor) -> Tensor:
    """Give foreseen poses (B, 15, 12, 2) a centre that goes on at the velocity of the window's last three frames."""
    velocity = window[:, -2:, KEYPOINTS:].mean(dim=1, keepdim=True)  # (B, 1, 1, 2): two steps between three frames
    return torch.cat((poses, velocity.expand(-1, HORIZON, -1, -1)), dim=2)


class LstmForecaster(nn.Module):
    """The LSTM of the paper's Table 1: 24 in, two layers of 512, dropout 0.5, fully connected layer.

    `rollout` is the paper's: the fully connected layer (512 -> 24) gives the next pose, which is fed
    back as the next input. `direct` reads the window once and a wider layer (512 -> 15 x 24) gives all poses.
    With `residual` the layer gives the displacement from the newest pose instead of the pose itself, so that
    an untrained output is close to zero velocity (Martinez et al., CVPR 2017).
    """

    def __init__(
        self, mode: Mode = "direct", hidden: int = 512, layers: int = 2, dropout: float = 0.5, residual: bool = True
    ) -> None:
        super().__init__()
        if mode not in get_args(Mode):
            raise ValueError(f"mode is '{mode}', expected one of {', '.join(get_args(Mode))}")
        self.settings: Settings = {
            "mode": mode, "hidden": hidden, "layers": layers, "dropout": dropout, "residual": residual,
        }  # fmt: skip
        self.mode = mode
        self.residual = residual
        self.lstm = nn.LSTM(COORDINATES, hidden, layers, batch_first=True)
        self.dropout = nn.Dropout(dropout)
        self.head = nn.Linear(hidden, COORDINATES * (HORIZON if mode == "direct" else 1))
        for name, parameter in self.named_parameters():
            if "weight" in name:
                nn.init.xavier_normal_(parameter)
            else:
                nn.init.zeros_(parameter)

    def forward(self, window: Tensor) -> Tensor:
        """Forecast (B, 15, 13, 2) from a window (B, 15, 13, 2)."""
        poses = window[:, :, :KEYPOINTS].flatten(2)  # (B, 15, 24)
        hidden, state = self.lstm(poses)  # (B, 15, 512)
        last = poses[:, -1:]  # (B, 1, 24)
        if self.mode == "direct":
            future: Tensor = self.head(self.dropout(hidden[:, -1])).reshape(-1, HORIZON, COORDINATES)
            return with_centre((future + last if self.residual else future).view(-1, HORIZON, KEYPOINTS, 2), window)
        futures = []
        newest = hidden[:, -1:]  # (B, 1, 512)
        for step in range(HORIZON):
            if step:
                newest, state = self.lstm(last, state)
            pose = self.head(self.dropout(newest))  # (B, 1, 24)
            last = last + pose if self.residual else pose
            futures.append(last)
        return with_centre(torch.cat(futures, dim=1).view(-1, HORIZON, KEYPOINTS, 2), window)


def cosine_basis(frames: int) -> Tensor:
    """Return the orthonormal DCT-II as a matrix (frames, frames): `basis @ x` transforms, `basis.T` inverts."""
    k = torch.arange(frames, dtype=torch.float64)
    basis = torch.cos(math.pi / frames * (k[None, :] + 0.5) * k[:, None]) * math.sqrt(2 / frames)
    basis[0] /= math.sqrt(2)
    return basis.float()


class DctMlpForecaster(nn.Module):
    """A small MLP over the cosine transform in time, after siMLPe (Guo et al., WACV 2023).

    The 15 frames go through a discrete cosine transform, `blocks` residual blocks that mix first over
    frequency and then over coordinates, and back; the result is added to the last pose. The last layer
    starts at zero, so an untrained network is the zero-velocity forecast.
    """

    basis: Tensor

    def __init__(self, width: int = 128, blocks: int = 6, dropout: float = 0.1) -> None:
        super().__init__()
        self.settings: Settings = {"width": width, "blocks": blocks, "dropout": dropout}
        self.register_buffer("basis", cosine_basis(WINDOW), persistent=False)
        self.enter = nn.Linear(COORDINATES, width)
        self.blocks = nn.ModuleList(MixerBlock(width, dropout) for _ in range(blocks))
        self.leave = nn.Linear(width, COORDINATES)
        nn.init.zeros_(self.leave.weight)
        nn.init.zeros_(self.leave.bias)

    def forward(self, window: Tensor) -> Tensor:
        """Forecast (B, 15, 13, 2) from a window (B, 15, 13, 2)."""
        poses = window[:, :, :KEYPOINTS].flatten(2)  # (B, 15, 24)
        x = self.enter(self.basis @ poses)  # (B, 15, width)
        for block in self.blocks:
            x = block(x)
        future: Tensor = self.basis.T @ self.leave(x)  # (B, 15, 24)
        return with_centre((future + poses[:, -1:]).view(-1, HORIZON, KEYPOINTS, 2), window)


class MixerBlock(nn.Module):
    """One residual step over frequency and one over coordinates: (B, 15, width) -> the same."""

    def __init__(self, width: int, dropout: float) -> None:
        super().__init__()
        self.norm_time = nn.LayerNorm(width)
        self.time = nn.Linear(WINDOW, WINDOW)
        self.norm_space = nn.LayerNorm(width)
        self.space = nn.Linear(width, width)
        self.dropout = nn.Dropout(dropout)

    def forward(self, x: Tensor) -> Tensor:
        """Mix (B, 15, width)."""
        x = x + self.time(self.norm_time(x).transpose(1, 2)).transpose(1, 2)
        mixed: Tensor = x + self.dropout(nn.functional.gelu(self.space(self.norm_space(x))))
        return mixed


class MlpForecaster(nn.Module):
    """A residual MLP over all numbers of a window, the centre's velocity among them.

    The frames enter as displacements from the last, and the last as it is; the result is added to the last frame. The
    last layer starts at zero: an untrained network holds the last pose and lets the centre go on.
    """

    def __init__(self, width: int = 256, blocks: int = 2, dropout: float = 0.2) -> None:
        super().__init__()
        self.settings: Settings = {"width": width, "blocks": blocks, "dropout": dropout}
        self.enter = nn.Linear(WINDOW * ROWS * 2, width)
        self.blocks = nn.ModuleList(ResidualBlock(width, dropout) for _ in range(blocks))
        self.leave = nn.Linear(width, HORIZON * ROWS * 2)
        nn.init.zeros_(self.leave.weight)
        nn.init.zeros_(self.leave.bias)

    def forward(self, window: Tensor) -> Tensor:
        """Forecast (B, 15, 13, 2) from a window (B, 15, 13, 2)."""
        frames = window.flatten(2)  # (B, 15, 26)
        last = frames[:, -1:]
        x = self.enter(INPUT_GAIN * torch.cat((frames[:, :-1] - last, last), dim=1).flatten(1))  # (B, width)
        for block in self.blocks:
            x = block(x)
        future: Tensor = self.leave(x).view(-1, HORIZON, ROWS * 2) + last  # (B, 15, 26)
        return future.view(-1, HORIZON, ROWS, 2)


class ResidualBlock(nn.Module):
    """Norm, two layers, and what came in: (B, width) -> the same."""

    def __init__(self, width: int, dropout: float) -> None:
        super().__init__()
        self.norm = nn.LayerNorm(width)
        self.first = nn.Linear(width, width)
        self.dropout = nn.Dropout(dropout)
        self.second = nn.Linear(width, width)

    def forward(self, x: Tensor) -> Tensor:
        """Add what two layers make of (B, width)."""
        added: Tensor = x + self.second(self.dropout(nn.functional.gelu(self.first(self.norm(x)))))
        return added


FORECASTERS: Final[Mapping[str, Callable[..., nn.Module]]] = {
    "lstm": LstmForecaster,
    "dct_mlp": DctMlpForecaster,
    "mlp": MlpForecaster,
}
"""Learned forecasters by the name a checkpoint carries; the constructor takes the module's `settings`."""

BASELINES: Final[Mapping[str, Forecast]] = {"zero_velocity": zero_velocity, "constant_velocity": constant_velocity}
"""Forecasts that need no learning, by the name configuration and checkpoints use."""
