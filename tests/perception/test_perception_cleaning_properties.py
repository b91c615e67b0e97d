"""What cleaning promises, for any camera and any detector."""

from typing import NamedTuple

import numpy as np
from hypothesis import given, settings
from hypothesis import strategies as st
from numpy.typing import NDArray

from bridge.clock import NS
from bridge.config.perception import CleaningConfig
from bridge.messages import KeypointStatus
from perception.cleaning import PERIOD_NS, Cleaner, CleanFrame, clean_clip

Floats = NDArray[np.float64]
CONFIG = CleaningConfig()
BODY = np.array(
    [
        (12, -37),
        (-12, -37),
        (16, -20),
        (-16, -20),
        (17, -2),
        (-17, -2),
        (8, 0),
        (-8, 0),
        (8, 32),
        (-8, 32),
        (8, 63),
        (-8, 63),
    ],
    dtype=np.float64,
)


class Recording(NamedTuple):
    keypoints: Floats  # (N, 12, 3)
    stamps_ns: list[int]


@st.composite
def recordings(draw: st.DrawFn) -> Recording:
    """A person drifting about, seen by a jittering camera through a detector that misses, jumps and doubts."""
    count = draw(st.integers(2, 50))
    fps_hz = draw(st.sampled_from([12.0, 15.0, 24.0, 25.0, 30.0, 50.0, 60.0]))
    rng = np.random.default_rng(draw(st.integers(0, 2**32 - 1)))
    path = np.cumsum(rng.normal(0, 60.0 / fps_hz, (count, 1, 2)), axis=0) + np.array([160.0, 120.0])
    keypoints = np.concatenate([BODY + path, rng.uniform(0, 1.05, (count, 12, 1))], axis=2)
    keypoints[..., :2] += rng.normal(0, draw(st.floats(0, 3)), (count, 12, 2))
    jumps = rng.random((count, 12)) < draw(st.floats(0, 0.3))
    keypoints[jumps, :2] += rng.normal(0, 80.0, (int(jumps.sum()), 2))
    keypoints[rng.random((count, 12)) < draw(st.floats(0, 0.6))] = np.nan
    keypoints[rng.random(count) < draw(st.floats(0, 0.3))] = np.nan
    keypoints[rng.random((count, 12, 3)) < draw(st.sampled_from([0.0, 0.01]))] = np.inf
    period_ns = NS / fps_hz
    steps = period_ns * (1 + rng.uniform(-0.4, 0.4, count) * draw(st.floats(0, 1)))
    steps[rng.random(count) < draw(st.sampled_from([0.0, 0.05]))] += NS * 0.3
    start = draw(st.integers(0, 2**61))
    return Recording(keypoints, [start + int(s) for s in np.cumsum(steps)])


def same(one: list[CleanFrame], other: list[CleanFrame]) -> bool:
    return len(one) == len(other) and all(
        a.stamp_ns == b.stamp_ns
        and np.array_equal(a.position_px, b.position_px, equal_nan=True)
        and np.array_equal(a.confidence, b.confidence)
        and np.array_equal(a.status, b.status)
        and np.array_equal(a.body_length_px, b.body_length_px, equal_nan=True)
        for a, b in zip(one, other, strict=True)
    )


@settings(deadline=None, max_examples=60)
@given(recordings())
def test_every_tick_is_well_formed(recording: Recording) -> None:
    ticks = clean_clip(*recording, CONFIG)
    stamps = [tick.stamp_ns for tick in ticks]
    assert (np.diff(stamps) > 0).all()
    assert recording.stamps_ns[0] == stamps[0]
    assert stamps[-1] <= recording.stamps_ns[-1]
    for tick in ticks:
        lost = tick.status == KeypointStatus.LOST
        measured = tick.status == KeypointStatus.MEASURED
        assert np.isfinite(tick.position_px[~lost]).all()
        assert np.isnan(tick.position_px[lost]).all()
        assert ((tick.confidence >= 0.0) & (tick.confidence <= 1.0)).all()
        assert (tick.confidence[~measured] == 0.0).all()
        assert (tick.confidence[measured] >= CONFIG.min_confidence).all()
        assert np.isnan(tick.body_length_px) or tick.body_length_px > 0.0


