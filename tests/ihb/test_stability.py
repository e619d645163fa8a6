"""Floquet multipliers of the balance's cycles: against shooting, simulation and Liouville."""

from functools import cache

import numpy as np
import pytest

from shimmy_ros.cycles.one_harmonic import one_harmonic_cycles
from shimmy_ros.cycles.orbits import balance_orbit, converge, shoot
from shimmy_ros.gear.matrices import SWIVEL
from shimmy_ros.gear.parameter_file import reference_parameters
from shimmy_ros.gear.parameters import changed
from shimmy_ros.gear.system import OperatingPoint, gear_system
from shimmy_ros.ihb.elements import Coulomb, OddElement, QuadraticDamping
from shimmy_ros.ihb.harmonics import evaluate, shifted, velocity_zeros, with_harmonics
from shimmy_ros.ihb.solution import LimitCycle
from shimmy_ros.ihb.solve import solve_cold
from shimmy_ros.ihb.stability import Stability, StickingError, half_period_map, stability
from shimmy_ros.ihb.system import System
from shimmy_ros.shooting.flow import advance
from shimmy_ros.shooting.modes import model_of
from shimmy_ros.shooting.periodic import limit_cycle
from shimmy_ros.simulation.simulation import Simulation

HARMONICS, STEPS = 64, 640
# C_d, T_CF, V, and which cycle of one harmonic, the smallest first: enough harmonics for 1e-4.
STABLE = [(quadratic, torque, velocity, 1)
          for quadratic, torque, lowest in ((5, 5, 10), (10, 20, 15), (20, 15, 15), (50, 10, 30))
          for velocity in (10, 15, 20, 30, 40, 70, 100) if velocity >= lowest]
# Where the friction weighs more, the error still falls as 1/N at sixty-four of them.
SLOW = [(10, 20, 10, 1), (20, 15, 10, 1), (50, 10, 10, 1), (50, 10, 20, 1), (10, 150, 40, 1)]
UNSTABLE = [(10, 140, 60, 0), (5, 300, 60, 0)]


def at(quadratic_damping, coulomb_torque, velocity):
    gear, damper = reference_parameters()
    return OperatingPoint(gear, changed(damper, quadratic_damping=quadratic_damping,
                                        coulomb_torque=coulomb_torque), float(velocity))


@cache
def balanced(quadratic_damping, coulomb_torque, velocity, which, harmonics=HARMONICS):
    """The system and the balance's cycle near a cycle of one harmonic."""
    point = at(quadratic_damping, coulomb_torque, velocity)
    guess = one_harmonic_cycles(point)[which]
    system = gear_system(point)
    cycle = converge(system, with_harmonics(guess.coefficients, harmonics), guess.frequency)
    assert cycle is not None
    return system, cycle


@cache
def exact(case):
    """Shooting's multipliers of the half-period map."""
    system, cycle = balanced(*case)
    orbit = shoot(system, *balance_orbit(system, cycle).initial_state())
    assert not orbit.sticks
    assert orbit.swivel == pytest.approx(cycle.amplitude()[SWIVEL], rel=0.02)
    return orbit.source.half_multipliers


def paired(found, expected):
    """``found`` in the order of ``expected``, each with the nearest that is left."""
    left, result = list(found), []
    for value in expected:
        result.append(left.pop(int(np.argmin(np.abs(np.array(left) - value)))))
    return np.array(result)


@pytest.mark.parametrize("case", STABLE)
def test_all_seven_multipliers_are_those_of_shooting(case):
    found = stability(*balanced(*case), STEPS)
    expected = exact(case)
    assert np.abs(paired(found.multipliers, expected) - expected).max() < 1e-4
    assert found.shift_error < 1e-5
    assert found.stable
    assert found.full_period == pytest.approx(found.multipliers**2)
    assert np.all(np.diff(np.abs(found.multipliers)) <= 0.0)


@pytest.mark.parametrize("case", [*SLOW, *UNSTABLE])
def test_where_friction_dominates_they_converge_to_those_of_shooting(case):
    expected = exact(case)
    found = [paired(stability(*balanced(*case, harmonics), STEPS).multipliers, expected)
             for harmonics in (32, 64, 128)]
    errors = [np.abs(values - expected).max() for values in found]
    assert errors[2] < 0.7 * errors[1] < 0.5 * errors[0]
    # The error falls as 1/N, so that two answers give a third.
    assert np.abs(2.0 * found[2] - found[1] - expected).max() < max(0.1 * errors[2], 1e-4)
    assert bool(np.abs(found[2]).max() < 1.0) is (case[3] == 1)


def test_few_harmonics_and_steps_tell_stable_from_unstable():
    for case, stable in [(STABLE[0], True), (SLOW[2], True), *((case, False) for case in UNSTABLE)]:
        assert stability(*balanced(*case, 4)).stable is stable


