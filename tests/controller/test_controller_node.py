"""The controller node in lock-step: safe commands in time, no jump, no way to stop the loop, hot reload."""

from __future__ import annotations

import logging
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from controller_messages import MS, NS, command, horizon, odometry, wrench

from bridge.clock import ManualClock
from bridge.config.intervention import InterventionConfig
from bridge.config.load import load_config, parse_config
from bridge.config.surefoot import SurefootConfig
from bridge.errors import ConfigError
from bridge.inbox import Inbox
from bridge.messages import GaitState, Odometry, SupportCommand, Wrench
from bridge.node import NodeContext
from bridge.outbox import Outbox
from bridge.topics import FALL_HORIZON, ODOMETRY, SUPPORT_COMMAND, TWIST, WRENCH
from bridge.transport.interface import Sample
from bridge.transport.memory import MemoryHub
from controller.gate import GateLimits
from controller.interface import Controller, Decision
from controller.limits import check_limits
from controller.mock import LoggingController
from controller.node import ControllerNode, create

PERIOD_NS = 10 * MS
LIMITS = GateLimits(**SurefootConfig().gate.model_dump())


class Pushing:
    """A controller that walks on at half a metre a second, with ways to misbehave."""

    def __init__(self, clock: ManualClock) -> None:
        self.clock = clock
        self.velocity = np.array([0.5, 0.1, 0.2, 0.0])
        self.error: Exception | None = None
        self.takes_s = 0.001
        self.solver = "mpc"
        self.resets = 0
        self.steps = 0

    def reset(self) -> None:
        self.resets += 1

    def step(self, now_ns: int, odometry: Odometry, wrench: Wrench, decision: Decision) -> SupportCommand:
        self.steps += 1
        self.clock.advance(self.takes_s)
        if self.error is not None:
            raise self.error
        return command(
            now_ns,
            velocity=self.velocity,
            state=decision.state,
            reason=decision.reason,
            stiffening=decision.stiffening,
            solver=self.solver,
        )


class Bench:
    """The node on an in-memory wire, with a person that walks: inputs at their own rates until they are cut."""

    def __init__(
        self,
        make: Callable[[ManualClock], Controller] = Pushing,
        config: SurefootConfig | None = None,
        config_path: Path | None = None,
    ) -> None:
        self.clock = ManualClock(NS)
        hub = self.hub = MemoryHub(self.clock)
        wire = hub.transport()
        self.controller: Any = make(self.clock)
        context = NodeContext(
            config or SurefootConfig(), hub.transport(), self.clock, logging.getLogger("test"), {}, config_path
        )
        self.node = ControllerNode(context, self.controller)
        self._out = {t.key: Outbox(wire, t) for t in (FALL_HORIZON, WRENCH, ODOMETRY)}
        self._commands: Inbox[SupportCommand] = Inbox(wire, SUPPORT_COMMAND, max_age_s=10.0)
        self.twists: list[Sample] = []
        wire.subscribe(TWIST, self.twists.append)
        self.sent: list[SupportCommand] = []
        self.lost: set[str] = set()
        self.person: dict[str, Any] = {}
        self.last_ns: dict[str, int] = {}
        self._turn = 0

    def run(self, span_s: float) -> SupportCommand:
        for _ in range(round(span_s * 100)):
            now_ns = NS + self._turn * PERIOD_NS
            self.clock.sleep_until(now_ns)
            if "fall_horizon" not in self.lost and self._turn % 3 == 0:
                alive = self.person.get("distance", 5.0) + 1e-9 * (self._turn % 2)  # measured, so never still
                self._send("fall_horizon", horizon(now_ns, **{**self.person, "distance": alive}))
            if "wrench" not in self.lost:
                self._send("wrench", wrench(now_ns))
            if "odom" not in self.lost:
                self._send("odom", odometry(now_ns, height=0.95))
            self.node.step(now_ns)
            received = self._commands.read(self.clock.now_ns())
            assert received.fresh
            assert received.message is not None
            self.sent.append(received.message)
            self._turn += 1
        return self.sent[-1]

    def _send(self, key: str, message: Any) -> None:
        self._out[key].send(message)
        self.last_ns[key] = message.stamp_ns

    def largest_jump(self) -> np.ndarray:
        return np.abs(np.diff([c.velocity for c in self.sent], axis=0)).max(axis=0)


ACCELERATION = np.array([limit.acceleration for limit in LIMITS.axes()])