@settings(deadline=None, max_examples=60)
@given(recordings())
def test_ticks_keep_thirty_to_the_second_outside_gaps(recording: Recording) -> None:
    stamps = np.array([tick.stamp_ns for tick in clean_clip(*recording, CONFIG)])
    frames = np.array(recording.stamps_ns)
    starts = np.flatnonzero(np.diff(frames) > (CONFIG.fill_s + 1e-3) * NS) + 1
    for piece in np.split(frames, starts):
        inside = stamps[(stamps >= piece[0]) & (stamps <= piece[-1])]
        assert (np.abs(np.diff(inside) - PERIOD_NS) <= 2 * CONFIG.snap_s * NS).all()
        assert piece[-1] - inside[-1] < PERIOD_NS + CONFIG.snap_s * NS


@settings(deadline=None, max_examples=40)
@given(recordings())
def test_frame_by_frame_equals_the_array(recording: Recording) -> None:
    cleaner = Cleaner(CONFIG)
    streamed = [tick for frame, stamp in zip(*recording, strict=True) for tick in cleaner.push(frame, stamp)]
    assert same(streamed, clean_clip(*recording, CONFIG))


@settings(deadline=None, max_examples=40)
@given(recordings(), st.floats(0, 1), st.integers(0, 2**32 - 1))
def test_a_changed_future_changes_nothing_in_the_past(recording: Recording, share: float, seed: int) -> None:
    cut = int(share * len(recording.keypoints))
    changed = recording.keypoints.copy()
    changed[cut:] = np.random.default_rng(seed).uniform(-500, 500, changed[cut:].shape)
    past = clean_clip(recording.keypoints[:cut], recording.stamps_ns[:cut], CONFIG)
    with_future = clean_clip(changed, recording.stamps_ns, CONFIG)
    assert same(past, with_future[: len(past)])


@settings(deadline=None, max_examples=40)
@given(recordings(), st.integers(-6, 6))
def test_scaling_the_picture_scales_the_output(recording: Recording, power: int) -> None:
    scale = 2.0**power  # exact in floating point, so that no comparison can tip over
    scaled = recording.keypoints * [scale, scale, 1.0]
    for one, other in zip(clean_clip(*recording, CONFIG), clean_clip(scaled, recording.stamps_ns, CONFIG), strict=True):
        assert np.array_equal(one.position_px * scale, other.position_px, equal_nan=True)
        assert np.array_equal(one.status, other.status)
        assert np.array_equal(one.body_length_px * scale, other.body_length_px, equal_nan=True)


@settings(deadline=None, max_examples=30)
@given(recordings(), st.integers(0, 2**40))
def test_only_time_differences_matter(recording: Recording, shift_ns: int) -> None:
    later = clean_clip(recording.keypoints, [stamp + shift_ns for stamp in recording.stamps_ns], CONFIG)
    for one, other in zip(clean_clip(*recording, CONFIG), later, strict=True):
        assert one.stamp_ns + shift_ns == other.stamp_ns
        assert np.array_equal(one.status, other.status)
        assert np.array_equal(one.position_px, other.position_px, equal_nan=True)


@settings(deadline=None, max_examples=30)
@given(recordings(), st.floats(0, 500), st.floats(0, 500))
def test_wherever_the_detector_settles_it_is_followed_after_a_bounded_time(
    recording: Recording, x: float, y: float
) -> None:
    cleaner = Cleaner(CONFIG)
    for frame, stamp in zip(*recording, strict=True):
        cleaner.push(frame, stamp)
    settled = np.column_stack([BODY + np.array([x, y]), np.full(12, 0.9)])
    period_ns = NS // 30
    first_ns = recording.stamps_ns[-1] + period_ns
    for k in range(20):
        for tick in cleaner.push(settled, first_ns + k * period_ns):
            if tick.stamp_ns - first_ns > (CONFIG.fill_s + 2 / 30) * NS:
                assert (tick.status == KeypointStatus.MEASURED).all()
