"""Keys and certificates as files: private from the first byte on, whole or not there, never replaced unasked."""

from __future__ import annotations

import os
import stat
import tempfile
from contextlib import suppress
from pathlib import Path
from typing import Final

from cryptography import x509
from cryptography.hazmat.primitives import serialization
from cryptography.hazmat.primitives.asymmetric import ec

from bridge.errors import SurefootError
from bridge.keys.authority import Pair

AUTHORITY: Final = "ca"
_OTHERS: Final = stat.S_IRWXG | stat.S_IRWXO


class KeysError(SurefootError):
    """A key or certificate that is missing, damaged, too open, expired, or not what its name says."""


def certificate_file(folder: Path, identity: str) -> Path:
    """Return where the certificate of `identity` lies."""
    return folder / f"{identity}.pem"


def key_file(folder: Path, identity: str) -> Path:
    """Return where the private key of `identity` lies."""
    return folder / f"{identity}.key"


def make_folder(folder: Path) -> None:
    """Make `folder` for nobody but its owner, whatever the umask.

    Raises:
        KeysError: it cannot be made, or is there and others may enter it.
    """
    try:
        folder.mkdir(mode=0o700, parents=True)
        folder.chmod(0o700)
    except FileExistsError:
        if not folder.is_dir():
            raise KeysError(f"{folder}: is there already and no folder") from None
        require_private(folder)
    except OSError as error:
        raise KeysError(f"{folder}: cannot be made: {error.strerror}") from error


def require_private(path: Path) -> None:
    """Raise unless `path` is closed to everybody but its owner.

    Raises:
        KeysError: says how to close it.
    """
    mode = stat.S_IMODE(path.stat().st_mode)
    if mode & _OTHERS:
        closed = mode & ~_OTHERS
        raise KeysError(f"{path}: mode {mode:03o} lets others in, expected {closed:03o}: chmod {closed:03o} {path}")


def write_pair(folder: Path, identity: str, pair: Pair, *, replace: bool = False) -> None:
    """Write key (mode 600) and certificate (mode 644) of `identity` into `folder`.

    Raises:
        KeysError: one of them is there already and `replace` is not set, or it cannot be written.
    """
    if not replace:
        require_free(folder, identity)
    write(key_file(folder, identity), pair.key_pem(), 0o600, replace=replace)
    write(certificate_file(folder, identity), pair.certificate_pem(), 0o644, replace=replace)


def require_free(folder: Path, identity: str) -> None:
    """Raise if `identity` has a key or a certificate in `folder`.

    Raises:
        KeysError: names the file.
    """
    for path in (key_file(folder, identity), certificate_file(folder, identity)):
        if path.exists() or path.is_symlink():
            how = "a new authority needs a new folder" if identity == AUTHORITY else "--renew replaces it"
            raise KeysError(f"{path}: is there already; {how}")


def write(path: Path, content: bytes, mode: int, *, replace: bool = False) -> None:
    """Write a file under its name at once and whole.

    Raises:
        KeysError: it is there already and `replace` is not set, or it cannot be written.
    """
    temporary = ""
    try:
        descriptor, temporary = tempfile.mkstemp(prefix=f".{path.name}.", dir=path.parent)  # 600 whatever the umask
        with os.fdopen(descriptor, "wb") as file:
            os.fchmod(file.fileno(), mode)
            file.write(content)
            file.flush()
            os.fsync(file.fileno())
        if replace:
            Path(temporary).replace(path)
        else:
            os.link(temporary, path)  # unlike a rename, fails if the name is taken
    except FileExistsError:
        raise KeysError(f"{path}: is there already and was left as it is") from None
    except OSError as error:
        raise KeysError(f"{path}: cannot be written: {error.strerror}") from error
    finally:
        if temporary:
            with suppress(FileNotFoundError):
                Path(temporary).unlink()


def read_certificates(path: Path) -> list[x509.Certificate]:
    """Return the certificates in a PEM file, at least one.

    Raises:
        KeysError: there is no such file, or it holds no certificate.
    """
    try:
        return x509.load_pem_x509_certificates(_read(path))
    except ValueError as error:
        raise KeysError(f"{path}: holds no certificate in PEM form") from error


def read_key(path: Path) -> ec.EllipticCurvePrivateKey:
    """Return the private key in a PEM file that nobody else can read.

    Raises:
        KeysError: there is no such file, others may read it, or it holds no key of the expected kind.
    """
    content = _read(path)
    require_private(path)
    try:
        key = serialization.load_pem_private_key(content, password=None)
    except (ValueError, TypeError) as error:
        raise KeysError(f"{path}: holds no private key in PEM form, or an encrypted one") from error
    if not isinstance(key, ec.EllipticCurvePrivateKey):
        raise KeysError(f"{path}: holds a {type(key).__name__}, expected an elliptic-curve key")
    return key


def _read(path: Path) -> bytes:
    try:
        return path.read_bytes()
    except FileNotFoundError as error:
        raise KeysError(f"{path}: no such file") from error
    except OSError as error:
        raise KeysError(f"{path}: cannot be read: {error.strerror}") from error
