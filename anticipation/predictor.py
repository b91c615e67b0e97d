"""Keypoints in, fall-state horizon out."""

from __future__ import annotations

from typing import Final, Self

import numpy as np
import torch
from numpy.typing import NDArray

from anticipation.centre import SPAN_S, path
from anticipation.checkpoint import Checkpoint, load
from anticipation.fast_gait_state import FastDirectedGraph
from anticipation.fast_motion import fast_forecast
from anticipation.mirror import mirrored
from anticipation.motion import BASELINES, COORDINATES, HORIZON, ROWS, WINDOW
from anticipation.outlook import FastOutlook
from anticipation.quality import Quality, judge
from anticipation.shipped import weights
from anticipation.transient import fold
from anticipation.window import PoseWindow
from bridge.config.anticipation import AnticipationConfig
from bridge.messages import CLASSES, KEYPOINTS, STEPS, FallHorizon, Floats, Keypoints

_STABLE: Final = CLASSES.index("stable")
_TRANSIENT: Final = CLASSES.index("transient")


class Predictor:
    """Keeps a person's last half second and foresees the next.

    One window is forecast, and one pass of the classifier over the 15 frames seen and the 15 foreseen judges
    the sixteen windows that end at steps 0..15; the outlook, if the checkpoint has one, judges the steps from the
    window seen. The same is done with its mirror image, and all logits are averaged (`Checkpoint.logits`).
    """

    def __init__(self, checkpoint: Checkpoint, config: AnticipationConfig) -> None:
        self._config = config
        self._plane = checkpoint.plane
        self._statistics = checkpoint.statistics
        self._temperature = checkpoint.temperature[:, None]
        own = config.forecaster == "checkpoint"
        self._forecast = fast_forecast(checkpoint.forecast if own else BASELINES[config.forecaster])
        self._classify = FastDirectedGraph(checkpoint.classifier)
        self._outlook = None if checkpoint.outlook is None else FastOutlook(checkpoint.outlook)
        self._window = PoseWindow(config, checkpoint.statistics.mean_pose)
        self._frames = torch.zeros(1 + checkpoint.mirrored, WINDOW + HORIZON, ROWS, 2)

    @classmethod
    def from_config(cls, config: AnticipationConfig) -> Self:
        """Load the checkpoint that `config` names.

        Raises:
            CheckpointError: it is missing or damaged.
        """
        return cls(load(weights(config.checkpoint)), config)

    @property
    def frames(self) -> int:
        """How many of the fifteen ticks of the window are there."""
        return self._window.frames

    def reset(self) -> None:
        """Forget the person."""
        self._window.reset()

    def warm_up(self) -> None:
        """Run the networks a few times, so that the first real step is as quick as the later ones."""
        for _ in range(5):
            still = np.concatenate((self._statistics.mean_pose, np.zeros((1, 2)))).astype(np.float32)
            self._run(np.repeat(still[None], WINDOW, axis=0))

    def push(self, keypoints: Keypoints) -> None:
        """Take in the next tick; one that is not newer than the last is ignored."""
        self._window.push(keypoints)

    def predict(self) -> FallHorizon | None:
        """Return the horizon that starts at the newest tick; None before the first full window.

        A horizon that must not be used says why: `valid` is False and `reason` names what is
        wrong with the newest keypoints or with the window.
        """
        window = self._window
        if window.refusal:
            return invalid_horizon(window.stamp_ns, window.refusal)
        if not window.full:
            return None
        strangeness = self._statistics.strangeness(window.relative)
        quality = judge(self._config.quality, window.status, strangeness, window.people)
        if quality.total < self._config.min_quality:
            reason = f"quality is {quality.total:.2f}, limit {self._config.min_quality:.2f}: {quality.cause}"
            return invalid_horizon(window.stamp_ns, reason, quality.total)
        frames, logits, features = self._run(window.rows)
        transition = self._plane.transition(features)
        return FallHorizon(
            stamp_ns=window.stamp_ns,
            probabilities=self._probabilities(logits, quality),
            distance=transition.distance,
            distance_rate=transition.distance_rate,
            time_to_boundary=transition.time_to_boundary,
            centre_distance=transition.centre_distance,
            plane=transition.plane,
            forecast_px=self._in_image(frames[WINDOW - 1 :]),
            quality=quality.total,
        )

    def _run(self, window: NDArray[np.float32]) -> tuple[Floats, Floats, Floats]:
        """Return 30 frames (30, 13, 2), logits (16, 3) and the plane's features (16, D) of a window (15, 13, 2)."""
        with torch.inference_mode():
            frames = self._frames  # (1 or 2, 30, 13, 2)
            frames[0, :WINDOW] = torch.from_numpy(window)
            if (
                len(frames) > 1
            ):  # the networks were not made symmetric; the mean with the mirror image is, and errs less
                frames[1, :WINDOW] = mirrored(frames[0, :WINDOW])
            for side in (frames[at : at + 1] for at in range(len(frames))):
                side[:, WINDOW:] = self._forecast(side[:, :WINDOW])
            judgement = self._classify(frames)
            logits = judgement.logits.mean(dim=0)
            if self._outlook is not None:
                logits = 0.5 * (logits + self._outlook(frames[:, :WINDOW]).mean(dim=0))
            if self._plane.features == "embedding":
                features = judgement.embedding[0]
            else:  # every window is a stretch of the flattened frames
                poses = frames[0, :, :KEYPOINTS]
                poses = poses if self._plane.features == "window" else torch.from_numpy(fold(poses.numpy()))
                features = poses.flatten().unfold(0, WINDOW * COORDINATES, COORDINATES)
            return frames[0].double().numpy(), logits.double().numpy(), features.double().numpy()

    def _probabilities(self, logits: Floats, quality: Quality) -> Floats:
        """Calibrated probabilities (16, 3).

        Where the quality is below one half, 'stable' gets no more than twice the quality and 'transient' gets
        the rest: input that was never seen is not sold as stable.
        """
        scaled = logits / self._temperature
        likelihood = np.exp(scaled - scaled.max(axis=1, keepdims=True))
        probabilities: Floats = likelihood / likelihood.sum(axis=1, keepdims=True)
        excess = np.maximum(probabilities[:, _STABLE] - 2.0 * quality.total, 0.0)
        probabilities[:, _STABLE] -= excess
        probabilities[:, _TRANSIENT] += excess
        return probabilities

    def _in_image(self, frames: Floats) -> Floats:
        """Keypoints (16, 12, 2) of steps 0..15 in the image [px], from frames (16, 13, 2).

        The body's centre goes the way that was foreseen for it, as far as people can be that fast.
        """
        length_px = self._window.body_length_px
        velocity = frames[1:, KEYPOINTS]  # (15, 2)
        fastest = self._config.max_centre_speed_body_lengths_s * SPAN_S
        speed = np.hypot(velocity[:, 0], velocity[:, 1])[:, None]
        gone_px = path(velocity * np.minimum(1.0, fastest / np.maximum(speed, 1e-9)), length_px)
        centres_px = self._window.centre_px[-1] + np.concatenate((np.zeros((1, 2)), gone_px))  # (16, 2)
        foreseen_px: Floats = frames[:, :KEYPOINTS] * length_px + centres_px[:, None]
        return foreseen_px


def invalid_horizon(stamp_ns: int, reason: str, quality: float = 0.0) -> FallHorizon:
    """Return a horizon that says why there is none; its numbers are NaN."""
    return FallHorizon(
        stamp_ns=stamp_ns,
        probabilities=np.full((STEPS, len(CLASSES)), np.nan),
        distance=np.full(STEPS, np.nan),
        distance_rate=np.full(STEPS, np.nan),
        time_to_boundary=np.full(STEPS, np.nan),
        centre_distance=np.full((STEPS, len(CLASSES)), np.nan),
        plane=np.full((STEPS, 2), np.nan),
        forecast_px=np.full((STEPS, KEYPOINTS, 2), np.nan),
        quality=quality,
        valid=False,
        reason=reason,
    )