class TestWalking:
    def test_the_controller_moves_the_base(self) -> None:
        bench = Bench()
        out = bench.run(2.0)
        assert out.velocity == pytest.approx([0.5, 0.1, 0.2, 0.0])
        assert (out.state, out.valid) == (GaitState.FOLLOW, True)
        assert len(bench.twists) == len(bench.sent) == 200
        assert [c.sequence for c in bench.sent] == list(range(200))

    def test_disarmed_holds_the_column_where_it_is(self) -> None:
        first = Bench().run(0.02)
        assert (first.state, first.valid, first.solver) == (GaitState.DISARMED, False, "stop")
        assert first.column_height == 0.95
        assert not first.velocity.any()

    def test_stiffening_reaches_the_wire(self) -> None:
        bench = Bench()
        bench.run(1.0)
        bench.person = {"distance": 0.2, "rate": -5.0, "fall": 0.9}
        out = bench.run(0.3)
        assert out.state is GaitState.ARREST
        assert out.stiffening == 1.0
        assert out.reason.startswith("fall boundary 0.2 sd away")


class TestLoss:
    @pytest.mark.parametrize(("key", "limit_s"), [("fall_horizon", 0.2), ("wrench", 0.1), ("odom", 0.1)])
    @pytest.mark.parametrize("phase", [0, 1, 2])
    def test_safe_command_in_time_and_no_jump_at_loss_or_return(self, key: str, limit_s: float, phase: int) -> None:
        bench = Bench()
        bench.run(2.0 + phase * 0.01)
        bench.lost = {key}
        seen = len(bench.sent)
        bench.run(1.0)
        safe = next(c for c in bench.sent[seen:] if not c.valid)
        assert (safe.stamp_ns - bench.last_ns[key]) / NS <= limit_s
        assert safe.state is GaitState.SAFE_STOP
        assert f"{key} is" in safe.reason
        assert bench.sent[-1].velocity == pytest.approx(np.zeros(4), abs=1e-6)
        bench.lost = set()
        out = bench.run(4.0)
        assert out.state is GaitState.FOLLOW
        assert out.velocity == pytest.approx([0.5, 0.1, 0.2, 0.0])
        assert (bench.largest_jump() <= ACCELERATION * 0.01 + 1e-9).all()
        assert bench.controller.resets == 2

    def test_a_stop_is_as_stiff_as_an_arrest(self) -> None:
        bench = Bench()
        bench.run(1.0)
        bench.lost = {"wrench"}
        out = bench.run(0.3)
        admittance = SurefootConfig().admittance
        assert out.state is GaitState.SAFE_STOP
        assert tuple(out.damping) == admittance.damping_arrest
        assert tuple(out.stiffness) == admittance.stiffness_stop

    def test_the_controller_is_not_asked_while_stopped(self) -> None:
        bench = Bench()
        bench.run(1.0)
        bench.lost = {"wrench"}
        bench.run(0.2)
        steps = bench.controller.steps
        bench.run(0.5)
        assert bench.controller.steps == steps

    def test_garbage_is_named(self) -> None:
        bench = Bench()
        bench.run(1.0)
        bench.person = {"valid": False, "reason": "person lost"}
        out = bench.run(0.3)
        assert out.state is GaitState.SAFE_STOP
        assert out.reason == "horizon is not valid: person lost"

    def test_nothing_ever_arrives(self) -> None:
        bench = Bench()
        bench.lost = {"fall_horizon", "wrench", "odom"}
        out = bench.run(1.0)
        assert (out.state, out.valid) == (GaitState.DISARMED, False)
        assert "no wrench received yet" in out.reason


class TestMisbehaviour:
    def test_an_exception_becomes_a_safe_command_and_the_loop_goes_on(self, caplog: pytest.LogCaptureFixture) -> None:
        bench = Bench()
        bench.run(2.0)
        bench.controller.error = ZeroDivisionError("division by zero")
        out = bench.run(1.0)
        assert (out.valid, out.state) == (False, GaitState.SAFE_STOP)
        assert out.reason == "controller failed: ZeroDivisionError: division by zero"
        assert out.velocity == pytest.approx(np.zeros(4), abs=1e-6)
        assert bench.node.status(bench.clock.now_ns()).level == 2
        assert sum("division by zero" in r.getMessage() for r in caplog.records if r.levelno >= logging.ERROR) == 1
        bench.controller.error = None
        out = bench.run(1.0)
        assert out.velocity == pytest.approx([0.5, 0.1, 0.2, 0.0])
        assert (bench.largest_jump() <= ACCELERATION * 0.01 + 1e-9).all()
        assert bench.node.status(bench.clock.now_ns()).level == 0

    def test_an_overrun_is_replaced(self) -> None:
        bench = Bench()
        bench.run(1.0)
        bench.controller.takes_s = 0.041
        out = bench.run(0.01)
        assert not out.valid
        assert out.reason == "controller took 41 ms, limit 40"
        assert bench.node.status(bench.clock.now_ns()).values["overruns"] == "1"

    def test_taking_exactly_the_limit_is_in_time(self) -> None:
        bench = Bench()
        bench.run(1.0)
        bench.controller.takes_s = 0.040
        assert bench.run(0.01).valid

    def test_nonsense_stops_at_the_gate(self) -> None:
        bench = Bench()
        bench.run(1.0)
        bench.controller.velocity = np.array([np.nan, 0, 0, 0])
        out = bench.run(0.5)
        assert out.reason == "command velocity is not finite"
        assert not out.valid
        assert np.isfinite(out.velocity).all()


