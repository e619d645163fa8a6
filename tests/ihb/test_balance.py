import numpy as np
import pytest
from hypothesis import assume, given
from hypothesis import strategies as st

from shimmy_ros.ihb.balance import balance, recovered
from shimmy_ros.ihb.elements import Coulomb, OddElement, QuadraticDamping
from shimmy_ros.ihb.harmonics import evaluate, orders, velocity_zeros
from shimmy_ros.ihb.system import System

SEEDS = st.integers(0, 2**32 - 1)
HARMONICS = st.integers(1, 8)
FREQUENCY = 1.3
EVERY = (0, 1, 2, 3)

COUPLED = OddElement(
    (3, 1), lambda q, v: np.array([q[0] ** 2 * v[1], q[1] ** 3 - v[0] ** 3]),
    lambda q, v: np.array([[2.0 * q[0] * v[1], 0.0 * q[0]], [0.0 * q[0], 3.0 * q[1] ** 2]]),
    lambda q, v: np.array([[0.0 * q[0], q[0] ** 2], [-3.0 * v[0] ** 2, 0.0 * q[0]]]))
ELEMENTS = {
    "rubbing": (Coulomb(1, 2.0), QuadraticDamping(2, 0.8)),
    "twice": (Coulomb(1, 2.0), QuadraticDamping(1, 0.8), Coulomb(1, -0.5)),
    "coupled": (COUPLED,),
    "linear": (),
}
ACTIVE = {"rubbing": (1, 2), "twice": (0, 1), "coupled": (1, 3), "linear": (2,)}


def random_system(rng, elements):
    """No symmetry, and no undamped resonance of the coordinates that are eliminated."""
    mass = np.eye(4) + 0.1 * rng.standard_normal((4, 4))
    damping = 2.0 * np.eye(4) + 0.3 * rng.standard_normal((4, 4))
    return System(mass, damping, 3.0 * rng.standard_normal((4, 4)), elements)


def random_orbit(rng, harmonics):
    orbit = rng.standard_normal((4, 2 * harmonics)) / np.tile(orders(harmonics), 2)
    for row in orbit:
        reversals = np.abs(evaluate(row, velocity_zeros(row), 2))
        assume(np.min(reversals) > 0.05 * orders(harmonics)[-1])
    return orbit


def close(value, expected, tolerance=1e-6):
    """Whether every column of ``value`` is ``expected`` relative to the column's size."""
    error, size = (np.max(np.abs(x), axis=0) for x in (value - expected, expected))
    return np.all(error <= tolerance * size)


def test_without_elements_it_is_the_equation_of_motion_of_every_harmonic():
    rng = np.random.default_rng(3)
    system, orbit = random_system(rng, ()), rng.standard_normal((4, 6))
    residual = balance(system, orbit, FREQUENCY, EVERY).residual.reshape(4, 6)
    tau = np.linspace(0.0, 6.0, 11)
    motion = (FREQUENCY**2 * system.mass @ evaluate(orbit, tau, 2)
              + FREQUENCY * system.damping @ evaluate(orbit, tau, 1)
              + system.stiffness @ evaluate(orbit, tau))
    assert evaluate(residual, tau) == pytest.approx(motion)


@given(SEEDS, HARMONICS, st.sampled_from(sorted(ELEMENTS)), st.booleans())
def test_every_column_is_a_derivative_of_the_residual(differences, seed, harmonics, name, whole):
    rng = np.random.default_rng(seed)
    system = random_system(rng, ELEMENTS[name])
    active = EVERY if whole else ACTIVE[name]
    orbit = random_orbit(rng, harmonics)[list(active)]
    strength = tuple(type(e)(e.dof, 0.4) for e in system.elements if e is not COUPLED)
    change = System(*rng.standard_normal((3, 4, 4)), strength)

    def at(parameter):
        elements = tuple(
            type(e)(e.dof, (e.torque if isinstance(e, Coulomb) else e.coefficient)
                    + 0.4 * parameter) if e is not COUPLED else e for e in system.elements)
        return System(system.mass + parameter * change.mass,
                      system.damping + parameter * change.damping,
                      system.stiffness + parameter * change.stiffness, elements)

    found = balance(system, orbit, FREQUENCY, active, change)
    assert close(found.by_coefficients, differences(
        lambda moved: balance(system, moved, FREQUENCY, active).residual, orbit))
    assert close(found.by_frequency, differences(
        lambda moved: balance(system, orbit, moved[0], active).residual, [FREQUENCY])[:, 0])
    assert close(found.by_parameter, differences(
        lambda moved: balance(at(moved[0]), orbit, FREQUENCY, active).residual, [0.0])[:, 0])
    assert balance(system, orbit, FREQUENCY, active).by_parameter is None


@given(SEEDS, HARMONICS, st.sampled_from(sorted(ELEMENTS)))
def test_the_condensed_balance_is_the_schur_complement_of_the_full_one(seed, harmonics, name):
    rng = np.random.default_rng(seed)
    system, active = random_system(rng, ELEMENTS[name]), ACTIVE[name]
    change = System(*rng.standard_normal((3, 4, 4)))
    orbit = recovered(system, random_orbit(rng, harmonics)[list(active)], FREQUENCY, active)
    full = balance(system, orbit, FREQUENCY, EVERY, change)
    small = balance(system, orbit[list(active)], FREQUENCY, active, change)

    kept = np.isin(np.repeat(EVERY, 2 * harmonics), active)
    assert np.max(np.abs(full.residual[~kept])) <= 1e-11 * np.max(np.abs(full.residual[kept]))
    assert close(small.residual, full.residual[kept], 1e-11)
    gain = np.linalg.solve(full.by_coefficients[~kept][:, ~kept].T,
                           full.by_coefficients[kept][:, ~kept].T).T
    assert close(small.by_coefficients, full.by_coefficients[kept][:, kept]
                 - gain @ full.by_coefficients[~kept][:, kept], 1e-10)
    for of_small, of_full in ((small.by_frequency, full.by_frequency),
                              (small.by_parameter, full.by_parameter)):
        assert close(of_small, of_full[kept] - gain @ of_full[~kept], 1e-10)


def test_the_error_is_relative_to_the_terms():
    system = System([[1.0]], [[0.0]], [[4.0]])
    orbit = np.array([[3.0, 0.0]])
    assert balance(system, orbit, 2.0, (0,)).error == 0.0
    assert balance(system, orbit, 1.0, (0,)).error == pytest.approx(1.0)
    assert balance(system, 1e9 * orbit, 1.0, (0,)).error == pytest.approx(1.0)
    assert balance(system, 0.0 * orbit, 1.0, (0,)).error == 0.0


@pytest.mark.parametrize(("system", "orbit", "active"), [
    # Coordinate 1, eliminated, resonates undamped at the third harmonic.
    (System(np.eye(2), np.zeros((2, 2)), np.diag([5.0, 9.0])), np.ones((1, 4)), (0,)),
    (System(np.eye(1), np.eye(1), np.eye(1), (Coulomb(0, 1.0),)), np.zeros((1, 4)), (0,)),
])
def test_where_the_balance_is_not_defined_its_error_is_infinite(system, orbit, active):
    assert balance(system, orbit, 1.0, active).error == np.inf
