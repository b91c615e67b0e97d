"""Whether the roles that run here can prove who they are."""

from __future__ import annotations

import re
import shlex
from collections.abc import Iterator
from datetime import UTC, datetime
from pathlib import Path
from typing import Final

from bridge.doctor.finding import Finding, Level, Patient
from bridge.keys.check import load_credentials
from bridge.keys.files import AUTHORITY, KeysError, certificate_file, key_file
from bridge.keys.identity import OBSERVER, ROUTER

CERTIFICATES: Final = "certificates"


def check_certificates(patient: Patient) -> Iterator[Finding]:
    """Whether every role of this machine has a certificate that is its own, in time, and closed to others."""
    config = patient.config
    if not config.bridge.keys:
        yield Finding(CERTIFICATES, Level.NOTE, "none are used: everything stays on this machine", "surefoot keys init")
        return
    folder = Path(config.bridge.keys)
    roles = (*config.launch.roles, OBSERVER, *([ROUTER] if config.bridge.router.listen else []))
    yield from judge_certificates(folder, tuple(dict.fromkeys(roles)), datetime.now(UTC))


def judge_certificates(folder: Path, roles: tuple[str, ...], now: datetime) -> Iterator[Finding]:
    """Give a finding for each of `roles` whose files in `folder` have something wrong with them."""
    if not certificate_file(folder, AUTHORITY).is_file():
        quoted = shlex.quote(str(folder))
        text = f"{certificate_file(folder, AUTHORITY)}: no such file"
        mend = f"surefoot keys init --keys {quoted} && surefoot keys issue --keys {quoted}"
        yield Finding(CERTIFICATES, Level.BROKEN, text, mend)
        return
    good: list[str] = []
    said: set[str] = set()
    for role in roles:
        try:
            credentials = load_credentials(folder, role, now)
        except KeysError as error:
            if str(error) not in said:  # what is wrong with the folder is wrong for all
                yield Finding(CERTIFICATES, Level.BROKEN, str(error), _mend(str(error), folder, role))
            said.add(str(error))
            continue
        good.append(role)
        for warning in credentials.warnings:
            if warning not in said:
                yield Finding(CERTIFICATES, Level.WARNING, warning, _mend(warning, folder, role))
            said.add(warning)
    if good:
        yield Finding(CERTIFICATES, Level.GOOD, f"{folder}: good for {', '.join(good)}")


def _mend(text: str, folder: Path, role: str) -> str:
    """Return the command for what is said of the files of `role`."""
    closes = re.search(r"chmod \d+ .*", text)
    if closes:
        return closes[0]
    quoted = shlex.quote(str(folder))
    if text.startswith(f"{certificate_file(folder, AUTHORITY)}:"):
        return "a new authority: see docs/security.md, 'When certificates end'"
    if "clock" in text:
        return "sudo timedatectl set-ntp true"
    # with one of the two files left, issuing anew would rightly refuse to replace it
    renew = " --renew" if certificate_file(folder, role).exists() or key_file(folder, role).exists() else ""
    return f"surefoot keys issue {role}{renew} --keys {quoted}"
