"""What ``shimmy demo`` refuses before it starts anything."""

from __future__ import annotations

import subprocess
import sys
from pathlib import Path

import pytest

from shimmy_ros.cli import demo
from shimmy_ros.cli.main import main

CONFIG = Path(__file__).parents[2] / "config"


@pytest.fixture(autouse=True)
def nothing_starts(monkeypatch):
    """A demo that gets as far as starting nodes fails the test."""
    def play(*arguments):
        pytest.fail("the demo went on")

    monkeypatch.setattr(demo, "_play", play)


def refused(capsys, *options):
    """The one sentence with which ``shimmy demo`` ends with status 2."""
    assert main(["demo", *options]) == 2
    captured = capsys.readouterr()
    assert captured.out == ""
    (sentence,) = captured.err.splitlines()
    assert sentence.startswith("shimmy: ")
    return sentence


@pytest.mark.parametrize(("options", "words"), [
    (["--run=nobody_flew_this"], ["nobody_flew_this", "cannot be read"]),
    (["--run=missing.csv"], ["missing.csv", "cannot be read"]),
    (["--from=30", "--to=20"], ["--from 30 --to 20", "leaves no stretch", "landing_EDW229"]),
    (["--run=synthetic", "--from=39.95"], ["--from 39.95 --to 40", "synthetic"]),
    (["--from=nan"], ["--from nan"]),
])
def test_a_bad_run(capsys, tmp_path, options, words):
    sentence = refused(capsys, *options, f"--out={tmp_path / 'out'}")
    assert all(word in sentence for word in words), sentence
    assert not (tmp_path / "out").exists()


def test_a_run_with_a_bad_line(capsys, tmp_path):
    file = tmp_path / "run.csv"
    file.write_text("time_s,taxi_velocity_m_per_s\n0,30\n1,-1\n")
    sentence = refused(capsys, f"--run={file}")
    assert f"{file}, line 3: taxi_velocity_m_per_s is -1" in sentence


def test_without_ros_the_demo_says_how_to_get_it(tmp_path):
    """As a process of its own, in which rclpy cannot be imported."""
    program = ("import sys; sys.modules['rclpy'] = None; from shimmy_ros.cli.main import main; "
               f"sys.exit(main(['demo', '--out={tmp_path / 'out'}']))")
    done = subprocess.run([sys.executable, "-c", program], capture_output=True, text=True,
                          check=False)
    assert done.returncode == 2
    assert "rclpy" in done.stderr
    assert "pip install" in done.stderr
    assert not (tmp_path / "out").exists()


class TestWithRos:
    """What is refused after a look whether there is a ROS."""

    @pytest.fixture(autouse=True)
    def ros(self):
        """Skip without rclpy."""
        pytest.importorskip("rclpy", reason="the demo needs ROS 2 Jazzy's rclpy")

    @pytest.mark.parametrize("exists", [False, True])
    def test_a_bad_gear(self, capsys, tmp_path, exists):
        file = tmp_path / "gear.yaml"
        if exists:
            file.write_text((CONFIG / "reference_gear.yaml").read_text().replace(
                "wheel_mass: 25.0", "wheel_mass: -1.0"))
        sentence = refused(capsys, f"--gear={file}", f"--out={tmp_path / 'out'}")
        assert ("gear.wheel_mass is -1" if exists else str(file)) in sentence

    def test_out_is_a_file(self, capsys, tmp_path):
        out = tmp_path / "out"
        out.write_text("precious")
        assert f"--out is {out}" in refused(capsys, f"--out={out}")
        assert out.read_text() == "precious"

    @pytest.mark.parametrize("name", ["notes.txt", "more/bag.mcap"])
    def test_what_is_no_bag_is_not_removed(self, capsys, tmp_path, name):
        precious = tmp_path / "landing_EDW229" / name
        precious.parent.mkdir(parents=True)
        precious.write_text("precious")
        assert "landing_EDW229 other than the bag" in refused(capsys, f"--out={tmp_path}")
        assert precious.read_text() == "precious"
