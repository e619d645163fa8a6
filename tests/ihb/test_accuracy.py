"""The estimated error against the true one, and solves to a requested accuracy."""

from dataclasses import replace
from functools import cache

import numpy as np
import pytest
from scipy.integrate import solve_ivp

from shimmy_ros.cycles.one_harmonic import one_harmonic_cycles
from shimmy_ros.cycles.orbits import balance_orbit, converge, shoot
from shimmy_ros.gear.parameter_file import reference_parameters
from shimmy_ros.gear.parameters import changed
from shimmy_ros.gear.system import OperatingPoint, gear_system
from shimmy_ros.ihb.accuracy import estimate_error, solve_to_accuracy
from shimmy_ros.ihb.elements import Coulomb, OddElement, QuadraticDamping
from shimmy_ros.ihb.harmonics import with_harmonics
from shimmy_ros.ihb.solution import LimitCycle, Outcome
from shimmy_ros.ihb.solve import solve_cold, solve_warm
from shimmy_ros.ihb.system import System

# growth, torque, damping, amplitude and frequency by exact shooting: stable and unstable.
ONE_COORDINATE = [
    (0.2, 0.05, 0.1, 0.380133057, 0.996899207), (0.2, 0.05, 0.1, 1.977690577, 0.999673640),
    (0.5, 0.1, 0.2, 0.285896890, 0.975794926), (0.5, 0.1, 0.2, 2.675197961, 0.996826861)]
# C_d, T_CF, V of the gear, and which cycle of one harmonic, the smallest first: the paper's cases,
# cycles near folds, and unstable ones.
GEAR_CYCLES = [
    (5, 5, 10, 1), (5, 5, 100, 1), (10, 20, 10, 1), (10, 20, 40, 1), (20, 15, 15, 1),
    (50, 10, 10, 1), (50, 10, 40, 1), (10, 150, 40, 1), (10, 150, 40, 0), (10, 140, 60, 0)]


@pytest.mark.parametrize(("growth", "torque", "damping", "amplitude", "frequency"), ONE_COORDINATE)
def test_the_estimate_covers_the_error_of_an_oscillator_that_rubs(
        rubbing, balanced, growth, torque, damping, amplitude, frequency):
    system = rubbing(growth, torque, damping)
    for harmonics in (1, 2, 4, 8, 16, 32):
        cycle = balanced(system, amplitude, harmonics)
        estimate = estimate_error(system, cycle)
        assert abs(cycle.amplitude()[0] / amplitude - 1.0) <= estimate.amplitude[0] + 2e-9
        error = abs(cycle.frequency / frequency - 1.0)
        assert error <= estimate.frequency + 2e-9
        if harmonics > 1:
            assert estimate.frequency <= 5.0 * error


@pytest.mark.parametrize("mu", [0.3, 1.0, 3.0])
def test_the_estimate_covers_the_error_of_a_van_der_pol_oscillator(van_der_pol, balanced, mu):
    system = van_der_pol(mu)
    exact = balanced(system, 2.0, 64)
    for harmonics in (2, 4, 8, 16):
        cycle = balanced(system, 2.0, harmonics)
        estimate = estimate_error(system, cycle)
        off = (abs(cycle.amplitude() / exact.amplitude() - 1.0)[0],
               abs(cycle.frequency / exact.frequency - 1.0))
        # With two harmonics Newton's step is too long for the smaller of the two to be covered.
        assert max(off) <= estimate.largest <= max(30.0 * max(off), 1e-11)
        if harmonics > 2:
            assert off[0] <= estimate.amplitude[0]
            assert off[1] <= estimate.frequency


@pytest.mark.parametrize("case", GEAR_CYCLES)
def test_the_estimate_covers_the_error_of_the_gear_and_is_not_much_larger(case):
    gear, damper = reference_parameters()
    quadratic, torque, velocity, which = case
    point = OperatingPoint(gear, changed(damper, quadratic_damping=quadratic,
                                         coulomb_torque=torque), float(velocity))
    system, guess = gear_system(point), one_harmonic_cycles(point)[which]
    exact = None
    for harmonics in (16, 8, 4, 2):
        cycle = converge(system, with_harmonics(guess.coefficients, harmonics), guess.frequency)
        if exact is None:
            exact = shoot(system, *balance_orbit(system, cycle).initial_state())
            assert not exact.sticks
            assert exact.stable is (which == 1)
        estimate = estimate_error(system, cycle)
        amplitude = np.abs(cycle.amplitude() / exact.amplitude - 1.0)
        frequency = abs(cycle.frequency_hz / exact.frequency_hz - 1.0)
        assert np.all(amplitude <= estimate.amplitude)
        assert frequency <= estimate.frequency
        assert estimate.largest <= 10.0 * max(amplitude.max(), frequency)


