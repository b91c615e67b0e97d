"""Documented commands run with a home of their own, so that none changes the user's."""

import os
from pathlib import Path

import pytest


@pytest.fixture(autouse=True)
def _home(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    compiled = os.environ.get("SUREFOOT_CACHE") or str(Path.home() / ".cache" / "surefoot")
    monkeypatch.setenv("SUREFOOT_CACHE", compiled)  # what was compiled before need not be again
    monkeypatch.setenv("HOME", str(tmp_path))
