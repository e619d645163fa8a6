"""Gear, damper and settings as parameters: described, set at run time, refused with a reason."""

from __future__ import annotations

import json
import math
from itertools import pairwise
from pathlib import Path

import pytest
import yaml

from shimmy_ros.cli.main import main
from shimmy_ros.cycles.settings import ACCURACY_RANGE, BUDGET_RANGE
from shimmy_ros.gear.parameters import Damper, Gear, Limits, ranges

REFERENCE_FILE = Path(__file__).parents[2] / "config" / "reference_gear.yaml"
REFERENCE = yaml.safe_load(REFERENCE_FILE.read_text(encoding="utf-8"))["/**"]["ros__parameters"]
PHYSICAL = {f"{group}.{name}": (REFERENCE[group][name], range_)
            for group, values in (("gear", Gear), ("damper", Damper))
            for name, range_ in ranges(values).items()}
SOLVER = {f"limits.{name}": (getattr(Limits(), name), range_)
          for name, range_ in ranges(Limits).items()} | {
    "accuracy": (0.01, ACCURACY_RANGE), "budget": (1.0, BUDGET_RANGE)}
PARTIES = ("predictor", "simulator")


@pytest.fixture
def bench(both):
    """The bench, after which gear, damper and settings are the reference again."""
    yield both.bench
    for party in PARTIES:
        values = {name: value for name, (value, _) in PHYSICAL.items()}
        settings = {"minimum_velocity": 1.0} | (
            {"harmonics": 4} | {name: value for name, (value, _) in SOLVER.items()}
            if party == "predictor" else {"kick_swivel_rate": 3.0})
        results = both.bench.set_parameters(party, **values, **settings)
        assert all(success for success, _ in results), results


@pytest.mark.parametrize("party", PARTIES)
def test_nodes_start_themselves(both, party):
    both.bench.wait_until(lambda: both.bench.state(party) == "active", f"the {party}")


@pytest.mark.parametrize(("party", "parameters"), [
    ("predictor", PHYSICAL), ("simulator", PHYSICAL), ("predictor", SOLVER)],
    ids=["predictor", "simulator", "solver"])
def test_parameters_are_described_with_unit_and_range(both, party, parameters):
    descriptors = both.bench.call(
        f"{party}/describe_parameters", "rcl_interfaces/srv/DescribeParameters",
        names=list(parameters)).descriptors
    assert len(descriptors) == len(parameters) == {id(PHYSICAL): 19, id(SOLVER): 5}[id(parameters)]
    for descriptor in descriptors:
        _, expected = parameters[descriptor.name]
        (allowed,) = descriptor.floating_point_range
        assert (allowed.from_value, allowed.to_value) == (expected.low, expected.high)
        assert f"[{expected.unit}]" in descriptor.description
        assert not descriptor.read_only
    assert both.bench.get_parameters(party, *parameters) == [
        value for value, _ in parameters.values()]


def test_a_change_of_the_gear_is_answered_for_the_last_velocity(bench, tmp_path, capsys):
    asked = bench.ask(40.0)
    assert bench.set_parameters("predictor", gear__trail=0.1) == [(True, "")]
    answer = bench.await_answer(lambda answer: answer.frequency.data != asked.frequency.data,
                                "an answer to the change")
    assert answer.status.header.stamp == asked.status.header.stamp
    file = tmp_path / "trail.yaml"
    file.write_text("{predictor: {ros__parameters: {gear: {trail: 0.1}}}}")
    assert main(["predict", "--velocity=40", "--json", f"--gear={REFERENCE_FILE}",
                 f"--gear={file}"]) == 0
    expected = json.loads(capsys.readouterr().out)
    assert answer.frequency.data == pytest.approx(expected["frequency"], rel=1e-9)
    assert answer.amplitude.position[1] == pytest.approx(expected["amplitude"]["swivel"], rel=1e-9)


def test_a_change_of_the_damper_is_answered_for_the_last_velocity(bench):
    asked = bench.ask(40.0)
    assert bench.set_parameters("predictor", damper__coulomb_torque=900.0) == [(True, "")]
    answer = bench.await_answer(lambda answer: answer.values["coulomb_torque"] == "900.0",
                                "an answer to the change")
    assert answer.values["outcome"] == "no_limit_cycle"
    assert answer.status.header.stamp == asked.status.header.stamp


