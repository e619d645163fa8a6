"""x'' - mu x' + T sgn x' + D |x'| x' + x = 0: its cycles and its fold against exact shooting.

The expected cycles (amplitude, frequency) are those of event-exact shooting, to nine digits.
"""

import numpy as np
import pytest

from shimmy_ros.ihb.continuation import branch
from shimmy_ros.ihb.elements import Coulomb
from shimmy_ros.ihb.newton import STABLE_ORIENTATION, Point, phase_of
from shimmy_ros.ihb.solve import solve_cold
from shimmy_ros.ihb.stability import stability
from shimmy_ros.ihb.system import Family, System
from shimmy_ros.shooting.continuation import continue_branch
from shimmy_ros.shooting.periodic import limit_cycle

# mu, T, D, amplitude, frequency, stable
CYCLES = [
    (0.2, 0.05, 0.1, 0.380133057, 0.996899207, False),
    (0.2, 0.05, 0.1, 1.977690577, 0.999673640, True),
    (0.5, 0.1, 0.2, 0.285896890, 0.975794926, False),
    (0.5, 0.1, 0.2, 2.675197961, 0.996826861, True),
    (0.2, 0.0, 0.1, 2.358901328, 0.999081526, True),
]


def one_harmonic_amplitudes(growth, torque, damping):
    """The roots of 8 D/(3 pi) A^2 - mu A + 4 T/pi = 0."""
    return np.roots([8.0 * damping / (3.0 * np.pi), -growth, 4.0 * torque / np.pi])


@pytest.mark.parametrize(("growth", "torque", "damping", "amplitude", "frequency", "stable"),
                         CYCLES)
def test_both_cycles_are_found_to_a_millionth(
        rubbing, balanced, growth, torque, damping, amplitude, frequency, stable):
    system = rubbing(growth, torque, damping)
    guess = min(one_harmonic_amplitudes(growth, torque, damping),
                key=lambda root: abs(root - amplitude))
    cycles = [balanced(system, guess, harmonics) for harmonics in (4, 8, 16, 32, 64)]
    errors = np.array([cycle.amplitude()[0] for cycle in cycles]) - amplitude
    # The amplitude's error falls as 1/N^2 in the end, so that two answers give a third.
    assert np.all(np.abs(errors[1:]) < np.maximum(0.4 * np.abs(errors[:-1]), 1e-9))
    assert errors[-1] + (errors[-1] - errors[-2]) / 3.0 == pytest.approx(0.0, abs=1e-6)
    assert errors[-1] == pytest.approx(0.0, abs=2e-6)
    # The frequency's falls as 1/N with friction, for the series misses the kink at a reversal.
    slow = np.array([cycle.frequency for cycle in cycles]) - frequency
    order = 1.0 if torque else 3.0
    assert slow[-1] + (slow[-1] - slow[-2]) / (2.0**order - 1.0) == pytest.approx(0.0, abs=1e-6)
    for cycle in cycles:
        floquet = stability(system, cycle)
        assert floquet.stable == stable
        assert (cycle.orientation == STABLE_ORIENTATION) == stable
    exact = limit_cycle(system, np.array([0.0, amplitude * frequency]), 2.0 * np.pi / frequency)
    assert exact.cycle.amplitude[0] == pytest.approx(amplitude, abs=1e-9)
    assert exact.cycle.frequency == pytest.approx(frequency, abs=1e-9)
    assert floquet.multipliers[0].real == pytest.approx(exact.cycle.half_multipliers[0].real,
                                                        abs=1e-4)


@pytest.mark.parametrize(("growth", "torque", "damping", "amplitude"), [
    (0.2, 0.05, 0.1, 1.977690577), (0.5, 0.1, 0.2, 2.675197961), (0.2, 0.0, 0.1, 2.358901328)])
def test_a_cold_start_finds_the_stable_one(rubbing, growth, torque, damping, amplitude):
    cold = solve_cold(rubbing(growth, torque, damping), 32).limit_cycle
    assert cold.amplitude()[0] == pytest.approx(amplitude, abs=1e-6)


def test_the_fold_lies_where_shooting_says(rubbing, balanced):
    growth, damping = 0.2, 0.1

    def system(torque):
        return rubbing(growth, torque, damping)

    start = limit_cycle(system(0.05), np.array([0.0, 1.977]), 2.0 * np.pi).cycle
    exact = next(point for point in continue_branch(system, start, 0.05, direction=1, scale=0.1)
                 if point.fold)
    family = Family(system, lambda torque: System(
        [[0.0]], [[0.0]], [[0.0]], (Coulomb(0, 1.0),)))
    folds = []
    for harmonics in (1, 2, 4, 8, 16):
        cycle = balanced(system(0.05), 1.98, harmonics)
        points = branch(family, Point(cycle.coefficients, cycle.frequency), 0.05, 0.1, 1, (0,),
                        phase_of((0,), harmonics, 0))
        folds.append(next(point for point in points if point.is_fold).parameter)
    # The discriminant of the one-harmonic equation vanishes at T = 3 pi^2 mu^2 / (128 D).
    one_harmonic = 3.0 * np.pi**2 * growth**2 / (128.0 * damping)
    assert folds[0] == pytest.approx(one_harmonic, rel=1e-10)
    assert one_harmonic == pytest.approx(exact.parameter, rel=growth**2)
    errors = np.abs(np.array(folds) - exact.parameter)
    assert np.all(np.diff(errors) < 0.0)
    assert errors[-1] < 1e-6
    assert exact.cycle.amplitude[0] == pytest.approx(
        one_harmonic_amplitudes(growth, one_harmonic, damping).real[0], rel=growth**2)
