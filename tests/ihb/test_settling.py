"""Cold starts of relaxation oscillations, and of nonsense, against integrations."""

from functools import cache

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.integrate import solve_ivp

from shimmy_ros.ihb.elements import Coulomb, OddElement, QuadraticDamping
from shimmy_ros.ihb.harmonics import to_complex
from shimmy_ros.ihb.newton import STABLE_ORIENTATION
from shimmy_ros.ihb.settling import settled_motions
from shimmy_ros.ihb.solution import LimitCycle, Outcome
from shimmy_ros.ihb.solve import solve_cold, solve_warm
from shimmy_ros.ihb.stability import stability
from shimmy_ros.ihb.system import System


def van_der_pol(mu):
    element = OddElement((0,), lambda q, v: mu * q**2 * v, lambda q, v: (2.0 * mu * q * v)[None],
                         lambda q, v: (mu * q**2)[None])
    return System([[1.0]], [[-mu]], [[1.0]], (element,))


def rayleigh(mu):
    element = OddElement((0,), lambda q, v: mu / 3.0 * v**3, lambda q, v: (0.0 * q)[None],
                         lambda q, v: (mu * v**2)[None])
    return System([[1.0]], [[-mu]], [[1.0]], (element,))


@cache
def integrated(oscillator, mu, torque=0.0):
    """Amplitude and period of the cycle, by half periods from one turn to the next."""
    force = {van_der_pol: lambda x, v: mu * (1.0 - x * x) * v,
             rayleigh: lambda x, v: mu * (v - v**3 / 3.0)}[oscillator]

    def turns(_, state):
        return state[1]

    turns.terminal, turns.direction = True, 1.0
    amplitude = 2.5
    for _ in range(4 if torque == 0.0 else 30):
        motion = solve_ivp(
            lambda _, y: [y[1], force(y[0], y[1]) + torque - y[0]], (0.0, 60.0),
            [amplitude, -1e-12], method="DOP853", rtol=1e-11, atol=1e-13, events=turns)
        amplitude, half = -motion.y_events[0][-1][0], motion.t_events[0][-1]
    return amplitude, 2.0 * half


CASES = [(mu, harmonics, error) for mu, errors in (
    (3.0, (5e-4, 1e-6, 1e-8)), (5.0, (3e-3, 2e-5, 1e-6)), (10.0, (0.07, 0.03, 3e-3)))
    for harmonics, error in zip((16, 32, 64), errors, strict=True)]


@pytest.mark.parametrize("oscillator", [van_der_pol, rayleigh])
@pytest.mark.parametrize(("mu", "harmonics", "error"), CASES)
def test_relaxation_oscillations_are_found_from_rest(oscillator, mu, harmonics, error):
    result = solve_cold(oscillator(mu), harmonics)
    amplitude, period = integrated(oscillator, mu)
    assert result.outcome is Outcome.LIMIT_CYCLE, result.message
    assert not result.warm
    assert result.limit_cycle.orientation == STABLE_ORIENTATION
    assert result.limit_cycle.amplitude()[0] == pytest.approx(amplitude, rel=error)
    assert result.limit_cycle.period == pytest.approx(period, rel=error)


def test_a_hundred_and_twenty_eight_harmonics_give_the_published_period():
    cycle = solve_cold(van_der_pol(10.0), 128).limit_cycle
    assert cycle.period == pytest.approx(19.0783695, rel=1e-6)
    found = stability(van_der_pol(10.0), cycle)
    assert found.reliable
    assert found.stable
    assert abs(found.multipliers[0]) < 1e-6


@pytest.mark.parametrize("scale", [1e-6, 1e4])
def test_the_unit_of_length_does_not_matter(scale):
    mu = 3.0
    element = OddElement(
        (0,), lambda q, v: mu * (q / scale) ** 2 * v,
        lambda q, v: (2.0 * mu * q * v / scale**2)[None],
        lambda q, v: (mu * (q / scale) ** 2)[None])
    cycle = solve_cold(System([[1.0]], [[-mu]], [[1.0]], (element,)), 16).limit_cycle
    expected = solve_cold(van_der_pol(mu), 16).limit_cycle
    assert cycle.amplitude() / scale == pytest.approx(expected.amplitude(), rel=1e-6)
    assert cycle.frequency == pytest.approx(expected.frequency, rel=1e-9)


@pytest.mark.parametrize("torque", [0.1, 0.3])
def test_a_relaxation_oscillation_that_rubs_is_reached_by_its_friction(torque):
    plain = van_der_pol(3.0)
    system = System(plain.mass, plain.damping, plain.stiffness,
                    (Coulomb(0, torque), *plain.elements))
    result = solve_cold(system, 64)
    amplitude, period = integrated(van_der_pol, 3.0, torque)
    assert result.limit_cycle.amplitude()[0] == pytest.approx(amplitude, rel=1e-4)
    assert result.limit_cycle.period == pytest.approx(period, rel=1e-3)


def test_a_relaxation_oscillator_that_drives_another_mass():
    system = System(np.eye(2), np.diag([-3.0, 0.5]), np.array([[1.2, -0.2], [-0.2, 2.0]]),
                    (*van_der_pol(3.0).elements, QuadraticDamping(1, 0.3)))
    motion = next(settled_motions(system, [], 48))
    cycle = solve_cold(system, 48).limit_cycle
    assert np.abs(to_complex(cycle.coefficients)[:, :3]) == pytest.approx(
        np.abs(to_complex(motion.coefficients)[:, :3]), rel=1e-4)
    assert cycle.frequency == pytest.approx(motion.frequency, rel=1e-5)


def test_what_grows_without_bound_settles_to_nothing():
    system = System([[1.0]], [[-3.0]], [[1.0]], (OddElement(
        (0,), lambda q, v: -q**2 * v, lambda q, v: (-2.0 * q * v)[None],
        lambda q, v: (-q**2)[None]),))
    assert list(settled_motions(system, [], 4)) == []
    assert solve_cold(system, 4).outcome is Outcome.NOT_CONVERGED


def test_friction_alone_settles_to_nothing():
    system = System([[1.0]], [[-3.0]], [[1.0]], (Coulomb(0, 0.1),))
    assert solve_cold(system, 4).outcome is not Outcome.LIMIT_CYCLE


NUMBERS = st.one_of(st.floats(-10.0, 10.0), st.floats(allow_nan=False, allow_infinity=False),
                    st.sampled_from([0.0, 5e-324, 1e-300, 1e300]))
FEW = st.lists(NUMBERS, min_size=4, max_size=4)


@settings(max_examples=15)
@given(FEW, FEW, FEW, NUMBERS, NUMBERS, st.lists(NUMBERS, min_size=2, max_size=2))
def test_nonsense_ends_with_a_sentence(mass, damping, stiffness, torque, drag, cubic):
    first, second = cubic
    element = OddElement((0,), lambda q, v: first * q**3 + second * q**2 * v,
                         lambda q, v: (3.0 * first * q**2 + 2.0 * second * q * v)[None],
                         lambda q, v: (second * q**2)[None])
    system = System(*(np.reshape(entries, (2, 2)) for entries in (mass, damping, stiffness)),
                    (Coulomb(1, abs(torque)), QuadraticDamping(1, abs(drag)), element))
    try:
        system.check()
    except ValueError:
        with pytest.raises(ValueError, match="mass is singular"):
            solve_cold(system, 2)
    else:
        assert solve_cold(system, 2).message
        start = LimitCycle(np.array([[torque, 1.0, 0.0, 0.0], [drag, 0.1, 0.0, 1.0]]), 1.0, -1)
        assert solve_warm(system, start).message
