"""Limit cycles of the gear to a requested accuracy."""

import json
from pathlib import Path

import numpy as np
import pytest

from shimmy_ros.cycles.settings import BALANCE, SHOOTING, Settings
from shimmy_ros.cycles.stable_cycle import stable_cycle
from shimmy_ros.gear.parameter_file import reference_parameters
from shimmy_ros.gear.parameters import ParameterError, changed
from shimmy_ros.gear.system import OperatingPoint
from shimmy_ros.ihb.solution import Outcome

GEAR, DAMPER = reference_parameters()
CASES = json.loads(
    (Path(__file__).parents[1] / "data" / "limit_cycles.json").read_text(encoding="utf-8"))["cases"]
# Of the reference itself.
INTEGRATION = 2e-5


def at(velocity, quadratic_damping, coulomb_torque):
    return OperatingPoint(GEAR, changed(DAMPER, quadratic_damping=quadratic_damping,
                                        coulomb_torque=coulomb_torque), velocity)


def deviation(orbit, case):
    return max(float(np.max(np.abs(orbit.amplitude / case["amplitude"] - 1.0))),
               abs(orbit.frequency_hz / case["frequency"] - 1.0))


@pytest.mark.parametrize("accuracy", [1e-2, 1e-3])
def test_every_case_is_as_accurate_as_asked_for_and_as_estimated(accuracy):
    methods = set()
    for case in CASES:
        answer = stable_cycle(
            at(case["taxi_velocity"], case["quadratic_damping"], case["coulomb_torque"]),
            Settings(accuracy=accuracy))
        assert answer.outcome is Outcome.LIMIT_CYCLE
        assert answer.orbit.error <= accuracy
        assert deviation(answer.orbit, case) <= answer.orbit.error + INTEGRATION, case
        methods.add((answer.orbit.method, answer.orbit.harmonics))
    # The accuracy decides on the method, and no more harmonics are used than needed.
    assert (BALANCE, 4) in methods
    assert (SHOOTING, 0) in methods
    assert methods <= {(BALANCE, 4), (BALANCE, 8), (BALANCE, 16), (SHOOTING, 0)}


@pytest.mark.parametrize("accuracy", [3e-2, 1e-2, 1e-3])
def test_as_few_harmonics_as_will_do_are_used(accuracy):
    for case in CASES[::3]:
        point = at(case["taxi_velocity"], case["quadratic_damping"], case["coulomb_torque"])
        answer = stable_cycle(point, Settings(accuracy=accuracy)).orbit
        fewer = [number for number in (4, 8) if number < (answer.harmonics or 5)]
        for harmonics in fewer:
            balanced = stable_cycle(point, Settings(harmonics, method=BALANCE)).orbit
            assert balanced.error > accuracy


def test_the_friction_dominated_corner_reaches_a_thousandth():
    case = next(item for item in CASES if (
        item["quadratic_damping"], item["coulomb_torque"], item["taxi_velocity"]) == (50, 10, 10))
    answer = stable_cycle(at(10.0, 50.0, 10.0), Settings(accuracy=1e-3))
    assert deviation(answer.orbit, case) < 5e-5
    assert answer.orbit.method == SHOOTING


def test_a_cycle_that_sticks_is_found():
    answer = stable_cycle(at(10.0, 50.0, 20.0), Settings(accuracy=1e-3))
    assert answer.outcome is Outcome.LIMIT_CYCLE
    assert answer.orbit.sticks
    assert answer.orbit.stable


def test_what_the_balance_takes_for_a_cycle_beyond_the_fold_is_none():
    assert stable_cycle(at(40.0, 10.0, 164.0)).outcome is Outcome.NO_LIMIT_CYCLE
    assert stable_cycle(at(40.0, 10.0, 163.6)).outcome is Outcome.LIMIT_CYCLE


@pytest.mark.parametrize("point", [
    at(4.0, 10.0, 20.0), at(4.0, 10.0, 0.0), at(40.0, 10.0, 400.0)])
def test_no_limit_cycle_is_an_answer(point):
    answer = stable_cycle(point, Settings(accuracy=1e-3))
    assert answer.outcome is Outcome.NO_LIMIT_CYCLE
    assert answer.orbit is None
    assert answer.message.startswith("no limit cycle")


@pytest.mark.parametrize("accuracy", [0.0, -1.0, 0.51, float("nan"), "1"])
def test_bad_accuracies_are_refused(accuracy):
    with pytest.raises(ParameterError, match=r"accuracy is .*, but must be .*\[1e-09, 0\.5\]"):
        stable_cycle(at(40.0, 10.0, 20.0), Settings(accuracy=accuracy))
