"""What `surefoot view` cannot do it says in one line, and leaves nothing behind; a video lies under its keypoints."""

from __future__ import annotations

import importlib
import io
import itertools
from pathlib import Path
from types import ModuleType

import numpy as np
import pytest
from bridge_recordings import START_NS, walk, write
from bridge_view_files import Rrd, foreseen

from bridge.cli import main
from bridge.clock import NS

pytest.importorskip("rerun", reason="rerun-sdk is not installed: pip install 'surefoot[view]'")


@pytest.fixture
def recording(tmp_path: Path) -> Path:
    return write(tmp_path / "walk.mcap", foreseen(0.4))


def refused(capsys: pytest.CaptureFixture[str], *arguments: object) -> str:
    assert main(["view", *map(str, arguments)]) == 2
    lines = capsys.readouterr().err.splitlines()
    assert len(lines) == 1, lines
    return lines[0]


@pytest.mark.parametrize(
    ("content", "said"),
    [(None, "no such file"), (b"", "not an MCAP file"), (b"\x89MCAP0\r\n", "holds no message of Surefoot's topics")],
)
def test_recordings_that_show_nothing(
    content: bytes | None, said: str, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    path = tmp_path / "bad.mcap"
    if content is not None:
        path.write_bytes(content)
    assert said in refused(capsys, path, "--out", tmp_path / "out.rrd")
    assert [left.name for left in tmp_path.iterdir()] == ([] if content is None else ["bad.mcap"])


def test_a_recording_of_nothing_at_all(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    from bridge.record.writer import BagWriter
    from bridge.topics import TOPICS

    BagWriter(tmp_path / "empty.mcap", "surefoot", TOPICS).finish()
    assert "holds no message" in refused(capsys, tmp_path / "empty.mcap", "--out", tmp_path / "out.rrd")
    assert not (tmp_path / "out.rrd").exists()


def test_a_recording_cut_off_is_shown_as_far_as_it_goes(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    whole = write(tmp_path / "walk.mcap", walk(2.0)).read_bytes()
    (tmp_path / "cut.mcap").write_bytes(whole[: 2 * len(whole) // 3])
    assert main(["view", str(tmp_path / "cut.mcap"), "--out", str(tmp_path / "cut.rrd")]) == 0
    assert "not whole: cut off after" in capsys.readouterr().err
    assert len(Rrd(tmp_path / "cut.rrd").drawn("/series/stiffening", "scalars")) >= 50


def test_where_the_file_cannot_go(recording: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    taken = tmp_path / "taken.rrd"
    taken.write_bytes(b"mine")
    assert "the name is taken; --force replaces it" in refused(capsys, recording, "--out", taken)
    assert taken.read_bytes() == b"mine"
    assert "end in .rrd" in refused(capsys, recording, "--out", tmp_path / "out.mcap")
    assert "cannot be written: No such file" in refused(capsys, recording, "--out", tmp_path / "no" / "out.rrd")
    assert sorted(path.name for path in tmp_path.iterdir()) == ["taken.rrd", "walk.mcap"]
    assert main(["view", str(recording), "--out", str(taken), "--force"]) == 0
    assert Rrd(taken).drawn("/series/stiffening", "scalars")


def test_without_the_extra(
    recording: Path, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    real = importlib.import_module

    def missing(name: str) -> ModuleType:
        if name.partition(".")[0].startswith("rerun"):
            raise ImportError(name)
        return real(name)

    monkeypatch.setattr("bridge.view.extra.importlib.import_module", missing)
    said = refused(capsys, recording, "--out", "out.rrd")
    assert said == "surefoot: surefoot view needs the package 'rerun-sdk': pip install 'surefoot[view]'"


def test_without_a_display(
    recording: Path, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.delenv("DISPLAY", raising=False)
    monkeypatch.delenv("WAYLAND_DISPLAY", raising=False)
    said = refused(capsys, recording)
    assert "no display" in said
    assert "--out FILE.rrd" in said


def test_nothing_to_show_on(recording: Path, capsys: pytest.CaptureFixture[str]) -> None:
    assert "nothing to show on" in refused(capsys, recording, "--no-window")


@pytest.fixture
def video(tmp_path: Path) -> Path:
    """Twelve pictures of 340x240, each lighter than the one before."""
    cv2 = pytest.importorskip("cv2")
    folder = tmp_path / "video"
    folder.mkdir()
    for index in range(12):
        cv2.imwrite(str(folder / f"{index:03d}.png"), np.full((240, 340, 3), 20 * index, np.uint8))
    return folder


def test_video_lies_under_the_keypoints_it_was_seen_with(recording: Path, video: Path, tmp_path: Path) -> None:
    from PIL import Image

    out = tmp_path / "out.rrd"
    assert main(["view", str(recording), "--out", str(out), "--video", str(video), "--crop", "10,0,320,240"]) == 0
    frames = Rrd(out).drawn("/image/frame", "blob")
    assert len(frames) == 12
    for index, row in enumerate(frames):
        assert abs(row.stamp_ns - START_NS - round(index * NS / 30)) < 10
        picture = np.asarray(Image.open(io.BytesIO(bytes(row.values["blob"][0]))))
        assert picture.shape == (240, 320, 3)
        assert picture.mean() == pytest.approx(20 * index, abs=3)


def test_video_can_be_shifted(recording: Path, video: Path, tmp_path: Path) -> None:
    out = tmp_path / "out.rrd"
    crop = ["--video", str(video), "--crop", "0,0,320,240", "--video-offset", "0.1"]
    assert main(["view", str(recording), "--out", str(out), *crop]) == 0
    stamps = [row.stamp_ns for row in Rrd(out).drawn("/image/frame", "blob")]
    assert abs(stamps[0] - START_NS - NS // 10) < 10
    assert all(0 < later - sooner < NS / 29 for sooner, later in itertools.pairwise(stamps))


def test_video_of_another_size(
    recording: Path, video: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    said = refused(capsys, recording, "--out", tmp_path / "out.rrd", "--video", video)
    assert "its pictures are 340x240, the keypoints are in 320x240; --crop" in said
    assert not list(tmp_path.glob("*.rrd")) + list(tmp_path.glob(".*.rrd"))  # it had been begun
    assert "there is none" in refused(capsys, recording, "--out", tmp_path / "out.rrd", "--crop", "0,0,10,10")
    assert "no such video" in refused(capsys, recording, "--out", tmp_path / "out.rrd", "--video", tmp_path / "no.mp4")
    assert not (tmp_path / "out.rrd").exists()