class TestStatus:
    def test_before_the_first_step(self) -> None:
        status = Bench().node.status(NS)
        status.check()
        assert status.level == 1
        assert status.summary == "DISARMED: not started"

    def test_says_rate_ages_state_and_solver(self) -> None:
        bench = Bench()
        bench.run(1.0)
        status = bench.node.status(bench.clock.now_ns())
        assert status.level == 0
        assert float(status.values["rate_hz"]) == pytest.approx(100.0)
        assert float(status.values["period_error_ms.p99"]) == pytest.approx(0.0)
        assert float(status.values["solve_ms.p50"]) == pytest.approx(1.0)
        assert float(status.values["age_ms.horizon"]) <= 30
        assert float(status.values["age_ms.wrench"]) == 0
        assert float(status.values["age_ms.odometry"]) == 0
        assert (status.values["state"], status.values["solver"]) == ("FOLLOW", "mpc")
        assert status.values["config"] == "in use"

    def test_a_stop_is_a_warning_with_its_reason(self) -> None:
        bench = Bench()
        bench.run(1.0)
        bench.lost = {"wrench"}
        bench.run(0.3)
        status = bench.node.status(bench.clock.now_ns())
        assert status.level == 1
        assert status.summary.startswith("SAFE_STOP: wrench is")
        assert float(status.values["age_ms.wrench"]) > 250

    def test_who_does_not_intervene_says_so(self) -> None:
        bench = Bench(config=SurefootConfig(intervention=InterventionConfig(steps_used=0)))
        bench.run(1.0)
        status = bench.node.status(bench.clock.now_ns())
        assert status.level == 1
        assert "no intervention whatever happens" in status.summary

    def test_a_controller_that_stops_while_following_is_a_warning(self) -> None:
        bench = Bench()
        bench.run(1.0)
        assert bench.node.status(bench.clock.now_ns()).level == 0
        bench.controller.solver = "stop"
        assert bench.run(0.1).state is GaitState.FOLLOW
        assert bench.node.status(bench.clock.now_ns()).level == 1

    def test_is_never_finished(self) -> None:
        assert not Bench().node.finished()


class TestRival:
    def test_a_second_publisher_is_named_and_changes_nothing(self) -> None:
        bench = Bench()
        bench.run(1.0)
        before = bench.sent[-1].state
        other = Outbox(bench.hub.transport(), WRENCH)
        for _ in range(50):
            other.send(wrench(bench.clock.now_ns(), force=(0.0, 0.0, -900.0)))  # a fall, if it were believed
            bench.run(0.01)
        assert before is bench.sent[-1].state is GaitState.FOLLOW
        status = bench.node.status(bench.clock.now_ns())
        assert status.level == 1
        assert "two publishers of wrench: the first is followed, the other refused" in status.summary
        bench.run(1.2)
        assert "two publishers" not in bench.node.status(bench.clock.now_ns()).summary


