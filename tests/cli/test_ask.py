"""``shimmy ask``: tables and JSON, exit status, refusals; here, and by a predictor that runs."""

from __future__ import annotations

import io
import json
import math
import sys

import pytest

from shimmy_ros.cli import ask
from shimmy_ros.cli.main import main
from shimmy_ros.resources import resource_directory


@pytest.fixture
def run(capsys):
    """Exit status, output and errors of ``shimmy ask`` with these arguments."""
    def command(*arguments):
        status = main(["ask", *arguments])
        captured = capsys.readouterr()
        return status, captured.out, captured.err

    return command


@pytest.fixture
def answer(run):
    """The answer to a query, as JSON."""
    def command(query, *arguments):
        status, out, err = run(json.dumps(query), "--json", *arguments)
        assert (status, err) == (0, "")
        return json.loads(out)

    return command


def rows(out):
    """The cells of a table's lines, by their columns' headings, which are at their right ends."""
    head, *lines = out.rstrip("\n").split("\n")
    ends = [index for index in range(1, len(head) + 1)
            if head[index - 1] != " " and head[index:index + 2] in ("", "  ")]
    bounds = list(zip([0, *ends], ends, strict=False))
    names = [head[begin:end].strip() for begin, end in bounds]
    return [dict(zip(names, (line[begin:end].strip() for begin, end in bounds), strict=True))
            for line in lines]


def test_a_table_has_a_row_for_each_point_in_the_order_of_the_query(run):
    status, out, err = run("{taxi_velocity: [40, 20, 60], coulomb_torque: [5, 900]}")
    assert (status, err) == (0, "")
    table = rows(out)
    assert [(row["taxi velocity"], row["coulomb torque"]) for row in table] == [
        (velocity, torque) for velocity in ("40", "20", "60") for torque in ("5", "900")]
    assert [row["outcome"] for row in table] == ["limit cycle", "no limit cycle"] * 3
    assert float(table[0]["swivel [deg]"]) == pytest.approx(7.105, rel=1e-3)
    assert table[1]["swivel [deg]"] == table[1]["error"] == "-"
    assert 0.0 < float(table[0]["error"]) < 0.1


def test_json_has_all_of_the_answer(run, answer, capsys):
    result = answer({"id": "a", "taxi_velocity": {"from": 20, "to": 90, "points": 300}})
    assert (result["id"], result["state"], result["done"], result["of"]) == (
        "a", "complete", 300, 300)
    assert [point["index"] for point in result["points"]] == list(range(300))
    assert result["inputs"]["coulomb_torque"] == 20.0
    assert main(["predict", "--velocity=90", "--json"]) == 0
    predicted = json.loads(capsys.readouterr().out)
    assert result["points"][-1]["limit_cycle"]["amplitude"]["swivel"] == pytest.approx(
        predicted["amplitude"]["swivel"], rel=1e-9)


def test_what_the_query_does_not_name_is_on_the_command_line(answer):
    inputs = answer({}, "--velocity=33", "--coulomb-torque=7", "--harmonics=2",
                    "--minimum-velocity=2")["inputs"]
    assert [inputs[name] for name in (
        "taxi_velocity", "coulomb_torque", "harmonics", "minimum_velocity")] == [33.0, 7.0, 2, 2.0]


def test_accuracy_and_limits_are_on_the_command_line(answer, tmp_path):
    limits = tmp_path / "limits.yaml"
    limits.write_text("/**:\n  ros__parameters:\n    limits:\n      swivel: 0.1\n")
    gear = resource_directory("config") / "reference_gear.yaml"
    damper = next(resource_directory("config").glob("damper_*.yaml"))
    inputs = answer({}, "--velocity=33", "--accuracy=0.001", f"--gear={gear}", f"--gear={damper}",
                    f"--gear={limits}")["inputs"]
    assert inputs["accuracy"] == 0.001
    assert inputs["limits"] == {"swivel": 0.1, "strut_tilt": 0.2, "tyre_deflection": 0.3}


def test_a_query_may_come_from_standard_input(run, monkeypatch):
    monkeypatch.setattr("sys.stdin", io.StringIO("taxi_velocity: 40\n"))
    status, out, _ = run("-")
    assert (status, len(rows(out))) == (0, 1)


def test_a_value_is_found(run):
    status, out, _ = run("{taxi_velocity: 40, find: {smallest: quadratic_damping, below: 4 deg}}")
    wanted, table = out.split("\n\n")
    assert wanted == ("Smallest quadratic damping for which the swivel stays below 4 deg; "
                      "looked for from 0 to 1000 N m s^2/rad^2.")
    (row,) = rows(table)
    assert (status, row["outcome"], row["decided by"], row["at [m/s]"]) == (
        0, "found", "amplitude", "40")
    assert float(row["swivel [deg]"]) == pytest.approx(4.0, rel=1e-5)
    assert float(row["change"]) == pytest.approx(float(row["value"]) - 10.0, rel=1e-5)


