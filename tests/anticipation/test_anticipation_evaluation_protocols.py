"""Who learns from what and is tested on what, with networks that are never trained."""

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from anticipation_nets import random_checkpoint
from anticipation_people import walking
from anticipation_records import alarmed, clip_of, seen
from rich.progress import Progress

from anticipation import checkpoint as checkpoints
from anticipation.training.clips import Clip
from anticipation.training.corpus import Corpus
from anticipation.training.evaluation import protocols
from anticipation.training.evaluation.calibration import cross_fitted
from anticipation.training.evaluation.protocols import Study, cross, grouped, observed, paper
from anticipation.training.evaluation.recordings import Recording
from anticipation.training.evaluation.records import Record
from anticipation.training.plan import RecipeName, plan_for
from anticipation.training.samples import clean, cut
from bridge.config.perception import CleaningConfig
from bridge.config.surefoot import SurefootConfig
from bridge.errors import SourceError


def mocap(number):
    points = walking(number)[:, :, [1, 2]] * [100, -100] + [160, 200]
    keypoints = np.concatenate([points, np.full((len(points), 12, 1), 0.9)], axis=-1)
    labels = np.zeros(len(points), dtype=np.int64)
    return Clip(f"01_0{number}/camera-{number}", f"cmu/{number}", keypoints, 30.0, labels, 320, 240, "cmu", "made")


@pytest.fixture(scope="module")
def recordings():
    """Four URFD falls tracked twice, three UP-Fall falls, three daily clips, one of eight points, two kept walks."""
    falls = [
        clip_of(number, f"fall-0{number}/{estimator}", group=f"urfd/fall-0{number}")
        for estimator in ("alphapose", "movenet")
        for number in range(4)
    ]
    staged = [clip_of(number, f"activity0{number}-trial1-cam1", "UP-Fall") for number in (1, 2, 3)]
    daily = [clip_of(number, f"activity0{number}-trial1-cam1", "UP-Fall") for number in (6, 7, 8)]
    partial = clip_of(9, "seg00_adl-01/eight")
    return [
        *(Recording(clip, "fall") for clip in falls),
        *(Recording(clip, "staged") for clip in staged),
        *(Recording(clip, "daily") for clip in daily),
        Recording(partial, "partial"),
        *(Recording(mocap(number), "walk") for number in (1, 2)),
    ]


@pytest.fixture
def study(recordings, tmp_path, monkeypatch):
    """A study that notes from which clips each checkpoint is made, instead of making it."""

    def tracks(kind):
        return tuple(clean(each.clip, CleaningConfig()) for each in recordings if each.kind == kind)

    learnt = []

    def fitted(corpus, chosen, known, *rest, **options):
        learnt.append({track.name for track in chosen})
        assert sum(len(samples) for samples, _ in (*known.motion, *known.gait)) > 0
        return random_checkpoint(len(learnt))

    def examined(checkpoint, shifted, rivals, recordings, part):
        return [
            Record(clip.name, clip.group, clip.source, kind, part, seen(clip, confidence=0.99, wrong=0.3))
            for clip, kind in recordings
        ]

    monkeypatch.setattr(protocols, "fold_checkpoint", fitted)
    monkeypatch.setattr(protocols, "examine", examined)
    monkeypatch.setattr(protocols.networks, "pretrained_forecaster", lambda *rest, **options: None)
    monkeypatch.setattr(protocols, "watch", lambda clips, *rest: [alarmed(clip.labels, 40) for clip in clips])
    walks = (clean(mocap(3), CleaningConfig()),)
    corpus = Corpus(tracks("fall"), tracks("staged"), tracks("daily"), walks, tracks("walk"))
    plan = plan_for(RecipeName.SUREFOOT, 0, True)
    made = Study(corpus, recordings, plan, 0, tmp_path, SurefootConfig(), Progress(disable=True), baselines=False)
    return made, learnt


