"""From keypoints to horizons: the right windows, honest numbers, and reasons where there are none."""

from dataclasses import replace

import numpy as np
import pytest
import torch
from anticipation_nets import STANDING, lost, message, nobody, random_checkpoint

from anticipation.checkpoint import load, save
from anticipation.mirror import mirrored
from anticipation.motion import LstmForecaster, constant_velocity, zero_velocity
from anticipation.predictor import Predictor
from anticipation.transient import fold
from bridge.config.anticipation import AnticipationConfig
from bridge.errors import CheckpointError
from bridge.messages import CLASSES, STEP_S, FallHorizon
from perception.skeleton import MIRROR

CONFIG = AnticipationConfig(min_quality=0.0)
STABLE = CLASSES.index("stable")


def walking(tick: int) -> np.ndarray:
    """Arms and legs that swing a little."""
    pose = np.array(STANDING)
    swing = 0.05 * np.sin(2 * np.pi * tick / 30)
    pose[[2, 4, 9, 11], 0] += swing
    pose[[3, 5, 8, 10], 0] -= swing
    return pose


def still_window(ticks) -> torch.Tensor:
    """What the networks read of someone who walks on the spot: (1, 15, 13, 2)."""
    poses = torch.tensor(np.array([walking(tick) for tick in ticks]), dtype=torch.float32)
    return torch.cat((poses, torch.zeros(len(poses), 1, 2)), dim=1)[None]


def predictor(config: AnticipationConfig = CONFIG, **changes) -> Predictor:
    return Predictor(replace(random_checkpoint(), **changes), config)


def run(subject: Predictor, ticks=range(20)) -> FallHorizon:
    for tick in ticks:
        subject.push(message(tick, walking(tick)))
    horizon = subject.predict()
    assert horizon is not None
    return horizon


def test_a_horizon_from_the_fifteenth_tick_on():
    subject = predictor()
    for tick in range(18):
        subject.push(message(tick, walking(tick)))
        assert subject.frames == min(tick + 1, 15)
        horizon = subject.predict()
        assert (horizon is None) == (tick < 14)
        if horizon is not None:
            horizon.check()
            assert horizon.stamp_ns == message(tick).stamp_ns


@pytest.mark.parametrize("features", ["window", "folded", "embedding"])
@pytest.mark.parametrize("forecaster", [None, LstmForecaster("direct", 16).eval(), "constant_velocity"])
def test_the_sixteen_steps_are_sixteen_windows_judged_one_by_one(features, forecaster):
    checkpoint = random_checkpoint(features=features)
    if forecaster is not None:
        checkpoint = replace(checkpoint, forecaster=forecaster)
    horizon = run(Predictor(checkpoint, CONFIG))
    seen = still_window(range(5, 20))
    with torch.inference_mode():
        frames = torch.cat((seen, checkpoint.forecast(seen)), dim=1)
        windows = torch.cat([frames[:, step : step + 15] for step in range(16)])
        reflected = torch.cat((mirrored(seen), checkpoint.forecast(mirrored(seen))), dim=1)
        reflections = torch.cat([reflected[:, step : step + 15] for step in range(16)])
        mean = 0.5 * (checkpoint.classifier(windows) + checkpoint.classifier(reflections))
        outlook = 0.5 * (checkpoint.outlook(seen) + checkpoint.outlook(mirrored(seen)))[0]
        logits = 0.5 * (mean[:, 0] + outlook)
        torch.testing.assert_close(checkpoint.logits(seen)[0], logits, atol=1e-5, rtol=0)
        logits = logits.double().numpy() / checkpoint.temperature[:, None]
        inputs = {
            "window": windows[:, :, :12].flatten(1),
            "folded": torch.stack((windows[..., 0].abs(), windows[..., 1]), dim=-1)[:, :, :12].flatten(1),
            "embedding": checkpoint.classifier.embedding(windows)[:, 0],
        }[features]
    expected = np.exp(logits) / np.exp(logits).sum(axis=1, keepdims=True)
    np.testing.assert_allclose(horizon.probabilities, expected, atol=1e-5)
    transition = checkpoint.plane.transition(inputs.double().numpy())
    np.testing.assert_allclose(horizon.distance, transition.distance, atol=1e-4)
    np.testing.assert_allclose(horizon.plane, transition.plane, atol=1e-4)
    np.testing.assert_allclose(horizon.centre_distance, transition.centre_distance, atol=1e-4)
    rate = np.gradient(horizon.distance, STEP_S)
    np.testing.assert_allclose(horizon.distance_rate, rate, atol=1e-9)


