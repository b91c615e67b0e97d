"""Scenarios: drawn from seeds, what they claim to be, and performed by the whole stack."""

from __future__ import annotations

import itertools
import json
from dataclasses import replace

import numpy as np
import pytest

from bridge.config.surefoot import SurefootConfig
from bridge.errors import SurefootError
from simulation.campaign.checks import CHECKS
from simulation.campaign.job import Job, perform
from simulation.campaign.trial import run_trial
from simulation.person.ability import FRAIL
from simulation.person.anthropometry import BodySize
from simulation.person.person import Intent
from simulation.scenarios import drawing, library
from simulation.scenarios.deed import LeanOn, gradual, there_and_back
from simulation.scenarios.disturbance import AtPhase, Faint, Push
from simulation.scenarios.drawing import draw, draw_checked
from simulation.scenarios.scenario import Kind, Performance, Scenario, SensorFaults, Wish
from simulation.scenarios.unassisted import unassisted

KINDS: tuple[Kind, ...] = ("fall", "non_fall")
ALL = [(kind, number) for kind in KINDS for number in range(len(library.FAMILIES[kind]))]
REST = (0.0, 0.0, 0.0, 0.0)


def fainting(at_s: float = 0.2, lasts_s: float = 2.0) -> Scenario:
    return Scenario(
        title="faint", kind="fall", family="faint", size=BodySize(1.7, 80.0), wishes=(), disturbances=(Faint(at_s),),
        duration_s=lasts_s, checks=library.FALL_CHECKS,
    )  # fmt: skip


@pytest.mark.parametrize(("kind", "number"), ALL)
def test_a_draw_is_a_matter_of_its_seed(kind: Kind, number: int) -> None:
    scenario = draw(kind, number, seed=3)
    assert scenario == draw(kind, number, seed=3)
    assert scenario != draw(kind, number, seed=4)
    assert scenario != draw(kind, number, seed=3, attempt=1)
    assert scenario.kind == kind
    assert set(scenario.checks) <= set(CHECKS)
    assert max([wish.at_s for wish in scenario.wishes], default=0.0) < scenario.duration_s
    assert all(each.at_s + 2.0 < scenario.duration_s for each in scenario.disturbances)


def test_every_family_takes_its_turn() -> None:
    for kind in KINDS:
        families = {draw(kind, number, 0).family for number in range(len(library.FAMILIES[kind]))}
        assert len(families) == len(library.FAMILIES[kind])


def test_pushes_follow_the_recorded_ones() -> None:
    rng = np.random.default_rng(0)
    size = BodySize(1.7, 70.0)
    pushes = [library._push_of(rng, size, (1.0, 1.0))[0] for _ in range(400)]
    assert all(isinstance(each, AtPhase) for each in pushes)
    changes = np.array([each.what.impulse_n_s / size.mass_kg for each in pushes])  # type: ignore[attr-defined]
    assert changes.mean() == pytest.approx(0.523, abs=0.02)
    assert changes.std() == pytest.approx(0.103, abs=0.02)


def test_who_faints_falls_and_who_stands_does_not() -> None:
    course = unassisted(fainting(lasts_s=3.0))
    assert course.fell
    assert 0.0 < course.descent_s < course.impact_s < 2.0
    assert 0.5 < course.impact_speed_m_s < 5.0
    assert not unassisted(replace(fainting(lasts_s=1.0), disturbances=())).fell


def test_what_is_not_what_it_claims_is_drawn_again(monkeypatch: pytest.MonkeyPatch) -> None:
    tries = itertools.count()

    def doubtful(rng: np.random.Generator, size: BodySize, ability: object) -> Scenario:
        stands = next(tries) < 2
        return replace(fainting(lasts_s=3.0), disturbances=()) if stands else fainting(lasts_s=3.0)

    monkeypatch.setattr(drawing, "FAMILIES", {"fall": (doubtful,), "non_fall": ()})
    drawn = draw_checked("fall", 0, 0)
    assert drawn.rejected == 2
    assert drawn.course.fell


def test_a_family_that_never_is_what_it_claims_is_an_error(monkeypatch: pytest.MonkeyPatch) -> None:
    stands = replace(fainting(lasts_s=0.1), disturbances=())
    monkeypatch.setattr(drawing, "FAMILIES", {"fall": (lambda *_: stands,), "non_fall": ()})
    with pytest.raises(SurefootError, match="fall 0, seed 5: 40 draws"):
        draw_checked("fall", 0, 5)