def test_an_estimate_is_of_the_cycle_and_not_of_its_phase_or_size(rubbing):
    plain = rubbing(0.5, 0.1, 0.2)
    scaled = rubbing(0.5, 0.3, 0.2 / 3.0)
    cycle = solve_cold(plain, 4).limit_cycle
    estimate = estimate_error(plain, cycle)
    tripled = replace(cycle, coefficients=3.0 * cycle.coefficients)
    other = estimate_error(scaled, tripled)
    assert other.amplitude == pytest.approx(estimate.amplitude, rel=1e-6)
    assert other.frequency == pytest.approx(estimate.frequency, rel=1e-6)
    mirrored = estimate_error(plain, replace(cycle, coefficients=-cycle.coefficients))
    assert mirrored.amplitude == pytest.approx(estimate.amplitude, rel=1e-6)
    assert estimate.largest == max(estimate.amplitude[0], estimate.frequency)


def test_where_no_step_exists_the_estimate_is_infinite(rubbing):
    at_rest = LimitCycle(np.zeros((1, 8)), 1.0, -1)
    estimate = estimate_error(rubbing(0.5, 0.1, 0.2), at_rest)
    assert estimate.largest == np.inf
    assert np.all(estimate.amplitude == np.inf)


@pytest.mark.parametrize("accuracy", [1e-2, 1e-3, 1e-4, 1e-5])
def test_the_accuracy_asked_for_is_reached_with_as_few_harmonics_as_a_doubling_allows(
        rubbing, accuracy):
    growth, torque, damping, amplitude, frequency = ONE_COORDINATE[3]
    system = rubbing(growth, torque, damping)
    result, estimate = solve_to_accuracy(system, accuracy)
    cycle = result.limit_cycle
    assert estimate.largest <= accuracy
    assert cycle.amplitude()[0] == pytest.approx(amplitude, rel=estimate.amplitude[0] + 1e-9)
    assert cycle.frequency == pytest.approx(frequency, rel=estimate.frequency + 1e-9)
    assert not result.warm
    assert result.iterations > 0
    if cycle.harmonics > 4:
        fewer = solve_cold(system, cycle.harmonics // 2).limit_cycle
        assert estimate_error(system, fewer).largest > accuracy


def test_what_cannot_be_reached_comes_with_the_estimate_that_it_has(rubbing):
    system = rubbing(0.5, 0.1, 0.2)
    result, estimate = solve_to_accuracy(system, 1e-9, largest=16)
    assert result.outcome is Outcome.LIMIT_CYCLE
    assert result.limit_cycle.harmonics == 16
    assert 1e-9 < estimate.largest < 1e-3


def test_a_start_near_by_is_gone_on_from(rubbing):
    system = rubbing(0.5, 0.1, 0.2)
    start = solve_cold(rubbing(0.5, 0.101, 0.2), 8).limit_cycle
    warm, estimate = solve_to_accuracy(system, 1e-4, start)
    cold, _ = solve_to_accuracy(system, 1e-4)
    assert warm.warm
    assert estimate.largest <= 1e-4
    assert warm.limit_cycle.harmonics == cold.limit_cycle.harmonics
    assert np.allclose(warm.limit_cycle.coefficients, cold.limit_cycle.coefficients, atol=1e-9)


@pytest.mark.parametrize(("growth", "torque", "damping", "outcome"), [
    (-0.2, 0.0, 0.1, Outcome.NO_LIMIT_CYCLE), (0.2, 1.0, 0.1, Outcome.NO_LIMIT_CYCLE)])
def test_without_a_limit_cycle_there_is_no_estimate(rubbing, growth, torque, damping, outcome):
    result, estimate = solve_to_accuracy(rubbing(growth, torque, damping), 1e-3)
    assert result.outcome is outcome
    assert estimate is None


def test_a_failure_stays_one():
    """A ball between two hollows: nothing that leaves the top settles to a cycle."""
    hollows = OddElement((0,), lambda q, v: q**3, lambda q, v: (3.0 * q**2)[None],
                         lambda q, v: (0.0 * q)[None])
    result, estimate = solve_to_accuracy(System([[1.0]], [[0.3]], [[-1.0]], (hollows,)), 1e-3)
    assert result.outcome is Outcome.NOT_CONVERGED
    assert estimate is None


@pytest.mark.parametrize(("mu", "accuracy", "period"), [
    (3.0, 1e-6, 8.859095499720), (5.0, 1e-6, 11.612230667717), (10.0, 1e-3, 19.078369566)])
def test_a_relaxation_oscillation_is_solved_with_as_many_harmonics_as_it_needs(
        van_der_pol, mu, accuracy, period):
    result, estimate = solve_to_accuracy(van_der_pol(mu), accuracy)
    cycle = result.limit_cycle
    assert cycle.harmonics >= 16
    assert estimate.largest <= accuracy
    assert cycle.period == pytest.approx(period, rel=estimate.frequency + 1e-9)


def steep(width, points):
    """x'' - 0.2 x' + 0.05 tanh(x' / width) + 0.1 |x'| x' + x = 0."""
    friction = OddElement(
        (0,), lambda q, v: 0.05 * np.tanh(v / width), lambda q, v: (0.0 * q)[None],
        lambda q, v: (0.05 / width / np.cosh(np.clip(v / width, -300.0, 300.0))**2)[None], points)
    return System([[1.0]], [[-0.2]], [[1.0]], (friction, QuadraticDamping(0, 0.1)))


@cache
def integrated(width):
    """Amplitude and frequency of the cycle outside, by integration."""
    def turns(_, state):
        return state[1]

    turns.direction = -1.0
    motion = solve_ivp(
        lambda _, y: [y[1], 0.2 * y[1] - 0.05 * np.tanh(y[1] / width) - 0.1 * abs(y[1]) * y[1]
                      - y[0]],
        (0.0, 300.0), [2.0, 0.0], method="LSODA", rtol=1e-10, atol=1e-12, events=turns)
    period = motion.t_events[0][-1] - motion.t_events[0][-2]
    return motion.y_events[0][-1][0], 2.0 * np.pi / period


@pytest.mark.parametrize("harmonics", [4, 16])
@pytest.mark.parametrize("points", [16, 64, 256])
@pytest.mark.parametrize("width", [0.1, 0.03, 0.01, 1e-3, 1e-5])
def test_the_estimate_covers_what_the_quadrature_of_a_steep_force_lacks(
        rubbing, width, points, harmonics):
    system = steep(width, points)
    cycle = solve_warm(system, solve_cold(rubbing(0.2, 0.05, 0.1), harmonics).limit_cycle
                       ).limit_cycle
    estimate = estimate_error(system, cycle)
    amplitude, frequency = integrated(width)
    assert cycle.amplitude()[0] == pytest.approx(amplitude, rel=estimate.amplitude[0] + 1e-8)
    assert cycle.frequency == pytest.approx(frequency, rel=estimate.frequency + 1e-8)
    if width <= 1e-3:
        # The points see a jump: more harmonics do not make up for it.
        assert estimate.largest > 2e-5


def test_a_coordinate_that_resonates_beyond_the_harmonics_is_seen_in_the_estimate():
    """The linear coordinate's own harmonics beyond N are part of it."""
    system = System(np.eye(2), np.diag([-0.3, 0.02]), np.array([[2.0, -1.0], [-1.0, 60.0]]),
                    (Coulomb(0, 0.05), QuadraticDamping(0, 0.1)))
    exact = solve_cold(system, 128).limit_cycle
    for harmonics in (1, 2, 3, 4, 8):
        cycle = solve_cold(system, harmonics).limit_cycle
        estimate = estimate_error(system, cycle)
        off = np.abs(cycle.amplitude() / exact.amplitude() - 1.0)
        assert np.all(off <= estimate.amplitude)