REFUSED = {
    "negative mass": ("gear__wheel_mass", -1.0, ("gear.wheel_mass", "-1")),
    "no mass": ("gear__wheel_mass", 0.0, ("gear.wheel_mass", "0.0", "100000")),
    "no number": ("gear__trail", math.nan, ("gear.trail", "nan", "-5")),
    "infinite": ("gear__tyre_lateral_stiffness", math.inf,
                 ("gear.tyre_lateral_stiffness", "inf")),
    "mass matrix": ("gear__wheel_mass", 1000.0, ("gear.wheel_mass", "mass matrix",
                                                 "positive definite", "88 kg m^2")),
    "negative damping": ("damper__linear_damping", -0.5, ("damper.linear_damping", "-0.5")),
    "infinite torque": ("damper__coulomb_torque", math.inf, ("damper.coulomb_torque", "inf")),
    "another type": ("gear__trail", 1, ("gear.trail",)),
    "deletion": ("gear__trail", None, ("gear.trail",)),
    "read-only": ("hardware_id", "another", ("hardware_id",)),
    "minimum velocity": ("minimum_velocity", 0.0, ("minimum_velocity", "0.01")),
}


@pytest.mark.parametrize("party", PARTIES)
@pytest.mark.parametrize("case", REFUSED)
def test_a_bad_value_is_refused_with_a_reason_and_changes_nothing(bench, party, case):
    keyword, value, words = REFUSED[case]
    name = keyword.replace("__", ".")
    before = bench.get_parameters(party, name)
    ((success, reason),) = bench.set_parameters(party, **{keyword: value})
    assert not success
    if case not in ("another type", "deletion", "read-only"):  # refused by rclpy in its own words
        assert all(word in reason for word in words), reason
    assert reason
    assert bench.get_parameters(party, name) == before


def test_what_is_refused_is_not_used(bench):
    asked = bench.ask(40.0)
    for keyword, value, _ in REFUSED.values():
        bench.set_parameters("predictor", **{keyword: value})
    answer = bench.ask(40.0)
    assert answer.frequency.data == pytest.approx(asked.frequency.data, rel=1e-9)


def test_of_a_set_with_one_bad_value_nothing_is_taken(bench):
    parameter = bench.parameter_messages(gear__trail=0.1, gear__wheel_mass=-1.0)
    result = bench.call("predictor/set_parameters_atomically",
                        "rcl_interfaces/srv/SetParametersAtomically", parameters=parameter).result
    assert not result.successful
    assert "gear.wheel_mass" in result.reason
    assert bench.get_parameters("predictor", "gear.trail", "gear.wheel_mass") == [0.08, 25.0]


def test_values_that_fit_only_together_are_taken_together(bench):
    wanted = {"gear__wheel_mass": 100.0, "gear__swivel_inertia": 5.0}
    alone = bench.set_parameters("predictor", gear__wheel_mass=100.0)
    assert not alone[0][0]
    result = bench.call("predictor/set_parameters_atomically",
                        "rcl_interfaces/srv/SetParametersAtomically",
                        parameters=bench.parameter_messages(**wanted)).result
    assert result.successful, result.reason
    assert bench.ask(40.0).values["outcome"] in ("limit_cycle", "no_limit_cycle")
    assert bench.set_parameters("predictor", gear__wheel_mass=25.0)[0][0]


@pytest.mark.parametrize("harmonics", [1, 9])
def test_the_number_of_harmonics_can_be_changed(bench, capsys, harmonics):
    asked = bench.ask(20.0)
    assert bench.set_parameters("predictor", harmonics=harmonics) == [(True, "")]
    # One harmonic is not accurate to 1 %.
    assert bench.set_parameters("predictor", accuracy=0.5) == [(True, "")]
    answer = bench.await_answer(lambda answer: answer.values["harmonics"] == str(harmonics)
                                and answer.values["method"] == "ihb",
                                "an answer with the new number")
    assert answer.status.header.stamp == asked.status.header.stamp
    assert main(["predict", "--velocity=20", "--json", f"--harmonics={harmonics}",
                 "--accuracy=0.5"]) == 0
    expected = json.loads(capsys.readouterr().out)
    assert answer.amplitude.position[1] == pytest.approx(expected["amplitude"]["swivel"], rel=1e-9)


@pytest.mark.parametrize("harmonics", [0, 65])
def test_a_bad_number_of_harmonics_is_refused(bench, harmonics):
    ((success, reason),) = bench.set_parameters("predictor", harmonics=harmonics)
    assert not success
    assert "harmonics" in reason
    assert bench.get_parameters("predictor", "harmonics") == [4]


SOLVER_REFUSED = {
    "no accuracy": ("accuracy", 0.0, ("accuracy", "1e-09", "0.5")),
    "any accuracy": ("accuracy", 0.6, ("accuracy", "0.6", "0.5")),
    "infinite budget": ("budget", math.inf, ("budget", "inf")),
    "no budget": ("budget", 0.0, ("budget", "0.0", "0.001")),
    "no limit": ("limits__swivel", 0.0, ("limits.swivel", "0.0")),
    "no number": ("limits__tyre_deflection", math.nan, ("limits.tyre_deflection", "nan")),
    "negative": ("limits__strut_tilt", -0.1, ("limits.strut_tilt", "-0.1")),
}


