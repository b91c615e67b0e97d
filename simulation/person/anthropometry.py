"""Sizes and masses of a body from its height and weight.

Masses, centres of mass and radii of gyration: P. de Leva, 'Adjustments to Zatsiorsky-Seluyanov's segment inertia
parameters', J. Biomechanics 29(9), 1996 (table 4, male). Lengths as fractions of the height: R. Drillis and R. Contini,
'Body segment parameters', 1966, as given by D. Winter, 'Biomechanics and Motor Control of Human Movement'.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Final, NamedTuple

from bridge.errors import ConfigError

HEIGHT_M: Final = (1.50, 1.95)
MASS_KG: Final = (45.0, 120.0)


class Segment(NamedTuple):
    """One body segment; fractions of body mass and of the segment's own length."""

    mass: float
    centre: float  # from the proximal (upper) end
    gyration: tuple[float, float, float]  # about the forward, the left and the long axis


TRUNK: Final = Segment(0.3229, 0.50, (0.40, 0.34, 0.27))  # upper and middle trunk together; radii combined from both
PELVIS: Final = Segment(0.1117, 0.39, (0.615, 0.551, 0.587))  # from the hips' height upwards
HEAD: Final = Segment(0.0694, 0.50, (0.303, 0.315, 0.261))
UPPER_ARM: Final = Segment(0.0271, 0.577, (0.285, 0.269, 0.158))
FOREARM: Final = Segment(0.0223, 0.70, (0.40, 0.40, 0.12))  # with the hand, which is not a body of its own
THIGH: Final = Segment(0.1416, 0.4095, (0.329, 0.329, 0.149))
SHANK: Final = Segment(0.0433, 0.4395, (0.251, 0.246, 0.102))
FOOT: Final = Segment(0.0137, 0.44, (0.124, 0.245, 0.257))


@dataclass(frozen=True, slots=True)
class BodySize:
    """Height and weight of a person; every length follows.

    Raises:
        ConfigError: height or mass outside what the tables were made for.
    """

    height_m: float = 1.70
    mass_kg: float = 75.0

    def __post_init__(self) -> None:
        for name, value, (low, high) in (("height_m", self.height_m, HEIGHT_M), ("mass_kg", self.mass_kg, MASS_KG)):
            if not low <= value <= high:
                raise ConfigError(f"person {name} = {value:g}: must lie within [{low:g}, {high:g}]")

    @property
    def thigh_m(self) -> float:
        """Hip to knee."""
        return 0.245 * self.height_m

    @property
    def shank_m(self) -> float:
        """Knee to ankle."""
        return 0.246 * self.height_m

    @property
    def leg_m(self) -> float:
        """Hip to ankle, stretched."""
        return self.thigh_m + self.shank_m

    @property
    def ankle_height_m(self) -> float:
        """Ankle above the sole."""
        return 0.039 * self.height_m

    @property
    def foot_m(self) -> float:
        """Heel to toe."""
        return 0.152 * self.height_m

    @property
    def sole_half_width_m(self) -> float:
        """Half the width of the sole."""
        return 0.0275 * self.height_m

    @property
    def sole_forward_m(self) -> float:
        """From the ankle to the middle of the sole."""
        return 0.25 * self.foot_m

    @property
    def hip_half_width_m(self) -> float:
        """Hip joint from the middle."""
        return 0.055 * self.height_m

    @property
    def shoulder_half_width_m(self) -> float:
        """Shoulder joint from the middle."""
        return 0.115 * self.height_m

    @property
    def lumbar_height_m(self) -> float:
        """Lumbar joint above the hips."""
        return 0.10 * self.height_m

    @property
    def trunk_m(self) -> float:
        """Hips to shoulders."""
        return 0.288 * self.height_m

    @property
    def upper_arm_m(self) -> float:
        """Shoulder to elbow."""
        return 0.186 * self.height_m

    @property
    def forearm_m(self) -> float:
        """Elbow to wrist."""
        return 0.146 * self.height_m

    @property
    def strength(self) -> float:
        """Torque scale: 1 for 70 kg and 1.70 m."""
        return (self.mass_kg / 70.0) * (self.height_m / 1.70)
