"""The picture of a run is drawn whatever the run holds."""

from __future__ import annotations

import numpy as np
import pytest
from matplotlib.figure import Figure
from matplotlib.image import imread

from shimmy_ros.report import picture
from shimmy_ros.report.comparison import compare
from shimmy_ros.report.picture import draw_run
from shimmy_ros.report.recording import read_recording


def drawn(run, made_up, directory):
    """The pixels of the picture of a run."""
    directory.mkdir(exist_ok=True)
    recording = read_recording(run.write(directory / "bag"), made_up.namespace)
    draw_run(recording, compare(recording), "a made-up run", directory / "run.png")
    pixels = imread(directory / "run.png")
    assert pixels.ndim == 3
    assert min(pixels.shape[:2]) > 600
    return pixels


def colourful(pixels, red, green, blue):
    """How many pixels have a colour, given in [0, 255]."""
    return int((np.abs(255.0 * pixels[..., :3] - [red, green, blue]) < 8.0).all(axis=2).sum())


def test_a_run_shows_what_was_measured_and_predicted(made_up, tmp_path):
    pixels = drawn(made_up.landing(), made_up, tmp_path)
    assert colourful(pixels, 31, 119, 180) > 100  # predicted: tab:blue
    assert colourful(pixels, 255, 127, 14) > 100  # measured: tab:orange


SHADES = {"unbounded": (214, 39, 40), "beyond the model's limits": (255, 215, 0),
          "not periodic": (148, 103, 189), "not converged": (140, 86, 75)}


def test_answers_that_are_no_ordinary_ones_are_shaded_and_named(made_up, tmp_path):
    pixels = drawn(made_up.perilous(), made_up, tmp_path)
    plain = drawn(made_up.landing(), made_up, tmp_path / "plain")
    for colour in SHADES.values():
        shade = [255.0 - 0.25 * (255.0 - part) for part in colour]
        assert colourful(pixels, *shade) > 5000
        assert colourful(plain, *shade) < 500


def test_what_is_no_number_is_not_plotted(made_up, tmp_path, monkeypatch):
    figures = []
    monkeypatch.setattr(picture, "Figure", lambda **settings: figures.append(
        Figure(**settings)) or figures[-1])
    drawn(made_up.perilous(), made_up, tmp_path)
    axes = figures[0].axes
    for axis in axes:
        assert np.isfinite(axis.get_ylim()).all()
        for line in axis.lines:
            assert not np.isinf(line.get_ydata()).any()
    over_time, over_velocity = axes[2], axes[3]
    # 1 s of shimmy, 1 s beyond the limits; then the bounds, dashed.
    shown = over_time.lines[0].get_ydata()
    assert np.isfinite(shown).tolist() == 20 * [True] + 31 * [False]
    names = {text.get_text() for text in over_velocity.get_legend().get_texts()}
    assert names == {"predicted", "measured, cycle by cycle", "predicted bounds, not periodic",
                     *SHADES}


def only_velocity(run):
    run.velocity(0.0, 40.0)
    run.velocity(1.0, 41.0)


def only_standing(run):
    only_velocity(run)
    run.answer(0.5, np.nan, np.nan)


def only_no_limit_cycle(run):
    only_velocity(run)
    run.answer(0.5, 0.0, np.nan)


def only_motion(run):
    only_velocity(run)
    run.swivel(np.arange(0.0, 1.0, 0.002), 0.1, 10.0)


def only_unbounded(run):
    only_velocity(run)
    run.answer(1.0, np.inf)


def only_not_periodic(run):
    only_velocity(run)
    run.answer(0.5, 0.3, outcome="not_periodic")


def only_a_change(run):
    run.add("damper/coulomb_torque", 1.0, 15.0)


@pytest.mark.parametrize("fill", [lambda run: None, only_velocity, only_standing,
                                  only_no_limit_cycle, only_unbounded, only_not_periodic,
                                  only_motion, only_a_change])
def test_a_run_in_which_something_is_missing(made_up, tmp_path, fill):
    run = made_up.Run()
    fill(run)
    drawn(run, made_up, tmp_path)


def test_a_place_that_cannot_be_written(made_up, tmp_path):
    recording = read_recording(made_up.landing().write(tmp_path / "bag"), made_up.namespace)
    with pytest.raises(OSError, match="nowhere"):
        draw_run(recording, compare(recording), "", tmp_path / "nowhere" / "run.png")