class TestReload:
    """The watcher is looked at once by hand: no thread, no sleep."""

    def bench(self, tmp_path: Path, text: str = "") -> tuple[Bench, Path]:
        file = tmp_path / "surefoot.toml"
        file.write_text(text)
        bench = Bench(config=load_config(file), config_path=file)
        bench.node._watcher.close()
        bench.person = {"distance": 2.0}
        bench.run(1.0)
        return bench, file

    def change(self, bench: Bench, file: Path, text: str) -> None:
        file.write_text(text)
        bench.node._watcher.check()

    def test_a_valid_change_takes_effect_without_a_jump(self, tmp_path: Path) -> None:
        bench, file = self.bench(tmp_path)
        assert bench.sent[-1].stiffening == 0.0
        self.change(
            bench, file, "[intervention]\ndistance_onset_sd = 6.0\ndistance_full_sd = 2.5\nunconfirmed_most = 1.0\n"
        )
        out = bench.run(0.3)
        assert out.stiffening == 1.0
        jumps = np.abs(np.diff([c.stiffening for c in bench.sent]))
        assert jumps.max() <= 20.0 * 0.01 + 1e-9
        assert (bench.largest_jump() <= ACCELERATION * 0.01 + 1e-9).all()

    @pytest.mark.parametrize(
        ("text", "reason"),
        [
            ("[intervention]\ndistance_onset_sd = -3.0\n", "must be below distance_onset_sd"),
            ("[intervention]\ndistanc_onset_sd = 2.0\n", "did you mean 'intervention.distance_onset_sd'"),
            ("[intervention\n", "not valid TOML"),
        ],
    )
    def test_a_broken_file_is_refused_and_the_old_values_stay(
        self, tmp_path: Path, text: str, reason: str, caplog: pytest.LogCaptureFixture
    ) -> None:
        bench, file = self.bench(tmp_path)
        self.change(bench, file, text)
        out = bench.run(0.3)
        assert (out.state, out.stiffening) == (GaitState.FOLLOW, 0.0)
        status = bench.node.status(bench.clock.now_ns())
        assert status.level == 1
        assert reason in status.summary
        assert reason in status.values["config"]
        assert any(reason in r.getMessage() and "old values stay" in r.getMessage() for r in caplog.records)
        self.change(bench, file, "[intervention]\nunknown_risk = 0.4\n")
        bench.run(0.1)
        assert bench.node.status(bench.clock.now_ns()).values["config"] == "in use"

    @pytest.mark.parametrize(("before", "after"), [(16, 0), (0, 16)])
    def test_intervention_is_not_turned_off_or_on_while_somebody_walks(
        self, tmp_path: Path, before: int, after: int
    ) -> None:
        bench, file = self.bench(tmp_path, f"[intervention]\nsteps_used = {before}\n")
        self.change(bench, file, f"[intervention]\nsteps_used = {after}\n")
        bench.person = {"distance": -3.0, "fall": 0.9}
        out = bench.run(0.5)
        assert (out.state is GaitState.ARREST) == (before > 0)
        status = bench.node.status(bench.clock.now_ns())
        assert f"steps_used = {after} ({before} in use)" in status.summary
        assert "restart" in status.summary

    def test_other_sections_wait_for_a_restart(self, tmp_path: Path, caplog: pytest.LogCaptureFixture) -> None:
        bench, file = self.bench(tmp_path)
        self.change(bench, file, "[gate]\nspeed_m_s = 0.2\n")
        bench.run(0.1)
        assert any("only [intervention] is reloaded" in r.getMessage() for r in caplog.records)
        assert bench.sent[-1].velocity[0] > 0.2


class TestCreate:
    def context(self, options: dict[str, str], config: SurefootConfig | None = None) -> NodeContext:
        clock = ManualClock(NS)
        return NodeContext(
            config or SurefootConfig(), MemoryHub(clock).transport(), clock, logging.getLogger("test"), options
        )

    def test_option_chooses_the_mock_and_its_log(self, tmp_path: Path) -> None:
        file = tmp_path / "calls.jsonl"
        node = create(self.context({"controller": "log", "log": str(file)}))
        assert isinstance(node, ControllerNode)
        node.step(NS)
        assert "DISARMED" in file.read_text()
        node.close()

    def test_configuration_chooses_the_mock(self) -> None:
        config = parse_config({"controller": {"kind": "log"}}, "test")
        node = create(self.context({}, config))
        assert isinstance(node, ControllerNode)
        assert isinstance(node._controller, LoggingController)
        assert node.period_s == 0.01
        node.wait()
        node.close()

    def test_unknown_controller(self) -> None:
        with pytest.raises(ConfigError, match="controller = pid: expected mpc or log"):
            create(self.context({"controller": "pid"}))

    @pytest.mark.parametrize(
        ("table", "words"),
        [
            (
                {"walker": {"velocity_forward_max_m_s": 1.5}},
                r"walker.velocity_forward_max_m_s = 1.5 is above gate.speed_m_s = 1.2",
            ),
            ({"gate": {"jerk_m_s3": 30}}, r"walker.jerk_forward_max_m_s3 = 40 is above gate.jerk_m_s3 = 30"),
            ({"walker": {"column_low_m": 0.6}}, r"walker.column_low_m = 0.6 is below gate.column_low_m = 0.7"),
        ],
    )
    def test_limits_that_contradict_each_other(self, table: dict[str, Any], words: str) -> None:
        with pytest.raises(ConfigError, match=words):
            check_limits(parse_config(table, "test"))

    def test_default_limits_agree(self) -> None:
        check_limits(SurefootConfig())