def group_of(recordings):
    return {each.clip.name: each.clip.group for each in recordings}


def test_grouped_tests_everything_once_by_who_has_not_seen_its_group(study):
    made, learnt = study
    found = grouped(made, 2)
    assert sorted(record.name for record in found.records) == sorted(each.clip.name for each in made.recordings)
    groups = group_of(made.recordings)
    for record in found.records:
        assert record.group not in {groups[name] for name in learnt[record.part]}
        assert (record.ticks is not None) == (record.kind in {"fall", "staged"})
        assert record.frames is not None
    assert {record.part for record in found.records if record.kind == "walk"} == {0, 1}
    for part in (1, 2):
        assert Path(made.folder / f"grouped-{part}.safetensors").is_file()


def test_temperatures_in_the_checkpoints_come_from_the_other_part(study):
    made, _ = study
    found = grouped(made, 2)
    for part, expected in enumerate(cross_fitted(found.of("fall"), 2, "alphapose")):
        stored = checkpoints.load(made.folder / f"grouped-{part + 1}.safetensors").temperature
        assert stored == pytest.approx(expected)
        assert (stored != 1).any()


def test_cross_learns_one_data_set_and_tests_the_other(study):
    made, learnt = study
    found = cross(made)
    source = {each.clip.name: each.clip.source for each in made.recordings}
    assert [{source[name] for name in names} for names in learnt] == [{"URFD"}, {"UP-Fall"}]
    for record in found.records:
        assert record.source == ("UP-Fall", "URFD")[record.part]
    assert {record.kind for record in found.records} == {"fall", "staged", "daily", "partial"}


def test_paper_tests_a_fifth_of_the_windows_of_recordings_that_were_learnt(study):
    made, learnt = study
    found = paper(made)
    assert {record.name for record in found.records} <= learnt[0]
    windows = cut([track for track in made.corpus.falls if track.name.endswith("alphapose")])
    tested = sum(int(record.ticks.tested.sum()) for record in found.records)
    assert tested == len(windows) - round(0.8 * len(windows))


def test_the_live_pass_again_keeps_what_was_said_and_replaces_what_was_done(study, monkeypatch):
    made, _ = study
    found = grouped(made, 2)
    used = []

    def watched(clips, path, *rest):
        used.append(path.name)
        return [alarmed(clip.labels, 70) for clip in clips]

    monkeypatch.setattr(protocols, "watch", watched)
    again = observed(found, made)
    assert used == ["grouped-1.safetensors", "grouped-2.safetensors"]
    before, after = ({record.name: record for record in each.records} for each in (found, again))
    assert before.keys() == after.keys()
    for name, record in after.items():
        assert record.part == before[name].part
        assert (record.frames.state != before[name].frames.state).any()
        if record.ticks is not None:
            assert record.ticks is before[name].ticks


@pytest.mark.parametrize("protocol", [lambda made: grouped(made, 2), cross], ids=["grouped", "cross"])
def test_a_live_pass_made_later_is_the_one_that_was_left_out(study, protocol):
    """Clips without falls are in no record until the whole system was run over them."""
    made, _ = study
    at_once = protocol(made)
    later = observed(protocol(replace(made, live=False)), made)
    parts = {record.name: (record.part, record.kind) for record in at_once.records}
    assert {record.name: (record.part, record.kind) for record in later.records} == parts
    assert all(record.frames is not None for record in later.records)


def test_a_live_pass_by_the_papers_protocol_is_refused(study):
    made, _ = study
    with pytest.raises(SourceError, match="every clip was learnt from in part"):
        observed(paper(made), made)


def test_a_live_pass_over_other_walks_than_the_networks_know_is_refused(study):
    made, _ = study
    found = grouped(made, 2)
    larger = replace(made, plan=plan_for(RecipeName.SUREFOOT, 0, False))
    with pytest.raises(SourceError, match="know 8 clips of motion capture, this command reads 600: .*--quick again"):
        observed(found, larger)
