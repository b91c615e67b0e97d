from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest
from numpy.typing import NDArray

from bridge.clock import NS, ManualClock
from bridge.config.perception import SourceConfig
from bridge.errors import MissingExtraError, SourceError
from perception.extras import load_opencv
from perception.sources.frame import Frame, Source
from perception.sources.keypoint_file import clip_names, read_clip
from perception.sources.open import open_source
from perception.sources.picture import parse_crop

Floats = NDArray[np.float64]
Body = Callable[..., Floats]
CLOCK = ManualClock()
UNPACED = SourceConfig(paced=False)


@pytest.fixture
def npz(tmp_path: Path, body: Body) -> Path:
    path = tmp_path / "clips.npz"
    walk = np.array([body(x=100 + k) for k in range(20)])
    arrays = {
        "fall-01/alphapose": walk,
        "fall-01/movenet": walk + 1,
        "fall-01/label": np.zeros(20),
        "walk/keypoints": walk[:12],
        "walk/fps": np.float32(12.5),
        "walk/image_size": np.array([640, 480]),
        "walk/onset": np.array(7),
        "activity06/movenet": walk,
        "activity06/fps": np.array(11.6),
        "bare": walk,
        "wide": np.zeros((5, 17, 3)),
        "words": np.array(["a", "b"]),
        "empty": np.zeros((0, 12, 3)),
        "nothing": np.full((9, 12, 3), np.nan),
        "slow/keypoints": walk,
        "slow/fps": np.array(np.nan),
        "flat/keypoints": walk,
        "flat/image_size": np.array([320, 0]),
    }
    np.savez(path, **arrays)
    return path


@pytest.fixture
def video(tmp_path: Path) -> Path:
    """Ten frames at 25 fps, 64x32: the left half is black, the right half brightens by 20 a frame."""
    cv2 = load_opencv("the test", "video")
    path = tmp_path / "clip.avi"
    writer = cv2.VideoWriter(str(path), cv2.VideoWriter_fourcc(*"MJPG"), 25.0, (64, 32))
    for k in range(10):
        image = np.zeros((32, 64, 3), dtype=np.uint8)
        image[:, 32:, 2] = 20 * k  # red: BGR in OpenCV
        writer.write(image)
    writer.release()
    return path


def drain(source: Source, now_ns: int = NS) -> list[Frame]:
    frames = []
    while (frame := source.next(now_ns)) is not None:
        frames.append(frame)
    return frames


# keypoint files


@pytest.mark.parametrize(
    ("name", "frames", "fps_hz", "size"),
    [
        ("fall-01/alphapose", 20, 30.0, (320, 240)),
        ("fall-01/movenet", 20, 30.0, (320, 240)),
        ("walk", 12, 12.5, (640, 480)),
        ("walk/keypoints", 12, 12.5, (640, 480)),
        ("activity06", 20, pytest.approx(11.6), (320, 240)),
        ("activity06/movenet", 20, pytest.approx(11.6), (320, 240)),
        ("bare", 20, 30.0, (320, 240)),
    ],
)
def test_clips_are_found_in_every_layout(
    npz: Path, name: str, frames: int, fps_hz: float, size: tuple[int, int]
) -> None:
    clip = read_clip(npz, name, SourceConfig())
    assert (len(clip.keypoints), clip.fps_hz, (clip.width, clip.height)) == (frames, fps_hz, size)
    assert clip.stamps_ns[-1] == pytest.approx((frames - 1) / clip.fps_hz * NS, abs=1)


def test_a_clip_with_several_arrays_gives_the_preferred_one(npz: Path) -> None:
    chosen = read_clip(npz, "fall-01", SourceConfig()).keypoints
    assert np.array_equal(chosen, read_clip(npz, "fall-01/alphapose", SourceConfig()).keypoints)


def test_what_the_file_lacks_comes_from_the_config(npz: Path) -> None:
    clip = read_clip(npz, "bare", SourceConfig(fps_hz=25.0, image_width_px=1280, image_height_px=720))
    assert (clip.fps_hz, clip.width, clip.height) == (25.0, 1280, 720)


def test_clip_names_leave_out_what_lies_beside(npz: Path) -> None:
    names = clip_names(npz)
    assert {"walk", "bare", "fall-01/alphapose", "activity06/movenet"} <= set(names)
    assert not [name for name in names if name.endswith(("fps", "label", "image_size", "onset"))]


