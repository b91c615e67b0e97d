"""`surefoot doctor`: each check is made to fail for real, and says what is wrong and what mends it."""

from __future__ import annotations

import importlib
import json
import os
import shutil
import socket
import sys
from collections.abc import Iterator
from contextlib import closing
from datetime import UTC, datetime, timedelta
from pathlib import Path
from typing import Any

import pytest
from bridge_site import make_keys
from bridge_toys import free_ports, wait_until
from packaging.requirements import Requirement

from bridge.cli import main
from bridge.clock import SystemClock
from bridge.config.bridge import BridgeConfig
from bridge.config.load import parse_config
from bridge.config.surefoot import SurefootConfig
from bridge.doctor import building, clock, machine, wire
from bridge.doctor.certificates import judge_certificates
from bridge.doctor.configuration import check_config, check_source
from bridge.doctor.examine import CHECKS, examine
from bridge.doctor.finding import Finding, Level, Patient
from bridge.doctor.modules import judge_modules
from bridge.doctor.needs import PURPOSES, Needs, needs
from bridge.doctor.packages import installed, judge_extras, judge_packages, judge_python, wanted_extras
from bridge.doctor.weights import SUMS, judge_weights
from bridge.keys.authority import create_authority, issue
from bridge.keys.files import write, write_pair
from bridge.messages import NodeStatus
from bridge.outbox import Outbox
from bridge.topics import DIAGNOSTICS, SUPPORT_COMMAND
from bridge.transport.memory import MemoryHub
from bridge.transport.zenoh import ZenohTransport

REPO = Path(__file__).resolve().parents[2]


def patient(table: dict[str, Any] | None = None, path: Path | None = None) -> Patient:
    return Patient(path, (), parse_config(table or {}, "test"))


def only(findings: Any, level: Level) -> Finding:
    """Return the single finding of a level."""
    (found,) = [finding for finding in findings if finding.level is level]
    return found


class TestPackages:
    @pytest.mark.parametrize(
        ("running", "level"), [("3.10.14", "broken"), ("3.11.0", "good"), ("3.12.1", "good"), ("3.14.0rc1", "good")]
    )
    def test_python(self, running: str, level: str) -> None:
        assert judge_python(running, ">=3.11").level == level

    def test_what_is_missing_or_too_old_is_named_with_the_command(self, tmp_path: Path) -> None:
        (tmp_path / "pyproject.toml").write_text(
            '[project]\nname = "surefoot"\nrequires-python = ">=3.11"\n'
            'dependencies = ["numpy>=1000", "no-such-package>=2", "pydantic>=2"]\n'
        )
        too_old, absent = judge_packages(needs(tmp_path), installed)
        assert too_old.level is absent.level is Level.BROKEN
        assert "numpy" in too_old.text
        assert "needed: >=1000" in too_old.text
        assert too_old.mend == "pip install 'numpy>=1000'"
        assert absent.text == "no-such-package is not installed"
        assert absent.mend == "pip install 'no-such-package>=2'"

    def test_a_checkout_counts_before_what_was_installed_from_it(self) -> None:
        assert needs().source == str(REPO / "pyproject.toml")
        assert {one.name for one in needs().packages} >= {"torch", "eclipse-zenoh", "packaging"}

    def test_without_a_checkout_the_installed_package_says_what_it_needs(self, tmp_path: Path) -> None:
        found = needs(tmp_path)
        assert found.source == "the installed package"
        assert "torch" in {one.name for one in found.packages}
        assert "pytest" in {one.name for one in found.extras["dev"]}
        assert "pytest" not in {one.name for one in found.packages}

    def test_every_extra_is_said_to_be_for_something(self) -> None:
        assert set(needs().extras) <= set(PURPOSES)

    def test_an_extra_that_nobody_asks_for_is_a_note(self) -> None:
        need = Needs("", (), {"view": (Requirement("no-such-viewer>=1"),)}, "here")
        found = only(judge_extras(need, installed, {}), Level.NOTE)
        assert "no-such-viewer" in found.text
        assert "surefoot view" in found.text
        assert found.mend == "pip install 'surefoot[view]'"

    @pytest.mark.parametrize(
        ("table", "extra"),
        [
            ({"mpc": {"solver": "piqp"}}, "solvers"),
            ({"perception": {"source": {"uri": "camera:0"}}}, "movenet"),
            ({"perception": {"source": {"uri": "walk.mp4"}, "estimator": "yolo"}}, "yolo"),
        ],
    )
    def test_an_extra_that_the_configuration_needs_is_broken_without(self, table: dict[str, Any], extra: str) -> None:
        need = Needs("", (), {extra: (Requirement("no-such-package"),)}, "here")
        found = only(judge_extras(need, installed, wanted_extras(parse_config(table, "test"))), Level.BROKEN)
        assert found.mend == f"pip install 'surefoot[{extra}]'"

    def test_keypoints_need_no_estimator(self) -> None:
        for uri in ("clip.npz:walk", "wire", "lab/camera.py:frames"):
            assert wanted_extras(parse_config({"perception": {"source": {"uri": uri}}}, "test")) == {}

    def test_an_extra_made_of_extras_lacks_what_they_lack(self) -> None:
        extras = {"all": (Requirement("surefoot[view]"),), "view": (Requirement("no-such-viewer"),)}
        texts = [finding.text for finding in judge_extras(Needs("", (), extras, "here"), installed, {})]
        assert any(text.startswith("all is not installed (no-such-viewer)") for text in texts)


