"""``shimmy map``: nodes and folds as tables, the picture, and exit status."""

import csv
import json
import signal
from dataclasses import replace

import numpy as np
import pytest
from matplotlib.colors import to_rgb
from matplotlib.image import imread

from shimmy_ros.cli.main import main
from shimmy_ros.cycles import amplitude_map, fold_curve
from shimmy_ros.cycles.amplitude_map import AmplitudeMap
from shimmy_ros.cycles.settings import Settings
from shimmy_ros.cycles.stable_cycle import stable_cycle
from shimmy_ros.cycles.verdict import Verdict
from shimmy_ros.gear.axes import Axis
from shimmy_ros.gear.parameter_file import reference_parameters
from shimmy_ros.gear.parameters import Limits
from shimmy_ros.gear.system import OperatingPoint
from shimmy_ros.ihb.solution import Outcome

SMALL = ["map", "--x", "taxi_velocity", "52", "58", "--y", "coulomb_torque", "160", "180",
         "--points", "3"]


def test_a_map_leaves_nodes_folds_and_a_picture(tmp_path, capsys, monkeypatch):
    # Fewer folds than a picture asks for.
    monkeypatch.setattr(fold_curve, "_FIRST_STEP", 0.2)
    monkeypatch.setattr(fold_curve, "_LARGEST_STEP", 0.3)
    files = {kind: tmp_path / f"map.{kind}" for kind in ("csv", "json", "png")}
    assert main([*SMALL, "--csv", str(files["csv"]), "--json", str(files["json"]),
                 "--plot", str(files["png"])]) == 0
    assert capsys.readouterr().out == ""
    content = json.loads(files["json"].read_text())
    assert content["parameters"] == ["taxi_velocity", "damper.coulomb_torque"]
    nodes = [point for point in content["points"] if not point["fold"]]
    folds = [point for point in content["points"] if point["fold"]]
    assert [(node["taxi_velocity"], node["damper.coulomb_torque"]) for node in nodes] == [
        (v, t) for t in (160.0, 170.0, 180.0) for v in (52.0, 55.0, 58.0)]
    assert [node["outcome"] == "limit_cycle" for node in nodes] == [
        True, True, True, False, True, True, False, False, False]
    assert len(folds) >= 3
    assert {fold["method"] for fold in folds} == {"shooting"}
    velocities = [fold["taxi_velocity"] for fold in folds]
    assert velocities in (sorted(velocities), sorted(velocities)[::-1])
    assert all(point["beyond_limits"] == [] for point in content["points"])
    assert [node["amplitudes_of"] for node in nodes] == [
        "limit_cycle" if node["outcome"] == "limit_cycle" else None for node in nodes]
    with files["csv"].open(newline="") as stream:
        assert len(list(csv.DictReader(stream))) == len(content["points"])
    picture = imread(files["png"])
    assert picture.shape[0] > 500
    assert picture[..., :3].std() > 0.05


def test_the_table_is_printed_and_folds_can_be_left_out(capsys):
    assert main(["map", "--x", "quadratic_damping", "5", "10", "--y", "coulomb_torque", "0", "10",
                 "--velocity", "60", "--points", "2", "--no-folds"]) == 0
    lines = capsys.readouterr().out.splitlines()
    assert lines[0].startswith("damper.quadratic_damping,damper.coulomb_torque,outcome,stable,fold")
    assert len(lines) == 5


def test_every_outcome_has_a_row_and_a_colour(tmp_path, monkeypatch, capsys):
    outcomes = list(Outcome)

    def verdict(point, settings, start):
        outcome = outcomes[round((point.velocity - 50.0) / 10.0)]
        envelope = np.array([0.0, 0.6, 0.0, 0.0]) if outcome is Outcome.NOT_PERIODIC else None
        orbit = None
        if outcome is Outcome.LIMIT_CYCLE:
            orbit = stable_cycle(point).orbit
        settings = replace(settings, limits=Limits(0.05, 0.2, 0.3))
        return Verdict(point, settings, outcome, orbit, envelope)

    monkeypatch.setattr(amplitude_map, "stable_cycle", verdict)
    files = {kind: tmp_path / f"map.{kind}" for kind in ("csv", "png")}
    assert main(["map", "--x", "taxi_velocity", "50", "100", "--y", "coulomb_torque", "0", "20",
                 "--points", "6", "--no-folds", "--csv", str(files["csv"]),
                 "--plot", str(files["png"])]) == 1
    assert capsys.readouterr().err.count("did not converge: ") == 6
    with files["csv"].open(newline="") as stream:
        rows = list(csv.DictReader(stream))[:6]
    assert [row["outcome"] for row in rows] == [outcome.value for outcome in outcomes]
    beyond = {row["outcome"]: row["beyond_limits"] for row in rows}
    assert (beyond["limit_cycle"], beyond["not_periodic"]) == ("swivel", "swivel")
    amplitudes = {row["outcome"]: row["amplitudes_of"] for row in rows}
    assert amplitudes == {**dict.fromkeys(amplitudes, ""), "limit_cycle": "limit_cycle",
                          "not_periodic": "envelope"}
    colors = imread(files["png"])[..., :3].reshape(-1, 3)
    for name in ("0.88", "tab:red", "tab:pink", "lightsteelblue", "black"):
        share = (np.abs(colors - to_rgb(name)).max(axis=1) < 0.01).mean()
        assert share > 0.05


def test_a_fold_that_passes_between_two_rows_is_tracked():
    """Over the velocity the fold in the friction is nearly level around 40 m/s."""
    gear, damper = reference_parameters()
    shimmy = AmplitudeMap(OperatingPoint(gear, damper, 40.0), Axis("taxi_velocity"),
                          Axis("damper.coulomb_torque"), [38.0, 42.0], [155.0, 175.0], Settings())
    rows = list(shimmy.fill())
    assert [[node.outcome for node in row] for row in rows] == [
        2 * [Outcome.LIMIT_CYCLE], 2 * [Outcome.NO_LIMIT_CYCLE]]
    fold = next(shimmy.trace_folds())
    assert fold.second == pytest.approx(163.8, abs=0.5)


def test_an_interruption_leaves_what_is_finished(tmp_path, monkeypatch):
    whole = AmplitudeMap.fill

    def interrupted(self):
        for row in whole(self):
            signal.raise_signal(signal.SIGINT)
            yield row

    monkeypatch.setattr(AmplitudeMap, "fill", interrupted)
    table = tmp_path / "part.csv"
    assert main([*SMALL, "--csv", str(table), "--plot", str(tmp_path / "part.png")]) == 130
    with table.open(newline="") as stream:
        assert len(list(csv.DictReader(stream))) == 3
    assert (tmp_path / "part.png").exists()


@pytest.mark.parametrize(("arguments", "message"), [
    (["--y", "taxi_velocity", "10", "20"], "are both taxi_velocity, but must differ"),
    (["--y", "coulomb_torque", "zero", "20"], "'zero' in a number's place"),
    (["--y", "coulomb_torque", "5", "5"], "is no range"),
    (["--y", "coulomb_torque", "-5", "5"], "damper.coulomb_torque is -5, but must be"),
    (["--points", "1"], "--points is 1, but must be in [2, 1000]"),
    (["--x", "trail", "0", "0.1"], "--velocity is missing"),
])
def test_bad_input_is_refused_in_a_sentence(arguments, message, capsys):
    assert main(["map", *arguments]) == 2
    captured = capsys.readouterr()
    assert message in captured.err
    assert captured.err.count("\n") == 1