def test_the_only_clip_needs_no_name(tmp_path: Path, body: Body) -> None:
    path = tmp_path / "one.npz"
    np.savez(path, **{"walk/keypoints": np.array([body()] * 3), "walk/fps": 30.0})
    assert len(drain(open_source(str(path), UNPACED, CLOCK))) == 3


@pytest.mark.parametrize(
    ("spec", "message"),
    [
        ("{npz}:fall-10/alphapose", "no clip 'fall-10/alphapose'; the nearest is 'fall-01/alphapose'"),
        ("{npz}:walkk", "no clip 'walkk'; the nearest is 'walk'"),
        ("{npz}:wide", r"'wide' is float64 \(5, 17, 3\), expected numbers \(frames, 12, 3\)"),
        ("{npz}:words", r"expected numbers \(frames, 12, 3\)"),
        ("{npz}:empty", "'empty' holds no frame"),
        ("{npz}:nothing", "no keypoint in any of its 9 frames, all are NaN"),
        ("{npz}:slow", r"'slow/fps' is nan, expected one number within 1..240"),
        ("{npz}:flat", r"'flat/image_size' is \[320, 0\], expected width and height"),
        ("{npz}", "name one as clips.npz:CLIP"),
        ("{npz}x.npz:walk", "no such keypoint file"),
        ("nowhere/at/all.mp4", "no such file or folder; expected FILE.npz:CLIP"),
        ("", "no source given: set --source"),
    ],
)
def test_a_bad_source_is_one_line_naming_what_is_wrong(npz: Path, spec: str, message: str) -> None:
    with pytest.raises(SourceError, match=message) as caught:
        open_source(spec.format(npz=npz), SourceConfig(), CLOCK)
    assert "\n" not in str(caught.value)


@pytest.mark.parametrize("share", [0.0, 0.1, 0.5, 0.9, 0.999])
def test_a_truncated_file_is_said(npz: Path, share: float) -> None:
    content = npz.read_bytes()
    npz.write_bytes(content[: int(share * len(content))])
    with pytest.raises(SourceError, match=r"clips.npz: not a readable npz file"):
        open_source(f"{npz}:walk", SourceConfig(), CLOCK)


def test_a_damaged_array_is_said(npz: Path) -> None:
    content = bytearray(npz.read_bytes())
    middle = len(content) // 40
    content[middle : middle + 200] = bytes(200)
    npz.write_bytes(content)
    with pytest.raises(SourceError, match="damaged|readable"):
        open_source(f"{npz}:fall-01/alphapose", SourceConfig(), CLOCK)


def test_pickles_and_single_arrays_are_refused(tmp_path: Path) -> None:
    pickled = tmp_path / "pickled.npz"
    np.savez(pickled, walk=np.array([{"a": 1}], dtype=object))
    with pytest.raises(SourceError, match="'walk' is damaged"):
        open_source(f"{pickled}:walk", SourceConfig(), CLOCK)
    single = tmp_path / "single.npz"
    with single.open("wb") as file:
        np.save(file, np.zeros((3, 12, 3)))
    with pytest.raises(SourceError, match="a single array"):
        open_source(f"{single}:walk", SourceConfig(), CLOCK)


# playback


def test_paced_frames_come_when_they_are_due_and_are_stamped_so(npz: Path) -> None:
    source = open_source(f"{npz}:bare", SourceConfig(), CLOCK)
    clock = ManualClock(5 * NS)
    stamps = []
    while not source.finished:
        now_ns = clock.now_ns()
        for frame in drain(source, now_ns):
            assert 0 <= now_ns - frame.stamp_ns < NS / 30
            stamps.append(frame.stamp_ns)
        source.wait(clock)
    assert stamps == [5 * NS + round(k * NS / 30) for k in range(20)]


def test_a_late_reader_misses_frames_as_with_a_camera(npz: Path) -> None:
    source = open_source(f"{npz}:bare", SourceConfig(), CLOCK)
    assert source.next(0) is not None
    late_ns = NS // 2
    frames = drain(source, late_ns)
    assert late_ns - frames[0].stamp_ns <= 0.1 * NS + NS / 30
    assert frames[-1].stamp_ns <= late_ns < frames[-1].stamp_ns + NS / 30


def test_unpaced_every_frame_is_due_at_once(npz: Path) -> None:
    source = open_source(f"{npz}:walk", UNPACED, CLOCK)
    frames = drain(source)
    assert [frame.stamp_ns for frame in frames] == [NS + round(k * NS / 12.5) for k in range(12)]
    assert source.finished
    assert not source.gives_images


