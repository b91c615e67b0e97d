"""C code built once into a cache: CasADi's functions as machine code; without a compiler, CasADi's own machine.

Called through fixed buffers: nothing is allocated in a step. The compiled function and CasADi's virtual machine give
the same numbers (tested); the compiled one takes a tenth of the time. The cache is `$SUREFOOT_CACHE`, else
`$XDG_CACHE_HOME/surefoot`, else `~/.cache/surefoot`; what lies there is named by a digest of the source, so another
configuration or version never meets a stale library. Beside each library lies a seal, the digest of its own bytes: a
file that a power cut left half written would end the process that loads it, and is built again.
"""

from __future__ import annotations

import hashlib
import logging
import os
import shutil
import subprocess
import tempfile
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import casadi as ca
import numpy as np

from bridge.messages import Floats

# Never -ffast-math: it would take the checks for what is not a number away.
FLAGS = ("-fPIC", "-shared")
_BUILD_LIMIT_S = 120.0
_log = logging.getLogger(__name__)


class Kernel:
    """A function with its arguments and results in place.

    Attributes:
        inputs: one array for each argument, to be written before a call.
        outputs: one array for each result, rewritten by each call.
    """

    def __init__(
        self, function: Any, inputs: Sequence[Floats] | None = None, outputs: Sequence[Floats] | None = None
    ) -> None:
        """Take a dense function; arrays that are given are shared with whoever owns them."""
        self.inputs = (
            list(inputs) if inputs is not None else [_room(function.size_in(i)) for i in range(function.n_in())]
        )
        self.outputs = (
            list(outputs) if outputs is not None else [_room(function.size_out(i)) for i in range(function.n_out())]
        )
        for i, array in enumerate(self.inputs):
            _fits(array, function.size_in(i), f"argument {i} of {function.name()}")
        for i, array in enumerate(self.outputs):
            _fits(array, function.size_out(i), f"result {i} of {function.name()}")
        self._function = function  # the buffer does not keep it alive
        self._buffer, self._call = function.buffer()
        for i, array in enumerate(self.inputs):
            self._buffer.set_arg(i, array.data)
        for i, array in enumerate(self.outputs):
            self._buffer.set_res(i, array.data)

    def __call__(self) -> None:
        """Evaluate."""
        self._call()


def compiled(functions: Sequence[Any], wanted: bool = True) -> list[Any]:
    """Return CasADi functions as machine code, or as they are where none can be made or is `wanted`."""
    path = library(source("surefoot_kernels", functions), "-O1") if wanted else None
    if path is None:
        return list(functions)
    try:
        return [ca.external(function.name(), str(path)) for function in functions]
    except RuntimeError as error:  # damaged, or on a file system that nothing may be executed from
        _log.warning("%s cannot be loaded (%s): the MPC runs in CasADi's virtual machine", path, _line(error))
        return list(functions)


def library(text: str, effort: str = "-O3") -> Path | None:
    """Return the shared library of a C source, built now if it is not in the cache; None where it cannot be.

    Unrolled code gains nothing from more `effort` than -O1 and takes a compiler several times as long.
    """
    compiler = os.environ.get("CC") or shutil.which("cc") or shutil.which("gcc")
    if compiler is None:
        _log.warning("no C compiler (cc, gcc or $CC): the MPC runs in CasADi's virtual machine, slower by half a ms")
        return None
    digest = hashlib.sha256("\0".join([compiler, effort, *FLAGS, os.uname().machine, text]).encode()).hexdigest()[:24]
    try:
        path = cache_folder() / f"mpc-{digest}.so"
        if not _whole(path):
            _log.info("building the MPC's C code, once for this configuration: %s", path)
            _build([*compiler.split(), effort], text, path)
    except (OSError, RuntimeError, subprocess.SubprocessError) as error:  # RuntimeError: there is no home
        _log.warning("the MPC's C code could not be built (%s): it runs in CasADi's virtual machine", _line(error))
        return None
    return path


def source(name: str, functions: Sequence[Any]) -> str:
    """Return the C source of functions."""
    generator = ca.CodeGenerator(name, {"with_header": False})
    for function in functions:
        generator.add(function)
    text: str = generator.dump()
    return text


def cache_folder() -> Path:
    """Return the folder of compiled code, made if need be.

    Raises:
        OSError: it cannot be made, or somebody else may write to it.
    """
    named = os.environ.get("SUREFOOT_CACHE")
    base = os.environ.get("XDG_CACHE_HOME")
    folder = Path(named) if named else (Path(base) if base else Path.home() / ".cache") / "surefoot"
    folder.mkdir(mode=0o700, parents=True, exist_ok=True)
    state = folder.stat()
    # What lies there is loaded into the controller.
    if state.st_uid != os.getuid() or state.st_mode & 0o022:
        raise PermissionError(f"{folder} may be written by others")
    return folder


def _build(compiler: Sequence[str], text: str, target: Path) -> None:
    with tempfile.TemporaryDirectory(dir=target.parent) as scratch:
        path, out = Path(scratch) / "mpc.c", Path(scratch) / target.name
        path.write_text(text, encoding="utf-8")
        subprocess.run(  # noqa: S603 (the compiler the user named)
            [*compiler, *FLAGS, "-o", str(out), str(path), "-lm"],
            check=True,
            capture_output=True,
            timeout=_BUILD_LIMIT_S,
        )
        seal = Path(scratch) / _seal(target).name
        seal.write_text(_digest(out), encoding="ascii")
        for written in (out, seal):
            with written.open("rb") as file:
                os.fsync(file.fileno())
        # Each whole or not at all, whoever else builds the same; compilers repeat themselves to the byte,
        # and where one does not, a library under another's seal is only built once more.
        out.replace(target)
        seal.replace(_seal(target))


def _whole(path: Path) -> bool:
    """Whether a library is there as it was built."""
    try:
        return _seal(path).read_text(encoding="ascii") == _digest(path)
    except (FileNotFoundError, UnicodeDecodeError):
        return False


def _seal(path: Path) -> Path:
    return path.with_suffix(".sha256")


def _digest(path: Path) -> str:
    return hashlib.sha256(path.read_bytes()).hexdigest()


def _line(error: Exception) -> str:
    said = getattr(error, "stderr", None)
    text = said.decode(errors="replace") if isinstance(said, bytes) and said else str(error)
    return " ".join(text.split())[:300]


def _room(size: tuple[int, int]) -> Floats:
    return np.zeros(size[0] * size[1])


def _fits(array: Floats, size: tuple[int, int], what: str) -> None:
    if array.size != size[0] * size[1] or array.dtype != np.float64 or not array.flags.c_contiguous:
        raise ValueError(f"{what} needs {size[0] * size[1]} contiguous doubles, got {array.dtype} {array.shape}")
