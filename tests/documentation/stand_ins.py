"""A folder in which every file that the pages name is there: small, made up, and of the right kind."""

from __future__ import annotations

import importlib.util
import re
import shutil
from pathlib import Path
from types import ModuleType

import numpy as np
from documented import REPO

from simulation.kinematic.motion import Walker, move

CLIP = "walk-stumble-fall"
SHIPPED = REPO / "simulation" / "demo" / f"{CLIP}.npz"
FRAMES = 75  # two and a half seconds
LABELS = "clip,onset_s,lying_s,up_s,person\nkitchen.npz:trip,1.0,1.8,,anna\n"


def furnish(folder: Path) -> None:
    """Put everything there that a documented command may read."""
    for kept in ("config/surefoot.toml", "anticipation/weights/default.safetensors"):
        (folder / kept).parent.mkdir(parents=True, exist_ok=True)
        shutil.copy(REPO / kept, folder / kept)
    (folder / "docs" / "images").mkdir(parents=True)
    for empty in ("pictures", "runs"):
        (folder / empty).mkdir()
    shutil.copytree(REPO / "examples", folder / "examples", ignore=shutil.ignore_patterns("__pycache__"))
    with np.load(SHIPPED) as arrays:
        clip = {name.partition("/")[2]: arrays[name] for name in arrays}
    short = {"keypoints": clip["keypoints"][-FRAMES:], "fps": clip["fps"], "image_size": clip["image_size"]}
    parts = {
        "clip": "walk",
        "clips": "walk",
        "FILE": "CLIP",
        "recordings/kitchen": "trip",
        f"simulation/demo/{CLIP}": CLIP,
    }
    for name, part in parts.items():
        file = folder / f"{name}.npz"
        file.parent.mkdir(parents=True, exist_ok=True)
        np.savez(file, **{f"{part}/{key}": value for key, value in short.items()})
    motion = move(Walker(speed_m_s=0.5), (), 4.0, np.random.default_rng(0))
    every = round(1.0 / 30.0 / float(motion.time_s[1]))
    np.savez(folder / "walks.npz", slow=motion.keypoints_m[::every])
    (folder / "recordings" / "labels.csv").write_text(LABELS, encoding="utf-8")
    shutil.copytree(folder / "recordings", folder / "FOLDER")
    for name in ("C.toml", "my.toml", "robot.toml"):
        (folder / name).write_text("[intervention]\ndistance_onset_sd = 1.6\n", encoding="utf-8")
    _recordings(folder)
    _video(folder / "fall.mp4")
    for page in sorted((REPO / "docs").glob("*.md")):
        _files_of(page.read_text(encoding="utf-8"), folder)


def _recordings(folder: Path) -> None:
    made_up = _module(REPO / "tests" / "bridge" / "bridge_recordings.py")
    made_up.write(folder / "walk.mcap", made_up.walk(1.0))
    for copy in ("runs/demo/held.mcap", "runs/demo/unheld.mcap", "FILE", "RECORDING"):
        (folder / copy).parent.mkdir(parents=True, exist_ok=True)
        shutil.copy(folder / "walk.mcap", folder / copy)


def _video(file: Path) -> None:
    import cv2

    writer = cv2.VideoWriter(str(file), cv2.VideoWriter.fourcc(*"mp4v"), 30.0, (640, 240))
    for shade in range(45):
        writer.write(np.full((240, 640, 3), 60 + shade, np.uint8))
    writer.release()


def _files_of(page: str, folder: Path) -> None:
    """Write the files that a page gives whole: a `toml` or `csv` block after the name of its file."""
    for name, text in re.findall(r"`([\w-]+\.(?:toml|csv))`:?\s*\n\s*```(?:toml|csv)\n(.*?)```", page, re.DOTALL):
        (folder / name).write_text(text, encoding="utf-8")


def _module(file: Path) -> ModuleType:
    spec = importlib.util.spec_from_file_location(file.stem, file)
    assert spec is not None
    assert spec.loader is not None
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    return module
