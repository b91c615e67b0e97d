"""OUMVLP-Pose as it is published: a folder for each walk, a JSON file for each frame."""

import json

import numpy as np
import pytest

from anticipation.training import oumvlp
from anticipation.training.clips import STABLE
from anticipation.training.samples import clean, cut
from bridge.config.perception import CleaningConfig
from bridge.errors import SourceError
from perception.skeleton import NAMES

OPENPOSE = [  # the 18 keypoints of its COCO model
    "nose", "neck", "r_shoulder", "r_elbow", "r_wrist", "l_shoulder", "l_elbow", "l_wrist", "r_hip", "r_knee",
    "r_ankle", "l_hip", "l_knee", "l_ankle", "r_eye", "l_eye", "r_ear", "l_ear",
]  # fmt: skip
HEIGHT = dict(zip(("shoulder", "elbow", "wrist", "hip", "knee", "ankle"), (300, 380, 440, 480, 600, 720), strict=True))


def frame(number):
    """A person who walks through the image."""
    values = []
    for name in OPENPOSE:
        side, _, part = name.partition("_")
        x = 400 + 8 * number + (12 if side == "l" else -12) + 5 * np.sin(number)
        values += [x, HEIGHT.get(part, 250), 0.8]
    return {"version": 1.1, "people": [{"pose_keypoints_2d": values}]}


def write(folder, frames=range(1, 31), name="{:04d}_keypoints.json"):
    folder.mkdir(parents=True)
    for number in frames:
        (folder / name.format(number)).write_text(json.dumps(frame(number)))


def test_keypoints_come_in_our_order():
    assert [OPENPOSE[index] for index in oumvlp.OURS] == list(NAMES)


@pytest.mark.parametrize("place", ["00001/030_00", "00001/00/030"])
def test_both_layouts_are_read_and_give_windows(tmp_path, place):
    write(tmp_path / "oumvlp" / "alphapose" / place)
    assert oumvlp.is_there(tmp_path, "alphapose")
    assert not oumvlp.is_there(tmp_path, "openpose")
    [clip] = oumvlp.read(tmp_path, "alphapose", 10, seed=0)
    assert (clip.name, clip.group) == ("oumvlp-00001-030-00/alphapose", "oumvlp/00001")
    assert clip.keypoints.shape == (30, 12, 3)
    assert clip.fps == 25.0
    assert (clip.labels == STABLE).all()
    assert np.allclose(clip.keypoints[0, NAMES.index("l_hip"), 1], 480)
    assert clip.keypoints[0, NAMES.index("l_hip"), 0] > clip.keypoints[0, NAMES.index("r_hip"), 0]
    assert len(cut([clean(clip, CleaningConfig())]))


def test_frames_that_are_missing_or_empty_keep_their_time(tmp_path):
    place = tmp_path / "a"
    write(place, [3, 4, 7])
    (place / "0005_keypoints.json").write_text('{"people": []}')
    keypoints = oumvlp.read_sequence(place)
    assert len(keypoints) == 5
    assert np.isfinite(keypoints[:, 0, 0]).tolist() == [True, True, False, False, True]


def test_a_keypoint_that_was_not_found_is_not_at_the_origin(tmp_path):
    content = frame(1)
    content["people"][0]["pose_keypoints_2d"][3 * 4 : 3 * 5] = [0, 0, 0]
    (tmp_path / "0001_keypoints.json").write_text(json.dumps(content))
    keypoints = oumvlp.read_sequence(tmp_path)
    assert np.isnan(keypoints[0, NAMES.index("r_wrist")]).all()
    assert np.isfinite(np.delete(keypoints[0], NAMES.index("r_wrist"), axis=0)).all()


@pytest.mark.parametrize(
    "content",
    ["", "{", "[]", "{}", '{"people": [{}]}', '{"people": 3}', '{"people": [{"pose_keypoints_2d": [1, 2, 3]}]}',
     '{"people": [{"pose_keypoints_2d": ["a"]}]}', b"\xff\xfe\x00"],
)  # fmt: skip
def test_a_malformed_frame_is_named(tmp_path, content):
    path = tmp_path / "0001_keypoints.json"
    path.write_bytes(content if isinstance(content, bytes) else content.encode())
    with pytest.raises(SourceError, match=r"0001_keypoints\.json"):
        oumvlp.read_sequence(tmp_path)


def test_a_folder_without_frames_and_impossible_numbers_are_refused(tmp_path):
    with pytest.raises(SourceError, match="no frame"):
        oumvlp.read_sequence(tmp_path)
    write(tmp_path / "far", [1, 5000])
    with pytest.raises(SourceError, match="limit 1000"):
        oumvlp.read_sequence(tmp_path / "far")
    write(tmp_path / "nameless", [1], name="frame.json")
    with pytest.raises(SourceError, match="frame number"):
        oumvlp.read_sequence(tmp_path / "nameless")
    with pytest.raises(SourceError, match="oumvlp/openpose"):
        oumvlp.read(tmp_path, "openpose", 1, seed=0)


def test_a_few_clips_are_of_many_people(tmp_path):
    for person in ("00001", "00002", "00003"):
        for view in ("000_00", "090_01"):
            write(tmp_path / "oumvlp" / "openpose" / person / view, range(1, 4))
    clips = oumvlp.read(tmp_path, "openpose", 3, seed=0)
    assert len({clip.group for clip in clips}) == 3
    assert len(oumvlp.read(tmp_path, "openpose", 99, seed=0)) == 6
    again = oumvlp.read(tmp_path, "openpose", 3, seed=0)
    assert [clip.name for clip in again] == [clip.name for clip in clips]
