"""The quick replay does what the intervention that runs live does, whatever happens to its inputs."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from controller_tuning_streams import START_NS, course, watched

from bridge.config.surefoot import SurefootConfig
from bridge.messages import GaitState
from controller.tuning.cases import Case, Horizons, stream
from controller.tuning.course import Stages
from controller.tuning.reference import replay_live
from controller.tuning.replay import STATES, Run, replay

CONFIG = SurefootConfig()


def same(ours: Run, live: Run) -> None:
    assert ours.transitions == live.transitions
    np.testing.assert_array_equal(ours.state, live.state)
    np.testing.assert_allclose(ours.stiffening, live.stiffening, atol=1e-9)


@pytest.mark.parametrize("seed", range(12))
def test_it_does_what_the_live_code_does(seed: int) -> None:
    rng = np.random.default_rng(1000 + seed)
    intervention = CONFIG.intervention.model_copy(
        update={
            "steps_used": int(rng.choice([16, 16, 16, 4, 1, 0])),
            "distance_onset_sd": float(rng.uniform(0.5, 3.0)),
            "probability_onset": float(rng.uniform(0.05, 0.6)),
            "probability_full": float(rng.uniform(0.65, 1.0)),
            "unconfirmed_most": float(rng.choice([0.5, 0.7, 1.0])),
            "unknown_risk": float(rng.choice([0.0, 0.2, 0.35, 0.9])),
            "trusted_quality": float(rng.choice([0.5, 0.7])),
        }
    )
    supervisor = CONFIG.supervisor.model_copy(
        update={"auto_rearm": bool(rng.random() < 0.8), "arrest_hold_s": float(rng.choice([0.2, 1.0]))}
    )
    stages = Stages() if seed % 3 else Stages(8, 0.06)
    case = course(seed)
    same(replay(case, intervention, supervisor, stages), replay_live(case, intervention, supervisor, stages))


def test_these_courses_have_everything_in_them() -> None:
    """What is compared above is worth comparing: every state is entered, for reasons of every kind."""
    reasons = ""
    entered = set()
    for seed in range(12):
        for transition in replay(course(seed), CONFIG.intervention, CONFIG.supervisor).transitions:
            entered.add(transition.after)
            reasons += transition.reason + "\n"
    assert entered == set(GaitState) - {GaitState.DISARMED}
    for word in ("harness load", "column descends", "fall boundary", "quality", "not valid",
                 "ms old", "not finite", "all inputs good"):  # fmt: skip
        assert word in reasons, word


def test_a_fall_that_passes_is_released_as_the_live_code_does() -> None:
    case = watched(10.0, [(2.0, 2.5, 0.97)])
    run = replay(case, CONFIG.intervention, CONFIG.supervisor)
    reasons = [transition.reason for transition in run.transitions]
    assert "support released" in reasons
    assert any("fall probability" in reason for reason in reasons)
    same(run, replay_live(case, CONFIG.intervention, CONFIG.supervisor))


def test_a_case_of_nothing_is_never_armed() -> None:
    empty = stream("fall_horizon", [], [], [])
    nothing = Horizons(
        empty, np.zeros((0, 16, 3)), np.zeros((0, 16)), np.zeros((0, 16)), np.zeros(0), np.zeros(0)
    )  # fmt: skip
    case = Case("nothing", "nothing", START_NS, 10_000_000, 100, nothing)
    run = replay(case, CONFIG.intervention, CONFIG.supervisor)
    assert set(run.state.tolist()) == {STATES.index(GaitState.DISARMED)}
    assert set(run.risk_ahead.tolist()) == {CONFIG.intervention.unknown_risk}
    same(run, replay_live(case, CONFIG.intervention, CONFIG.supervisor))


def test_what_comes_later_changes_nothing_before() -> None:
    case = course(3)
    cut = replace(case, ticks=300)
    whole, part = (replay(one, CONFIG.intervention, CONFIG.supervisor) for one in (case, cut))
    np.testing.assert_array_equal(whole.state[:300], part.state)
    np.testing.assert_array_equal(whole.stiffening[:300], part.stiffening)


def test_a_lower_threshold_intervenes_earlier_and_says_why() -> None:
    case = watched(4.0, [(2.0, 2.3, 0.5), (2.3, 3.0, 0.97)])
    late = CONFIG.intervention.model_copy(update={"probability_onset": 0.6, "probability_full": 0.9})
    early = CONFIG.intervention.model_copy(update={"probability_onset": 0.1, "probability_full": 0.5})
    times = {}
    for name, config in (("late", late), ("early", early)):
        arrest = next(t for t in replay(case, config, CONFIG.supervisor).transitions if t.after is GaitState.ARREST)
        assert "fall probability" in arrest.reason
        times[name] = arrest.time_s
    assert times["early"] == pytest.approx(2.05, abs=0.03)  # the dwell of the supervisor
    assert times["late"] == pytest.approx(2.35, abs=0.03)


def test_before_anything_is_known_the_risk_is_that_of_not_knowing() -> None:
    run = replay(course(2), CONFIG.intervention, CONFIG.supervisor)
    assert run.risk_ahead[0] == run.risk_near[0] == CONFIG.intervention.unknown_risk


def test_a_case_keeps_its_values() -> None:
    case = course(1)
    before = case.horizons.distance.copy()
    replay(case, CONFIG.intervention, CONFIG.supervisor)
    np.testing.assert_array_equal(case.horizons.distance, before)


@pytest.mark.data
def test_real_falls_and_days(data_dir, tmp_path) -> None:  # type: ignore[no-untyped-def]
    from controller.tuning.load import load_cases
    from controller.tuning.score import score

    words = [f"{data_dir}/urfd/falls.npz:fall-0[1-4]", f"{data_dir}/upfall/subject1_cam1.npz:activity09-trial*"]
    cases = load_cases(words, CONFIG, cache=tmp_path)
    assert [len(case.falls) for case in cases] == [1, 1, 1, 0, 0, 0]
    runs = [replay(case, CONFIG.intervention, CONFIG.supervisor) for case in cases]
    for case, run in zip(cases, runs, strict=True):
        same(run, replay_live(case, CONFIG.intervention, CONFIG.supervisor))
    outcome = score(runs)
    assert outcome.falls == 3
    assert outcome.caught >= 2
