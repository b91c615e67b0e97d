"""The plane's regions as polygons: they fill the box, each where its class wins, and end at the fall boundary."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from bridge_recordings import START_NS, horizon
from bridge_view_files import PLANE, on_plane

from anticipation.plane_file import read_plane
from bridge.errors import CheckpointError
from bridge.view.geometry import Box, around, belongs, fall_boundary, raster, region

BOXES = [around(PLANE, 3.0), around(PLANE, 15.0), Box(np.array([-40.0, -1.0]), np.array([-39.0, 30.0]))]


def area(corners: np.ndarray) -> float:
    if not len(corners):
        return 0.0
    x, y = corners.T
    return 0.5 * abs(float(x @ np.roll(y, -1) - y @ np.roll(x, -1)))


@pytest.mark.parametrize("box", BOXES)
def test_regions_fill_the_box(box: Box) -> None:
    parts = [area(region(PLANE, kind, box)) for kind in range(3)]
    assert sum(parts) == pytest.approx(float(np.prod(box.high - box.low)))
    share = np.bincount(raster(PLANE, box, 400).ravel(), minlength=3) / 400**2
    np.testing.assert_allclose(np.array(parts) / sum(parts), share, atol=0.01)


@pytest.mark.parametrize("box", BOXES)
def test_inside_of_a_region_its_class_wins(box: Box) -> None:
    random = np.random.default_rng(5)
    for kind in range(3):
        corners = region(PLANE, kind, box)
        if len(corners):
            points = random.dirichlet(np.ones(len(corners)), size=50) @ corners
            assert (PLANE.regions(points) == kind).all()


def test_the_boundary_is_where_the_distance_is_zero() -> None:
    for box in BOXES[:2]:
        sides = fall_boundary(PLANE, box)
        assert len(sides) == 2
        points = np.array([a + share * (b - a) for a, b in sides for share in np.linspace(0.0, 1.0, 9)])
        np.testing.assert_allclose(PLANE.signed_distance(points), 0.0, atol=1e-9)
    assert fall_boundary(PLANE, Box(PLANE.centres[0] - 0.01, PLANE.centres[0] + 0.01)) == []


def test_a_horizon_is_known_by_its_distances() -> None:
    own = on_plane(horizon(START_NS))
    assert belongs(PLANE, own)
    assert not belongs(PLANE, replace(own, distance=own.distance + 0.01))
    assert not belongs(PLANE, replace(own, centre_distance=own.centre_distance[:, ::-1]))


def test_the_plane_is_that_of_the_checkpoint() -> None:
    from anticipation.checkpoint import load

    whole = load().plane
    for name, array in whole.arrays().items():
        np.testing.assert_array_equal(getattr(PLANE, name), array)
    assert whole.features == PLANE.features


def test_a_file_without_a_plane_is_named(tmp_path: Path) -> None:
    from safetensors.numpy import save_file

    with pytest.raises(CheckpointError, match="no such checkpoint"):
        read_plane(str(tmp_path / "none.safetensors"))
    (tmp_path / "broken.safetensors").write_bytes(b"no")
    with pytest.raises(CheckpointError, match="not a whole safetensors file"):
        read_plane(str(tmp_path / "broken.safetensors"))
    save_file({"x": np.zeros(1)}, tmp_path / "other.safetensors")
    with pytest.raises(CheckpointError, match="not a checkpoint of Surefoot"):
        read_plane(str(tmp_path / "other.safetensors"))
