"""What may be proposed: bounds, what is safe to render, and that the real controller agrees about what swings."""

from __future__ import annotations

import numpy as np
import pytest
from controller_loop import Loop

from bridge.config.admittance import AdmittanceConfig
from bridge.config.load import parse_config
from bridge.config.surefoot import SurefootConfig
from bridge.errors import ConfigError
from controller.personal.proposals import AXES, space_of
from controller.personal.stability import phase_margin

DELAY_S = 0.05


def one(value: float) -> np.ndarray:
    return np.array([value])


class TestStability:
    @pytest.mark.parametrize(("mass", "damping"), [(40.0, 30.0), (10.0, 30.0), (120.0, 60.0), (5.0, 300.0)])
    def test_the_margin_ends_where_a_delayed_loop_begins_to_swing(self, mass: float, damping: float) -> None:
        """Against the differential equation itself, M a + D v = -k p(t - tau)."""
        stiffness = np.geomspace(10.0, 20000.0, 4000)
        margins = np.array([phase_margin(one(mass), one(damping), k, DELAY_S)[0] for k in stiffness])
        assert np.all(np.diff(margins) < 0)  # stiffer is never steadier
        limit = stiffness[np.argmin(np.abs(margins))]
        assert self._swing(mass, damping, 0.9 * limit) < 1.0 < self._swing(mass, damping, 1.1 * limit)

    @pytest.mark.parametrize(("mass", "damping"), [(40.0, 30.0), (40.0, 20.0)])
    def test_the_mpc_on_a_lagging_drive_swings_where_it_is_said_to(self, mass: float, damping: float) -> None:
        limit = next(k for k in range(50, 5000, 5) if phase_margin(one(mass), one(damping), k, DELAY_S)[0] < 0)
        assert self._rendered_swing(mass, damping, 0.75 * limit) < 0.8
        assert self._rendered_swing(mass, damping, 1.3 * limit) > 1.2

    def test_without_a_coupling_nothing_swings(self) -> None:
        assert phase_margin(one(40.0), one(30.0), 0.0, DELAY_S)[0] == pytest.approx(np.pi / 2)

    @staticmethod
    def _swing(mass: float, damping: float, stiffness: float) -> float:
        """Return by how much the swing grows over some of its periods."""
        step_s = 5e-4
        past = [0.01] * (round(DELAY_S / step_s) + 1)
        velocity, heights = 0.0, []
        for k in range(40_000):
            position = past[-1]
            velocity += step_s * (-stiffness * past[k % len(past)] - damping * velocity) / mass
            past[k % len(past)] = past[-1]
            position += step_s * velocity
            past[-1] = position
            heights.append(abs(position))
            if not position < 1e6:
                return np.inf
        early, late = max(heights[4_000:12_000]), max(heights[32_000:])
        return late / early

    @staticmethod
    def _rendered_swing(mass: float, damping: float, stiffness: float) -> float:
        names = {"mass_horizontal_kg": mass, "damping_free_forward_ns_m": damping}
        loop = Loop(admittance=AdmittanceConfig(**names), lag_s=DELAY_S, velocity=(0.05, 0.0, 0.0, 0.0))
        places = []
        for _ in range(900):
            loop.step([-stiffness * loop.pose[0], 0, 0, 0, 0, 0])
            places.append(abs(loop.pose[0]))
        return max(places[650:]) / max(places[150:400])


class TestBounds:
    def test_a_proposal_is_within_the_span_of_the_present_setting(self) -> None:
        space = space_of(SurefootConfig(), ("forward",))
        for side in space.parameters:
            assert side.low >= side.present / 3.0
            assert side.high <= side.present * 3.0
            assert side.low < side.present < side.high

    def test_the_bounds_of_a_key_and_of_an_arrest_hold(self) -> None:
        admittance = {"mass_horizontal_kg": 6.0, "damping_free_left_ns_m": 700.0}
        config = parse_config({"admittance": admittance}, "test")
        mass, damping = space_of(config, ("left",)).parameters
        assert mass.low == 5.0  # of the key
        assert damping.high == 800.0  # damping_arrest_horizontal_ns_m

    @pytest.mark.parametrize("axes", [("forward",), ("left",), ("yaw",), ("forward", "left", "yaw")])
    def test_whatever_may_be_proposed_is_a_valid_configuration_along_every_axis(self, axes: tuple[str, ...]) -> None:
        config = SurefootConfig()
        space = space_of(config, axes)
        drawn = space.draw(500, np.random.default_rng(0))
        assert len(drawn) > 50
        for values in drawn[:60]:
            proposed = dict(zip((side.key for side in space.parameters), map(float, values), strict=True))
            new = AdmittanceConfig(**{**config.admittance.model_dump(), **proposed})
            for axis in AXES.values():
                mass, damping = getattr(new, axis.mass), getattr(new, axis.damping)
                assert mass / damping <= config.personal.coast_max_s
                stiffness = getattr(config.personal, axis.stiffness)
                assert phase_margin(one(mass), one(damping), stiffness, config.personal.loop_delay_s)[0] >= 0

    def test_the_horizontal_mass_is_held_to_the_axis_that_is_not_asked_about(self) -> None:
        config = parse_config({"admittance": {"damping_free_left_ns_m": 35.0}}, "test")
        drawn = space_of(config, ("forward",)).draw(2000, np.random.default_rng(0))
        assert drawn[:, 0].max() <= 2.0 * 35.0

    def test_values_survive_the_way_to_the_cube_and_back(self) -> None:
        space = space_of(SurefootConfig(), ("forward", "left", "yaw"))
        drawn = space.draw(200, np.random.default_rng(1))
        np.testing.assert_allclose(space.values(space.unit(drawn)), drawn, rtol=1e-12)
        np.testing.assert_allclose(space.values(np.full(5, 2.0)), [side.high for side in space.parameters])

    def test_values_are_short_to_read(self) -> None:
        for value in space_of(SurefootConfig(), ("yaw",)).draw(200, np.random.default_rng(1)).ravel():
            assert len(f"{float(value)!r}".replace(".", "").strip("0")) <= 3

    @pytest.mark.parametrize(
        ("table", "words"),
        [
            ({"admittance": {"mass_horizontal_kg": 70.0}}, "admittance.mass_horizontal_kg = 70 with"),
            ({"admittance": {"mass_horizontal_kg": 70.0}}, "limit personal.coast_max_s = 2"),
            ({"personal": {"coupling_stiffness_n_m": 700.0}}, "personal.coupling_stiffness_n_m = 700"),
            (
                {
                    "admittance": {"damping_free_left_ns_m": 30.0, "damping_arrest_horizontal_ns_m": 30.0},
                    "personal": {"coupling_stiffness_n_m": 603.0},
                },
                "next to nothing",
            ),
        ],
    )
    def test_a_setting_in_use_that_is_not_safe_is_refused(self, table: dict[str, dict[str, float]], words: str) -> None:
        with pytest.raises(ConfigError, match=words.replace(".", r"\.")):
            space_of(parse_config(table, "test"), ("forward",))
