"""``shimmy predict``: answers, their JSON, exit status and sentences."""

from __future__ import annotations

import json
import math
import subprocess
import sys
from pathlib import Path

import jsonschema
import numpy as np
import pytest

from shimmy_ros.cli import predict
from shimmy_ros.cli.main import main
from shimmy_ros.cycles.prediction import Prediction
from shimmy_ros.ihb.solution import Outcome

ROOT = Path(__file__).parents[2]
CONFIG = ROOT / "config"
REFERENCE = json.loads((ROOT / "tests" / "data" / "limit_cycles.json").read_text())["cases"]
JOINTS = ["strut_tilt", "swivel", "damper", "tyre_lateral"]
BY_JOINT = {"type": ["object", "null"], "required": JOINTS, "additionalProperties": False,
            "properties": {joint: {"type": "number", "exclusiveMinimum": 0} for joint in JOINTS}}
SCHEMA = {
    "type": "object",
    "additionalProperties": False,
    "required": ["outcome", "amplitude", "peak_velocity", "frequency", "harmonics", "iterations",
                 "residual", "taxi_velocity", "linear_damping", "quadratic_damping",
                 "coulomb_torque", "message"],
    "properties": {
        "outcome": {"enum": ["limit_cycle", "no_limit_cycle", "not_converged"]},
        "amplitude": BY_JOINT,
        "peak_velocity": BY_JOINT,
        "frequency": {"type": ["number", "null"], "exclusiveMinimum": 0},
        "harmonics": {"type": "integer", "minimum": 1},
        "iterations": {"type": "integer", "minimum": 0},
        "residual": {"type": ["number", "null"], "minimum": 0},
        "taxi_velocity": {"type": "number"},
        "linear_damping": {"type": "number"},
        "quadratic_damping": {"type": "number"},
        "coulomb_torque": {"type": "number"},
        "message": {"type": "string", "minLength": 1},
    },
}


def answered(capsys, *options, status=0):
    """The JSON of ``shimmy predict``, which fits the schema."""
    assert main(["predict", *options, "--json"]) == status
    captured = capsys.readouterr()
    assert captured.err == ""
    answer = json.loads(captured.out)
    jsonschema.validate(answer, SCHEMA)
    return answer


def refused(capsys, *options):
    """The one sentence with which ``shimmy predict`` ends with status 2."""
    assert main(["predict", *options]) == 2
    captured = capsys.readouterr()
    assert captured.out == ""
    (sentence,) = captured.err.splitlines()
    assert sentence.startswith("shimmy: ")
    return sentence


@pytest.mark.parametrize("case", REFERENCE[3::11], ids=lambda case: "-".join(
    f"{case[name]:g}" for name in ("quadratic_damping", "coulomb_torque", "taxi_velocity")))
def test_a_limit_cycle(capsys, case):
    answer = answered(capsys, f"--velocity={case['taxi_velocity']}",
                      f"--quadratic-damping={case['quadratic_damping']}",
                      f"--coulomb-torque={case['coulomb_torque']}", "--harmonics=16")
    assert answer["outcome"] == "limit_cycle"
    assert [answer["amplitude"][joint] for joint in JOINTS] == pytest.approx(
        case["amplitude"], rel=0.02)
    assert answer["amplitude"]["swivel"] == pytest.approx(case["amplitude"][1], rel=0.01)
    assert answer["frequency"] == pytest.approx(case["frequency"], rel=0.005)
    assert answer["harmonics"] == 16
    assert answer["residual"] < 1e-9
    assert (answer["linear_damping"], answer["quadratic_damping"], answer["coulomb_torque"]) == (
        2.0, case["quadratic_damping"], case["coulomb_torque"])


def test_the_peak_velocity_of_a_nearly_harmonic_cycle(capsys):
    answer = answered(capsys, "--velocity=60", "--harmonics=1")
    for joint in JOINTS:
        assert answer["peak_velocity"][joint] == pytest.approx(
            2.0 * math.pi * answer["frequency"] * answer["amplitude"][joint], rel=1e-9)


def test_no_limit_cycle_is_an_answer(capsys):
    answer = answered(capsys, "--velocity=40", "--coulomb-torque=900")
    assert answer["outcome"] == "no_limit_cycle"
    assert answer["amplitude"] is answer["peak_velocity"] is answer["frequency"] is None
    assert main(["predict", "--velocity=40", "--coulomb-torque=900"]) == 0
    out = capsys.readouterr().out
    assert out == out[0].upper() + out[1:]
    assert "no limit cycle" in out.lower()


def test_sentences_for_people(capsys):
    answer = answered(capsys, "--velocity=40")
    assert main(["predict", "--velocity=40"]) == 0
    out = capsys.readouterr().out
    assert f"{answer['frequency']:.4f} Hz" in out
    assert f"swivel {answer['amplitude']['swivel']:.5f} rad" in out
    assert f"{math.degrees(answer['amplitude']['swivel']):.3f} deg" in out
    assert "4 harmonics" in out


