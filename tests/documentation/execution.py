"""Executes a documented command as it stands, or finds out whether its words mean anything."""

from __future__ import annotations

import argparse
import importlib.util
import io
import os
import re
import runpy
import shlex
import signal
import subprocess
import sys
import tomllib
from collections.abc import Iterator
from contextlib import chdir, contextmanager, redirect_stderr, redirect_stdout
from pathlib import Path
from typing import Any

import typer
from documented import REPO, Documented, plain
from ways import way

from bridge.cli import COMMANDS, _app, main
from bridge.launch.ports import free_ports

MAKEFILE = (REPO / "Makefile").read_text(encoding="utf-8")
STAMPS = re.findall(r"^\$\(VENV\)/(\.\w+):", MAKEFILE, re.MULTILINE)
ROLES = ("perception", "anticipation", "controller", "drive")
PATIENCE_S = 900


def places() -> dict[str, str]:
    """Return options that keep a command away from whatever else runs on this machine, by the name of their place."""
    *for_roles, port = free_ports(len(ROLES) + 1)
    ports = dict(zip(ROLES, for_roles, strict=True))
    return {"port": str(port)} | {
        protocol_name: "--set bridge.namespace=documented "
        + " ".join(f"--set bridge.endpoints.{role}={protocol}/127.0.0.1:{port}" for role, port in ports.items())
        for protocol_name, protocol in (("wire", "tcp"), ("tls", "tls"))
    }


class NotAsDocumentedError(AssertionError):
    """A command that does not do what its page says."""


def execute(command: Documented, folder: Path, places: dict[str, str], *, apart: bool = False) -> str:
    """Execute a command in `folder` with its extra options, perhaps as a process apart; return what it wrote.

    Raises:
        NotAsDocumentedError: its exit code is not the one expected, or it is of no kind that can be executed.
    """
    known = way(command.text)
    words = [*command.words, *shlex.split(known.extra.format(**places))]
    if words[0] == "surefoot" and not apart:
        code, out, err = _surefoot(words[1:], folder)
    elif words[0] in ("surefoot", "python", "python3", "torchrun"):
        code, out, err = _process(words, folder, known.stops_s)
    else:
        raise NotAsDocumentedError(f"{command.page}: `{command.text}` is not ours to execute: name it in ways.py")
    if code not in known.codes:
        raise NotAsDocumentedError(
            f"{command.page}: `{shlex.join(words)}` ended with exit code {code}:\n{out[-2000:]}{err[-2000:]}"
        )
    if not re.search(known.says, out + err):
        raise NotAsDocumentedError(f"{command.page}: `{shlex.join(words)}` did not say {known.says}:\n{out[-2000:]}")
    if command.output:
        (folder / command.output).parent.mkdir(parents=True, exist_ok=True)
        (folder / command.output).write_text(out, encoding="utf-8")
    return out + err


def _surefoot(words: list[str], folder: Path) -> tuple[int, str, str]:
    """Run the command line in this process: it is the same function, without a second of imports for each."""
    out, err = io.StringIO(), io.StringIO()
    with chdir(folder), redirect_stdout(out), redirect_stderr(err):
        code = main(words)
    return code, out.getvalue(), err.getvalue()


def _process(words: list[str], folder: Path, stops_s: float) -> tuple[int, str, str]:
    if words[0].startswith("python") and not (folder / words[1]).exists() and (REPO / words[1]).exists():
        words = [words[0], str(REPO / words[1]), *words[2:]]
    binaries = Path(sys.executable).parent
    path = f"{REPO}{os.pathsep}{os.environ.get('PYTHONPATH', '')}"
    environment = {**os.environ, "PYTHONPATH": path, "PATH": f"{binaries}{os.pathsep}{os.environ['PATH']}"}
    pipe = subprocess.PIPE
    with subprocess.Popen(words, cwd=folder, env=environment, stdout=pipe, stderr=pipe, text=True) as process:
        try:
            out, err = process.communicate(timeout=stops_s or PATIENCE_S)
        except subprocess.TimeoutExpired:
            process.send_signal(signal.SIGINT if stops_s else signal.SIGKILL)
            out, err = process.communicate(timeout=60)
    return process.returncode, out, err