@pytest.mark.parametrize(("multipliers", "stable"), [
    ([0.9, -0.5, 0.1], True), ([-0.3 + 0.9j, -0.3 - 0.9j, 0.9], True),
    ([1.001, 0.2, 0.1], False), ([-1.1, 0.2, 0.1], False), ([-0.6 + 0.9j, -0.6 - 0.9j, 0.9], False),
    ([1.0, 0.2, 0.1], False)])
def test_stable_means_that_every_modulus_is_below_one(multipliers, stable):
    assert Stability(np.array(multipliers, dtype=complex), 0.0, True).stable is stable


def test_what_is_not_reliable_is_not_called_stable():
    assert not Stability(np.array([0.5 + 0.0j]), 0.5, False).stable


def test_it_converges_with_the_tolerance():
    system, cycle = balanced(10, 20, 40, 1)
    finest = half_period_map(system, cycle, tolerance=1e-11)
    errors = [np.abs((half_period_map(system, cycle, tolerance=tolerance) - finest)
                     / np.abs(finest).max()).max() for tolerance in (1e-2, 1e-4, 1e-6)]
    assert errors[1] < 0.1 * errors[0]
    assert errors[2] < 0.1 * errors[1]
    assert errors[2] < 1e-6


def test_the_map_is_the_derivative_of_the_flow():
    system, cycle = balanced(10, 20, 40, 1)
    # From where nothing turns, so that the phases of both agree.
    turned = LimitCycle(shifted(cycle.coefficients, 1.0), cycle.frequency, cycle.orientation)
    start = np.concatenate([turned.position(np.zeros(1))[:, 0], turned.velocity(np.zeros(1))[:, 0]])
    flow = advance(model_of(system), start, 0.5 * cycle.period, derivatives=True)
    size = np.concatenate([turned.amplitude(), turned.peak_velocity()])
    expected = flow.transition * size / size[:, None]
    found = half_period_map(system, turned, STEPS) * size / size[:, None]
    assert np.abs(found - expected).max() < 1e-3 * np.abs(expected).max()


def swings(point, state, period, count):
    """The swivel's successive peaks [rad] in a simulation from ``state``, by cubic interpolation.
    """
    simulation = Simulation(point.gear, point.damper, point.velocity, tolerance=1e-6)
    cosine, sine = np.cos(point.gear.strut_rake), np.sin(point.gear.strut_rake)
    # The simulation's last coordinate is the tyre's torsion.
    torsion = -state[7] / point.velocity - (cosine * state[1] - sine * state[0])
    simulation.set_state(np.append(state[:7], torsion))
    step = period / 128.0
    time = step * np.arange(1, 64 * count + 1)
    run = simulation.advance(float(time[-1]), time)
    place, rate = run.position[:, SWIVEL], run.velocity[:, SWIVEL]
    index = np.flatnonzero(rate[:-1] * rate[1:] < 0.0)
    part = rate[index] / (rate[index] - rate[index + 1])
    return np.abs((1.0 + 2.0 * part) * (1.0 - part)**2 * place[index]
                  + part**2 * (3.0 - 2.0 * part) * place[index + 1]
                  + step * part * (1.0 - part) * ((1.0 - part) * rate[index]
                                                  - part * rate[index + 1]))


@pytest.mark.parametrize("case", [(10, 20, 70, 1), (20, 15, 100, 1), (50, 10, 70, 1)])
def test_a_simulation_one_per_cent_off_a_stable_cycle_returns_at_the_rate_of_the_multiplier(case):
    system, cycle = balanced(*case)
    orbit = balance_orbit(system, cycle)
    state, period = orbit.initial_state()
    larger, smaller = (swings(at(*case[:3]), factor * state, period, 13) for factor in (1.01, 0.99))
    for peaks, sign in ((larger, 1.0), (smaller, -1.0)):
        assert sign * (peaks[0] / orbit.swivel - 1.0) > 3e-3
        assert peaks[-1] == pytest.approx(orbit.swivel, rel=2e-4)
    apart = larger[:9] - smaller[:9]
    dominant = stability(system, cycle, STEPS).multipliers[0]
    assert abs(dominant.imag) < 1e-12
    assert (apart[8] / apart[3])**0.2 == pytest.approx(dominant.real, rel=3e-3)


@pytest.mark.parametrize("case", UNSTABLE)
def test_a_simulation_one_per_cent_off_an_unstable_cycle_leaves_at_the_rate_of_the_multiplier(case):
    system, cycle = balanced(*case)
    orbit = balance_orbit(system, cycle)
    state, period = orbit.initial_state()
    larger, smaller = (swings(at(*case[:3]), factor * state, period, 60) for factor in (1.01, 0.99))
    dominant = stability(system, cycle, STEPS).multipliers[0].real
    assert dominant > 1.3
    apart = larger[:5] - smaller[:5]
    assert (apart[4] / apart[0])**0.25 == pytest.approx(dominant, rel=0.01)
    # Upwards to the stable cycle; downwards until friction holds the swivel.
    _, outer = balanced(*case[:3], 1)
    assert larger[-1] == pytest.approx(outer.amplitude()[SWIVEL], rel=2e-3)
    assert len(larger) >= 60
    assert len(smaller) < 12
    assert np.all(np.diff(smaller) < 0.0)