@pytest.mark.parametrize("case", SOLVER_REFUSED)
def test_a_bad_setting_of_the_solver_is_refused_with_a_reason(bench, case):
    keyword, value, words = SOLVER_REFUSED[case]
    name = keyword.replace("__", ".")
    ((success, reason),) = bench.set_parameters("predictor", **{keyword: value})
    assert not success
    assert all(word in reason for word in words), reason
    assert bench.get_parameters("predictor", name) == [SOLVER[name][0]]


def test_the_accuracy_counts_at_once(bench, capsys):
    asked = bench.ask(20.0)
    assert bench.set_parameters("predictor", accuracy=1e-4) == [(True, "")]
    assert main(["predict", "--velocity=20", "--json", "--accuracy=1e-4"]) == 0
    expected = json.loads(capsys.readouterr().out)
    assert expected["estimated_error"] <= 1e-4
    assert expected["amplitude"]["swivel"] != pytest.approx(asked.amplitude.position[1], rel=1e-9)
    answer = bench.await_answer(
        lambda answer: answer.amplitude.position[1] == pytest.approx(
            expected["amplitude"]["swivel"], rel=1e-9)
        and (answer.values["method"], answer.values["harmonics"]) == (
            expected["method"], str(expected["harmonics"])), "an answer that is more accurate")
    assert answer.status.header.stamp == asked.status.header.stamp


def test_the_minimum_velocity_counts_at_once(bench):
    bench.ask(40.0)
    for party in PARTIES:
        assert bench.set_parameters(party, minimum_velocity=45.0) == [(True, "")]
    bench.await_answer(lambda answer: answer.values["outcome"] == "not_rolling",
                       "the predictor to call 40 m/s standing")
    bench.await_diagnostic("simulator: motion", lambda status: "stands" in status.message
                           and "45 m/s" in status.message, "the simulator to stand")
    for party in PARTIES:
        assert bench.set_parameters(party, minimum_velocity=1.0) == [(True, "")]
    bench.await_answer(lambda answer: answer.values["outcome"] == "limit_cycle",
                       "the predictor to answer again")
    bench.await_diagnostic("simulator: motion", lambda status: "rolling at 40" in status.message,
                           "the simulator to roll")


@pytest.mark.parametrize("bound", ["low", "high"])
@pytest.mark.parametrize("name", ["damper_inertia", "wheel_radius", "tyre_lateral_stiffness"])
def test_a_gear_at_the_bounds_stops_no_node(both, bench, name, bound):
    bench.ask(40.0)
    for party in PARTIES:
        value = getattr(ranges(Gear)[name], bound)
        assert bench.set_parameters(party, **{f"gear__{name}": value}) == [(True, "")]
    responses = len(bench.received["gear_response"])
    bench.wait_until(lambda: len(bench.received["gear_response"]) > responses + 50,
                     "the simulator to go on")
    assert bench.ask(41.0).values["outcome"] in (
        "limit_cycle", "no_limit_cycle", "unbounded", "not_periodic", "not_converged")
    assert not any(node.ended for node in both.nodes.values())


def test_another_publishing_rate_counts_from_the_next_run(bench):
    def steps_ns():
        begin = len(bench.received["gear_response"])
        bench.wait_until(lambda: len(bench.received["gear_response"]) > begin + 50,
                         "the simulator to go on")
        stamps = [response.header.stamp.sec * 10**9 + response.header.stamp.nanosec
                  for response in bench.received["gear_response"][begin:]]
        return {late - early for early, late in pairwise(stamps)}

    for rate in (1000.0, 50.0):
        assert bench.set_parameters("simulator", publish_rate=rate) == [(True, "")]
        assert steps_ns() == {2_000_000}
    assert bench.change_state("simulator", "deactivate")
    bench.drain("gear_response")
    assert bench.change_state("simulator", "activate")
    assert steps_ns() == {20_000_000}
    assert bench.set_parameters("simulator", publish_rate=500.0) == [(True, "")]


def test_params_files_override_each_other(stage, tmp_path):
    config = REFERENCE_FILE.parent
    own = tmp_path / "own.yaml"
    own.write_text("/**: {ros__parameters: {harmonics: 3, limits: {swivel: 0.3}, "
                   "gear: {trail: 0.09}}}")
    stage.start("predictor", *(word for file in (REFERENCE_FILE, config / "damper_50_10.yaml", own)
                               for word in ("--params-file", str(file))))
    assert stage.bench.get_parameters(
        "predictor", "damper.quadratic_damping", "damper.coulomb_torque", "harmonics",
        "gear.trail", "gear.wheel_mass", "limits.swivel", "limits.strut_tilt") == [
            50.0, 10.0, 3, 0.09, 25.0, 0.3, 0.2]