def parse(command: Documented) -> None:
    """Find out whether a command's options, values and files exist, and run nothing.

    Raises:
        NotAsDocumentedError: they do not.
    """
    words = command.words
    environment = re.compile(r"\w+=.*")
    while words and environment.fullmatch(words[0]):
        words = words[1:]
    if words[0] == "torchrun":
        words = words[words.index("--no-python") + 1 :]
    try:
        if words[0] == "surefoot":
            _parse_surefoot(words[1:])
        elif words[0] in ("python", "python3"):
            _parse_python(words[1:])
        elif words[:2] == ["pip", "install"]:
            _parse_pip(words[2:])
        elif words[0] == "make":
            recipe(words[1:])
    except Exception as error:
        raise NotAsDocumentedError(f"{command.page}: `{command.text}`: {error}") from error


def _parse_surefoot(words: list[str]) -> None:
    if words[0] == "COMMAND":
        return
    if not words[0].startswith("-") and words[0] not in COMMANDS:
        raise ValueError(f"no command {words[0]}")
    command: Any = typer.main.get_command(_app(words))
    name, rest, context = "surefoot", words, None
    while rest and rest not in (["--help"], ["--version"]):
        for parameter in command.params:
            parameter.callback = None  # some do what they are for while they are read
        context = command.make_context(name, list(rest), parent=context)
        if not hasattr(command, "commands"):
            return
        remaining = [*context._protected_args, *context.args]
        if not remaining:
            return
        name, command, rest = command.resolve_command(context, remaining)


def _parse_python(words: list[str]) -> None:
    if words[0] != "-m":
        if not (REPO / words[0]).exists():
            raise ValueError(f"no file {words[0]}")
        return
    if importlib.util.find_spec(words[1]) is None:
        raise ValueError(f"no module {words[1]}")
    if words[1].startswith("benchmarks."):
        known = sys.modules.pop(words[1], None)  # another test's import: runpy would warn of it
        try:
            with _only_parsing(words[1:]):
                runpy.run_module(words[1], run_name="__main__")
        finally:
            if known is not None:
                sys.modules[words[1]] = known


@contextmanager
def _only_parsing(words: list[str]) -> Iterator[None]:
    """Let a main program read `words` as its command line and end there."""

    class Parsed(BaseException):
        pass

    def parsed(self: argparse.ArgumentParser, *_: Any) -> argparse.Namespace:
        _, rest = self.parse_known_args(words[1:])
        if rest:
            self.error(f"unrecognised: {' '.join(rest)}")
        raise Parsed

    original, argv = argparse.ArgumentParser.parse_args, sys.argv
    argparse.ArgumentParser.parse_args, sys.argv = parsed, words  # type: ignore[method-assign,assignment]
    said = io.StringIO()
    try:
        with redirect_stderr(said):
            yield
    except Parsed:
        return
    except SystemExit as error:
        raise ValueError(said.getvalue().strip().splitlines()[-1]) from error
    finally:
        argparse.ArgumentParser.parse_args, sys.argv = original, argv  # type: ignore[method-assign]
    raise ValueError("reads no command line")


def _parse_pip(words: list[str]) -> None:
    project = tomllib.loads((REPO / "pyproject.toml").read_text(encoding="utf-8"))["project"]
    for word, following in zip(words, [*words[1:], ""], strict=True):
        wanted = re.fullmatch(r"(?:surefoot|\.)\[([\w,]+)\]", word)
        for extra in wanted[1].split(",") if wanted else ():
            if extra not in project["optional-dependencies"]:
                raise ValueError(f"no extra {extra}")
        if word in ("-c", "-r") and not (REPO / following).is_file():
            raise ValueError(f"no file {following}")


def recipe(words: list[str]) -> list[Documented]:
    """Return the commands that `make` would execute, everything being installed.

    Raises:
        ValueError: there is no such target.
    """
    installed = [word for stamp in STAMPS for word in ("-o", f".venv/{stamp}")]
    done = subprocess.run(
        ["make", "-n", *installed, *words], cwd=REPO, capture_output=True, text=True, timeout=60, check=False
    )
    if done.returncode:
        raise ValueError(done.stderr.strip())
    joined = re.sub(r"\\\n\s*", " ", done.stdout)
    lines = (plain(line.replace(".venv/bin/", "")) for line in joined.splitlines())
    return [
        Documented(f"make {' '.join(words)}", line) for line in lines if line and not line.startswith(("echo", "make"))
    ]
