"""What cleaning promises, example by example; `test_perception_cleaning_properties` holds it for any input."""

from collections.abc import Callable

import numpy as np
import pytest
from numpy.typing import NDArray
from scipy.signal import butter, lfilter, lfilter_zi

from bridge.clock import NS
from bridge.config.perception import CleaningConfig
from bridge.messages import KeypointStatus
from perception.cleaning import PERIOD_NS, Cleaner, CleanFrame, clean_clip
from perception.skeleton import L_WRIST

Floats = NDArray[np.float64]
Body = Callable[..., Floats]
MEASURED, FILLED, LOST = KeypointStatus.MEASURED, KeypointStatus.FILLED, KeypointStatus.LOST
CONFIG = CleaningConfig()


def stamps(count: int, fps_hz: float = 30.0) -> list[int]:
    return [round(k * NS / fps_hz) for k in range(count)]


def walk(body: Body, count: int, fps_hz: float = 30.0, speed_px_s: float = 60.0) -> Floats:
    return np.array([body(x=100 + speed_px_s * k / fps_hz) for k in range(count)])


def position(ticks: list[CleanFrame]) -> Floats:
    return np.array([tick.position_px for tick in ticks])


def status(ticks: list[CleanFrame], point: int) -> list[int]:
    return [int(tick.status[point]) for tick in ticks]


def test_thirty_fps_lands_on_its_own_frames(body: Body) -> None:
    ticks = clean_clip(walk(body, 200), stamps(200), CONFIG)
    assert [tick.stamp_ns for tick in ticks] == stamps(200)


@pytest.mark.parametrize("jitter_ms", [2.0, 7.0])
def test_jitter_of_a_camera_neither_drops_nor_doubles_a_tick(body: Body, jitter_ms: float) -> None:
    jitter = np.random.default_rng(1).uniform(-jitter_ms, jitter_ms, 300) * 1e6 / 2
    at = [int(s + j) for s, j in zip(stamps(300), jitter, strict=True)]
    cleaner = Cleaner(CONFIG)
    assert [len(cleaner.push(frame, s)) for frame, s in zip(walk(body, 300), at, strict=True)] == [1] * 300


@pytest.mark.parametrize("fps_hz", [12.0, 15.0, 24.0, 25.0, 27.0, 29.97, 48.0, 60.0])
def test_any_rate_gives_thirty_ticks_a_second_in_step_with_real_time(body: Body, fps_hz: float) -> None:
    seconds = 10
    count = int(seconds * fps_hz) + 1
    ticks = clean_clip(walk(body, count, fps_hz), stamps(count, fps_hz), CONFIG)
    assert len(ticks) == pytest.approx(30 * seconds + 1, abs=1)
    spacing = np.diff([tick.stamp_ns for tick in ticks])
    assert (np.abs(spacing - PERIOD_NS) < 0.017 * NS).all()
    # a point at constant speed is where it was at the tick's own time, but for the filter's delay
    moved = position(ticks)[10:, 0, 0] - body(x=100)[0, 0]
    expected = 60.0 * np.array([tick.stamp_ns for tick in ticks])[10:] / NS
    assert np.ptp(moved - expected) < 60.0 * 0.02