def test_a_solve_that_does_not_converge_ends_with_1(capsys, monkeypatch):
    class Failing:
        def __init__(self, harmonics, minimum_velocity):
            self.harmonics = harmonics

        def predict(self, point):
            return Prediction(point, self.harmonics, Outcome.FAILED.value, None, 50, np.inf, False,
                              "not converged: the residual stays at 1e-2")

    monkeypatch.setattr(predict, "Predictor", Failing)
    answer = answered(capsys, "--velocity=40", status=1)
    assert answer["outcome"] == "not_converged"
    assert answer["amplitude"] is answer["frequency"] is answer["residual"] is None
    assert main(["predict", "--velocity=40"]) == 1
    assert "Not converged" in capsys.readouterr().out


@pytest.mark.parametrize(("options", "words"), [
    (["--velocity=nan"], ["velocity", "nan", "[0, 200] m/s"]),
    (["--velocity=inf"], ["velocity", "inf", "[0, 200] m/s"]),
    (["--velocity=-3"], ["velocity", "-3", "[0, 200] m/s"]),
    (["--velocity=1e9"], ["velocity", "1e+09", "[0, 200] m/s"]),
    (["--velocity=0.5"], ["--velocity", "0.5", "1 m/s"]),
    (["--velocity=0"], ["--velocity", "0", "1 m/s"]),
    (["--velocity=40", "--minimum-velocity=0"], ["minimum_velocity", "0.01"]),
    (["--velocity=40", "--harmonics=0"], ["harmonics", "0", "64"]),
    (["--velocity=40", "--harmonics=65"], ["harmonics", "65", "64"]),
    (["--velocity=40", "--linear-damping=-1"], ["linear_damping", "-1", "N m s/rad"]),
    (["--velocity=40", "--quadratic-damping=nan"], ["quadratic_damping", "nan"]),
    (["--velocity=40", "--coulomb-torque=inf"], ["coulomb_torque", "inf", "N m"]),
    (["--velocity=40", "--gear=nowhere.yaml"], ["nowhere.yaml", "cannot be read"]),
    (["--velocity=40", f"--gear={CONFIG / 'damper_05_05.yaml'}"], ["gear.", "missing"]),
])
def test_bad_input_ends_with_2_and_one_sentence(capsys, options, words):
    sentence = refused(capsys, *options)
    assert all(word in sentence for word in words), sentence


@pytest.mark.parametrize("options", [
    [], ["--velocity"], ["--velocity=fast"], ["--velocity=40", "--harmonics=4.5"],
    ["--velocity=40", "--wheel=3"],
])
def test_bad_arguments_end_with_2(capsys, options):
    with pytest.raises(SystemExit) as raised:
        main(["predict", *options])
    assert raised.value.code == 2
    assert "usage: shimmy" in capsys.readouterr().err


def test_gear_files_override_each_other(capsys, tmp_path):
    trail = tmp_path / "trail.yaml"
    trail.write_text("/**: {ros__parameters: {gear: {trail: 0.1}, other: 3}}")
    reference, damper = CONFIG / "reference_gear.yaml", CONFIG / "damper_50_10.yaml"
    answer = answered(capsys, "--velocity=40", f"--gear={reference}", f"--gear={damper}",
                      "--linear-damping=3.5")
    assert (answer["linear_damping"], answer["quadratic_damping"], answer["coulomb_torque"]) == (
        3.5, 50.0, 10.0)
    other = answered(capsys, "--velocity=40", f"--gear={reference}", f"--gear={damper}",
                     f"--gear={trail}", "--linear-damping=3.5")
    assert other["amplitude"] != answer["amplitude"]


@pytest.mark.parametrize(("text", "words"), [
    ("/**: {ros__parameters: {gear: {wheel_mass: -1.0}}}", ["gear.wheel_mass", "-1"]),
    ("/**: {ros__parameters: {gear: {wheel_mass: 1000.0}}}", ["positive definite"]),
    ("/**: {ros__parameters: {gear: {wheelmass: 20.0}}}", ["gear.wheelmass"]),
    ("/**: {ros__parameters: {damper: {coulomb_torque: .nan}}}", ["damper.coulomb_torque", "nan"]),
    ("/**: {ros__parameters: {gear: [", ["cannot be read"]),
    ("nothing: here", ["no ros__parameters"]),
])
def test_a_bad_gear_file_ends_with_2_and_one_sentence(capsys, tmp_path, text, words):
    file = tmp_path / "gear.yaml"
    file.write_text(text)
    sentence = refused(capsys, "--velocity=40", f"--gear={CONFIG / 'reference_gear.yaml'}",
                       f"--gear={file}")
    assert all(word in sentence for word in words), sentence


def test_the_command_needs_no_ros():
    """As a process of its own, in which rclpy cannot be imported."""
    program = ("import sys; sys.modules['rclpy'] = None; from shimmy_ros.cli.main import main; "
               "sys.exit(main(['predict', '--velocity', '40', '--json']))")
    done = subprocess.run([sys.executable, "-c", program], capture_output=True, text=True,
                          check=False)
    assert done.returncode == 0, done.stderr
    assert json.loads(done.stdout)["outcome"] == "limit_cycle"


@pytest.mark.parametrize(("velocity", "how"), [
    ("40", "4 harmonics, 4 iterations, relative residual "),
    ("7.2", "By shooting, as 4 harmonics do not tell; relative residual ")])
def test_the_sentence_says_how_the_cycle_was_found(velocity, how, capsys):
    assert main(["predict", "--velocity", velocity]) == 0
    assert capsys.readouterr().out.splitlines()[1].startswith(how)
