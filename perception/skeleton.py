"""The body as twelve keypoints and twelve directed links.

Vertices are the COCO keypoints 5..16 (Lin et al., 2014, "Microsoft COCO: Common
Objects in Context") in their order; links point away from the trunk. Twelve
vertices and twelve links: the torso is a loop, so the graph is a directed acyclic
graph and not a tree.
"""

from __future__ import annotations

from typing import Final

import numpy as np
from numpy.typing import NDArray

NAMES: Final = (
    "l_shoulder",
    "r_shoulder",
    "l_elbow",
    "r_elbow",
    "l_wrist",
    "r_wrist",
    "l_hip",
    "r_hip",
    "l_knee",
    "r_knee",
    "l_ankle",
    "r_ankle",
)

L_SHOULDER: Final = 0
R_SHOULDER: Final = 1
L_ELBOW: Final = 2
R_ELBOW: Final = 3
L_WRIST: Final = 4
R_WRIST: Final = 5
L_HIP: Final = 6
R_HIP: Final = 7
L_KNEE: Final = 8
R_KNEE: Final = 9
L_ANKLE: Final = 10
R_ANKLE: Final = 11


def _constant(values: object) -> NDArray[np.int64]:
    array = np.array(values, dtype=np.int64)
    array.flags.writeable = False
    return array


COCO_INDEX: Final = _constant(range(5, 17))
"""(12,) index of each of our keypoints among the 17 of COCO."""

LINKS: Final = _constant(
    [
        (L_SHOULDER, L_ELBOW),
        (L_ELBOW, L_WRIST),
        (R_SHOULDER, R_ELBOW),
        (R_ELBOW, R_WRIST),
        (L_HIP, L_KNEE),
        (L_KNEE, L_ANKLE),
        (R_HIP, R_KNEE),
        (R_KNEE, R_ANKLE),
        (L_SHOULDER, R_SHOULDER),
        (L_HIP, R_HIP),
        (L_SHOULDER, L_HIP),
        (R_SHOULDER, R_HIP),
    ]
)
"""(12, 2) source and target vertex of each directed link."""

MIRROR: Final = _constant([1, 0, 3, 2, 5, 4, 7, 6, 9, 8, 11, 10])
"""(12,) the keypoint of the other body side: `p[MIRROR]` relabels left and right."""