def test_a_frame_without_any_keypoint_has_nobody_in_it(tmp_path: Path, body: Body) -> None:
    path = tmp_path / "gap.npz"
    clip = np.array([body()] * 3)
    clip[1] = np.nan
    np.savez(path, gap=clip)
    assert [len(frame.people) for frame in drain(open_source(f"{path}:gap", UNPACED, CLOCK))] == [1, 0, 1]


# images


def test_a_video_gives_cropped_rgb_frames_at_its_own_rate(video: Path) -> None:
    config = SourceConfig(paced=False, crop_px=(32, 8, 32, 16))
    source = open_source(str(video), config, CLOCK)
    frames = drain(source)
    assert source.gives_images
    assert [frame.stamp_ns - NS for frame in frames] == pytest.approx([k * NS / 25 for k in range(10)], abs=1e6)
    for k, frame in enumerate(frames):
        assert (frame.width, frame.height) == (32, 16)
        assert frame.image is not None
        assert frame.image.shape == (16, 32, 3)
        assert frame.image.reshape(-1, 3).mean(axis=0) == pytest.approx([20 * k, 0, 0], abs=6)


def test_a_folder_of_images_is_read_in_the_order_of_its_numbers(tmp_path: Path) -> None:
    cv2 = load_opencv("the test", "video")
    for k in (1, 2, 9, 10, 100):
        cv2.imwrite(str(tmp_path / f"frame{k}.png"), np.full((8, 8, 3), k, dtype=np.uint8))
    (tmp_path / "notes.txt").write_text("not an image")
    frames = drain(open_source(str(tmp_path), SourceConfig(paced=False, fps_hz=10.0), CLOCK))
    assert [int(frame.image[0, 0, 0]) for frame in frames if frame.image is not None] == [1, 2, 9, 10, 100]
    assert [frame.stamp_ns for frame in frames] == [NS + k * NS // 10 for k in range(5)]


def test_a_video_that_does_not_open_is_said(tmp_path: Path, capfd: pytest.CaptureFixture[str]) -> None:
    for content in (b"", b"not a video" * 1000):
        path = tmp_path / "broken.mp4"
        path.write_bytes(content)
        with pytest.raises(SourceError, match=r"broken.mp4: not a video that OpenCV can open"):
            open_source(str(path), SourceConfig(), CLOCK)
    assert capfd.readouterr().err == ""


def test_an_empty_folder_and_a_broken_image_are_said(tmp_path: Path) -> None:
    with pytest.raises(SourceError, match="no image in this folder"):
        open_source(str(tmp_path), SourceConfig(), CLOCK)
    (tmp_path / "frame.png").write_bytes(b"not an image")
    with pytest.raises(SourceError, match=r"frame.png: not an image"):
        open_source(str(tmp_path), SourceConfig(), CLOCK)


def test_a_crop_outside_the_image_is_said(video: Path) -> None:
    with pytest.raises(SourceError, match="crop 40,0,32,32 reaches outside the 64x32 image"):
        open_source(str(video), SourceConfig(crop_px=(40, 0, 32, 32)), CLOCK)


def test_crops_are_parsed_and_checked() -> None:
    assert parse_crop("320,0,320,240") == (320, 0, 320, 240)
    for text in ("1,2,3", "a,b,c,d", "", "1,2,3,4,5", "-1,0,10,10", "0,0,0,10"):
        with pytest.raises(SourceError, match="expected"):
            parse_crop(text)
    for crop in ((0, -1, 5, 5), (0, 0, 5), (0, 0, 5, 0)):
        with pytest.raises(ValueError, match="expected x, y >= 0 and width, height > 0"):
            SourceConfig(crop_px=crop)


def test_a_missing_extra_is_named(video: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setitem(__import__("sys").modules, "cv2", None)
    with pytest.raises(MissingExtraError, match=r"pip install 'surefoot\[video\]'"):
        open_source(str(video), SourceConfig(), CLOCK)


@pytest.mark.data
def test_the_research_data_opens(data_dir: Path) -> None:
    for spec, size in (
        (f"{data_dir}/urfd/falls.npz:fall-01/alphapose", (320, 240)),
        (f"{data_dir}/upfall/subject1_cam1.npz:activity06-trial1-cam1", (320, 240)),
    ):
        frame = open_source(spec, UNPACED, CLOCK).next(NS)
        assert frame is not None
        assert (frame.width, frame.height) == size
