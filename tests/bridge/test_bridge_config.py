"""One file, every mistake named."""

from __future__ import annotations

from pathlib import Path

import pytest
from pydantic import BaseModel, ValidationError

from bridge.config.load import load_config
from bridge.config.reload import Watcher
from bridge.config.surefoot import SurefootConfig
from bridge.config.template import render_template
from bridge.errors import ConfigError

REPO = Path(__file__).resolve().parents[2]


def write(folder: Path, text: str) -> Path:
    path = folder / "c.toml"
    path.write_text(text, encoding="utf-8")
    return path


@pytest.mark.parametrize(
    ("text", "says"),
    [
        ("[bridge]\nlease_sm = 3", r"unknown key 'bridge.lease_sm'; did you mean 'bridge.lease_ms'\?"),
        ("[brigde]\nlease_ms = 300", r"unknown key 'brigde'; did you mean 'bridge'\?"),
        ("[launch]\nlease_ms = 300", r"unknown key 'launch.lease_ms'; did you mean 'bridge.lease_ms'\?"),
        ("[bridge]\nlease_ms = 3", r"bridge.lease_ms = 3: input should be greater than or equal to 50"),
        ("[bridge]\nlease_ms = nan", r"bridge.lease_ms = nan: input should be a finite number"),
        ("[launch]\nstop_timeout_s = inf", r"launch.stop_timeout_s = inf: input should be a finite number"),
        ("[bridge]\nendpoints = {perception = 'tcp/7471'}", r"endpoints.perception is 'tcp/7471', expected PROTOCOL"),
        ("[bridge]\nendpoints = {perception = 'tcp/10.0.0.5:7471'}", r"leaves this machine without TLS"),
        ("[launch]\nroles = ['camera']", r"roles names 'camera', but modules.camera is not set"),
        ("[bridge\n", r"c.toml: not valid TOML"),
        ("[bridge]\nlease_ms = 3\nnamespace = 'a b'", r"\(and 1 more\)"),
    ],
)
def test_a_mistake_is_one_line_naming_the_key(tmp_path: Path, text: str, says: str) -> None:
    with pytest.raises(ConfigError, match=says) as caught:
        load_config(write(tmp_path, text))
    assert "\n" not in str(caught.value)
    assert "c.toml" in str(caught.value)


def test_a_missing_file_is_named(tmp_path: Path) -> None:
    with pytest.raises(ConfigError, match="absent.toml: no such configuration file"):
        load_config(tmp_path / "absent.toml")


def test_overrides_are_toml_values_or_plain_text(tmp_path: Path) -> None:
    path = write(tmp_path, "[bridge]\nlease_ms = 400")
    config = load_config(path, ["bridge.lease_ms=250", "bridge.namespace=robot_2", "launch.roles=['drive']"])
    assert config.bridge.lease_ms == 250
    assert config.bridge.namespace == "robot_2"
    assert config.launch.roles == ("drive",)
    for bad in ("lease_ms=3", "bridge.lease_ms", "bridge.lease_ms.x=1"):
        with pytest.raises(ConfigError, match="--set"):
            load_config(path, ["bridge.lease_ms=250", bad])


def test_naming_one_endpoint_keeps_the_others() -> None:
    config = load_config(None, ["bridge.endpoints.drive=tcp/127.0.0.1:9999"])
    assert config.bridge.endpoints["drive"] == "tcp/127.0.0.1:9999"
    assert list(config.bridge.endpoints) == list(SurefootConfig().bridge.endpoints)


@pytest.mark.parametrize("endpoint", ["tls/10.0.0.5:7471", "tcp/localhost:7471", "tcp/[::1]:7471", "quic/robot:7471"])
def test_loopback_and_tls_endpoints_are_accepted(endpoint: str) -> None:
    assert load_config(None, [f"bridge.endpoints.perception={endpoint}"]).bridge.endpoints["perception"] == endpoint


def test_the_configuration_is_frozen() -> None:
    with pytest.raises(ValidationError, match="frozen"):
        load_config(None).bridge.lease_ms = 300


def every_field(model: type[BaseModel], prefix: str = "") -> list[tuple[str, str | None]]:
    rows: list[tuple[str, str | None]] = []
    for name, field in model.model_fields.items():
        rows.append((prefix + name, field.description))
        if isinstance(field.annotation, type) and issubclass(field.annotation, BaseModel):
            rows += every_field(field.annotation, f"{prefix}{name}.")
    return rows


def test_every_key_says_what_it_is() -> None:
    rows = every_field(SurefootConfig)
    assert len(rows) > 50
    assert [key for key, description in rows if not description] == []


def test_the_shipped_file_is_the_defaults_with_every_key() -> None:
    shipped = REPO / "config" / "surefoot.toml"
    assert load_config(shipped) == load_config(None)
    assert shipped.read_text(encoding="utf-8") == render_template(), "run: surefoot config > config/surefoot.toml"


class TestReload:
    def test_a_change_is_seen_once(self, tmp_path: Path) -> None:
        path = write(tmp_path, "[bridge]\nlease_ms = 300")
        watcher = Watcher(path, period_s=1000)
        watcher.check()
        assert watcher.poll() is None
        path.write_text("[bridge]\nlease_ms = 500")
        watcher.check()
        news = watcher.poll()
        assert isinstance(news, SurefootConfig)
        assert news.bridge.lease_ms == 500
        watcher.check()
        assert watcher.poll() is None
        watcher.close()

    def test_a_broken_file_is_refused_with_the_reason_and_a_mended_one_taken(self, tmp_path: Path) -> None:
        path = write(tmp_path, "[bridge]\nlease_ms = 300")
        watcher = Watcher(path, period_s=1000)
        path.write_text("[bridge]\nlease_ms = 'soon'")
        watcher.check()
        refusal = watcher.poll()
        assert isinstance(refusal, str)
        assert "bridge.lease_ms = 'soon'" in refusal
        path.unlink()
        watcher.check()
        assert "no such configuration file" in str(watcher.poll())
        path.write_text("[bridge]\nlease_ms = 310")
        watcher.check()
        assert isinstance(watcher.poll(), SurefootConfig)
        watcher.close()

    def test_the_thread_notices_by_itself(self, tmp_path: Path) -> None:
        path = write(tmp_path, "[bridge]\nlease_ms = 300")
        watcher = Watcher(path, period_s=0.01)
        path.write_text("[bridge]\nlease_ms = 301")
        for _ in range(500):
            if (news := watcher.poll()) is not None:
                break
            watcher._stop.wait(0.01)
        assert isinstance(news, SurefootConfig)
        watcher.close()

    def test_without_a_file_there_is_nothing_to_watch(self) -> None:
        watcher = Watcher(None)
        watcher.check()
        assert watcher.poll() is None
        watcher.close()