class TestModules:
    def test_a_role_that_cannot_be_imported(self, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
        (tmp_path / "lab_drive.py").write_text("import no_such_library_anywhere\n")
        monkeypatch.syspath_prepend(tmp_path)
        monkeypatch.setenv("PYTHONPATH", str(tmp_path))
        found = list(judge_modules({"drive": "lab_drive", "perception": "json", "controller": "no.such.node"}))
        assert [finding.level for finding in found] == [Level.BROKEN, Level.BROKEN, Level.GOOD]
        assert "no module 'no.such.node'" in found[0].text
        assert "No module named 'no_such_library_anywhere'" in found[1].text
        assert "launch.modules.drive" in found[1].mend

    def test_one_that_takes_the_interpreter_along(self, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
        (tmp_path / "crashing_node.py").write_text("import os\nos.abort()\n")
        monkeypatch.syspath_prepend(tmp_path)
        monkeypatch.setenv("PYTHONPATH", str(tmp_path))
        assert "ended with -6" in only(judge_modules({"drive": "crashing_node"}), Level.BROKEN).text


class TestConfiguration:
    def test_an_unknown_key(self, tmp_path: Path) -> None:
        file = tmp_path / "my own.toml"
        file.write_text("[launch]\nrestrat = true\n")
        found = only(check_config(Patient(file, (), SurefootConfig())), Level.BROKEN)
        assert "did you mean 'launch.restart'" in found.text
        assert found.mend == f"surefoot config --check '{file}'"

    def test_limits_that_contradict_each_other(self, tmp_path: Path) -> None:
        file = tmp_path / "my.toml"
        file.write_text("version = 1\n[gate]\nspeed_m_s = 0.5\n")
        found = only(check_config(Patient(file, (), SurefootConfig())), Level.BROKEN)
        assert "above gate.speed_m_s = 0.5" in found.text

    def test_a_file_of_before_there_were_versions(self, tmp_path: Path) -> None:
        file = tmp_path / "my.toml"
        file.write_text("[launch]\nrestart = true\n")
        found = only(check_config(Patient(file, (), SurefootConfig())), Level.NOTE)
        assert found.mend == f"surefoot config --migrate {file} --out {file} --force"

    @pytest.mark.parametrize(
        ("source", "text"),
        [
            ({"source": {"uri": "absent.mp4"}}, "absent.mp4: no such file"),
            ({"source": {"uri": "absent.npz:walk"}}, "absent.npz: no such file"),
            ({"source": {"uri": "camera:77"}}, "there is no /dev/video77"),
            ({"source": {"uri": "rtsp://x/1"}, "movenet": {"weights": "absent.tflite"}}, "absent.tflite: no such file"),
            ({"source": {"uri": "rtsp://x/1"}, "estimator": "yolo"}, "perception.yolo.model is not set"),
        ],
    )
    def test_what_perception_looks_at_is_not_there(self, source: dict[str, Any], text: str) -> None:
        broken = [finding for finding in check_source(patient({"perception": source})) if finding.level is Level.BROKEN]
        assert any(text in finding.text for finding in broken)
        assert all(finding.mend for finding in broken)

    def test_where_perception_does_not_run_nothing_is_looked_for(self) -> None:
        table = {"launch": {"roles": ["controller"]}, "perception": {"source": {"uri": "absent.mp4"}}}
        assert list(check_source(patient(table))) == []


@pytest.fixture
def load() -> Any:
    return importlib.import_module("anticipation.checkpoint").load


class TestWeights:
    SHIPPED = REPO / "anticipation" / "weights" / "default.safetensors"

    @pytest.mark.parametrize("name", sorted(path.name for path in SHIPPED.parent.glob("*.safetensors")))
    def test_the_shipped_ones_are_those_of_the_sum_beside_them(self, name: str, load: Any) -> None:
        found = judge_weights(self.SHIPPED.with_name(name), load, shipped=True)
        assert found.level is Level.GOOD, f"{found.text}; new ones? sha256sum *.safetensors > {SUMS}, beside them"
        assert found.text.endswith("as released")

    def test_a_single_changed_number_is_found(self, tmp_path: Path, load: Any) -> None:
        changed = bytearray(self.SHIPPED.read_bytes())
        changed[-1] ^= 1
        path = tmp_path / self.SHIPPED.name
        path.write_bytes(changed)
        shutil.copy(self.SHIPPED.with_name(SUMS), tmp_path)
        found = judge_weights(path, load, shipped=True)
        assert found.level is Level.BROKEN
        assert "is not what came with this release" in found.text
        assert found.mend.startswith(f"git checkout -- {tmp_path}")

    @pytest.mark.parametrize("content", [b"", b"not weights", None])
    def test_what_does_not_load(self, tmp_path: Path, content: bytes | None, load: Any) -> None:
        path = tmp_path / "mine.safetensors"
        if content is not None:
            path.write_bytes(content)
        found = judge_weights(path, load, shipped=False)
        assert found.level is Level.BROKEN
        assert str(path) in found.text
        assert "surefoot train" in found.mend


class TestCertificates:
    NOW = datetime.now(UTC)
    ROLES = ("perception", "controller")

    @pytest.fixture
    def folder(self, tmp_path: Path) -> Path:
        make_keys(tmp_path / "keys")
        return tmp_path / "keys"

    def test_good_ones(self, folder: Path) -> None:
        (found,) = judge_certificates(folder, self.ROLES, self.NOW)
        assert found.level is Level.GOOD
        assert "perception, controller" in found.text

    def test_no_authority(self, tmp_path: Path) -> None:
        found = only(judge_certificates(tmp_path / "keys", self.ROLES, self.NOW), Level.BROKEN)
        assert found.mend.startswith(f"surefoot keys init --keys {tmp_path / 'keys'} && surefoot keys issue")

    def test_a_role_without(self, folder: Path) -> None:
        (folder / "controller.pem").unlink()
        found = only(judge_certificates(folder, self.ROLES, self.NOW), Level.BROKEN)
        assert found.mend == f"surefoot keys issue controller --renew --keys {folder}"

    def test_the_commands_do_mend_it(self, tmp_path: Path) -> None:
        folder = tmp_path / "keys"
        for spoil in (lambda: None, (folder / "controller.pem").unlink, (folder / "perception.key").unlink):
            spoil()
            for finding in judge_certificates(folder, self.ROLES, datetime.now(UTC)):
                if finding.level is Level.BROKEN:
                    for command in finding.mend.split(" && "):
                        assert main(command.split()[1:]) == 0
            levels = {finding.level for finding in judge_certificates(folder, self.ROLES, datetime.now(UTC))}
            assert levels == {Level.GOOD}

    def test_a_key_that_others_may_read(self, folder: Path) -> None:
        (folder / "controller.key").chmod(0o644)
        found = only(judge_certificates(folder, self.ROLES, self.NOW), Level.BROKEN)
        assert found.mend == f"chmod 600 {folder / 'controller.key'}"

    def test_a_folder_that_others_may_enter_is_said_once(self, folder: Path) -> None:
        folder.chmod(0o755)
        assert only(judge_certificates(folder, self.ROLES, self.NOW), Level.BROKEN).mend == f"chmod 700 {folder}"

    def test_expired_and_expiring(self, folder: Path) -> None:
        late = self.NOW + timedelta(days=366)
        for finding in judge_certificates(folder, self.ROLES, late):
            assert finding.level is Level.BROKEN
            assert "expired" in finding.text
            assert "--renew" in finding.mend
        soon = list(judge_certificates(folder, self.ROLES, self.NOW + timedelta(days=360)))
        assert [finding.level for finding in soon] == [Level.WARNING, Level.WARNING, Level.GOOD]
        assert soon[0].mend == f"surefoot keys issue perception --renew --keys {folder}"

    def test_one_of_another_authority_and_one_of_another_role(self, folder: Path) -> None:
        write_pair(folder, "controller", issue(create_authority(10), "controller", [], 10), replace=True)
        for suffix in (".pem", ".key"):
            mode = 0o600 if suffix == ".key" else 0o644
            write(folder / f"perception{suffix}", (folder / f"drive{suffix}").read_bytes(), mode, replace=True)
        role, signer = judge_certificates(folder, self.ROLES, self.NOW)
        assert "made out to 'drive'" in role.text
        assert "not signed by the authority" in signer.text
        assert signer.mend == f"surefoot keys issue controller --renew --keys {folder}"


class TestWire:
    @pytest.fixture
    def bridge(self) -> dict[str, Any]:
        roles = ("perception", "anticipation", "controller", "drive")
        ports = free_ports(4)
        return {"endpoints": {role: f"tcp/127.0.0.1:{port}" for role, port in zip(roles, ports, strict=True)}}

    def test_a_port_that_somebody_else_has(self, bridge: dict[str, Any]) -> None:
        port = int(bridge["endpoints"]["controller"].rpartition(":")[2])
        with closing(socket.create_server(("127.0.0.1", port))):
            found = only(wire.judge_ports(BridgeConfig(**bridge), ("drive", "controller"), frozenset()), Level.BROKEN)
        assert found.text.startswith(f"controller cannot listen on tcp/127.0.0.1:{port}")
        assert f"sport = :{port}" in found.mend

    def test_who_runs_is_heard_and_keeps_its_port(
        self, bridge: dict[str, Any], monkeypatch: pytest.MonkeyPatch
    ) -> None:
        config = BridgeConfig(**bridge)
        with closing(ZenohTransport(config, "controller", SystemClock())) as other:
            other.declare_alive("controller")
            status = Outbox(other, DIAGNOSTICS)

            def talk() -> None:
                heard: dict[str, bool] = {}
                with closing(ZenohTransport(config, "watcher", SystemClock())) as watcher:
                    watcher.watch_alive(heard.__setitem__)
                    wait_until(lambda: "controller" in heard, "the controller is heard")
                for _ in range(20):
                    stamp_ns = SystemClock().now_ns()
                    status.send(NodeStatus(stamp_ns=stamp_ns, role="controller", level=0, summary="", values={}))

            monkeypatch.setattr(wire, "pause", talk)
            found = list(wire.check_wire(patient({"bridge": bridge})))
        assert not [finding for finding in found if finding.level is Level.BROKEN]
        assert any(finding.text == "a session opens; heard: controller" for finding in found)
        assert any(finding.text.startswith("controller runs already") for finding in found)

    def test_a_router_that_is_not_there(self, bridge: dict[str, Any]) -> None:
        (port,) = free_ports(1)
        table = {"bridge": {**bridge, "mode": "client", "connect": [f"tcp/127.0.0.1:{port}"]}}
        found = only(wire.judge_reach(parse_config(table, "test").bridge, " --config my.toml"), Level.BROKEN)
        assert f"tcp/127.0.0.1:{port}: nobody answers" in found.text
        assert found.mend == "surefoot router --config my.toml"

    def test_certificates_that_cannot_be_used_keep_the_session_shut(self, tmp_path: Path) -> None:
        table = {"bridge": {"keys": str(tmp_path / "none")}}
        found = only(wire.check_wire(patient(table)), Level.BROKEN)
        assert "no such folder of keys" in found.text
        assert found.mend == "surefoot doctor --only config,certificates"

    @pytest.mark.parametrize(("ahead_s", "words"), [(0.4, "400 ms ahead of ours"), (-3.0, "3000 ms old at best")])
    def test_a_clock_that_is_not_ours(self, ahead_s: float, words: str) -> None:
        hub = MemoryHub(SystemClock())
        writer = Outbox(hub.transport(), DIAGNOSTICS)

        def talk() -> None:
            stamp_ns = SystemClock().now_ns() + round(ahead_s * 1e9)
            writer.send(NodeStatus(stamp_ns=stamp_ns, role="drive", level=0, summary="", values={}))

        heard = wire.listen(hub.transport(), talk)
        found = only(wire.judge_streams(heard.ages_s), Level.BROKEN)
        number, unit = words.split(" ", 1)
        assert unit in found.text
        assert any(abs(int(word) - int(number)) <= 20 for word in found.text.split() if word.isdigit())
        assert found.mend

    def test_a_stream_in_time(self) -> None:
        (found,) = wire.judge_streams({SUPPORT_COMMAND: [0.004, 0.002, 0.030]})
        assert found.level is Level.GOOD
        assert "2 ms old at best" in found.text


class TestMachine:
    @pytest.mark.parametrize(("cores", "level"), [(1, "warning"), (2, "note"), (4, "good"), (64, "good")])
    def test_cores(self, cores: int, level: str) -> None:
        assert machine.judge_cores(cores, 4).level == level

    def test_a_priority_that_the_kernel_refuses(self) -> None:
        refused = machine.try_realtime(1000)  # there is none above 99, whoever asks
        assert refused
        found = machine.judge_realtime(1000, refused)
        assert found.level is Level.WARNING
        assert refused in found.text
        assert "rtprio 1000" in found.mend

    def test_no_permission_matters_where_it_is_asked_for(self) -> None:
        assert machine.judge_realtime(0, "PermissionError").level is Level.NOTE
        assert machine.judge_realtime(20, "PermissionError").level is Level.WARNING
        assert machine.judge_realtime(20, "").level is Level.GOOD

    def test_a_folder_that_cannot_be_written(self) -> None:
        found = machine.judge_disk(Path("/proc/surefoot/logs"))
        assert found.level is Level.BROKEN
        assert found.mend == "sudo chown $USER /proc"

    def test_a_file_where_a_folder_is_needed(self, tmp_path: Path) -> None:
        (tmp_path / "runs").write_text("")
        found = machine.judge_disk(tmp_path / "runs" / "logs")
        assert found.level is Level.BROKEN
        assert found.mend == f"mv {tmp_path}/runs {tmp_path}/runs.old"

    def test_a_folder_that_is_not_there_yet_is_none_afterwards(self, tmp_path: Path) -> None:
        machine.judge_disk(tmp_path / "runs" / "logs")
        assert list(tmp_path.iterdir()) == []

    @pytest.mark.parametrize(("free_mb", "level"), [(10, "broken"), (400, "warning"), (5000, "good")])
    def test_room(self, free_mb: int, level: str) -> None:
        assert machine.judge_room(Path("runs"), free_mb).level == level


class TestClock:
    def test_the_kernel_is_asked(self) -> None:
        held = clock.kernel_clock()
        assert held is None or held.error_ms >= 0

    def test_several_machines_need_what_one_does_not(self) -> None:
        free = clock.Held(synchronised=False, error_ms=16000.0)
        assert clock.judge_clock(free, several=False).level is Level.NOTE
        found = clock.judge_clock(free, several=True)
        assert found.level is Level.WARNING
        assert "sudo" in found.mend
        assert clock.judge_clock(clock.Held(True, 0.4), several=True).level is Level.GOOD
        assert clock.judge_clock(clock.Held(True, 80.0), several=True).level is Level.WARNING
        assert clock.judge_clock(None, several=True).level is Level.WARNING

    def test_what_makes_several_machines(self) -> None:
        assert not clock.several_machines(BridgeConfig())
        away = {"allow_remote_without_tls": True}
        assert clock.several_machines(BridgeConfig(endpoints={"drive": "tcp/10.0.0.3:7474"}, **away))
        assert clock.several_machines(BridgeConfig(connect=("tcp/10.0.0.2:7470",), **away))


class TestBuilding:
    @pytest.fixture
    def compiled(self, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Any:
        from controller.mpc import compiled

        monkeypatch.setenv("SUREFOOT_CACHE", str(tmp_path / "cache"))
        return compiled

    def compiler(self, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, script: str) -> None:
        tool = tmp_path / "mycc"
        tool.write_text(f"#!/bin/sh\n{script}\n")
        tool.chmod(0o755)
        monkeypatch.setenv("CC", str(tool))

    @pytest.mark.skipif(shutil.which("cc") is None, reason="there is no C compiler")
    def test_a_compiler_that_works_leaves_nothing_behind(self, compiled: Any, tmp_path: Path) -> None:
        assert building.judge_compiler(compiled).level is Level.GOOD
        assert list((tmp_path / "cache").iterdir()) == []

    def test_no_compiler(self, compiled: Any, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
        monkeypatch.delenv("CC", raising=False)
        monkeypatch.setenv("PATH", str(tmp_path))
        found = building.judge_compiler(compiled)
        assert found.level is Level.WARNING
        assert found.mend == "sudo apt install gcc libc6-dev"

    def test_a_compiler_that_fails(self, compiled: Any, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
        self.compiler(tmp_path, monkeypatch, "exit 1")
        found = building.judge_compiler(compiled)
        assert found.level is Level.WARNING
        assert "does not build" in found.text

    def test_a_cache_that_others_may_write(self, compiled: Any, tmp_path: Path) -> None:
        (tmp_path / "cache").mkdir()
        (tmp_path / "cache").chmod(0o777)
        found = building.judge_compiler(compiled)
        assert "may be written by others" in found.text
        assert "SUREFOOT_CACHE" in found.mend

    def test_a_cache_that_cannot_be(self, compiled: Any, tmp_path: Path) -> None:
        (tmp_path / "cache").write_text("a file")
        assert building.judge_compiler(compiled).level is Level.WARNING

    def test_what_cannot_be_loaded(self, compiled: Any, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
        script = 'while [ "$1" != -o ]; do shift; done; echo junk > "$2"'
        self.compiler(tmp_path, monkeypatch, script)
        found = building.judge_compiler(compiled)
        assert found.level is Level.WARNING
        assert found.mend

    def test_a_configuration_that_compiles_nothing(self) -> None:
        (found,) = building.check_compiler(patient({"mpc": {"compile_c": False}}))
        assert found.level is Level.NOTE

    def test_no_way_to_draw(self) -> None:
        found = building.judge_rendering({**os.environ, "MUJOCO_GL": "crayons"})
        assert found.level is Level.WARNING
        assert "MUJOCO_GL=crayons" in found.text
        assert "libegl1" in found.mend


def crashes(_: Patient) -> Iterator[Finding]:
    yield Finding("odd", Level.GOOD, "so far")
    raise RuntimeError("it fell\nover")


class TestCommand:
    def test_a_check_that_crashes_is_a_finding(self) -> None:
        good, broken = examine(patient(), {"odd": crashes}, ["odd"])
        assert good.level is Level.GOOD
        assert broken.level is Level.BROKEN
        assert "RuntimeError: it fell over" in broken.text

    def test_all_well(self, tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
        file = tmp_path / "doctor.json"
        assert main(["doctor", "--only", "python,config,cores,certificates", "--json", str(file)]) == 0
        said = json.loads(file.read_text())
        assert said["well"] is True
        assert [finding["check"] for finding in said["findings"]][:2] == ["python", "config"]
        assert "everything works" in capsys.readouterr().out

    def test_something_broken_ends_with_1_and_says_how_to_mend_it(
        self, tmp_path: Path, capsys: pytest.CaptureFixture[str]
    ) -> None:
        (tmp_path / "my.toml").write_text("[gate]\nsped_m_s = 1\n")
        assert main(["doctor", "--only", "config,certificates", "--config", str(tmp_path / "my.toml")]) == 1
        done = capsys.readouterr()
        assert "did you mean 'gate.speed_m_s'" in done.out
        assert f"-> surefoot config --check {tmp_path / 'my.toml'}" in done.out
        assert "1 broken" in done.out

    def test_json_on_stdout_is_alone_there(self, capsys: pytest.CaptureFixture[str]) -> None:
        assert main(["doctor", "--only", "cores", "--json", "-"]) == 0
        assert json.loads(capsys.readouterr().out)["counts"]["broken"] == 0

    def test_no_such_check(self, capsys: pytest.CaptureFixture[str]) -> None:
        assert main(["doctor", "--only", "teeth"]) == 2
        assert "known: python, packages" in capsys.readouterr().err

    def test_every_finding_that_is_not_good_says_what_to_do(self, capsys: pytest.CaptureFixture[str]) -> None:
        quick = [name for name in CHECKS if name not in {"wire", "modules", "rendering"}]
        main(["doctor", "--only", ",".join(quick), "--json", "-"])
        for finding in json.loads(capsys.readouterr().out)["findings"]:
            assert finding["level"] in {"good", "note"} or finding["mend"], finding

    def test_the_interpreter_it_is_about_is_the_one_that_runs(self) -> None:
        (found,) = CHECKS["python"](patient())
        assert ".".join(map(str, sys.version_info[:3])) in found.text
