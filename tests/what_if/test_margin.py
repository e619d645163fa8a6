"""Margins: the nearest folds, with a limit cycle and without one."""

from __future__ import annotations

import pytest

PARAMETERS = ["taxi_velocity", "linear_damping", "quadratic_damping", "coulomb_torque"]


@pytest.fixture(scope="module")
def with_a_cycle(present):
    return margin_at(present, {"return": "margin"})


@pytest.fixture(scope="module")
def without_one(present):
    return margin_at(present, {"return": "margin", "coulomb_torque": 250.0})


def margin_at(present, content):
    from shimmy_ros.what_if.evaluate import evaluate
    from shimmy_ros.what_if.reading import read_query

    (point,) = [item for item in evaluate(read_query(content, present, 10)) if item is not None]
    return point["margin"]


def test_with_a_limit_cycle_the_folds_end_it(with_a_cycle):
    assert (with_a_cycle["outcome"], with_a_cycle["message"]) == ("limit_cycle", "")
    folds = with_a_cycle["folds"]
    assert list(folds) == PARAMETERS
    assert [folds[name]["value"] for name in PARAMETERS] == [40.0, 2.0, 10.0, 20.0]
    # The velocity at which shimmy begins on the reference gear, and none at which it ends.
    assert folds["taxi_velocity"]["below"] == pytest.approx(6.892, abs=0.01)
    assert folds["taxi_velocity"]["above"] is None
    for name in PARAMETERS[1:]:
        assert folds[name]["below"] is None
        assert folds[name]["above"] > folds[name]["value"]
        assert folds[name]["distance"] == folds[name]["above"] - folds[name]["value"]
    assert folds["taxi_velocity"]["distance"] == 40.0 - folds["taxi_velocity"]["below"]
    assert folds["taxi_velocity"]["searched"] == [1.0, 200.0]


def test_folds_depend_on_friction_times_quadratic_damping(with_a_cycle, points):
    (point,) = points({"find": {"smallest": "quadratic_damping", "below": 0}})
    folds = with_a_cycle["folds"]
    assert folds["quadratic_damping"]["above"] == pytest.approx(point["find"]["value"], rel=1e-6)
    assert folds["coulomb_torque"]["above"] / 20.0 == pytest.approx(
        folds["quadratic_damping"]["above"] / 10.0, rel=1e-12)


def test_without_a_limit_cycle_the_folds_begin_one(without_one, with_a_cycle):
    assert (without_one["outcome"], without_one["message"]) == ("no_limit_cycle", "")
    folds = without_one["folds"]
    # The same fold from the other side.
    assert folds["coulomb_torque"]["below"] == pytest.approx(
        with_a_cycle["folds"]["coulomb_torque"]["above"], rel=1e-6)
    assert folds["coulomb_torque"]["above"] is None
    assert folds["quadratic_damping"]["below"] == pytest.approx(
        10.0 * folds["coulomb_torque"]["below"] / 250.0, rel=1e-12)
    # Friction that is enough at 40 m/s is not at 100.
    assert 40.0 < folds["taxi_velocity"]["above"] < 100.0
    assert folds["taxi_velocity"]["below"] is None


def test_the_velocity_at_which_shimmy_begins_is_the_fold(without_one, points):
    velocity = without_one["folds"]["taxi_velocity"]["above"]
    found = points({"taxi_velocity": [0.98 * velocity, 1.02 * velocity], "coulomb_torque": 250.0,
                    "accuracy": 0.01})
    assert [point["limit_cycle"]["outcome"] for point in found] == ["no_limit_cycle", "limit_cycle"]


def test_without_friction_or_quadratic_damping_nothing_scales(present):
    for parameter in ("coulomb_torque", "quadratic_damping"):
        folds = margin_at(present, {"return": "margin", parameter: 0.0})["folds"]
        assert folds["quadratic_damping"]["distance"] is None


def test_a_standing_tyre_has_no_margin(points):
    (point,) = points({"taxi_velocity": 0.5, "return": ["margin", "trigger", "all_cycles"]})
    assert {point[name]["outcome"] for name in ("margin", "trigger", "all_cycles")} == {
        "not_rolling"}
