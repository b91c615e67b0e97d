"""A folder of one's own recordings: what is there is used, what cannot be used is named."""

import numpy as np
import pytest
from anticipation_nets import lost, message, nobody
from anticipation_people import falling

from anticipation.training.clips import FALL, STABLE, TRANSIENT, UNLABELLED
from anticipation.training.own import read_own, track_of
from anticipation.training.own_labels import Label, label_track, read_labels
from anticipation.training.samples import cut
from bridge.codec import encode
from bridge.config.perception import CleaningConfig, SourceConfig
from bridge.errors import SourceError
from bridge.record.writer import BagWriter
from bridge.topics import KEYPOINTS
from bridge.transport.interface import Sample
from perception.sources.keypoint_file import clip_names, read_clip


@pytest.fixture
def folder(tmp_path):
    """A fall, a walk at 15 Hz and a clip that nobody labelled."""
    fall, _ = falling(0)
    np.savez(
        tmp_path / "mine.npz",
        **{
            "fall/keypoints": fall, "fall/movenet": fall, "slow/movenet": fall[::2], "slow/fps": 15.0,
            "bare": fall[:40],
        },
    )  # fmt: skip
    (tmp_path / "labels.csv").write_text(
        "clip,onset_s,lying_s,up_s,person\nmine.npz:fall,1.0,2.0,2.8,anna\nmine.npz:slow/movenet,,,,anna\n"
    )
    return tmp_path


def read(folder):
    return read_own(folder, CleaningConfig())


def test_clips_are_those_that_perception_finds(folder):
    own = read(folder)
    assert own.problems == ()
    assert {track.name.partition(":")[2] for track in own.tracks} == set(clip_names(folder / "mine.npz"))
    for track in own.tracks:
        clip = read_clip(folder / "mine.npz", track.name.partition(":")[2], SourceConfig())
        duration_s = (len(clip.keypoints) - 1) / clip.fps_hz
        assert abs(len(track.frames) / 30.0 - duration_s) < 0.1


def test_labels_reach_the_windows(folder):
    fall, slow, bare = (
        next(track for track in read(folder).tracks if name in track.name) for name in ("fall", "slow", "bare")
    )
    assert {STABLE, TRANSIENT, FALL, UNLABELLED} == set(fall.labels)
    assert set(slow.labels) == {STABLE}
    assert set(bare.labels) == {UNLABELLED}
    assert fall.group == slow.group == "own/anna" != bare.group
    assert len(cut([fall]))


def test_label_times_are_those_of_the_ticks():
    labels = label_track(150, Label(1.0, 3.0, 4.0, ""))
    changes = [int(np.argmax(labels == kind)) for kind in (UNLABELLED, TRANSIENT, FALL)]
    assert changes == [30, 60, 90]
    assert (labels[120:] == UNLABELLED).all()
    assert (label_track(60, Label(1.5, 1.8, None, ""))[45:54] == TRANSIENT).all()  # not before the onset


@pytest.mark.parametrize(
    ("content", "says"),
    [
        ("", "columns|clip,onset_s"),
        ("clip,begin\na,1\n", "columns are clip,begin"),
        ("clip,onset_s,lying_s\na,1,x\n", "line 2: lying_s is 'x'"),
        ("clip,onset_s,lying_s\na,2,1\n", "must rise"),
        ("clip,onset_s,lying_s\na,,1\n", "together"),
        ("clip,onset_s,lying_s\na,-1,1\n", "onset_s is '-1'"),
        ("clip,onset_s,lying_s\na,,\na,,\n", "line 3: 'a' was named before"),
        ("clip,onset_s,lying_s\na,1,2,3,4,5\n", "columns"),
        ("clip,onset_s,lying_s\na\n", ""),
    ],
)
def test_a_wrong_list_of_labels_is_named(folder, content, says):
    (folder / "labels.csv").write_text(content)
    problems = "; ".join(read(folder).problems)
    if content in ("", "clip,onset_s,lying_s\na\n"):
        return  # an empty list labels nothing; a short line has no times and no such clip
    with pytest.raises(SourceError, match=says):
        read_labels(folder / "labels.csv")
    assert "labels.csv" in problems


def test_everything_that_cannot_be_used_is_named(folder):
    np.savez(folder / "wrong.npz", **{"a/keypoints": np.zeros((5, 17, 3)), "b/keypoints": np.zeros((5, 12, 3))})
    (folder / "broken.npz").write_bytes(b"PK\x03\x04 and no more")
    (folder / "broken.mcap").write_bytes(b"nothing of the kind")
    with (folder / "labels.csv").open("a") as file:
        file.write("mine.npz:fell,,\nmine.npz:bare,1,99\n")
    problems = read(folder).problems
    for part in ("wrong.npz: 'a/keypoints'", "broken.npz", "broken.mcap", "'mine.npz:fell'; the nearest is", "99.0 s"):
        assert sum(part in problem for problem in problems) == 1, (part, problems)
    assert all("\n" not in problem for problem in problems)
    assert "mine.npz:fall" in {track.name for track in read(folder).tracks}


def test_an_empty_folder_and_none_are_said(tmp_path):
    (tmp_path / "labels.csv").write_text("clip,onset_s,lying_s\n")
    assert "no recording" in read(tmp_path).problems[0]
    with pytest.raises(SourceError, match="--own"):
        read(tmp_path / "nowhere")


def test_a_recording_is_learnt_from_as_it_ran(tmp_path):
    (tmp_path / "labels.csv").write_text("clip,onset_s,lying_s\nwalk.mcap,,\n")
    messages = [message(tick) for tick in range(40)]
    messages[12:14] = [lost(12, [3]), nobody(13)]
    del messages[20]
    writer = BagWriter(tmp_path / "walk.mcap", "surefoot", [KEYPOINTS])
    for number, each in enumerate(messages):
        sample = Sample(encode(KEYPOINTS, each), number, b"p", each.stamp_ns + 1_000_000)
        writer.write(KEYPOINTS, sample)
    writer.finish()
    own = read(tmp_path)
    assert own.problems == ()
    [track] = own.tracks
    assert len(track.frames) == 40
    assert np.flatnonzero(~track.whole).tolist() == [12, 13, 20]
    assert np.allclose(track.frames[0, :12], track.frames[39, :12])
    assert (track.labels == STABLE).all()


def test_messages_out_of_order_are_put_in_order_and_a_long_gap_is_refused():
    track = track_of([message(3), message(0), message(1)], "walk")
    assert track.whole.tolist() == [True, True, False, True]
    with pytest.raises(SourceError, match="gap"):
        track_of([message(0), message(5000)], "walk")