@pytest.mark.parametrize("torque", [0.0, 0.1, 0.3])
def test_the_product_of_the_multipliers_is_liouvilles(van_der_pol, torque):
    """det of the half-period map: exp of the integral of -2 c, times g+/g- at the reversal."""
    growth = 1.0
    plain = van_der_pol(growth)
    system = System(plain.mass, plain.damping, plain.stiffness,
                    (Coulomb(0, torque), QuadraticDamping(0, 0.05), *plain.elements))
    cycle = solve_cold(system, 48).limit_cycle
    (tau,) = velocity_zeros(cycle.coefficients[0])
    grid = tau + np.pi * (np.arange(20_000) + 0.5) / 20_000
    damping = (growth * (evaluate(cycle.coefficients[0], grid)**2 - 1.0)
               + 0.1 * np.abs(cycle.frequency * evaluate(cycle.coefficients[0], grid, 1)))
    smooth = np.exp(-np.mean(damping) * 0.5 * cycle.period)
    turn = abs(evaluate(cycle.coefficients[0], tau))
    jump = (turn - torque) / (turn + torque)
    found = np.linalg.det(half_period_map(system, cycle, STEPS))
    assert found == pytest.approx(smooth * jump, rel=1e-8)
    (multiplier,) = stability(system, cycle, STEPS).multipliers
    assert multiplier.real == pytest.approx(found, rel=0.02 if torque else 1e-6)


def test_friction_on_two_coordinates_is_that_of_shooting():
    stiffness = np.array([[2.0, -1.0], [-1.0, 2.4]])
    system = System(np.eye(2), np.diag([-0.3, 0.1]), stiffness,
                    (Coulomb(0, 0.05), Coulomb(1, 0.03), QuadraticDamping(1, 0.1)))
    cycle = solve_cold(system, 32).limit_cycle
    start = np.concatenate([cycle.position(np.zeros(1))[:, 0], cycle.velocity(np.zeros(1))[:, 0]])
    exact_cycle = limit_cycle(system, start, cycle.period).cycle
    assert not exact_cycle.sticks
    expected = exact_cycle.half_multipliers
    found = stability(system, cycle, STEPS).multipliers
    assert np.abs(paired(found, expected) - expected).max() < 1e-5
    assert np.abs(expected).max() > 0.8


@pytest.mark.parametrize("parts", [(0.06, 0.04), (0.1, 0.0)])
def test_two_frictions_on_one_coordinate_are_one(rubbing, parts):
    plain = rubbing(0.5, 0.1, 0.2)
    split = System(plain.mass, plain.damping, plain.stiffness,
                   (*(Coulomb(0, part) for part in parts), QuadraticDamping(0, 0.2)))
    cycle = solve_cold(plain, 32).limit_cycle
    assert half_period_map(split, cycle) == pytest.approx(half_period_map(plain, cycle), rel=1e-12)


def test_a_reversal_that_friction_would_hold_is_an_error():
    system, cycle = balanced(10, 120, 40, 0, 16)
    with pytest.raises(StickingError, match="friction on coordinate 1 sticks"):
        stability(system, cycle)


def test_a_coordinate_of_a_general_force_alone(van_der_pol):
    """x'' + (x^2 + x'^2 - 1) x' + x = 0 has x = cos t, and the multiplier exp(-pi)."""
    element = OddElement(
        (0,), lambda q, v: (q**2 + v**2) * v, lambda q, v: (2.0 * q * v)[None],
        lambda q, v: (q**2 + 3.0 * v**2)[None])
    system = System([[1.0]], [[-1.0]], [[1.0]], (element,))
    cycle = solve_cold(system, 3).limit_cycle
    found = stability(system, cycle, tolerance=1e-7)
    assert found.multipliers == pytest.approx([np.exp(-np.pi)], rel=1e-8)
    assert found.shift_error < 1e-8
    assert found.reliable


class Stiffening:
    """The force x^3, as the balance takes it, but of which nothing else is known."""

    dofs = (0,)

    def __init__(self):
        self._known = OddElement((0,), lambda q, v: q**3, lambda q, v: (3.0 * q**2)[None],
                                 lambda q, v: (0.0 * q)[None])
        self.balance = self._known.balance


def test_an_element_of_another_kind_is_refused(rubbing):
    plain = rubbing(0.2, 0.05, 0.1)
    system = System(plain.mass, plain.damping, plain.stiffness, (*plain.elements, Stiffening()))
    cycle = solve_cold(system, 4).limit_cycle
    assert cycle.frequency > 1.2
    with pytest.raises(ValueError, match="an element is Stiffening, but stability knows Coulomb"):
        stability(system, cycle)
