"""`surefoot keys`: what it makes is private and whole, what is broken is named, nothing is replaced unasked."""

from __future__ import annotations

import json
import os
import socket
import stat
from collections.abc import Callable, Iterator
from datetime import UTC, datetime, timedelta
from pathlib import Path

import pytest
import zenoh
from bridge_toys import free_ports
from cryptography import x509
from cryptography.hazmat.primitives import serialization
from cryptography.hazmat.primitives.asymmetric import rsa
from cryptography.x509.oid import ExtendedKeyUsageOID

from bridge.cli import main
from bridge.config.load import load_config
from bridge.errors import ConfigError, TransportError
from bridge.keys.authority import create_authority, issue
from bridge.keys.check import common_name, hosts, load_credentials
from bridge.keys.files import KeysError, make_folder, write, write_pair
from bridge.keys.identity import IDENTITIES, OBSERVER, PUBLISHERS, identity_of
from bridge.topics import TOPICS
from bridge.transport.session import zenoh_settings
from bridge.transport.zenoh import open_session


@pytest.fixture
def lax_umask() -> Iterator[None]:
    before = os.umask(0)
    yield
    os.umask(before)


@pytest.fixture(scope="module")
def made(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A folder of keys as `init` and `issue` make it; not to be changed."""
    folder = tmp_path_factory.mktemp("made") / "keys"
    assert main(["keys", "init", "--keys", str(folder)]) == 0
    assert main(["keys", "issue", "--keys", str(folder), "--host", "10.0.0.3", "--host", "walker.lan"]) == 0
    return folder


@pytest.fixture
def folder(tmp_path: Path) -> Path:
    """A folder with an authority and the certificate of perception; to be broken."""
    made = tmp_path / "keys"
    make_folder(made)
    authority = create_authority(3650)
    write_pair(made, "ca", authority)
    write_pair(made, "perception", issue(authority, "perception", [], 365))
    return made


def mode(path: Path) -> str:
    return oct(stat.S_IMODE(path.stat().st_mode))


@pytest.mark.usefixtures("lax_umask")
def test_keys_are_private_whatever_the_umask(tmp_path: Path) -> None:
    folder = tmp_path / "deep" / "keys"
    assert main(["keys", "init", "--keys", str(folder)]) == 0
    assert main(["keys", "issue", "drive", "--keys", str(folder)]) == 0
    assert mode(folder) == "0o700"
    assert {path.name: mode(path) for path in folder.glob("*.key")} == {"ca.key": "0o600", "drive.key": "0o600"}
    assert {path.name for path in folder.iterdir()} == {"ca.key", "ca.pem", "drive.key", "drive.pem", "bridge.toml"}


def test_a_key_is_private_before_it_has_its_name(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    seen: list[str] = []
    link = os.link

    def watched(source: str, target: Path) -> None:
        seen.append(mode(Path(source)))
        link(source, target)

    monkeypatch.setattr(os, "link", watched)
    write(tmp_path / "a.key", b"secret", 0o600)
    assert seen == ["0o600"]
    assert [path.name for path in tmp_path.iterdir()] == ["a.key"], "nothing temporary is left"


def test_every_identity_gets_what_its_name_says(made: Path) -> None:
    assert {topic.publisher for topic in TOPICS} - {"*"} == set(PUBLISHERS)
    for identity in IDENTITIES:
        found = load_credentials(made, identity)
        certificate = x509.load_pem_x509_certificate(found.certificate_file.read_bytes())
        assert common_name(certificate) == identity
        assert set(hosts(certificate)) == {"localhost", "127.0.0.1", "::1", "10.0.0.3", "walker.lan"}
        usage = certificate.extensions.get_extension_for_class(x509.ExtendedKeyUsage).value
        assert {ExtendedKeyUsageOID.SERVER_AUTH, ExtendedKeyUsageOID.CLIENT_AUTH} == set(usage)
        assert not certificate.extensions.get_extension_for_class(x509.BasicConstraints).value.ca
        assert found.warnings == ()
        assert 364 <= (found.expires - datetime.now(UTC)).days <= 365


def test_who_has_no_topic_is_an_observer() -> None:
    assert [identity_of(role) for role in ("controller", "recorder", "monitor", "view")] == [
        "controller",
        OBSERVER,
        OBSERVER,
        OBSERVER,
    ]


def test_a_role_is_not_valid_longer_than_its_authority() -> None:
    authority = create_authority(5)
    assert (
        issue(authority, "drive", [], 365).certificate.not_valid_after_utc == authority.certificate.not_valid_after_utc
    )


def run(capsys: pytest.CaptureFixture[str], *words: object) -> tuple[int, str, str]:
    capsys.readouterr()
    code = main([str(word) for word in words])
    said = capsys.readouterr()
    return code, said.out, said.err


def test_nothing_is_replaced_unasked(folder: Path, capsys: pytest.CaptureFixture[str]) -> None:
    before = {path: path.read_bytes() for path in folder.iterdir()}
    assert run(capsys, "keys", "init", "--keys", folder)[0] == 2
    code, _, error = run(capsys, "keys", "issue", "perception", "--keys", folder)
    assert code == 2
    assert "perception.key: is there already" in error
    assert {path: path.read_bytes() for path in folder.iterdir()} == before
    with pytest.raises(KeysError, match="left as it is"):
        write(folder / "ca.pem", b"other", 0o644)


def test_renewal_replaces_one_role(folder: Path, capsys: pytest.CaptureFixture[str]) -> None:
    before = {path.name: path.read_bytes() for path in folder.iterdir()}
    assert run(capsys, "keys", "issue", "perception", "--keys", folder, "--renew")[0] == 0
    changed = {path.name for path in folder.iterdir() if before[path.name] != path.read_bytes()}
    assert changed == {"perception.key", "perception.pem"}
    assert load_credentials(folder, "perception").warnings == ()


def test_what_another_machine_needs_is_written_apart(folder: Path, capsys: pytest.CaptureFixture[str]) -> None:
    out = folder.parent / "camera"
    words = ["keys", "issue", "anticipation", "observer", "--keys", folder, "--host", "10.0.0.2", "--out", out]
    assert run(capsys, *words)[0] == 0
    assert {path.name for path in out.iterdir()} == {
        "anticipation.key",
        "anticipation.pem",
        "observer.key",
        "observer.pem",
        "ca.pem",
        "bridge.toml",
    }, "the authority's key stays where it is"
    assert mode(out) == "0o700"
    assert "10.0.0.2" in load_credentials(out, "anticipation").hosts


def test_the_written_configuration_turns_security_on(made: Path) -> None:
    config = load_config(made / "bridge.toml").bridge
    assert config.keys == str(made)
    assert {endpoint.partition("/")[0] for endpoint in (*config.endpoints.values(), *config.router_listen)} == {"tls"}


def test_a_misspelt_role_is_named(made: Path, capsys: pytest.CaptureFixture[str]) -> None:
    code, _, error = run(capsys, "keys", "issue", "perceptoin", "--keys", made)
    assert code == 2
    assert "perceptoin: no such role; known: " in error


@pytest.mark.parametrize("host", ["tls/10.0.0.2:7470", "10.0.0.2:7470", "a b", "", "-a", "kamera-ä", "a" * 300])
def test_a_host_that_cannot_be_dialled_is_named(made: Path, host: str, capsys: pytest.CaptureFixture[str]) -> None:
    code, _, error = run(capsys, "keys", "issue", "drive", "--keys", made, "--host", host, "--renew")
    assert code == 2
    assert "neither an address nor a host name" in error
    assert "10.0.0.3" in load_credentials(made, "drive").hosts, "and what was there is still there"


def replaced(name: str, content: bytes) -> Callable[[Path], None]:
    return lambda folder: (folder / name).write_bytes(content) and None


def foreign_pair(folder: Path) -> None:
    write_pair(folder, "perception", issue(create_authority(10), "perception", [], 5), replace=True)


def other_key(folder: Path) -> None:
    key = issue(create_authority(10), "perception", [], 5).key_pem()
    (folder / "perception.key").write_bytes(key)


def rsa_key(folder: Path) -> None:
    key = rsa.generate_private_key(public_exponent=65537, key_size=2048)
    format_ = (serialization.Encoding.PEM, serialization.PrivateFormat.PKCS8, serialization.NoEncryption())
    (folder / "perception.key").write_bytes(key.private_bytes(*format_))


def other_role(folder: Path) -> None:
    for end in ("key", "pem"):
        (folder / f"drive.{end}").rename(folder / f"perception.{end}")


BROKEN: dict[str, tuple[Callable[[Path], object], str]] = {
    "no folder": (
        lambda folder: folder.rename(folder.parent / "elsewhere"),
        "no such folder of keys; surefoot keys init",
    ),
    "no authority": (lambda folder: (folder / "ca.pem").unlink(), r"ca\.pem: no such file"),
    "authority not PEM": (replaced("ca.pem", b"nonsense"), r"ca\.pem: holds no certificate in PEM form"),
    "no certificate": (lambda folder: (folder / "perception.pem").unlink(), "surefoot keys issue perception"),
    "certificate not PEM": (replaced("perception.pem", b"\xff\x00"), r"perception\.pem: holds no certificate in PEM"),
    "certificate cut off": (
        lambda folder: (folder / "perception.pem").write_bytes((folder / "perception.pem").read_bytes()[:200]),
        r"perception\.pem: holds no certificate in PEM form",
    ),
    "no key": (lambda folder: (folder / "perception.key").unlink(), r"perception\.key: no such file"),
    "key not PEM": (replaced("perception.key", b"nonsense"), r"perception\.key: holds no private key in PEM form"),
    "key of another kind": (rsa_key, r"perception\.key: holds a RSAPrivateKey, expected an elliptic-curve key"),
    "key of another": (other_key, r"perception\.pem: does not belong to the key in .*perception\.key"),
    "another authority": (foreign_pair, r"perception\.pem: is not signed by the authority in .*ca\.pem"),
    "another role": (other_role, r"perception\.pem: is made out to 'drive', expected 'perception'"),
    "key open to others": (
        lambda folder: (folder / "perception.key").chmod(0o640),
        r"perception\.key: mode 640 lets others in, expected 600: chmod 600",
    ),
    "folder open to others": (lambda folder: folder.chmod(0o755), "mode 755 lets others in, expected 700: chmod 700"),
}


@pytest.mark.parametrize("name", BROKEN)
def test_what_is_broken_is_named_and_refused(name: str, folder: Path, capsys: pytest.CaptureFixture[str]) -> None:
    run(capsys, "keys", "issue", "drive", "--keys", folder)
    damage, what = BROKEN[name]
    damage(folder)
    with pytest.raises(KeysError, match=what) as caught:
        load_credentials(folder, "perception")
    assert "\n" not in str(caught.value)
    config = load_config(None, [f"bridge.keys={folder}"]).bridge
    with pytest.raises(KeysError, match=what):  # a process refuses to start, and opens nothing
        open_session(config, "perception")


@pytest.mark.parametrize(
    ("days", "what"),
    [(366, "expired on"), (350, "expires in 14 days"), (-1, "is valid from .*is the clock right")],
    ids=["expired", "soon", "not yet"],
)
def test_time_is_judged(folder: Path, days: int, what: str) -> None:
    now = datetime.now(UTC) + timedelta(days=days)
    if "days" in what:
        (warning,) = load_credentials(folder, "perception", now).warnings
        assert what in warning
        return
    with pytest.raises(KeysError, match=what):
        load_credentials(folder, "perception", now)


def test_show_says_what_is_good_and_what_is_not(folder: Path, capsys: pytest.CaptureFixture[str]) -> None:
    run(capsys, "keys", "issue", "drive", "--keys", folder, "--days", 10)
    code, out, _ = run(capsys, "keys", "show", "--keys", folder)
    assert code == 0
    lines = {line.split()[0]: line for line in out.splitlines()}
    assert set(lines) == {"ca", "drive", "perception"}
    assert "good" in lines["perception"]
    assert "expires in 9 days" in lines["drive"]
    (folder / "perception.key").chmod(0o644)
    code, out, _ = run(capsys, "keys", "show", "--keys", folder, "--json", "-")
    assert code == 1
    rows = {row["name"]: row for row in json.loads(out)["certificates"]}
    assert "mode 644 lets others in" in rows["perception"]["trouble"]
    assert rows["drive"]["trouble"] == ""


def test_show_without_a_folder_is_one_line(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    code, _, error = run(capsys, "keys", "show", "--keys", tmp_path / "none")
    assert code == 2
    assert error.count("\n") == 1
    assert "surefoot keys init" in error


def test_an_authority_can_be_changed_without_a_gap(folder: Path) -> None:
    """While both authorities are in ca.pem, certificates of either are good."""
    new = create_authority(3650)
    old_and_new = (folder / "ca.pem").read_bytes() + new.certificate_pem()
    write(folder / "ca.pem", old_and_new, 0o644, replace=True)
    write_pair(folder, "drive", issue(new, "drive", [], 365))
    for role in ("perception", "drive"):
        assert load_credentials(folder, role).warnings == ()


def test_the_authority_signs_with_the_certificate_of_its_key(folder: Path, capsys: pytest.CaptureFixture[str]) -> None:
    """While the authority is changed there are two in ca.pem, in either order."""
    new = create_authority(3650)
    old = (folder / "ca.pem").read_bytes()
    for key, order in ((None, [new.certificate_pem(), old]), (new.key_pem(), [old, new.certificate_pem()])):
        write(folder / "ca.pem", b"".join(order), 0o644, replace=True)
        if key is not None:
            write(folder / "ca.key", key, 0o600, replace=True)
        assert run(capsys, "keys", "issue", "drive", "--keys", folder, "--renew")[0] == 0
        assert load_credentials(folder, "drive").warnings == ()


def test_an_authority_whose_key_and_certificate_do_not_match_signs_nothing(
    folder: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    write(folder / "ca.key", create_authority(3650).key_pem(), 0o600, replace=True)
    before = {path: path.read_bytes() for path in folder.iterdir()}
    out = folder.parent / "elsewhere"
    for words in (["--renew"], ["--out", str(out)]):
        code, _, error = run(capsys, "keys", "issue", "--keys", folder, *words)
        assert code == 2
        assert "ca.pem: its certificate does not belong to the key in" in error
    write(folder / "ca.pem", b"".join(create_authority(9).certificate_pem() for _ in range(2)), 0o644, replace=True)
    assert "none of 2 belongs to the key in" in run(capsys, "keys", "issue", "--keys", folder, "--renew")[2]
    after = {path: path.read_bytes() for path in folder.iterdir() if path.name != "ca.pem"}
    assert after == {path: content for path, content in before.items() if path.name != "ca.pem"}
    assert not out.exists()


def test_if_one_role_cannot_be_written_none_is(folder: Path, capsys: pytest.CaptureFixture[str]) -> None:
    code, _, error = run(capsys, "keys", "issue", "drive", "perception", "--keys", folder)
    assert code == 2
    assert "perception.key: is there already" in error
    assert not (folder / "drive.key").exists()


def test_what_expired_says_the_command_that_mends_it(folder: Path) -> None:
    with pytest.raises(KeysError, match="expired on") as caught:
        load_credentials(folder, "perception", datetime.now(UTC) + timedelta(days=366))
    assert f"surefoot keys issue perception --renew --keys {folder} makes" in str(caught.value)


def test_an_expired_authority_signs_nothing_and_says_what_helps(
    folder: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    gone = create_authority(0)
    write_pair(folder, "ca", gone, replace=True)
    new = f"surefoot keys init --keys {folder}-new and surefoot keys issue --keys {folder}-new make a new authority"
    code, _, error = run(capsys, "keys", "issue", "drive", "--keys", folder)
    assert code == 2
    assert "ca.pem: expired on" in error
    assert new in error
    assert not (folder / "drive.key").exists()
    write_pair(folder, "perception", issue(gone, "perception", [], 365), replace=True)
    code, out, _ = run(capsys, "keys", "show", "--keys", folder)
    assert code == 1
    assert new in out


def test_without_a_folder_the_hint_is_a_command_that_runs(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    missing = tmp_path / "keys"
    with pytest.raises(KeysError) as caught:
        load_credentials(missing, "drive")
    words = str(caught.value).partition("surefoot ")[2].removesuffix(" makes one").split()
    assert run(capsys, *words)[0] == 0
    assert (missing / "ca.pem").exists()


def test_zenoh_configuration_of_a_role(made: Path, capsys: pytest.CaptureFixture[str]) -> None:
    """As a file that zenohd reads: what is printed is what a process opens its session with."""
    for role in ("router", "drive", "observer"):
        code, out, _ = run(capsys, "keys", "zenoh", role, "--config", made / "bridge.toml")
        assert code == 0
        loaded = zenoh.Config.from_json5(out)
        credentials = load_credentials(made.resolve(), role)
        opened = zenoh.Config()
        for path, value in zenoh_settings(load_config(made / "bridge.toml").bridge, role, credentials).items():
            opened.insert_json5(path, json.dumps(value))
        assert json.loads(str(loaded)) == json.loads(str(opened))
    settings = json.loads(out)
    assert settings["transport"]["link"]["tls"]["enable_mtls"] is True
    assert settings["access_control"]["default_permission"] == "deny"
    assert Path(settings["transport"]["link"]["tls"]["connect_private_key"]).is_absolute()


def test_a_session_opens_with_the_printed_configuration(capsys: pytest.CaptureFixture[str]) -> None:
    port = free_ports(1)[0]
    words = ["keys", "zenoh", "drive", "--set", f"bridge.endpoints.drive=tcp/127.0.0.1:{port}"]
    code, out, _ = run(capsys, *words)
    assert code == 0
    with zenoh.open(zenoh.Config.from_json5(out)), socket.create_connection(("127.0.0.1", port), timeout=5.0):
        pass


@pytest.mark.parametrize(
    ("overrides", "what"),
    [
        (
            ["bridge.keys=keys", "bridge.endpoints.drive=tcp/127.0.0.1:9999"],
            "endpoints.drive .*with keys (set )?use tls/ or quic/",
        ),
        (["bridge.keys=keys", "bridge.connect=['tcp/127.0.0.1:7470']"], "connect is .*nobody shows a certificate"),
        (["bridge.router.listen=['tcp/0.0.0.0:7470']"], "router.listen is .*leaves this machine without TLS"),
        (["bridge.router.connect=['tcp/10.0.0.2:7470']"], "router.connect is .*leaves this machine without TLS"),
        (["bridge.mode=client"], "mode is 'client', which needs a router"),
    ],
)
def test_configurations_that_open_a_door_are_refused(overrides: list[str], what: str) -> None:
    with pytest.raises(ConfigError, match=what):
        load_config(None, overrides)


def test_an_endpoint_by_tls_wants_certificates() -> None:
    config = load_config(None, ["bridge.endpoints.drive=tls/10.0.0.3:7474"]).bridge
    with pytest.raises(TransportError, match=r"tls/10.0.0.3:7474 wants certificates: set bridge.keys"):
        open_session(config, "controller")


def test_a_role_elsewhere_has_no_endpoint_here() -> None:
    config = load_config(None, ["bridge.endpoints.perception=", "bridge.keys=keys"]).bridge
    assert "perception" not in config.endpoints
    assert config.endpoints["drive"] == "tls/127.0.0.1:7474"


def test_without_certificates_everything_listens_on_this_machine_alone() -> None:
    config = load_config(None).bridge
    for endpoint in (*config.endpoints.values(), *config.router_listen):
        assert endpoint.startswith("tcp/127.0.0.1:")