@pytest.mark.parametrize("fps_hz", [12.0, 30.0, 60.0])
def test_a_missing_point_continues_its_line_and_is_lost_after_a_bounded_time(body: Body, fps_hz: float) -> None:
    count = int(2 * fps_hz)
    clip = walk(body, count, fps_hz)
    clip[count // 2 :, L_WRIST] = np.nan
    last_s = (count // 2 - 1) / fps_hz
    ticks = clean_clip(clip, stamps(count, fps_hz), CONFIG)
    for tick in ticks:
        since_s = tick.stamp_ns / NS - last_s
        if since_s <= 1e-9:
            assert tick.status[L_WRIST] == MEASURED
        elif tick.status[L_WRIST] == FILLED:
            assert since_s <= CONFIG.fill_s + 2e-3
            # its line runs parallel to the other wrist, which goes on at the same speed
            assert tick.position_px[L_WRIST] - tick.position_px[L_WRIST + 1] == pytest.approx([34.0, 0.0], abs=1e-6)
            assert tick.confidence[L_WRIST] == 0.0
        else:
            assert tick.status[L_WRIST] == LOST
            assert since_s > CONFIG.fill_s - 1.0 / fps_hz
            assert np.isnan(tick.position_px[L_WRIST]).all()
    assert FILLED in status(ticks, L_WRIST)
    assert status(ticks, L_WRIST)[-1] == LOST


def test_a_point_seen_once_stays_where_it_was_while_it_is_filled(body: Body) -> None:
    clip = np.array([body()] * 4)
    clip[1:, L_WRIST] = np.nan
    ticks = clean_clip(clip, stamps(4), CONFIG)
    assert position(ticks)[:, L_WRIST] == pytest.approx(np.tile(body()[L_WRIST, :2], (4, 1)))


def test_an_unsure_point_counts_as_missing(body: Body) -> None:
    clip = np.array([body()] * 6)
    clip[3, L_WRIST, 2] = CONFIG.min_confidence * 0.99
    clip[4, L_WRIST, 2] = CONFIG.min_confidence
    assert status(clean_clip(clip, stamps(6), CONFIG), L_WRIST) == [MEASURED] * 3 + [FILLED] + [MEASURED] * 2


def test_a_jump_is_rejected_whatever_the_resolution(body: Body) -> None:
    for size in (20.0, 100.0, 1000.0):
        clip = np.array([body(size=size)] * 9)
        clip[5, L_WRIST, :2] += size * 0.5
        ticks = clean_clip(clip, stamps(9), CONFIG)
        assert status(ticks, L_WRIST) == [MEASURED] * 5 + [FILLED] + [MEASURED] * 3
        assert position(ticks)[:, L_WRIST] == pytest.approx(np.tile(body(size=size)[L_WRIST, :2], (9, 1)))


def test_a_fast_point_below_the_threshold_is_kept(body: Body) -> None:
    clip = np.array([body()] * 9)
    speed = 0.95 * CONFIG.max_speed_body_lengths_s * 100.0
    clip[:, L_WRIST, 0] += speed / 30.0 * np.arange(9)
    assert status(clean_clip(clip, stamps(9), CONFIG), L_WRIST) == [MEASURED] * 9


@pytest.mark.parametrize("jump", [0.4, 3.0])
def test_an_outlier_that_persists_is_accepted_after_a_bounded_time(body: Body, jump: float) -> None:
    clip = np.array([body()] * 40)
    clip[10:, L_WRIST, 0] += 100.0 * jump
    ticks = clean_clip(clip, stamps(40), CONFIG)
    assert ticks[10].status[L_WRIST] == FILLED
    late = [tick for tick in ticks if tick.stamp_ns / NS >= 9 / 30 + CONFIG.fill_s + 1 / 30]
    assert all(tick.status[L_WRIST] == MEASURED for tick in late)
    # and from its first tick there is no ringing between the two places
    accepted = [tick for tick in ticks[10:] if tick.status[L_WRIST] == MEASURED]
    assert np.array([tick.position_px[L_WRIST] for tick in accepted]) == pytest.approx(
        np.tile(clip[-1, L_WRIST, :2], (len(accepted), 1))
    )


def test_the_low_pass_is_scipys_second_order_butterworth(body: Body) -> None:
    rng = np.random.default_rng(0)
    clip = np.array([body()] * 60)
    clip[:, :, :2] += rng.normal(0, 2.0, (60, 12, 2))
    b, a = butter(2, CONFIG.cutoff_hz, fs=30.0)
    expected, _ = lfilter(b, a, clip[:, :, :2], axis=0, zi=lfilter_zi(b, a)[:, None, None] * clip[:1, :, :2])
    ticks = clean_clip(clip, stamps(60), CONFIG)
    assert all((tick.status == MEASURED).all() for tick in ticks)
    assert position(ticks) == pytest.approx(expected, abs=1e-9)


def test_the_filter_starts_in_the_steady_state_at_once_and_after_a_loss(body: Body) -> None:
    clip = np.array([body()] * 40)
    clip[10:25, L_WRIST] = np.nan
    clip[25:, L_WRIST, 0] += 150.0
    ticks = clean_clip(clip, stamps(40), CONFIG)
    assert position(ticks)[0] == pytest.approx(clip[0, :, :2])
    assert status(ticks, L_WRIST)[24:] == [LOST] + [MEASURED] * 15
    assert position(ticks)[25:, L_WRIST] == pytest.approx(clip[25:, L_WRIST, :2])


def test_after_a_gap_nothing_of_the_old_motion_is_left(body: Body) -> None:
    before = walk(body, 30, speed_px_s=300.0)
    after = np.array([body(x=40.0)] * 30)
    gap_ns = 5 * NS
    at = stamps(30) + [stamps(30)[-1] + gap_ns + s for s in stamps(30)]
    ticks = clean_clip(np.concatenate([before, after]), at, CONFIG)
    assert [tick.stamp_ns for tick in ticks] == at  # no ticks inside the gap, the grid starts anew after it
    assert position(ticks[30:]) == pytest.approx(after[:, :, :2])
    assert ticks[-1].body_length_px == pytest.approx(ticks[29].body_length_px, rel=0.01)


def test_a_few_dropped_frames_are_bridged(body: Body) -> None:
    clip, at = walk(body, 60), stamps(60)
    kept = [k for k in range(60) if k not in (20, 21, 40)]
    ticks = clean_clip(clip[kept], [at[k] for k in kept], CONFIG)
    assert len(ticks) == 60
    assert all((tick.status == MEASURED).all() for tick in ticks)
    assert np.diff(position(ticks)[10:, 0, 0]) == pytest.approx(2.0, abs=0.02)


def test_a_frame_that_is_not_newer_is_ignored(body: Body) -> None:
    cleaner = Cleaner(CONFIG)
    assert len(cleaner.push(body(), NS)) == 1
    assert cleaner.push(body(x=0.0), NS) == []
    assert cleaner.push(body(x=0.0), NS // 2) == []
    assert len(cleaner.push(body(), NS + PERIOD_NS)) == 1


def test_nothing_seen_is_all_lost_and_without_a_body_length() -> None:
    ticks = clean_clip(np.full((5, 12, 3), np.nan), stamps(5), CONFIG)
    assert all((tick.status == LOST).all() and np.isnan(tick.position_px).all() for tick in ticks)
    assert all(np.isnan(tick.body_length_px) and (tick.confidence == 0.0).all() for tick in ticks)


def test_confidence_stays_within_its_range(body: Body) -> None:
    clip = np.array([body(confidence=1.03)] * 3)
    assert all((tick.confidence == 1.0).all() for tick in clean_clip(clip, stamps(3), CONFIG))


def test_another_shape_is_refused() -> None:
    with pytest.raises(ValueError, match=r"\(17, 3\), expected \(12, 3\)"):
        Cleaner(CONFIG).push(np.zeros((17, 3)), 0)
