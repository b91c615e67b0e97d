"""`surefoot keys`: an authority, a certificate for each role, and a look at what there is."""

from __future__ import annotations

import json
from datetime import UTC, datetime
from pathlib import Path
from typing import Annotated, Final, NamedTuple

import typer

from bridge.config.load import load_config
from bridge.keys.authority import Pair, create_authority, issue
from bridge.keys.check import load_credentials, remaining, require_host
from bridge.keys.files import (
    AUTHORITY,
    KeysError,
    certificate_file,
    key_file,
    make_folder,
    read_certificates,
    read_key,
    write,
    write_pair,
)
from bridge.keys.identity import IDENTITIES, identity_of
from bridge.transport.session import zenoh_settings

FOLDER: Final = Path("keys")
CONFIG: Final = "bridge.toml"
_CONFIG_TEXT = """\
# Every link is mutual TLS, every role may write its own topics alone. Copy into your configuration.
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
    write(folder / CONFIG, _CONFIG_TEXT.format(folder=json.dumps(str(folder))).encode(), 0o644)
    typer.echo(f"{folder}: authority made; next: surefoot keys issue --keys {folder}", err=True)


@keys.command("issue", epilog="Example: surefoot keys issue perception anticipation --host 10.0.0.2 --out keys-camera")
def issue_(
    roles: Annotated[
        list[str] | None, typer.Argument(metavar="[ROLE]...", help=f"Of {', '.join(IDENTITIES)}; default: all.")
    ] = None,
    folder: FolderOption = FOLDER,
    host: Annotated[
        list[str] | None,
        typer.Option(metavar="NAME", help="Name or address at which others reach the role; repeatable."),
    ] = None,
    days: Annotated[int, typer.Option(min=1, max=3650, help="How long they are valid [days].")] = 365,
    out: Annotated[
        Path | None, typer.Option(metavar="FOLDER", help="Write them here, with ca.pem, to be taken elsewhere.")
    ] = None,
    renew: Annotated[bool, typer.Option("--renew", help="Replace what these roles have.")] = False,
) -> None:
    """Make a key and a certificate for each ROLE, signed by the authority."""
    wanted, names = _known(roles or list(IDENTITIES)), host or []
    for name in names:
        require_host(name)
    authority = Pair(read_key(key_file(folder, AUTHORITY)), read_certificates(certificate_file(folder, AUTHORITY))[0])
    expired = remaining(authority.certificate, datetime.now(UTC))
    if expired.startswith("expired"):
        raise KeysError(f"{certificate_file(folder, AUTHORITY)}: {expired}; surefoot keys init makes a new authority")
    target = out or folder
    if out is not None:
        make_folder(out)
        write(certificate_file(out, AUTHORITY), certificate_file(folder, AUTHORITY).read_bytes(), 0o644, replace=True)
        write(out / CONFIG, _CONFIG_TEXT.format(folder=json.dumps(FOLDER.name)).encode(), 0o644, replace=True)
    for role in wanted:
        write_pair(target, role, issue(authority, role, names, days), replace=renew)
        until = load_credentials(target, role).expires
        typer.echo(f"{certificate_file(target, role)}: until {until:%Y-%m-%d}", err=True)


@keys.command(epilog="Example: surefoot keys show --json")
def show(
    folder: FolderOption = FOLDER,
    as_json: Annotated[bool, typer.Option("--json", help="One JSON object instead of lines.")] = False,
) -> int:
    """Say who has a certificate, until when, for which hosts, and what is wrong with it. Exit code 1: something is."""
    if not folder.is_dir():
        raise KeysError(f"{folder}: no such folder of keys; surefoot keys init --keys {folder} makes one")
    names = sorted(path.stem for path in folder.glob("*.pem"))
    if not names:
        raise KeysError(f"{folder}: holds no certificates; surefoot keys init --keys {folder} makes an authority")
    rows = [_row(folder, name) for name in names]
    if as_json:
        typer.echo(json.dumps({"folder": str(folder), "certificates": [row._asdict() for row in rows]}, indent=2))
    else:
        for row in rows:
            state = row.trouble or row.warning or "good"
            typer.echo(f"{row.name:<14} until {row.expires or '-':<10}  {state:<8} {' '.join(row.hosts)}".rstrip())
    return 1 if any(row.trouble for row in rows) else 0


@keys.command("zenoh", epilog="Example: surefoot keys zenoh router --config keys/bridge.toml > router.json5")
def zenoh_(
    role: Annotated[str, typer.Argument(metavar="ROLE", help=f"One of {', '.join(IDENTITIES)}.")],
    config: Annotated[Path | None, typer.Option(metavar="FILE", help="Configuration; default: the defaults.")] = None,
    set_: Annotated[
        list[str] | None, typer.Option("--set", metavar="SECTION.KEY=VALUE", help="Override a value; repeatable.")
    ] = None,
) -> None:
    """Print the Zenoh configuration with which ROLE opens its session, for zenohd or a bridge to ROS 2."""
    (name,) = _known([role])
    bridge = load_config(config, set_ or []).bridge
    credentials = load_credentials(Path(bridge.keys), identity_of(name)) if bridge.keys else None
    typer.echo(json.dumps(zenoh_settings(bridge, name, credentials), indent=2))


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
            certificate = read_certificates(certificate_file(folder, name))[0]
            said = remaining(certificate, datetime.now(UTC))
            gone = said.startswith("expired")
            expires = f"{certificate.not_valid_after_utc:%Y-%m-%d}"
            return _Row(name, expires, (), "" if gone else said, said if gone else "")
        found = load_credentials(folder, name)
    except KeysError as error:
        return _Row(name, "", (), "", str(error))
    return _Row(name, f"{found.expires:%Y-%m-%d}", found.hosts, "; ".join(found.warnings), "")
