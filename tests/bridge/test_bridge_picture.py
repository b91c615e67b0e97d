"""The picture is drawn from columns alone, whatever is missing in them."""

import numpy as np
import pytest
from demo_stream import LINKS, run
from matplotlib.colors import to_hex

from bridge.config.intervention import InterventionConfig
from bridge.launch.picture import STATE_COLOUR, Labels, Picture, draw, write
from bridge.launch.timeline import Recorder

LABELS = Labels(np.arange(105) / 30, np.repeat(np.array([-1, 0, 1], dtype=np.int8), [60, 30, 15]))


def picture(*, without=(), labels=LABELS, period_s=0.02):
    recorder = Recorder()
    run(recorder, without=without)
    snapshots = [recorder.snapshot(time_s) for time_s in (0.5, 1.5, 2.5)]
    return Picture("a title", recorder.rows(period_s), snapshots, labels, InterventionConfig(), LINKS)


def axes_of(figure, label):
    return next(axes for axes in figure.axes if axes.get_ylabel().startswith(label))


def curve(axes, index=0):
    return np.asarray(axes.lines[index].get_ydata(), dtype=float)


def test_curves_are_the_columns():
    drawn = picture()
    figure = draw(drawn)
    for label, name in (("stiffening", "stiffening"), ("damping", "damping_x"), ("stiffness", "stiffness_x")):
        column = [getattr(row, name) for row in drawn.rows]
        shown = [curve(axes_of(figure, label), index) for index in range(len(axes_of(figure, label).lines))]
        assert any(len(y) == len(column) and np.allclose(y, column, equal_nan=True) for y in shown)


def test_every_panel_shares_the_time_of_the_recording():
    figure = draw(picture())
    limits = [axes.get_xlim() for axes in figure.axes if axes.get_ylabel()]
    assert len(set(limits)) == 1
    assert limits[0] == pytest.approx((0.0, 3.5))


def test_the_states_are_a_coloured_band():
    figure = draw(picture())
    colours = {to_hex(patch.get_facecolor()) for axes in figure.axes for patch in axes.patches}
    assert {STATE_COLOUR[state] for state in ("FOLLOW", "GUARD", "ARREST")} <= colours


def test_one_small_picture_for_each_snapshot():
    figure = draw(picture())
    titles = [axes.get_title() for axes in figure.axes if axes.get_title()]
    assert titles == ["0.5 s", "1.5 s", "2.5 s"]


@pytest.mark.parametrize("silent", ["horizon", "odometry", "command", "wrench"])
def test_a_silent_stream_leaves_its_curve_out(silent):
    stiffening = curve(axes_of(draw(picture(without=(silent,))), "stiffening"), -1)
    assert np.isnan(stiffening).all() == (silent == "command")


def test_without_labels_or_rows_there_is_still_a_picture(tmp_path):
    write(picture(labels=None), tmp_path / "a.png")
    write(Picture("", [], [], None, InterventionConfig(), LINKS), tmp_path / "b.png")
    assert sorted(path.name for path in tmp_path.iterdir()) == ["a.png", "b.png"]


def test_the_file_is_a_small_png(tmp_path):
    write(picture(), tmp_path / "deep" / "timeline.png")
    content = (tmp_path / "deep" / "timeline.png").read_bytes()
    assert content.startswith(b"\x89PNG")
    assert len(content) < 250_000
