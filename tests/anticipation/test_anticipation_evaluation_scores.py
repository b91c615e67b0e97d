"""Accuracy, macro-F1, confusion and forecast errors, against cases worked out by hand."""

from dataclasses import replace

import numpy as np
import pytest
from anticipation_records import clip_of, seen

from anticipation.training.evaluation.records import Record
from anticipation.training.evaluation.scores import (
    CONSTANT,
    MAJORITY,
    SHIPPED,
    ZERO,
    accuracy,
    by_step,
    confusion,
    forecast_errors,
    judged,
    macro_f1,
    mean_error,
)


def record(ticks, part=0):
    return Record("fall-00/alphapose", "g", "URFD", "fall", part, ticks)


def test_by_hand():
    truth, told = np.array([0, 0, 0, 1, 1, 2, -100, 2]), np.array([0, 0, 1, 1, 1, 2, 2, -1])
    assert accuracy(truth, told) == pytest.approx(5 / 6)
    assert confusion(truth, told).tolist() == [[2, 1, 0], [0, 2, 0], [0, 0, 1]]
    assert macro_f1(truth, told) == pytest.approx((4 / 5 + 4 / 5 + 1) / 3)
    nothing = np.full(3, -100)
    assert np.isnan([accuracy(nothing, nothing), macro_f1(nothing, nothing)]).all()


def test_who_knows_the_future_is_always_right_and_who_errs_is_so_as_often():
    steps = (0, 6, 15)
    perfect = judged([record(seen(clip_of(0)))])[0]
    assert by_step(perfect, SHIPPED, accuracy, steps) == [1, 1, 1]
    assert by_step(perfect, SHIPPED, macro_f1, steps) == [1, 1, 1]
    blind = by_step(perfect, MAJORITY, accuracy, steps)
    assert max(blind) < 0.7
    many = [record(seen(clip_of(seed), wrong=0.2, seed=seed), seed % 2) for seed in range(8)]
    parts = judged(many)
    assert list(parts) == [0, 1]
    assert np.mean([by_step(part, SHIPPED, accuracy, steps) for part in parts.values()]) == pytest.approx(0.8, abs=0.03)


def test_ticks_without_a_whole_window_count_only_where_every_horizon_does():
    ticks = seen(clip_of(0))
    halved = replace(ticks, tested=ticks.tested & (np.arange(len(ticks)) % 2 == 0))
    few, every = judged([record(halved)])[0], judged([record(halved)], every_tick=True)[0]
    assert len(few.truth) == halved.tested.sum() < len(every.truth) == ticks.valid.sum()


def test_naive_forecasts_of_motions_that_they_fit():
    ticks = seen(clip_of(0))
    still = replace(ticks, poses=np.repeat(ticks.poses[:1], len(ticks), axis=0))
    drift = np.arange(len(ticks))[:, None, None] * np.array([0.01, -0.02], dtype=np.float32)
    for moved, fitting in ((still, (ZERO, CONSTANT)), (replace(still, poses=still.poses + drift), (CONSTANT,))):
        errors = forecast_errors([record(moved)])[0]
        for name in fitting:
            assert mean_error(errors, name, falling=False, px=False) == pytest.approx(np.zeros(15), abs=1e-5)
    away = mean_error(errors, ZERO, falling=False, px=False)
    assert away == pytest.approx(np.arange(1, 16) * np.hypot(0.01, 0.02), rel=1e-4)


def test_errors_in_px_are_body_lengths_times_the_body_and_falling_is_a_part_of_all():
    ticks = seen(clip_of(1))
    errors = forecast_errors([record(ticks)])[0]
    body, px = (mean_error(errors, SHIPPED, falling=False, px=each) for each in (False, True))
    assert px / body == pytest.approx(np.full(15, np.nanmean(ticks.body_px)), rel=0.1)
    assert body == pytest.approx(np.full(15, 0.05), rel=0.1)  # noise of 0.04 in each of two coordinates
    assert errors.falling.sum() < np.isfinite(errors.body[SHIPPED]).sum()
    nobody_falls = replace(ticks, labels=np.zeros_like(ticks.labels))
    calm = forecast_errors([record(nobody_falls)])[0]
    assert np.isnan(mean_error(calm, SHIPPED, falling=True, px=False)).all()
