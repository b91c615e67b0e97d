"""Looking at certificates before they are used: whose, by whom, until when, and what is wrong with them."""

from __future__ import annotations

import ipaddress
import re
from collections.abc import Sequence
from datetime import UTC, datetime, timedelta
from pathlib import Path
from typing import Final, NamedTuple

from cryptography import x509
from cryptography.exceptions import InvalidSignature
from cryptography.x509.oid import NameOID

from bridge.keys.authority import Pair
from bridge.keys.files import (
    AUTHORITY,
    KeysError,
    certificate_file,
    key_file,
    read_certificates,
    read_key,
    require_private,
)

_HOST = re.compile(r"^(?!-)[A-Za-z0-9-]{1,63}(?<!-)(\.(?!-)[A-Za-z0-9-]{1,63}(?<!-))*$")
SOON: Final = timedelta(days=30)  # what expires sooner is named


class Credentials(NamedTuple):
    """Files that prove who a process is, checked, and what there is to say about them."""

    identity: str
    authority_file: Path  # one certificate, or two while the authority is changed
    certificate_file: Path
    key_file: Path
    hosts: tuple[str, ...]  # names and addresses that others may dial
    expires: datetime
    warnings: tuple[str, ...]


def load_credentials(folder: Path, identity: str, now: datetime | None = None) -> Credentials:
    """Return the files of `identity` in `folder`, if they prove what they should.

    Raises:
        KeysError: a file is missing, damaged, open to others, expired, not yet valid, signed by another authority, or
            made for another role or key.
    """
    now = now or datetime.now(UTC)
    if not folder.is_dir():
        raise KeysError(f"{folder}: no such folder of keys; surefoot keys init --keys {folder} makes one")
    require_private(folder)
    authorities = read_certificates(certificate_file(folder, AUTHORITY))
    path = certificate_file(folder, identity)
    if not path.exists():
        raise KeysError(f"{path}: no such file; surefoot keys issue {identity} --keys {folder} makes one")
    certificate = read_certificates(path)[0]
    key = read_key(key_file(folder, identity))
    if certificate.public_key() != key.public_key():
        raise KeysError(f"{path}: does not belong to the key in {key_file(folder, identity)}")
    authority = _signer(path, certificate, authorities)
    name = common_name(certificate)
    if name != identity:
        raise KeysError(f"{path}: is made out to '{name}', expected '{identity}'")
    renew = f"surefoot keys issue {identity} --renew --keys {folder} makes a new one"
    warnings = (
        _within(path, certificate, now, renew),
        _within(certificate_file(folder, AUTHORITY), authority, now, new_authority(folder)),
    )
    return Credentials(
        identity,
        certificate_file(folder, AUTHORITY),
        path,
        key_file(folder, identity),
        hosts(certificate),
        certificate.not_valid_after_utc,
        tuple(filter(None, warnings)),
    )


def signing_pair(folder: Path) -> Pair:
    """Return the authority's key and the certificate that belongs to it; while it is changed there are two.

    Raises:
        KeysError: one of them is missing or damaged, no certificate belongs to the key, or it has expired.
    """
    key, path = read_key(key_file(folder, AUTHORITY)), certificate_file(folder, AUTHORITY)
    certificates = read_certificates(path)
    for certificate in certificates:
        if certificate.public_key() == key.public_key():
            _within(path, certificate, datetime.now(UTC), new_authority(folder))
            return Pair(key, certificate)
    many = "its certificate does not belong" if len(certificates) == 1 else f"none of {len(certificates)} belongs"
    raise KeysError(f"{path}: {many} to the key in {key_file(folder, AUTHORITY)}")


def new_authority(folder: Path) -> str:
    """Return what helps when the authority in `folder` has come to its end."""
    new = f"{folder}-new"
    return f"surefoot keys init --keys {new} and surefoot keys issue --keys {new} make a new authority and all roles"


def common_name(certificate: x509.Certificate) -> str:
    """Return whom a certificate is made out to; empty if it does not say."""
    found = certificate.subject.get_attributes_for_oid(NameOID.COMMON_NAME)
    return str(found[0].value) if found else ""


def hosts(certificate: x509.Certificate) -> tuple[str, ...]:
    """Return the names and addresses a certificate is good for."""
    try:
        names = certificate.extensions.get_extension_for_class(x509.SubjectAlternativeName).value
    except x509.ExtensionNotFound:
        return ()
    return (
        *names.get_values_for_type(x509.DNSName),
        *(str(address) for address in names.get_values_for_type(x509.IPAddress)),
    )


def require_host(name: str) -> None:
    """Raise unless `name` can be dialled: an IP address, or a host name (RFC 1123).

    Raises:
        KeysError: it is neither.
    """
    try:
        ipaddress.ip_address(name)
    except ValueError:
        if len(name) > 253 or not _HOST.match(name):
            raise KeysError(f"--host {name}: neither an address nor a host name, without port or protocol") from None


def remaining(certificate: x509.Certificate, now: datetime) -> str:
    """Return in words how long a certificate is still valid; '' for longer than 30 days."""
    if now > certificate.not_valid_after_utc:
        return f"expired on {certificate.not_valid_after_utc:%Y-%m-%d}"
    left = certificate.not_valid_after_utc - now
    if left < SOON:
        return f"expires in {left.days} days, on {certificate.not_valid_after_utc:%Y-%m-%d}"
    return ""


def _within(path: Path, certificate: x509.Certificate, now: datetime, mending: str) -> str:
    """Return a warning if the certificate expires soon.

    Raises:
        KeysError: it has expired, and `mending` says what helps; or it is not valid yet.
    """
    if now < certificate.not_valid_before_utc:
        begins = f"{certificate.not_valid_before_utc:%Y-%m-%d %H:%M} UTC"
        raise KeysError(f"{path}: is valid from {begins}, and it is {now:%Y-%m-%d %H:%M}: is the clock right?")
    text = remaining(certificate, now)
    if now > certificate.not_valid_after_utc:
        raise KeysError(f"{path}: {text}; {mending}")
    return f"{path}: {text}" if text else ""


def _signer(path: Path, certificate: x509.Certificate, authorities: Sequence[x509.Certificate]) -> x509.Certificate:
    """Return who of `authorities` signed `certificate`."""
    for authority in authorities:
        try:
            certificate.verify_directly_issued_by(authority)
        except (ValueError, TypeError, InvalidSignature):
            continue
        return authority
    raise KeysError(f"{path}: is not signed by the authority in {path.parent / f'{AUTHORITY}.pem'}")
