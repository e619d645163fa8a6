"""``shimmy figures``: the picture, the cycles, and the table of differences and cost."""

import csv
import shutil
import signal

import pytest
from matplotlib.image import imread

from shimmy_ros.cli import figures
from shimmy_ros.cli.main import main
from shimmy_ros.cycles.method_comparison import MethodRun
from shimmy_ros.resources import resource_directory


@pytest.fixture
def one_case(tmp_path, monkeypatch):
    """The command with one of the four dampers, over two velocities."""
    config = tmp_path / "config"
    config.mkdir()
    for name in ("reference_gear.yaml", "damper_50_10.yaml"):
        shutil.copy(resource_directory("config") / name, config)
    monkeypatch.setattr(figures, "resource_directory", lambda name: config)
    return ["figures", "--from", "80", "--to", "90", "--step", "5",
            "--out", str(tmp_path / "out")]


def read(file):
    with file.open(newline="") as stream:
        return list(csv.DictReader(stream))


def test_figures_leave_picture_cycles_and_table(one_case, tmp_path, capsys):
    assert main(one_case) == 0
    printed = capsys.readouterr().out
    table = read(tmp_path / "out" / "figures_3_to_6_table.csv")
    assert [row["method"] for row in table] == [
        "harmonic balance, 1 harmonic", "harmonic balance, 4 harmonics",
        "numerical reference (shooting)"]
    one, four, reference = table
    assert one["velocities"] == four["velocities"] == "3"
    assert 1.0 < float(one["worst_amplitude_percent"]) < 4.0
    assert 1e-4 < float(four["worst_amplitude_percent"]) < 0.05
    assert float(four["median_amplitude_percent"]) <= float(four["worst_amplitude_percent"])
    assert float(four["worst_frequency_percent"]) < 0.05
    assert float(four["worst_at_m_per_s"]) in (80.0, 85.0, 90.0)
    assert reference["velocities"] == reference["median_amplitude_percent"] == ""
    for row in table:
        assert float(row["ms_per_velocity"]) > 0.0
        assert row["method"] in printed
    assert float(reference["times_faster"]) == 1.0
    worst = float(four["worst_amplitude_percent"])
    assert ("harmonic balance, 4 harmonics, swivel amplitude at 3 points: median "
            f"{float(four['median_amplitude_percent']):.3f} %, worst {worst:.3f} % (C_d 50, "
            f"T_CF 10, {float(four['worst_at_m_per_s']):g} m/s)") in printed
    assert "figures_3_to_6.png" in printed
    cycles = read(tmp_path / "out" / "figures_3_to_6.csv")
    for method in (row["method"] for row in table):
        own = [row for row in cycles if row["run"] == method and row["on_grid"] == "true"]
        stable = {row["taxi_velocity"] for row in own if row["stable"] == "true"}
        others = {row["taxi_velocity"] for row in own if row["stable"] != "true"}
        assert stable == {"80.0", "85.0", "90.0"}
        assert others == stable
    picture = imread(tmp_path / "out" / "figures_3_to_6.png")
    assert picture.shape[0] > 500
    assert picture[..., :3].std() > 0.05


def test_an_interruption_leaves_what_is_finished(one_case, tmp_path, monkeypatch, capsys):
    whole = MethodRun.trace_stable

    def interrupted(self):
        for point in whole(self):
            if self.harmonics == 4:
                signal.raise_signal(signal.SIGINT)
            yield point

    monkeypatch.setattr(MethodRun, "trace_stable", interrupted)
    assert main(one_case) == 130
    runs = {row["run"] for row in read(tmp_path / "out" / "figures_3_to_6.csv")}
    assert runs == {"harmonic balance, 1 harmonic", "harmonic balance, 4 harmonics"}
    assert (tmp_path / "out" / "figures_3_to_6.png").exists()


def test_a_range_that_is_none_is_refused(tmp_path, capsys):
    assert main(["figures", "--from", "40", "--to", "40", "--out", str(tmp_path)]) == 2
    assert "is no range" in capsys.readouterr().err
