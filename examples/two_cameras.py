"""Two depth cameras, calibrated to each other, as one: keypoints are joined in space, then seen from the first.

surefoot up --source examples/two_cameras.py:frames

Points of two *pictures* cannot be mixed: the same knee lies elsewhere in each, and the networks would see a person who
jumps. In space there is one knee. Where both cameras see it the mean counts, weighted by confidence; where they
disagree by more than 15 cm one of them is wrong, and the surer one is taken.
"""

from __future__ import annotations

import time
from collections.abc import Iterator, Mapping

import numpy as np
from depth_camera import StandIn, pinhole

from bridge.clock import NS, Clock
from bridge.messages import Floats
from perception.sources.frame import Frame

SECOND_IN_FIRST = (
    np.array(  # pose of the second camera in the first one's space: rotation and place [m], from calibration
        [
            [0.0, 0.0, -1.0, 2.5],  # it stands 2.5 m to the right and as far ahead, and looks back to the left
            [0.0, 1.0, 0.0, 0.0],
            [1.0, 0.0, 0.0, 2.5],
            [0.0, 0.0, 0.0, 1.0],
        ]
    )
)
DISAGREE_M = 0.15


def into_first(points_m: Floats, pose: Floats = SECOND_IN_FIRST) -> Floats:
    """Return (12, 4) x, y, z [m], confidence of the second camera in the space of the first."""
    return np.column_stack((points_m[:, :3] @ pose[:3, :3].T + pose[:3, 3], points_m[:, 3]))


def join(one: Floats, other: Floats) -> Floats:
    """Return the twelve points (12, 4) that two cameras see, both in the space of the first; NaN where neither does."""
    weights = np.stack([np.where(np.isfinite(points).all(axis=1), points[:, 3], 0.0) for points in (one, other)])
    apart = np.linalg.norm(one[:, :3] - other[:, :3], axis=1) > DISAGREE_M  # NaN: only one sees it, no quarrel
    weights[:, apart] *= weights[:, apart] == weights[:, apart].max(axis=0)
    total = weights.sum(axis=0)
    known = np.nan_to_num(np.stack((one[:, :3], other[:, :3])))
    with np.errstate(invalid="ignore"):
        position = np.where(total[:, None] > 0.0, (weights[:, :, None] * known).sum(axis=0) / total[:, None], np.nan)
    return np.column_stack((position, weights.max(axis=0)))


def frames(clock: Clock, options: Mapping[str, str]) -> Iterator[Frame]:
    """Give a frame for every reading of the first camera, with the newest of the second; options as in depth_camera."""
    lens = pinhole(options)
    first, second, start_ns = StandIn(), StandIn(), clock.now_ns()
    back = np.linalg.inv(SECOND_IN_FIRST)  # the stand-in of the second camera sees the same person from there
    while True:
        stamp_ns = clock.now_ns()  # of the older of the two readings, if they do not come together
        time_s = (stamp_ns - start_ns) / NS
        joined = join(first.read(time_s), into_first(into_first(second.read(time_s), back)))
        yield Frame(stamp_ns, lens.width_px, lens.height_px, None, (lens.project(joined),))
        time.sleep(1 / 30)
