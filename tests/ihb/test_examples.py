"""The examples of the documentation, run as a user would, against an independent integration."""

import os
import re
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest
from scipy.integrate import solve_ivp
from scipy.optimize import brentq

ROOT = Path(__file__).resolve().parents[2]
EXAMPLE = ROOT / "docs" / "examples" / "van_der_pol.py"
LINE = re.compile(r"T = (\S+): amplitude (\S+) \(known (\S+)\), frequency (\S+) rad/s "
                  r"\(known (\S+)\), (\w+), \d+ harmonics")
MU = 1.0


def next_turn(amplitude, torque):
    """When and where the motion from rest at ``amplitude`` > torque comes to rest again."""
    def stopped(_, state):
        return state[1]

    stopped.terminal, stopped.direction = True, 1.0
    motion = solve_ivp(
        lambda _, state: [state[1], MU * (1.0 - state[0]**2) * state[1] + torque - state[0]],
        (0.0, 20.0), [amplitude, 0.0], method="DOP853", rtol=1e-12, atol=1e-13, events=stopped)
    return motion.t_events[0][-1], motion.y_events[0][-1][0]


def integrated(torque):
    """Amplitude and frequency of the cycle, for which half a period turns the motion round."""
    amplitude = brentq(lambda start: start + next_turn(start, torque)[1], 1.5, 2.5, xtol=1e-11)
    return amplitude, np.pi / next_turn(amplitude, torque)[0]


def test_the_van_der_pol_oscillator_that_rubs(tmp_path):
    path = os.pathsep.join(filter(None, [str(ROOT), os.environ.get("PYTHONPATH")]))
    run = subprocess.run([sys.executable, str(EXAMPLE)], cwd=tmp_path, check=True, timeout=120,
                         capture_output=True, text=True, env={**os.environ, "PYTHONPATH": path})
    assert run.stderr == ""
    printed = [LINE.fullmatch(line).groups() for line in run.stdout.splitlines()]
    assert [float(line[0]) for line in printed] == [0.0, 0.1]
    for (torque, amplitude, known_amplitude, frequency, known_frequency, kind), accuracy in (
            zip(printed, (1e-8, 1e-4), strict=True)):
        expected = integrated(float(torque))
        assert (float(known_amplitude), float(known_frequency)) == pytest.approx(expected, abs=1e-9)
        assert (float(amplitude), float(frequency)) == pytest.approx(expected, rel=accuracy)
        assert kind == "stable"


def test_an_example_is_short():
    code = [line for line in EXAMPLE.read_text(encoding="utf-8").splitlines() if line.strip()]
    assert len(code) <= 25
