"""The transient plane: exact distances, rates that are derivatives, and a unit that means something."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from anticipation.transient import FALL, REACH, TransientPlane
from bridge.messages import STEP_S

finite = st.floats(-5, 5)


def plane(weights, biases) -> TransientPlane:
    """A plane whose features are its points."""
    return TransientPlane("window", np.eye(2), np.zeros(2), np.zeros((3, 2)), np.array(weights), np.array(biases))


WEDGE = plane([[0.0, 0.0], [1.0, -2.0], [2.0, 0.5]], [0.0, 0.3, -0.5])


def clouds(count: int = 900, seed: int = 0, dimensions: int = 12):
    random = np.random.default_rng(seed)
    labels = random.integers(0, 3, count)
    features = random.normal(size=(count, dimensions)) * np.linspace(0.1, 3, dimensions)
    centres = np.array([(0, 0), (3, 5), (9, 1)])
    mixing = random.normal(size=(2, dimensions))
    return features + centres[labels] @ mixing * 2, labels


@given(st.tuples(finite, finite))
@settings(deadline=None, max_examples=60)
def test_distance_is_that_to_the_nearest_point_of_the_boundary(point):
    """Against a search over the boundary itself: points of either line that belong to the fall region."""
    point = np.array(point)
    normals, offsets = WEDGE._fall_normals()
    along = np.linspace(-60, 60, 24001)[:, None]
    boundary = []
    for k in range(2):
        line = normals[k] * offsets[k] + along * np.array([-normals[k][1], normals[k][0]])
        boundary.append(line[line @ normals[1 - k] <= offsets[1 - k] + 1e-9])
    nearest = np.linalg.norm(np.concatenate(boundary) - point, axis=1).min()
    distance = WEDGE.signed_distance(point[None])[0]
    assert abs(distance) == pytest.approx(nearest, abs=0.006)
    if abs(distance) > 1e-6:
        assert (distance < 0) == (WEDGE.regions(point[None])[0] == FALL)


@given(st.lists(st.tuples(finite, finite), min_size=2, max_size=2))
@settings(deadline=None, max_examples=60)
def test_distance_changes_no_faster_than_the_point_moves(pair):
    a, b = np.array(pair)
    first, second = WEDGE.signed_distance(np.array([a, b]))
    assert abs(first - second) <= np.linalg.norm(a - b) + 1e-9


def test_distance_beyond_reach_is_cut():
    far = WEDGE.signed_distance(np.array([[1e9, 1e9], [-1e9, -1e9], [1e9, -1e9]]))
    assert np.abs(far).max() == REACH


def test_a_straight_approach_at_constant_speed():
    half = plane([[0.0, 0.0], [0.0, -50.0], [1.0, 0.0]], [0.0, -500.0, 0.0])  # fall where x > 0
    x = -3.0 + 6.0 * STEP_S * np.arange(16)  # 6 sd/s
    transition = half.transition(np.stack((x, np.zeros(16)), axis=1))
    np.testing.assert_allclose(transition.distance, -x, atol=1e-9)
    np.testing.assert_allclose(transition.distance_rate, -6.0, atol=1e-9)
    outside = x < 0
    np.testing.assert_allclose(transition.time_to_boundary[outside], -x[outside] / 6.0, atol=1e-9)
    assert (transition.time_to_boundary[~outside] == 0).all()


def test_no_time_is_given_while_the_boundary_is_not_coming_nearer():
    half = plane([[0.0, 0.0], [0.0, -50.0], [1.0, 0.0]], [0.0, -500.0, 0.0])
    away = -1.0 - 2.0 * STEP_S * np.arange(16)
    assert np.isinf(half.transition(np.stack((away, away * 0), axis=1)).time_to_boundary).all()
    still = half.transition(np.tile([-1.0, 0.0], (16, 1)))
    assert np.isinf(still.time_to_boundary).all()
    assert (still.distance_rate == 0).all()


def test_fitted_plane_is_in_units_of_the_within_class_spread():
    features, labels = clouds()
    fitted = TransientPlane.fit(features, labels, "window")
    points = fitted.project(features)
    spread = np.mean([np.cov(points[labels == k], rowvar=False) for k in range(3)], axis=0)
    np.testing.assert_allclose(spread, np.eye(2), atol=1e-9)
    for k in range(3):
        np.testing.assert_allclose(fitted.centres[k], points[labels == k].mean(axis=0), atol=1e-9)
    assert (fitted.regions(points) == labels).mean() > 0.9
    assert fitted.signed_distance(fitted.centres)[FALL] < 0
    assert (fitted.signed_distance(fitted.centres)[:FALL] > 0).all()


def test_fit_does_not_depend_on_the_units_of_the_features():
    features, labels = clouds()
    units = np.geomspace(1e-3, 1e3, features.shape[1])
    one = TransientPlane.fit(features, labels, "window")
    other = TransientPlane.fit(features * units + 7.0, labels, "window")
    np.testing.assert_allclose(
        one.signed_distance(one.project(features)),
        other.signed_distance(other.project(features * units + 7.0)),
        atol=1e-3,
    )


def test_the_share_of_each_class_does_not_move_the_boundary():
    features, labels = clouds(3000)
    keep = (labels != FALL) | (np.arange(3000) % 5 == 0)
    whole = TransientPlane.fit(features, labels, "window")
    fewer = TransientPlane.fit(features[keep], labels[keep], "window")
    agree = whole.regions(whole.project(features)) == fewer.regions(fewer.project(features))
    assert agree.mean() > 0.97


def test_centre_distances_are_those_to_the_centres():
    features, labels = clouds()
    fitted = TransientPlane.fit(features, labels, "window")
    transition = fitted.transition(features[:16])
    for k in range(3):
        expected = np.linalg.norm(transition.plane - fitted.centres[k], axis=1)
        np.testing.assert_allclose(transition.centre_distance[:, k], expected)


def test_a_constant_feature_is_harmless():
    features, labels = clouds()
    features[:, 4] = 3.0
    assert np.isfinite(TransientPlane.fit(features, labels, "embedding").project(features)).all()


def test_arrays_rebuild_the_plane():
    features, labels = clouds()
    fitted = TransientPlane.fit(features, labels, "embedding")
    again = TransientPlane.from_arrays(fitted.arrays(), fitted.features)
    assert np.array_equal(fitted.project(features), again.project(features))
    assert not again.projection.flags.writeable


def test_two_classes_are_not_enough():
    features, labels = clouds()
    with pytest.raises(ValueError, match="labels 0, 1 and 2"):
        TransientPlane.fit(features, np.minimum(labels, 1), "window")


@pytest.mark.parametrize(
    ("change", "says"),
    [
        ({"features": "spectrum"}, "plane features"),
        ({"projection": np.zeros((4, 3))}, "plane projection has shape"),
        ({"biases": np.array([0.0, np.nan, 0.0])}, "plane biases is not finite"),
        ({"weights": np.ones((3, 2))}, "no boundary"),
    ],
)
def test_arrays_that_make_no_plane_are_refused(change, says):
    with pytest.raises(ValueError, match=says):
        TransientPlane(**({"features": "window", **WEDGE.arrays()} | change))


def test_classes_in_a_line_have_parallel_boundaries_and_the_nearer_one_counts():
    plane = TransientPlane(
        features="window",
        projection=np.eye(2),
        offset=np.zeros(2),
        centres=np.array([[-3.0, 0.0], [0.0, 0.0], [3.0, 0.0]]),
        weights=np.array([[-1.0, 0.0], [0.0, 0.0], [1.0, 0.0]]),
        biases=np.array([0.0, 1.0, 0.0]),
    )
    points = np.array([[-2.0, 5.0], [0.0, -7.0], [1.0, 0.0], [2.5, 40.0]])
    np.testing.assert_allclose(plane.signed_distance(points), [3.0, 1.0, 0.0, -1.5], atol=1e-12)
    assert plane.regions(points).tolist() == [0, 1, 1, 2]