def test_what_is_looked_for_is_said(run):
    query = "{{taxi_velocity: {{from: 30, to: 40}}, find: {{{}}}}}"
    _, out, _ = run(query.format("largest_loss: trail, amplitude: tyre_lateral, below: 1"))
    assert out.startswith("Largest loss of trail for which the tyre lateral stays below 1 m at all "
                          "taxi velocities from 30 to 40 m/s; looked for from 0.04 to 0.08 m.\n")
    _, out, _ = run(query.format("smallest: linear_damping, below: 0, between: [500, 600]"))
    assert out.startswith("Smallest linear damping for which there is no limit cycle at all taxi ")
    assert "at range end" in out


def test_cycles_triggers_and_margins_have_tables_of_their_own(run):
    status, out, _ = run("{taxi_velocity: 60, quadratic_damping: 20, coulomb_torque: 15, "
                         "return: [limit_cycle, all_cycles, trigger, margin]}")
    assert status == 0
    limit_cycle, all_cycles, trigger, margin = (rows(table) for table in out.split("\n\n"))
    assert [row["outcome"] for row in limit_cycle] == ["limit cycle"]
    assert [row["outcome"] for row in all_cycles][:2] == ["trigger", "stable"]
    assert all_cycles[0]["beyond the gear"] == "no"
    assert trigger[0]["starts"] == "disturbance"
    assert trigger[0]["leads to"] == "limit cycle"
    assert "beyond limits" not in limit_cycle[0]
    assert all_cycles[-1]["beyond limits"] == "strut tilt, swivel, tyre deflection"
    assert float(trigger[0]["kick [rad/s]"]) > 0.0
    assert [row["parameter"] for row in margin] == [
        "taxi_velocity", "linear_damping", "quadratic_damping", "coulomb_torque"]
    assert float(margin[3]["fold above"]) == pytest.approx(90.11, rel=1e-3)


@pytest.mark.parametrize(("query", "words"), [
    ("{taxi_velocity: 300}", "(at taxi_velocity): taxi_velocity is 300, but must be in [0, 200]"),
    ('{"taxi_velocity": 40', "(at line 1, column 21): the query is no JSON"),
    ("", "the query is empty"), ("{}", "taxi_velocity is missing"),
    ("{velocity: 3}", "did you mean taxi_velocity?"), ("{cancel: a}", "no query with the id 'a'"),
])
def test_a_bad_query_is_refused_in_one_sentence(run, query, words):
    status, out, err = run(query)
    assert (status, out) == (2, "")
    assert err.startswith("shimmy: the query is refused")
    assert words in err
    assert len(err.splitlines()) == 1


@pytest.mark.parametrize("option", [
    "--coulomb-torque=-1", "--harmonics=0", "--minimum-velocity=0", "--gear=nowhere.yaml"])
def test_a_bad_option_is_refused(run, option):
    status, out, err = run("{taxi_velocity: 40}", option)
    assert (status, out) == (2, "")
    assert len(err.splitlines()) == 1


def test_what_does_not_converge_has_status_1(run, monkeypatch):
    from shimmy_ros.what_if import evaluate

    def failing(point, stable):
        raise ArithmeticError("lost the way")

    monkeypatch.setattr(evaluate, "all_cycles", failing)
    status, out, _ = run("{taxi_velocity: [40, 50], return: all_cycles}")
    assert status == 1
    assert out.splitlines()[-1] == "Did not converge: lost the way."


def test_a_solver_that_fails_has_status_1(run, monkeypatch):
    from shimmy_ros.what_if import desk

    def evaluate(query):
        raise ZeroDivisionError("oh")
        yield

    monkeypatch.setattr(desk, "evaluate", evaluate)
    status, _, err = run("{taxi_velocity: 40}")
    assert status == 1
    assert err.splitlines()[-1] == "shimmy: failed: the solver failed: ZeroDivisionError('oh')"


def test_angles_are_in_degrees(run, answer):
    _, out, _ = run("{taxi_velocity: 40}")
    amplitude = answer({"taxi_velocity": 40})["points"][0]["limit_cycle"]["amplitude"]
    (row,) = rows(out)
    for heading, name in (("swivel [deg]", "swivel"), ("strut tilt [deg]", "strut_tilt")):
        assert float(row[heading]) == pytest.approx(math.degrees(amplitude[name]), rel=1e-4)


def test_a_node_that_cannot_be_asked_without_ros_says_so(run, monkeypatch):
    monkeypatch.setitem(sys.modules, "shimmy_ros.nodes.asking", None)
    status, _, err = run("{taxi_velocity: 40}", "--node")
    assert status == 2
    assert "rclpy" in err


def test_the_default_namespace_is_the_launch_files():
    assert ask.DEFAULT_NAMESPACE == "/shimmy"