def test_a_mirrored_person_is_judged_alike():
    shipped = load(None)
    horizons, one_sided = [], []
    for side in (lambda pose: pose, mirrored):
        subject = Predictor(shipped, CONFIG)
        poses = [side(torch.from_numpy(leaning(tick)).float()) for tick in range(15)]
        for tick, pose in enumerate(poses):
            subject.push(message(tick, pose.double().numpy()))
        horizons.append(subject.predict())
        with torch.inference_mode():
            seen = torch.cat((torch.stack(poses), torch.zeros(15, 1, 2)), dim=1)[None]
            one_sided.append(shipped.classifier(torch.cat((seen, shipped.forecast(seen)), dim=1)).softmax(dim=-1))
    np.testing.assert_allclose(horizons[0].probabilities, horizons[1].probabilities, atol=1e-4)
    assert (one_sided[0] - one_sided[1]).abs().max() > 0.01, (
        "this person shows nothing: the networks agree by themselves"
    )


def leaning(tick: int) -> np.ndarray:
    """Someone who tips over to one side with one arm out."""
    pose = walking(tick)
    pose[[2, 4], 0] += 0.2
    angle = 0.05 * tick
    return pose @ np.array([[np.cos(angle), np.sin(angle)], [-np.sin(angle), np.cos(angle)]])


def test_the_shipped_plane_sees_left_and_right_alike():
    plane = load(None).plane
    random = np.random.default_rng(0)
    windows = random.normal(0, 0.5, (50, 15, 12, 2))
    mirrored = windows[:, :, MIRROR] * np.array([-1.0, 1.0])
    distance, other = (plane.signed_distance(plane.project(fold(side).reshape(50, -1))) for side in (windows, mirrored))
    np.testing.assert_allclose(distance, other, atol=1e-6)
    assert np.ptp(distance) > 0.5


@pytest.mark.parametrize("name", ["zero_velocity", "constant_velocity"])
def test_the_config_can_name_a_forecast_that_needs_no_learning(name):
    named = run(predictor(AnticipationConfig(forecaster=name, min_quality=0.0)))
    seen = still_window(range(5, 20))[:, :, :12]
    future = {"zero_velocity": zero_velocity, "constant_velocity": constant_velocity}[name](seen)[0].numpy()
    np.testing.assert_allclose(named.forecast_px[1:], future * 100 + (160, 120), atol=1e-3)


def test_a_frame_of_the_future_changes_nothing():
    early, late = predictor(), predictor()
    first = run(early, range(20))
    for tick in range(20):
        late.push(message(tick, walking(tick)))
    second = late.predict()
    late.push(message(20, STANDING * 1.3))
    assert second is not None
    assert np.array_equal(first.probabilities, second.probabilities)
    assert np.array_equal(first.forecast_px, second.forecast_px)


def test_only_the_last_fifteen_ticks_count():
    long, short = predictor(), predictor()
    np.testing.assert_array_equal(run(long, range(60)).probabilities, run(short, range(45, 60)).probabilities)


def test_predicting_twice_gives_the_same_and_takes_nothing():
    subject = predictor()
    first = run(subject)
    second = subject.predict()
    assert second is not None
    assert np.array_equal(first.probabilities, second.probabilities)
    assert first.probabilities is not second.probabilities


def test_place_and_size_in_the_image_change_only_the_pixels():
    near, far = predictor(), predictor()
    for tick in range(20):
        near.push(message(tick, walking(tick)))
        far.push(message(tick, position_px=walking(tick) * 40 + (250, 60), body_length_px=40.0))
    one, other = near.predict(), far.predict()
    assert one is not None
    assert other is not None
    np.testing.assert_allclose(one.probabilities, other.probabilities, atol=1e-5)
    np.testing.assert_allclose((one.forecast_px - (160, 120)) / 100, (other.forecast_px - (250, 60)) / 40, atol=1e-4)


def test_the_foreseen_body_goes_on_as_it_moved_but_no_faster_than_people_can():
    config = AnticipationConfig(forecaster="zero_velocity", min_quality=0.0, max_centre_speed_body_lengths_s=3.0)
    for speed, kept in ((1.0, 1.0), (30.0, 3.0)):  # body lengths per second
        subject = predictor(config)
        for tick in range(20):
            subject.push(message(tick, STANDING + np.array([speed * tick * STEP_S, 0])))
        horizon = subject.predict()
        assert horizon is not None
        moved = horizon.forecast_px - horizon.forecast_px[:1]
        np.testing.assert_allclose(
            moved[:, :, 0], (kept * 100 * STEP_S * np.arange(16))[:, None] + np.zeros(12), rtol=1e-4
        )
        np.testing.assert_allclose(moved[:, :, 1], 0, atol=1e-4)
        np.testing.assert_allclose(
            horizon.forecast_px[0], (STANDING + np.array([speed * 19 * STEP_S, 0])) * 100 + (160, 120), atol=1e-3
        )


