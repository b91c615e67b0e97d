from collections.abc import Callable

import numpy as np
import pytest
from numpy.typing import NDArray

from bridge.config.perception import BodyScaleConfig
from perception.features import BodyScale, relative, upper_body_centre
from perception.skeleton import L_HIP, L_SHOULDER, MIRROR, R_ANKLE, R_HIP, R_SHOULDER

Floats = NDArray[np.float64]
Body = Callable[..., Floats]
CONFIG = BodyScaleConfig()


def look(scale: BodyScale, person: Floats, since_s: float, seconds: float, fps_hz: float = 30.0) -> float:
    """Show `person` (12, 3) for a while; return the time at its end."""
    for k in range(1, int(seconds * fps_hz) + 1):
        scale.update(person[:, :2], since_s + k / fps_hz)
    return since_s + seconds


def test_relative_coordinates_do_not_depend_on_place_and_size(body: Body) -> None:
    near = relative(body(x=300, y=200, size=180.0)[:, :2], 180.0)
    far = relative(body(x=10, y=50, size=40.0)[:, :2], 40.0)
    assert near == pytest.approx(far)
    assert upper_body_centre(near) == pytest.approx([0.0, 0.0], abs=1e-12)


def test_relative_works_on_any_leading_shape_and_keeps_nan(body: Body) -> None:
    positions = np.tile(body()[:, :2], (2, 5, 1, 1))
    positions[0, 1, R_ANKLE] = np.nan
    lengths = np.full((2, 5), 100.0)
    lengths[1, 4] = 50.0
    scaled = relative(positions, lengths)
    assert scaled.shape == (2, 5, 12, 2)
    assert np.argwhere(np.isnan(scaled)).tolist() == [[0, 1, R_ANKLE, 0], [0, 1, R_ANKLE, 1]]
    assert scaled[1, 4] == pytest.approx(2.0 * scaled[0, 0])


def test_mirroring_the_image_mirrors_the_features(body: Body) -> None:
    position = body(tilt=0.3)[:, :2]
    mirrored = position[MIRROR] * [-1.0, 1.0]
    assert relative(mirrored, 100.0) == pytest.approx(relative(position, 100.0)[MIRROR] * [-1.0, 1.0])


def test_the_centre_survives_one_lost_side_and_no_more(body: Body) -> None:
    position = body()[:, :2]
    one_lost = position.copy()
    one_lost[[L_SHOULDER, R_HIP]] = np.nan
    expected = (position[R_SHOULDER] + position[L_HIP]) / 2
    assert upper_body_centre(one_lost) == pytest.approx(expected)
    both_lost = position.copy()
    both_lost[[L_SHOULDER, R_SHOULDER]] = np.nan
    assert np.isnan(upper_body_centre(both_lost)).all()


def test_the_length_is_known_at_the_first_sight(body: Body) -> None:
    scale = BodyScale(CONFIG)
    assert np.isnan(scale.length_px)
    assert scale.update(body(size=100.0)[:, :2], 0.0) == pytest.approx(100.0, rel=0.02)


def test_lying_down_shrinks_nobody(body: Body) -> None:
    scale = BodyScale(CONFIG)
    now = look(scale, body(), 0.0, 2.0)
    standing = scale.length_px
    look(scale, body(size=45.0, tilt=np.pi / 2), now, 120.0)  # foreshortened by half
    assert scale.length_px == pytest.approx(standing)


def test_turning_away_and_sitting_hardly_shrink(body: Body) -> None:
    scale = BodyScale(CONFIG)
    now = look(scale, body(), 0.0, 2.0)
    standing = scale.length_px
    sideways = body()
    sideways[:, 0] = 160.0
    now = look(scale, sideways, now, 10.0)
    assert scale.length_px == pytest.approx(standing, rel=0.05)
    sitting = body()
    sitting[8:10, 1] = sitting[6:8, 1] + 5.0  # thighs towards the camera
    sitting[10:, 1] = sitting[8:10, 1] + 31.0
    look(scale, sitting, now, 2.0)
    assert scale.length_px == pytest.approx(standing, rel=0.08)


def test_a_fall_away_from_the_camera_hardly_shrinks(body: Body) -> None:
    """Foreshortened lengthwise, but as broad as before: not somebody further away."""
    scale = BodyScale(CONFIG)
    now = look(scale, body(), 0.0, 2.0)
    standing = scale.length_px
    flat = body()
    flat[:, 1] = 120.0 + (flat[:, 1] - 120.0) * 0.5
    look(scale, flat, now, 2.0)
    assert scale.length_px == pytest.approx(standing, rel=0.08)


@pytest.mark.parametrize("size", [50.0, 200.0])
def test_walking_away_or_nearer_is_followed(body: Body, size: float) -> None:
    scale = BodyScale(CONFIG)
    now = look(scale, body(), 0.0, 2.0)
    look(scale, body(size=size), now, 4.0 * CONFIG.stand_s)
    assert scale.length_px == pytest.approx(size, rel=0.05)


def test_single_wrong_frames_change_nothing(body: Body) -> None:
    clean, spoilt = BodyScale(CONFIG), BodyScale(CONFIG)
    for k in range(300):
        person = body()
        clean.update(person[:, :2], k / 30)
        if k % 10 in (4, 5):
            person[R_ANKLE, 1] += 500.0
            person[8:10, 0] -= 300.0
        spoilt.update(person[:, :2], k / 30)
        assert spoilt.length_px == pytest.approx(clean.length_px)


def test_a_wrong_first_frame_is_forgotten_within_the_settling_time(body: Body) -> None:
    scale = BodyScale(CONFIG)
    scale.update(body(size=400.0)[:, :2], 0.0)
    look(scale, body(), 0.0, CONFIG.settle_s)
    assert scale.length_px == pytest.approx(100.0, rel=0.02)


def test_trunk_or_legs_alone_give_about_the_same_length(body: Body) -> None:
    trunk_only, legs_only = body()[:, :2], body()[:, :2]
    trunk_only[8:] = np.nan
    legs_only[:6] = np.nan
    for part in (trunk_only, legs_only):
        assert BodyScale(CONFIG).update(part, 0.0) == pytest.approx(100.0, rel=0.05)


def test_a_person_out_of_view_keeps_their_length(body: Body) -> None:
    scale = BodyScale(CONFIG)
    now = look(scale, body(), 0.0, 2.0)
    known = scale.length_px
    look(scale, np.full((12, 3), np.nan), now, 60.0)
    assert scale.length_px == known
