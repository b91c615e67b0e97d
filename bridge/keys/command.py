"""`surefoot keys`: an authority, a certificate for each role, and a look at what there is."""

from __future__ import annotations

import json as json_
from datetime import UTC, datetime
from pathlib import Path
from typing import Annotated, Final, NamedTuple

import typer
from cryptography import x509

from bridge.command_line import completion
from bridge.command_line.options import ConfigOption, JsonOption, SetOption
from bridge.command_line.output import STDOUT, note, require_writable, result, result_text, write_json
from bridge.config.load import load_config
from bridge.config.version import VERSION
from bridge.exit_codes import ExitCode
from bridge.keys.authority import create_authority, issue
from bridge.keys.check import load_credentials, new_authority, remaining, require_host, signing_pair
from bridge.keys.files import (
    AUTHORITY,
    KeysError,
    certificate_file,
    make_folder,
    read_certificates,
    require_free,
    write,
    write_pair,
)
from bridge.keys.identity import IDENTITIES, identity_of
from bridge.transport.session import nested, zenoh_settings

FOLDER: Final = Path("keys")
CONFIG: Final = "bridge.toml"
_CONFIG_TEXT = """\
# Every link is mutual TLS, every role may write its own topics alone. Copy into your configuration.
version = {version}
[bridge]
keys = {folder}
"""
EPILOG: Final = "Example: surefoot keys init && surefoot keys issue && surefoot up --config keys/bridge.toml"

keys = typer.Typer(
    no_args_is_help=True,
    rich_markup_mode="markdown",
    epilog=EPILOG,
    help="Make and look at the certificates with which processes prove to each other which role they are.",
)

FolderOption = Annotated[Path, typer.Option("--keys", metavar="FOLDER", help="Folder of the keys.")]


@keys.command(epilog="Example: surefoot keys init --days 3650")
def init(
    folder: FolderOption = FOLDER,
    days: Annotated[int, typer.Option(min=1, max=7300, help="How long the authority is valid [days].")] = 3650,
) -> None:
    """Make an authority of your own, `ca.pem` and `ca.key`, and `bridge.toml`, which turns security on.

    Whoever has `ca.key` can make a certificate for any role: keep it on one machine, not on the robot.
    """
    make_folder(folder)
    write_pair(folder, AUTHORITY, create_authority(days))
    write(folder / CONFIG, _config_text(str(folder)), 0o644)
    note(f"{folder}: authority made; next: surefoot keys issue --keys {folder}")


@keys.command("issue", epilog="Example: surefoot keys issue perception anticipation --host 10.0.0.2 --out keys-camera")
def issue_(
    roles: Annotated[
        list[str] | None,
        typer.Argument(
            metavar="[ROLE]...",
            autocompletion=completion.identities,
            help=f"Of {', '.join(IDENTITIES)}; default: all.",
        ),
    ] = None,
    folder: FolderOption = FOLDER,
    host: Annotated[
        list[str] | None,
        typer.Option(metavar="NAME", help="Name or address at which others reach the role; repeatable."),
    ] = None,
    days: Annotated[int, typer.Option(min=1, max=3650, help="How long they are valid [days].")] = 365,
    out: Annotated[
        Path | None,
        typer.Option("--out", metavar="FOLDER", help="Write them here, with ca.pem, to be taken elsewhere."),
    ] = None,
    renew: Annotated[bool, typer.Option("--renew", help="Replace what these roles have.")] = False,
) -> None:
    """Make a key and a certificate for each ROLE, signed by the authority."""
    wanted, names = _known(roles or list(IDENTITIES)), host or []
    for name in names:
        require_host(name)
    authority = signing_pair(folder)
    target = out or folder
    if not renew:
        for role in wanted:
            require_free(target, role)
    if out is not None:
        make_folder(out)
        write(certificate_file(out, AUTHORITY), certificate_file(folder, AUTHORITY).read_bytes(), 0o644, replace=True)
        write(out / CONFIG, _config_text(FOLDER.name), 0o644, replace=True)
    for role in wanted:
        write_pair(target, role, issue(authority, role, names, days), replace=renew)
        until = load_credentials(target, role).expires
        note(f"{certificate_file(target, role)}: until {until:%Y-%m-%d}")


