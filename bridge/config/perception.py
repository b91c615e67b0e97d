"""`[perception]`: where keypoints come from and how they are cleaned."""

from __future__ import annotations

from pydantic import Field, field_validator

from bridge.config.section import Section
from bridge.plugin import parse_plugin


class BodyScaleConfig(Section):
    """`[perception.cleaning.scale]`: the slowly adapting body length."""

    settle_s: float = Field(default=0.5, gt=0, le=10)
    """Time from the first sight of a person during which the length is the median of all measurements so far."""
    grow_s: float = Field(default=0.5, gt=0, le=60)
    """Time constant with which the length follows larger measurements with an upright trunk."""
    stand_s: float = Field(default=3.0, gt=0, le=3600)
    """Time constant for smaller measurements of one who plainly stands, and for larger ones of one who does not."""
    shrink_s: float = Field(default=20.0, gt=0, le=3600)
    """Time constant with which the length follows other smaller measurements with an upright trunk."""


class CleaningConfig(Section):
    """`[perception.cleaning]`: from detections at any rate to clean keypoints at 30 Hz."""

    min_confidence: float = Field(default=0.15, ge=0, lt=1)
    """A detection with less confidence than this counts as missing."""
    max_speed_body_lengths_s: float = Field(default=5.0, gt=0, le=100)
    """A keypoint that moves faster than this counts as missing [body lengths per second]."""
    fill_s: float = Field(default=0.2, gt=0.05, le=1.0)
    """A missing keypoint continues its line for this long; after that it is lost. Frames further apart restart all."""
    cutoff_hz: float = Field(default=10.0, gt=0.5, lt=15)
    """Cut-off frequency of the second-order Butterworth low-pass."""
    snap_s: float = Field(default=0.008, ge=0, le=0.012)
    """A frame this close to a tick of the 30 Hz grid is that tick, so that camera jitter moves no tick."""
    scale: BodyScaleConfig = BodyScaleConfig()
    """The slowly adapting body length."""


class TrackingConfig(Section):
    """`[perception.tracking]`: which of several people is followed."""

    gate_body_lengths: float = Field(default=0.5, gt=0, le=10)
    """A detection whose keypoints moved further than this from the last sight is another person [body lengths]."""
    gate_speed_body_lengths_s: float = Field(default=2.0, ge=0, le=20)
    """The gate widens by this much for every second without a sight [body lengths per second]."""
    gate_most_body_lengths: float = Field(default=1.5, gt=0, le=20)
    """The gate never gets wider than this [body lengths]."""
    min_keypoints: int = Field(default=4, ge=2, le=12)
    """A detection with fewer usable keypoints is not a person."""
    relock_s: float = Field(default=3.0, gt=0, le=3600)
    """After this long without the followed person, the best person in view is followed instead."""


class SourceConfig(Section):
    """`[perception.source]`: what the keypoints are made from."""

    uri: str = ""
    """`FILE.npz:CLIP[/ARRAY]`, a video file, a folder of images, `camera:N`, a URL, `wire`, or code of your own as
    `module:name` or `file.py:name`; "" = not set."""
    crop_px: tuple[int, ...] = ()
    """Part of each image that is used: x, y, width, height; [] = the whole image."""
    latency_s: float = Field(default=0.0, ge=0, le=0.5)
    """How long before its arrival a frame of a camera or stream was exposed, as you measured it; stamps are put back
    by this much, so that its age is not taken for less than it is."""
    paced: bool = True
    """Files are played in real time; false: as fast as they can be processed, which no reader on the wire accepts."""
    fps_hz: float = Field(default=30.0, ge=1, le=240)
    """Frame rate of files that carry none: bare keypoint arrays and folders of images."""
    image_width_px: int = Field(default=320, ge=16, le=16384)
    """Image width of keypoint files that carry none."""
    image_height_px: int = Field(default=240, ge=16, le=16384)
    """Image height of keypoint files that carry none."""

    @field_validator("crop_px")
    @classmethod
    def _check_crop(cls, crop: tuple[int, ...]) -> tuple[int, ...]:
        if crop and (len(crop) != 4 or min(crop[:2]) < 0 or min(crop[2:]) <= 0):
            raise ValueError("expected x, y >= 0 and width, height > 0, or [] for the whole image")
        return crop


class MovenetConfig(Section):
    """`[perception.movenet]`: MoveNet SinglePose through LiteRT."""

    weights: str = ""
    """Path of the `.tflite` file, relative to the working directory; "" = not set."""
    crop_min_score: float = Field(default=0.2, ge=0, le=1)
    """Keypoints with less score than this do not place the crop of the next frame."""
    min_score: float = Field(default=0.1, ge=0, le=1)
    """Mean score of the twelve keypoints below which nobody is in the picture."""


class YoloConfig(Section):
    """`[perception.yolo]`: YOLOv8-Pose as ONNX."""

    model: str = ""
    """Path of the `.onnx` file; "" = not set."""
    input_px: int = Field(default=640, ge=64, le=4096, multiple_of=32)
    """Side of the square input, where the model does not fix it."""
    min_score: float = Field(default=0.25, gt=0, lt=1)
    """Detections of people with less score than this are dropped."""
    max_overlap: float = Field(default=0.7, gt=0, lt=1)
    """Of two boxes with more intersection over union than this only the better is kept."""


class PerceptionConfig(Section):
    """`[perception]`: camera, video or recording in, twelve clean keypoints out."""

    estimator: str = "movenet"
    """Pose estimator for sources of images: movenet, yolo, or code of your own as `module:name` or `file.py:name`."""
    stall_s: float = Field(default=0.2, gt=0, le=10)
    """After this long without a frame the source is said to have stalled."""
    source: SourceConfig = SourceConfig()
    """What the keypoints are made from."""
    cleaning: CleaningConfig = CleaningConfig()
    """From detections at any rate to clean keypoints at 30 Hz."""
    tracking: TrackingConfig = TrackingConfig()
    """Which of several people is followed."""
    movenet: MovenetConfig = MovenetConfig()
    """MoveNet SinglePose through LiteRT."""
    yolo: YoloConfig = YoloConfig()
    """YOLOv8-Pose as ONNX."""

    @field_validator("estimator")
    @classmethod
    def _check_estimator(cls, name: str) -> str:
        if name not in {"movenet", "yolo"} and parse_plugin(name) is None:
            raise ValueError("expected movenet, yolo, or code of your own as module:name or file.py:name")
        return name
