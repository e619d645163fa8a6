"""``shimmy predict``: answers, their JSON, exit status and sentences."""

from __future__ import annotations

import json
import math
import re
import subprocess
import sys
from pathlib import Path

import jsonschema
import numpy as np
import pytest

from shimmy_ros.cli import predict
from shimmy_ros.cli.main import main
from shimmy_ros.cycles.prediction import Predictor
from shimmy_ros.cycles.verdict import Kick, Verdict
from shimmy_ros.gear.parameter_file import reference_parameters
from shimmy_ros.gear.system import OperatingPoint
from shimmy_ros.ihb.solution import Outcome

ROOT = Path(__file__).parents[2]
CONFIG = ROOT / "config"
REFERENCE = json.loads((ROOT / "tests" / "data" / "limit_cycles.json").read_text())["cases"]
JOINTS = ["strut_tilt", "swivel", "damper", "tyre_lateral"]
BY_JOINT = {"type": "object", "required": JOINTS, "additionalProperties": False,
            "properties": {joint: {"type": "number", "exclusiveMinimum": 0} for joint in JOINTS}}
OR_NULL = {"anyOf": [BY_JOINT, {"type": "null"}]}
SHARE = {"type": ["number", "null"], "minimum": 0}
PROPERTIES = {
    "outcome": {"enum": ["limit_cycle", "no_limit_cycle", "unbounded", "not_periodic",
                         "not_converged"]},
    "amplitude": OR_NULL,
    "peak_velocity": OR_NULL,
    "frequency": {"type": ["number", "null"], "exclusiveMinimum": 0},
    "envelope": OR_NULL,
    "beyond_limits": {"type": "array", "items": {
        "type": "object", "additionalProperties": False,
        "required": ["quantity", "value", "limit"],
        "properties": {"quantity": {"enum": ["strut_tilt", "swivel", "tyre_deflection"]},
                       "value": {"type": "number"}, "limit": {"type": "number"}}}},
    "rest_is_stable": {"type": ["boolean", "null"]},
    "kick": {"type": ["object", "null"], "additionalProperties": False,
             "required": ["dies", "grows", "unbounded"],
             "properties": {"dies": {"type": "number"}, "grows": {"type": "number"},
                            "unbounded": {"type": ["number", "null"]}}},
    "further_stable_cycles": {"type": "array", "items": {
        "type": "object", "additionalProperties": False,
        "required": ["amplitude", "frequency", "error"],
        "properties": {"amplitude": BY_JOINT, "frequency": {"type": "number"}, "error": SHARE}}},
    "method": {"enum": ["ihb", "shooting", None]},
    "harmonics": {"type": "integer", "minimum": 1},
    "work": {"type": "integer", "minimum": 0},
    "residual": SHARE,
    "estimated_error": SHARE,
    "multiplier": SHARE,
    "taxi_velocity": {"type": "number"},
    "linear_damping": {"type": "number"},
    "quadratic_damping": {"type": "number"},
    "coulomb_torque": {"type": "number"},
    "message": {"type": "string", "minLength": 1},
}
SCHEMA = {"type": "object", "additionalProperties": False, "required": list(PROPERTIES),
          "properties": PROPERTIES}
POINT = OperatingPoint(*reference_parameters(), 40.0)


@pytest.fixture
def verdict_is(monkeypatch):
    """Makes a verdict, whatever the point, with these values of Verdict's."""
    def give(outcome, **values):
        class Given:
            def __init__(self, settings):
                self.settings = settings

            def predict(self, point):
                return Verdict(point, self.settings, outcome, **values)

        monkeypatch.setattr(predict, "Predictor", Given)

    return give


def said(capsys, *options, status=0):
    """The lines for people."""
    assert main(["predict", "--velocity=40", *options]) == status
    captured = capsys.readouterr()
    assert captured.err == ""
    return captured.out.splitlines()


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
    assert answer["harmonics"] >= 16
    assert answer["estimated_error"] <= 0.01
    assert answer["residual"] < 1e-9
    assert answer["multiplier"] < 1.0
    assert answer["method"] in ("ihb", "shooting")
    assert answer["beyond_limits"] == []
    assert (answer["linear_damping"], answer["quadratic_damping"], answer["coulomb_torque"]) == (
        2.0, case["quadratic_damping"], case["coulomb_torque"])


def test_the_peak_velocity_of_a_nearly_harmonic_cycle(capsys):
    answer = answered(capsys, "--velocity=60", "--harmonics=1", "--accuracy=0.5")
    assert (answer["method"], answer["harmonics"]) == ("ihb", 1)
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


def test_a_limit_cycle_says_which_disturbance_grows_to_it(capsys, verdict_is):
    orbit = Predictor().predict(POINT).orbit
    for values, words in (
            ({}, "A growing oscillation would reach it."),
            ({"rest_is_stable": False, "kick": Kick(0.0, 0.0)},
             "A growing oscillation would reach it: rest is unstable, any disturbance grows."),
            ({"rest_is_stable": True},
             "A growing oscillation would reach it: rest is stable, small disturbances die."),
            ({"rest_is_stable": True, "kick": Kick(0.53, 0.64)},
             "A growing oscillation would reach it: a kick of the swivel of 0.53 rad/s dies, one "
             "of 0.64 rad/s grows."),
            ({"rest_is_stable": True, "kick": Kick(0.0, 0.5, 8.0)},
             "A growing oscillation would reach it: a kick of 0.5 rad/s grows, and one of 8 rad/s "
             "grows without bound.")):
        verdict_is(Outcome.LIMIT_CYCLE, orbit=orbit, **values)
        lines = said(capsys)
        assert lines[0].startswith("Limit cycle at 12.0281 Hz: swivel ")
        assert lines[1] == words
        answer = answered(capsys, "--velocity=40")
        kick = values.get("kick")
        assert answer["kick"] == (kick and {
            "dies": kick.dies, "grows": kick.grows, "unbounded": kick.unbounded})
        assert answer["rest_is_stable"] is values.get("rest_is_stable")