@keys.command(epilog="Example: surefoot keys show --json -")
def show(folder: FolderOption = FOLDER, json: JsonOption = None) -> int:
    """Say who has a certificate, until when, for which hosts, and what is wrong with it. Exit code 1: something is."""
    if not folder.is_dir():
        raise KeysError(f"{folder}: no such folder of keys; surefoot keys init --keys {folder} makes one")
    if json is not None:
        require_writable(json)
    names = sorted(path.stem for path in folder.glob("*.pem"))
    if not names:
        raise KeysError(f"{folder}: holds no certificates; surefoot keys init --keys {folder} makes an authority")
    rows = [_row(folder, name) for name in names]
    if json is not None:
        write_json(json, {"folder": folder, "certificates": rows})
    if json != STDOUT:
        for row in rows:
            state = row.trouble or row.warning or "good"
            result(f"{row.name:<14} until {row.expires or '-':<10}  {state:<8} {' '.join(row.hosts)}".rstrip())
    return ExitCode.CHECK_FAILED if any(row.trouble for row in rows) else ExitCode.DONE


@keys.command("zenoh", epilog="Example: surefoot keys zenoh router --config keys/bridge.toml > router.json5")
def zenoh_(
    role: Annotated[
        str,
        typer.Argument(metavar="ROLE", autocompletion=completion.identities, help=f"One of {', '.join(IDENTITIES)}."),
    ],
    config: ConfigOption = None,
    set_: SetOption = None,
) -> None:
    """Print the Zenoh configuration with which ROLE opens its session, for zenohd or a bridge to ROS 2."""
    (name,) = _known([role])
    bridge = load_config(config, set_ or []).bridge
    # absolute, because whoever reads it starts elsewhere
    credentials = load_credentials(Path(bridge.keys).resolve(), identity_of(name)) if bridge.keys else None
    result_text(json_.dumps(nested(zenoh_settings(bridge, name, credentials)), indent=2) + "\n")


def _config_text(folder: str) -> bytes:
    return _CONFIG_TEXT.format(version=VERSION, folder=json_.dumps(folder)).encode()


def _known(roles: list[str]) -> list[str]:
    for role in roles:
        if role not in IDENTITIES:
            raise KeysError(f"{role}: no such role; known: {', '.join(IDENTITIES)}")
    return list(dict.fromkeys(roles))


class _Row(NamedTuple):
    """One certificate, as it is shown."""

    name: str
    expires: str  # date, UTC
    hosts: tuple[str, ...]
    warning: str
    trouble: str  # why it cannot be used; '' = it can


def _row(folder: Path, name: str) -> _Row:
    try:
        if name == AUTHORITY:
            return _authority_row(folder, read_certificates(certificate_file(folder, name)))
        found = load_credentials(folder, name)
    except KeysError as error:
        return _Row(name, "", (), "", str(error))
    return _Row(name, f"{found.expires:%Y-%m-%d}", found.hosts, "; ".join(found.warnings), "")


def _authority_row(folder: Path, certificates: list[x509.Certificate]) -> _Row:
    """Say how long the authorities in `ca.pem` are good; there are two while one takes over from the other."""
    now = datetime.now(UTC)
    last = max(certificates, key=lambda certificate: certificate.not_valid_after_utc)
    said = [text for text in (remaining(certificate, now) for certificate in certificates) if text]
    trouble = f"{remaining(last, now)}; {new_authority(folder)}" if now > last.not_valid_after_utc else ""
    return _Row(AUTHORITY, f"{last.not_valid_after_utc:%Y-%m-%d}", (), "" if trouble else "; ".join(said), trouble)