def sitting(seed: int) -> Scenario:
    rng = np.random.default_rng(seed)
    return library.sitting(rng, *library.draw_person(rng))


@pytest.mark.parametrize("seed", [0, 1, 2])
def test_who_sits_down_ends_on_the_chair_and_without_one_on_the_floor(seed: int) -> None:
    scenario = sitting(seed)
    performance = Performance(scenario, worn=False)
    world = performance.world
    assert world.seat_force_n() == 0.0
    while world.time_s < scenario.duration_s:
        performance.advance(REST)
    assert world.seat_force_n() > 0.3 * 9.81 * scenario.size.mass_kg
    assert not world.person.fallen
    assert world.touched_down() == ""
    sunk = world.person.pelvis_height_m - world.pelvis_m[2]
    assert sunk == pytest.approx(scenario.lowered_m, abs=0.03), "as low as they meant to come"
    assert not unassisted(scenario).fell
    seat = scenario.seat
    assert seat is not None
    assert unassisted(replace(scenario, seat=seat._replace(x_m=-2.0))).fell, "missing the chair is no sitting down"


def test_a_push_waits_for_its_moment_of_the_stride() -> None:
    began = []
    for stride in (0.2, 0.7):
        walk = Scenario(
            title="", kind="fall", family="push", size=BodySize(1.7, 75.0), ability=FRAIL,
            wishes=(Wish(0.2, Intent(speed_m_s=0.6)),), disturbances=(AtPhase(Push(1.5, 0.0), stride),),
        )  # fmt: skip
        performance = Performance(walk, worn=False)
        while performance.disturbed_s is None:
            performance.advance(REST)
        person = performance.world.person
        began.append(person.stance)
        assert performance.disturbed_s >= 1.5
        assert (person.phase + (person.stance == "r")) / 2 == pytest.approx(stride, abs=0.11)
    assert began == ["l", "r"]


def test_leaning_is_felt_by_the_sensor_and_no_fall() -> None:
    lean = replace(fainting(), disturbances=(LeanOn(0.3, 100.0, going_s=0.3),))
    performance = Performance(lean)
    for _ in range(300):
        performance.advance(REST)
    assert performance.world.wrench.up_n == pytest.approx(-100.0, abs=30.0)
    assert not performance.world.person.fallen


def test_movements_are_gradual() -> None:
    assert [gradual(t, 2.0) for t in (-1.0, 0.0, 1.0, 2.0, 5.0)] == pytest.approx([0.0, 0.0, 0.5, 1.0, 1.0])
    assert [there_and_back(t, 1.0, 0.5) for t in (0.0, 1.2, 2.5, 9.0)] == pytest.approx([0.0, 1.0, 0.0, 0.0])


def test_a_camera_is_blind_for_as_long_as_it_is() -> None:
    faults = SensorFaults(blind_from_s=2.0, blind_for_s=0.1)
    assert [faults.blind(t) for t in (1.99, 2.0, 2.09, 2.11)] == [False, True, True, False]
    assert not SensorFaults().blind(0.0)


@pytest.mark.timeout(240)
def test_the_whole_stack_holds_who_faints_and_does_not_when_switched_off() -> None:
    config = SurefootConfig()
    scenario = fainting(at_s=1.4, lasts_s=2.6)
    held, trace = run_trial(scenario, "anticipatory", config)
    again, _ = run_trial(scenario, "anticipatory", config)
    assert json.dumps(held.row()) == json.dumps(again.row())
    left, _ = run_trial(scenario, "none", config)
    assert held.arrests == 1
    assert left.arrests == left.guards == 0
    assert held.pelvis_drop_m < left.pelvis_drop_m
    assert not held.tipped
    assert len(trace.horizon_s) > 20


@pytest.mark.timeout(240)
def test_a_job_is_done_from_its_seed_alone(monkeypatch: pytest.MonkeyPatch) -> None:
    families: dict[Kind, object] = {"fall": (lambda *_: fainting(at_s=1.2, lasts_s=1.8),), "non_fall": ()}
    monkeypatch.setattr(drawing, "FAMILIES", families)
    monkeypatch.setattr(drawing, "unassisted", lambda scenario: unassisted(replace(scenario, duration_s=4.0)))
    result = perform(Job("fall", 0, 1, ("reactive",), SurefootConfig()))
    assert json.loads(json.dumps(result))["scenario"]["family"] == "faint"
    assert set(result["trials"]) == {"reactive"}