def test_further_stable_cycles_are_listed(capsys, verdict_is):
    orbit = Predictor().predict(POINT).orbit
    other = Predictor().predict(OperatingPoint(POINT.gear, POINT.damper, 60.0)).orbit
    verdict_is(Outcome.LIMIT_CYCLE, orbit=orbit, further=(other,))
    assert said(capsys)[3].startswith(
        "Another stable limit cycle, which other disturbances reach, at "
        f"{other.frequency_hz:.4f} Hz: swivel {other.swivel:.5f} rad")
    (further,) = answered(capsys, "--velocity=40")["further_stable_cycles"]
    assert [further["amplitude"][joint] for joint in JOINTS] == other.amplitude.tolist()
    assert (further["frequency"], further["error"]) == (other.frequency_hz, other.error)


def test_the_limits_of_the_gear_file_mark_the_answer(capsys, tmp_path):
    limits = tmp_path / "limits.yaml"
    limits.write_text("/**: {ros__parameters: {limits: {swivel: 0.1}}}")
    files = [f"--gear={CONFIG / 'reference_gear.yaml'}", f"--gear={limits}"]
    answer = answered(capsys, "--velocity=40", *files)
    swivel = answer["amplitude"]["swivel"]
    assert answer["outcome"] == "limit_cycle"
    assert answer["beyond_limits"] == [{"quantity": "swivel", "value": swivel, "limit": 0.1}]
    assert (f"Hz BEYOND THE MODEL'S LIMITS (swivel {swivel:.4g} rad > 0.1 rad): swivel "
            in said(capsys, *files)[0])
    assert "BEYOND" not in said(capsys)[0]


def test_a_solve_that_does_not_converge_ends_with_1(capsys, verdict_is):
    verdict_is(Outcome.NOT_CONVERGED, reason="the residual stays at 1e-2", work=50)
    answer = answered(capsys, "--velocity=40", status=1)
    assert (answer["outcome"], answer["work"]) == ("not_converged", 50)
    assert answer["amplitude"] is answer["frequency"] is answer["residual"] is None
    assert said(capsys, status=1) == ["Did not converge; the residual stays at 1e-2."]


def test_motion_without_bound_ends_with_3(capsys, verdict_is):
    verdict_is(Outcome.UNBOUNDED, rest_is_stable=True, kick=Kick(0.5, 0.6))
    answer = answered(capsys, "--velocity=40", status=3)
    assert answer["outcome"] == "unbounded"
    assert answer["amplitude"] is answer["peak_velocity"] is answer["frequency"] is None
    assert answer["kick"] == {"dies": 0.5, "grows": 0.6, "unbounded": None}
    assert answer["message"].startswith("unbounded: motion grows ")
    assert "a kick of the swivel of 0.6 rad/s leads there, one of 0.5 rad/s dies" in (
        answer["message"])
    assert said(capsys, status=3) == [f"U{answer['message'][1:]}."]


def test_motion_that_is_not_periodic_is_an_answer_with_bounds(capsys, verdict_is):
    verdict_is(Outcome.NOT_PERIODIC, envelope=np.array([0.05, 0.75, 0.3, 0.04]))
    answer = answered(capsys, "--velocity=40")
    assert answer["outcome"] == "not_periodic"
    assert answer["envelope"] == {"strut_tilt": 0.05, "swivel": 0.75, "damper": 0.3,
                                  "tyre_lateral": 0.04}
    assert answer["amplitude"] is answer["frequency"] is None
    assert [item["quantity"] for item in answer["beyond_limits"]] == ["swivel"]
    (line,) = said(capsys)
    assert line.startswith("Not periodic BEYOND THE MODEL'S LIMITS (swivel 0.75 rad > 0.5 rad): ")
    assert "it stays below swivel 0.75000 rad (42.972 deg), damper 0.30000 rad" in line


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
    (["--velocity=40", "--accuracy=0"], ["accuracy", "0", "[1e-09, 0.5]"]),
    (["--velocity=40", "--budget=nan"], ["budget", "nan", "[0.001, 1000] s"]),
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
    ("/**: {ros__parameters: {limits: {swivel: 4.0}}}", ["limits.swivel", "4", "rad"]),
    ("/**: {ros__parameters: {limits: {tilt: 0.1}}}", ["limits.tilt"]),
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
    ("40", r"4 harmonics, relative residual .*, estimated error .*"),
    ("7.2", r"By shooting: relative residual .*, estimated error .*")])
def test_the_text_says_how_the_cycle_was_found(velocity, how, capsys):
    assert main(["predict", "--velocity", velocity]) == 0
    assert re.fullmatch(how, capsys.readouterr().out.splitlines()[2])
