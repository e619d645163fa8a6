"""``shimmy sweep``: tables, JSON, pictures, exit status, and what an interruption leaves."""

import csv
import io
import json
import signal

import numpy as np
import pytest
from matplotlib.image import imread

from shimmy_ros.cli.main import main
from shimmy_ros.cycles import diagram
from shimmy_ros.cycles.diagram import Diagram
from shimmy_ros.cycles.stable_cycle import stable_cycle
from shimmy_ros.cycles.verdict import Verdict
from shimmy_ros.ihb.solution import Outcome

NARROW = ["sweep", "coulomb_torque", "--velocity", "40", "--from", "150", "--to", "170",
          "--step", "5"]


def rows_of(text):
    return list(csv.DictReader(io.StringIO(text)))


def test_a_sweep_prints_every_value_up_and_down(capsys):
    assert main(NARROW) == 0
    rows = rows_of(capsys.readouterr().out)
    values = [150.0, 155.0, 160.0, 165.0, 170.0]
    assert [float(row["damper.coulomb_torque"]) for row in rows] == values + values[::-1]
    assert [row["direction"] for row in rows] == 5 * ["up"] + 5 * ["down"]
    expected = 3 * ["limit_cycle"] + 2 * ["no_limit_cycle"]
    assert [row["outcome"] for row in rows] == expected + expected[::-1]
    for row in rows:
        found = row["outcome"] == "limit_cycle"
        assert row["stable"] == ("true" if found else "")
        assert bool(row["swivel_rad"]) == found
        assert row["amplitudes_of"] == ("limit_cycle" if found else "")
        assert (row["beyond_limits"], row["kick_leads_here"]) == ("", "true")
        assert row["further_stable_cycles"] == "0"
        if found:
            assert 0.06 < float(row["swivel_rad"]) < 0.09
            assert float(row["estimated_error"]) <= 0.01
            assert row["method"] in ("ihb", "shooting")


def test_velocity_is_what_is_swept_by_default_and_the_end_is_met(capsys):
    assert main(["sweep", "--from", "30", "--to", "41", "--step", "5", "--direction", "up"]) == 0
    rows = rows_of(capsys.readouterr().out)
    assert [float(row["taxi_velocity"]) for row in rows] == [30.0, 35.0, 40.0, 41.0]
    assert float(rows[2]["swivel_rad"]) == pytest.approx(0.12070, abs=1e-4)
    assert float(rows[2]["frequency_hz"]) == pytest.approx(12.029, abs=2e-3)


def test_all_branches_go_to_files_of_each_kind(tmp_path, capsys):
    files = {kind: tmp_path / f"all.{kind}" for kind in ("csv", "json", "png")}
    assert main([*NARROW, "--all", "--csv", str(files["csv"]), "--json", str(files["json"]),
                 "--plot", str(files["png"])]) == 0
    assert capsys.readouterr().out == ""
    table = rows_of(files["csv"].read_text())
    content = json.loads(files["json"].read_text())
    assert content["parameters"] == ["damper.coulomb_torque"]
    assert content["taxi_velocity"] == 40.0
    assert content["damper"]["quadratic_damping"] == 10.0
    assert content["problems"] == []
    assert len(content["points"]) == len(table)
    for row, point in zip(table, content["points"], strict=True):
        assert float(row["swivel_rad"]) == point["swivel_rad"]
        assert int(row["branch"]) == point["branch"]
    (fold,) = [point for point in content["points"] if point["fold"]]
    assert fold["damper.coulomb_torque"] == pytest.approx(163.8147, abs=1e-3)
    at_start = [point for point in content["points"]
                if point["on_grid"] and point["damper.coulomb_torque"] == 150.0]
    assert sorted(point["stable"] for point in at_start) == [False, False, True]
    picture = imread(files["png"])
    assert picture.shape[0] > 500
    assert picture[..., :3].std() > 0.05


def test_an_interruption_leaves_what_is_finished(tmp_path, monkeypatch):
    whole = Diagram.trace_stable

    def interrupted(self):
        for count, point in enumerate(whole(self)):
            if count == 3:
                signal.raise_signal(signal.SIGINT)
            yield point

    monkeypatch.setattr(Diagram, "trace_stable", interrupted)
    table = tmp_path / "part.csv"
    assert main([*NARROW, "--csv", str(table)]) == 130
    rows = rows_of(table.read_text())
    assert 0 < len(rows) < 10
    assert {row["outcome"] for row in rows} == {"limit_cycle"}


def test_an_interruption_before_any_branch_leaves_the_answers(tmp_path, monkeypatch):
    whole = Diagram.judge

    def interrupted(self):
        for count, verdict in enumerate(whole(self)):
            if count == 1:
                signal.raise_signal(signal.SIGINT)
            yield verdict

    monkeypatch.setattr(Diagram, "judge", interrupted)
    files = tmp_path / "part.csv", tmp_path / "part.png"
    assert main([*NARROW, "--csv", str(files[0]), "--plot", str(files[1])]) == 130
    rows = rows_of(files[0].read_text())
    assert [row["damper.coulomb_torque"] for row in rows] == ["150.0", "155.0", "155.0", "150.0"]
    assert files[1].exists()


