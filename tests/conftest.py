"""What several tests need: the research data, where it is there."""

import os
from pathlib import Path

import pytest

REPO = Path(__file__).resolve().parent.parent


@pytest.fixture(scope="session")
def data_dir() -> Path:
    """Folder of the research data; skips, saying why, where it is not there."""
    folder = Path(os.environ.get("SUREFOOT_DATA", REPO.parent / "shared" / "data"))
    if not (folder / "urfd" / "falls.npz").is_file():
        pytest.skip(f"no research data in {folder} (set SUREFOOT_DATA)")
    return folder
