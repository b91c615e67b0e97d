"""Planes beside the shipped one."""

import numpy as np
import pytest
from anticipation_nets import random_checkpoint
from anticipation_people import walking
from anticipation_records import clip_of

from anticipation.motion import WINDOW
from anticipation.training.clips import Clip
from anticipation.training.corpus import Corpus
from anticipation.training.evaluation.rivals import fit_rivals
from anticipation.training.samples import clean, cut
from bridge.config.perception import CleaningConfig


@pytest.fixture(scope="module")
def corpus():
    falls = tuple(clean(clip_of(number), CleaningConfig()) for number in range(4))
    staged = tuple(
        clean(clip_of(number, f"activity0{number}-trial1-cam1", "UP-Fall"), CleaningConfig()) for number in (1, 2)
    )
    points = walking(0)[:, :, [1, 2]] * [100, -100] + [160, 200]
    keypoints = np.concatenate([points, np.full((len(points), 12, 1), 0.9)], axis=-1)
    walk = Clip("w", "w", keypoints, 30.0, np.zeros(len(points), dtype=np.int64), 320, 240, "cmu", "made")
    return Corpus(falls, staged, (), (clean(walk, CleaningConfig()),), ())


def test_every_plane_knows_the_falls_it_was_fitted_to_and_none_needs_more_than_a_window(corpus):
    rivals = fit_rivals(random_checkpoint(), corpus, corpus.falls, 0)
    assert {rival.name for rival in rivals} == {
        f"{way}, {of}" for way in ("PCA", "LDA") for of in ("window", "folded window", "DGNN embedding")
    }
    samples = cut(corpus.falls)
    windows, labels = samples.frames[:, :WINDOW], samples.labels[:, 0]
    for rival in rivals:
        judged = rival.judge(windows)
        assert judged.shape == (len(windows), 2)
        assert np.isfinite(judged).all()
        distance, region = judged.T
        assert ((distance <= 0) == (region == 2)).mean() > 0.99  # inside of the boundary is the fall region
        assert (region == labels).mean() > 0.7, rival.name
    assert len(rivals[0].judge(windows[:1])) == 1


def test_planes_are_fitted_to_the_chosen_people_alone(corpus):
    windows = cut(corpus.falls).frames[:, :WINDOW]
    one, other, again = (
        fit_rivals(random_checkpoint(), corpus, chosen, 0)[0].judge(windows)
        for chosen in (corpus.falls[:2], corpus.staged, corpus.falls[:2])
    )
    assert (one == again).all()
    assert (one != other).any()