def test_step_zero_is_where_the_person_is():
    horizon = run(predictor())
    np.testing.assert_allclose(horizon.forecast_px[0], walking(19) * 100 + (160, 120), atol=1e-3)


@pytest.mark.parametrize("bad", [nobody(20), lost(20, [0, 1]), lost(20, list(range(2, 12)))])
def test_bad_keypoints_make_an_invalid_horizon_with_the_reason(bad):
    subject = predictor()
    run(subject)
    subject.push(bad)
    horizon = subject.predict()
    assert horizon is not None
    assert not horizon.valid
    assert horizon.reason
    assert horizon.quality == 0.0
    assert horizon.stamp_ns == bad.stamp_ns
    assert np.isnan(horizon.probabilities).all()
    subject.push(message(21, walking(21)))
    again = subject.predict()
    assert again is not None
    assert again.valid


def test_after_a_long_absence_there_is_no_horizon_until_the_window_is_full_again():
    subject = predictor()
    run(subject)
    for tick in range(20, 26):
        subject.push(nobody(tick))
    for tick in range(26, 41):
        assert subject.frames < 15
        subject.push(message(tick, walking(tick)))
    horizon = subject.predict()
    assert horizon is not None
    fresh = run(predictor(), range(26, 41))
    np.testing.assert_array_equal(horizon.probabilities, fresh.probabilities)


def test_input_never_seen_is_not_sold_as_stable():
    """A classifier that always says 'stable', on a skeleton that is none."""
    checkpoint = random_checkpoint()
    with torch.no_grad():
        checkpoint.classifier.head.bias.copy_(torch.tensor([50.0, 0.0, 0.0]))
    subject = Predictor(checkpoint, CONFIG)
    assert run(subject).probabilities[:, STABLE].min() > 0.99
    scattered = np.random.default_rng(0).uniform(-1, 1, (12, 2))
    for tick in range(20, 40):
        subject.push(message(tick, scattered))
    horizon = subject.predict()
    assert horizon is not None
    assert horizon.quality < 0.1
    assert (horizon.probabilities.argmax(axis=1) != STABLE).all()
    horizon.check()


def test_poor_quality_is_refused_and_says_what_is_poor():
    strict = predictor(AnticipationConfig(min_quality=0.9))
    for tick in range(35):  # seen for half a second, then held where they were
        strict.push(message(tick, walking(tick)) if tick < 15 else lost(tick, [4, 5, 10, 11], walking(tick)))
    refused = strict.predict()
    assert refused is not None
    assert not refused.valid
    assert "limit 0.90: too few keypoints were measured" in refused.reason


def test_quality_falls_when_keypoints_are_lost_and_when_people_join():
    whole = run(predictor()).quality
    assert whole == 1.0
    holes, company = predictor(), predictor()
    for tick in range(20):
        holes.push(lost(tick, [4, 5, 10, 11], walking(tick)))
        company.push(message(tick, walking(tick), people=3))
    for poorer in (holes.predict(), company.predict()):
        assert poorer is not None
        assert poorer.quality < whole


def test_a_wild_horizon_still_passes_the_message_s_own_check():
    random = np.random.default_rng(0)
    subject = predictor()
    for tick in range(200):
        subject.push(message(tick, random.normal(0, 50, (12, 2))))
        horizon = subject.predict()
        if horizon is not None and horizon.valid:
            horizon.check()


def test_reset_forgets_the_person():
    subject = predictor()
    run(subject)
    subject.reset()
    assert subject.frames == 0
    assert subject.predict() is None


def test_warming_up_leaves_no_trace():
    warm = predictor()
    warm.warm_up()
    assert warm.frames == 0
    assert np.array_equal(run(warm).probabilities, run(predictor()).probabilities)


def test_from_config_reads_the_named_checkpoint(tmp_path):
    checkpoint = random_checkpoint()
    save(checkpoint, tmp_path / "mine.safetensors", storage="float32")
    config = AnticipationConfig(checkpoint=str(tmp_path / "mine.safetensors"), min_quality=0.0)
    np.testing.assert_array_equal(
        run(Predictor.from_config(config)).probabilities, run(Predictor(checkpoint, CONFIG)).probabilities
    )
    with pytest.raises(CheckpointError, match="no such checkpoint"):
        Predictor.from_config(AnticipationConfig(checkpoint=str(tmp_path / "nobody_s.safetensors")))
