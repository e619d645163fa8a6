"""What ends a node at its start: one sentence and a status of failure."""

from __future__ import annotations

from pathlib import Path

import pytest

WRONG = {
    "negative": ("predictor", "damper.linear_damping:=-1.0", "damper.linear_damping", "-1"),
    "mass matrix": ("simulator", "gear.wheel_mass:=1000.0", "gear.wheel_mass",
                    "positive definite"),
    "no number": ("predictor", "gear.trail:=.nan", "gear.trail", "nan"),
    "whole number for a double": ("simulator", "gear.trail:=1", "gear.trail", "1"),
    "setting": ("predictor", "autostart:=5", "autostart", "5"),
    "empty": ("simulator", "hardware_id:=''", "hardware_id", "empty"),
    "misspelt": ("predictor", "gear.trial:=0.1", "gear.trial", "gear.trail"),
    "minimum velocity": ("simulator", "minimum_velocity:=0.001", "minimum_velocity", "0.01"),
    "harmonics": ("predictor", "harmonics:=0", "harmonics", "0", "64"),
    "accuracy": ("predictor", "accuracy:=0.9", "accuracy", "0.9", "0.5"),
    "budget": ("predictor", "budget:=0.0", "budget", "0.001"),
    "limit": ("predictor", "limits.swivel:=7.0", "limits.swivel", "7", "rad"),
    "misspelt limit": ("predictor", "limits.tilt:=0.1", "limits.tilt", "limits.strut_tilt"),
    "rate": ("simulator", "publish_rate:=1e6", "publish_rate", "1000000", "5000"),
}

BAGS = ("directory", "file", "no permission")
PARAMS_FILES = {"missing": None, "no parameters": "gear: 3"}


def bag_of(case, directory):
    """A place where no bag can be made."""
    bag = directory / f"{case} bag"
    if case == "directory":
        bag.mkdir()
    elif case == "file":
        bag.write_text("precious")
    else:
        bag = Path("/proc/nobody/may/make/this")
    return bag


def params_file_of(case, directory):
    """A params file that is none."""
    file = directory / f"{case}.yaml"
    if PARAMS_FILES[case] is not None:
        file.write_text(PARAMS_FILES[case])
    return file


@pytest.fixture(scope="module")
def started(module_stage):
    """All of them, started at once; each case is a node and what it was given."""
    stage, directory = module_stage, module_stage.directory
    nodes = {("value", case): (stage.start(party, "-p", given), given)
             for case, (party, given, *_) in WRONG.items()}
    for case in BAGS:
        bag = bag_of(case, directory)
        nodes["bag", case] = stage.start("simulator", "-p", f"bag_directory:='{bag}'"), bag
    for case in PARAMS_FILES:
        file = params_file_of(case, directory)
        nodes["file", case] = stage.start("predictor", "--params-file", str(file)), file
    return nodes


@pytest.mark.parametrize("case", WRONG)
def test_a_wrong_value_is_named(started, case):
    node, _ = started["value", case]
    assert node.wait() == 2, node.log()
    (sentence,) = node.log().splitlines()
    assert all(word in sentence for word in WRONG[case][2:]), sentence


@pytest.mark.parametrize("case", PARAMS_FILES)
def test_a_params_file_that_is_none_is_named(started, case):
    node, file = started["file", case]
    assert node.wait() == 2, node.log()
    assert str(file) in node.log()
    assert "Traceback" not in node.log()


@pytest.mark.parametrize("case", BAGS)
def test_a_bag_that_cannot_be_made_is_named(started, case):
    node, bag = started["bag", case]
    assert node.wait() == 1, node.log()
    assert f"could not activate: bag {bag}" in node.log()
    assert "Traceback" not in node.log()
    assert case != "file" or bag.read_text() == "precious"
