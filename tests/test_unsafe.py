"""Nothing anywhere turns bytes or text into code: no pickle, no eval, no yaml.load, no look-alikes.

Read from the syntax trees, so that neither an alias nor a nested import hides one.
"""

from __future__ import annotations

import ast
from collections.abc import Iterator
from pathlib import Path

import pytest

REPO = Path(__file__).resolve().parent.parent
FOLDERS = ("perception", "anticipation", "bridge", "controller", "simulation", "benchmarks", "tests")
MODULES = {"pickle", "cPickle", "_pickle", "dill", "cloudpickle", "shelve", "marshal", "jsonpickle", "code", "codeop"}
BUILTINS = {"eval", "exec", "compile"}
# attribute -> the modules in which it runs what it reads
CALLS = {
    "load": {"yaml", "joblib", "torch", "numpy", "np"},
    "load_all": {"yaml"},
    "full_load": {"yaml"},
    "unsafe_load": {"yaml"},
    "read_pickle": {"pandas", "pd"},
    "system": {"os"},
    "popen": {"os"},
}
SAFE = {"torch": ("weights_only", True), "numpy": ("allow_pickle", False), "np": ("allow_pickle", False)}


def unsafe(text: str) -> Iterator[str]:
    """Name what in a source text could run what it is given."""
    for node in ast.walk(ast.parse(text)):
        if isinstance(node, ast.Import):
            names = [alias.name for alias in node.names]
        elif isinstance(node, ast.ImportFrom):
            names = [node.module or "", *(f"{node.module}.{alias.name}" for alias in node.names)]
        else:
            names = []
        yield from (f"import {name}" for name in names if name.split(".")[0] in MODULES)
        yield from (f"import {name}" for name in names if name in {"yaml.load", "yaml.unsafe_load", "os.system"})
        if isinstance(node, ast.Call):
            yield from _unsafe_call(node)


def _unsafe_call(node: ast.Call) -> Iterator[str]:
    function = node.func
    if isinstance(function, ast.Name) and function.id in BUILTINS:
        yield f"{function.id}()"
    given = {word.arg: word.value.value for word in node.keywords if isinstance(word.value, ast.Constant)}
    if given.get("shell") is True:
        yield "shell=True"
    if not (isinstance(function, ast.Attribute) and isinstance(function.value, ast.Name)):
        return
    module, name = function.value.id, function.attr
    if module not in CALLS.get(name, ()):
        return
    keyword, value = SAFE.get(module, ("", None))
    if module in {"numpy", "np"} and keyword not in given:
        return  # numpy's default refuses pickles
    if not keyword or given.get(keyword) is not value:
        yield f"{module}.{name}()"


@pytest.mark.parametrize("folder", FOLDERS)
def test_nothing_runs_what_it_reads(folder: str) -> None:
    files = sorted((REPO / folder).rglob("*.py"))
    assert files, f"{folder} is empty"
    ours = {"shell=True"} if folder == "tests" else set()  # a test runs the line that a README tells its reader to run
    found = [
        f"{path.relative_to(REPO)}: {what}"
        for path in files
        for what in unsafe(path.read_text(encoding="utf-8"))
        if what not in ours
    ]
    assert not found


@pytest.mark.parametrize(
    "line",
    [
        "import pickle",
        "from pickle import loads",
        "def f():\n    import dill as d",
        "eval('1')",
        "exec(text)",
        "yaml.load(text)",
        "from yaml import load",
        "np.load(path, allow_pickle=True)",
        "torch.load(path)",
        "subprocess.run(line, shell=True)",
        "os.system(line)",
    ],
)
def test_each_would_be_seen(line: str) -> None:
    assert list(unsafe(line))


@pytest.mark.parametrize(
    "line",
    ["np.load(path)", "np.load(path, allow_pickle=False)", "torch.load(path, weights_only=True)", "model.eval()"],
)
def test_what_is_safe_is_not_complained_of(line: str) -> None:
    assert not list(unsafe(line))