@pytest.mark.parametrize(("arguments", "message"), [
    (["trial", "--from", "0", "--to", "1"], "'trial' is not a parameter"),
    (["trail", "--from", "0", "--to", "0.1"], "--velocity is missing"),
    (["trail", "--from", "0", "--to", "0.1", "--velocity", "0"], "--velocity is 0, but must be"),
    (["--from", "10", "--to", "10"], "--from 10 --to 10 is no range"),
    (["--from", "10", "--to", "20", "--step", "0"], "--step is 0, but must be positive"),
    (["--from", "10", "--to", "300"], "taxi_velocity is 300, but must be in"),
    (["trail", "--from", "0", "--to", "0.8", "--velocity", "40"], "mass matrix"),
    (["--from", "10", "--to", "20", "--accuracy", "2"], "accuracy is 2, but must be"),
    (["--from", "10", "--to", "20", "--harmonics", "0"], "harmonics is 0, but must be"),
    (["--from", "10", "--to", "20", "--csv", "/nowhere/x.csv"], "/nowhere/x.csv cannot be written"),
])
def test_bad_input_is_refused_in_a_sentence(arguments, message, capsys):
    assert main(["sweep", *arguments]) == 2
    captured = capsys.readouterr()
    assert captured.out == ""
    assert captured.err.startswith("shimmy: ")
    assert message in captured.err
    assert captured.err.count("\n") == 1


@pytest.fixture
def told(monkeypatch):
    """What values of the friction come to, by outcome; all others as they do."""
    outcomes = {}

    def verdict(point, settings, start):
        outcome = outcomes.get(point.damper.coulomb_torque)
        if outcome is None:
            return stable_cycle(point, settings, start)
        envelope = np.array([0.0, 0.6, 0.0, 0.0]) if outcome is Outcome.NOT_PERIODIC else None
        return Verdict(point, settings, outcome, envelope=envelope, reason="as told")

    monkeypatch.setattr(diagram, "stable_cycle", verdict)
    return outcomes


def test_growth_without_bound_is_an_answer(told, tmp_path, capsys):
    told |= {170.0: Outcome.UNBOUNDED, 175.0: Outcome.NOT_PERIODIC}
    files = {kind: tmp_path / f"sweep.{kind}" for kind in ("csv", "json", "png")}
    assert main(["sweep", "coulomb_torque", "--velocity", "40", "--from", "165", "--to", "175",
                 "--step", "5", "--direction", "up", "--csv", str(files["csv"]),
                 "--json", str(files["json"]), "--plot", str(files["png"])]) == 0
    assert capsys.readouterr().err == ""
    rows = rows_of(files["csv"].read_text())
    assert [row["outcome"] for row in rows] == ["no_limit_cycle", "unbounded", "not_periodic"]
    assert [row["swivel_rad"] for row in rows] == ["", "", "0.6"]
    assert [row["amplitudes_of"] for row in rows] == ["", "", "envelope"]
    assert [row["beyond_limits"] for row in rows] == ["", "", "swivel"]
    points = json.loads(files["json"].read_text())["points"]
    assert [point["beyond_limits"] for point in points] == [[], [], ["swivel"]]
    # The band of the one and the mark of the other.
    colors = imread(files["png"])[..., :3].reshape(-1, 3)
    for wanted in ((0.993, 0.932, 0.932), (0.58, 0.404, 0.741)):
        assert (np.abs(colors - wanted).max(axis=1) < 0.02).any()


def test_what_did_not_converge_has_status_1_and_its_row(told, capsys):
    told[170.0] = Outcome.NOT_CONVERGED
    assert main([*NARROW, "--direction", "up"]) == 1
    captured = capsys.readouterr()
    assert [row["outcome"] for row in rows_of(captured.out)][-1] == "not_converged"
    assert rows_of(captured.out)[-1]["kick_leads_here"] == ""
    assert captured.err == ("shimmy: did not converge: damper.coulomb_torque 170: "
                            "as told\n")


def test_below_the_minimum_velocity_the_tyre_does_not_roll(capsys):
    assert main(["sweep", "--from", "4", "--to", "20", "--step", "8", "--minimum-velocity", "5",
                 "--direction", "up"]) == 0
    assert [row["outcome"] for row in rows_of(capsys.readouterr().out)] == [
        "not_rolling", "limit_cycle", "limit_cycle"]


def test_a_balance_that_sticks_is_no_answer(capsys):
    """At 10 m/s the swivel begins to stick before the fold, which the balance cannot see."""
    assert main(["sweep", "coulomb_torque", "--velocity", "10", "--from", "60", "--to", "100",
                 "--step", "20", "--method", "ihb", "--direction", "up"]) == 1
    captured = capsys.readouterr()
    outcomes = [row["outcome"] for row in rows_of(captured.out)]
    assert outcomes[0] == "limit_cycle"
    assert outcomes[1:] == 2 * ["not_converged"]
    assert "did not converge" in captured.err
    assert "a motion settles where the balance has no cycle" in captured.err
