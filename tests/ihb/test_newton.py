from itertools import pairwise

import numpy as np
import pytest

from shimmy_ros.ihb.balance import balance
from shimmy_ros.ihb.harmonics import peaks, shifted
from shimmy_ros.ihb.newton import (
    RESIDUAL_TOLERANCE,
    STABLE_ORIENTATION,
    Phase,
    Point,
    jacobian,
    moved,
    newton,
    phase_of,
    scales,
    unknowns,
)
from shimmy_ros.ihb.system import System

ALONE = (0,)


def cosine(amplitude, harmonics, frequency=1.0):
    coefficients = np.zeros((1, 2 * harmonics))
    coefficients[0, 0] = amplitude
    return Point(coefficients, frequency)


def test_the_frequency_takes_the_place_of_the_held_coefficient():
    phase = phase_of((1, 2), 3, 2)
    assert phase == Phase(9)
    point = Point(np.arange(1.0, 13.0).reshape(2, 6), 50.0)
    vector = unknowns(point, phase)
    assert vector.tolist() == [1, 2, 3, 4, 5, 6, 7, 8, 9, 50, 11, 12]
    back = moved(point, phase, 2.0 * vector)
    assert back.frequency == 100.0
    assert back.coefficients[1].tolist() == [14, 16, 18, 10, 22, 24]
    size = scales(point, phase)
    assert size[0] == np.linalg.norm(point.coefficients[0])
    assert size[9] == 50.0
    assert size[10] == np.linalg.norm(point.coefficients[1])


def test_convergence_is_quadratic(van_der_pol, rubbing):
    for system in (van_der_pol(1.0), rubbing(0.5, 0.1, 0.2)):
        phase = phase_of(ALONE, 8, 0)
        exact = newton(system, cosine(2.3, 8), ALONE, phase).point
        solution = unknowns(exact, phase)
        disturbance = np.random.default_rng(0).standard_normal(solution.size)
        errors = [2e-3]
        vector = solution + errors[0] * disturbance / np.linalg.norm(disturbance)
        for _ in range(3):
            point = moved(exact, phase, vector)
            terms = balance(system, point.coefficients, point.frequency, ALONE)
            vector = vector - np.linalg.solve(jacobian(terms, phase), terms.residual)
            errors.append(float(np.linalg.norm(vector - solution)))
        for before, after in pairwise(errors):
            assert after <= max(50.0 * before**2, 1e-11)


@pytest.mark.parametrize("amplitude", [1.5, 2.0, 6.0])
@pytest.mark.parametrize("frequency", [0.7, 1.3])
def test_it_converges_from_afar(van_der_pol, amplitude, frequency):
    found = newton(van_der_pol(1.0), cosine(amplitude, 8, frequency), ALONE, phase_of(ALONE, 8, 0))
    assert found.converged
    assert found.message == "converged"
    assert found.residual <= RESIDUAL_TOLERANCE
    assert found.point.frequency == pytest.approx(0.94295584, abs=1e-6)
    assert found.orientation == STABLE_ORIENTATION


def test_the_phase_is_that_of_the_start(van_der_pol):
    phase = phase_of(ALONE, 8, 0)
    plain = newton(van_der_pol(1.0), cosine(2.0, 8), ALONE, phase).point
    tilted = newton(van_der_pol(1.0), Point(shifted(plain.coefficients, 0.4), plain.frequency),
                    ALONE, phase).point
    start = Point(shifted(cosine(2.0, 8).coefficients, 0.4), 1.0)
    found = newton(van_der_pol(1.0), start, ALONE, phase).point
    assert found.coefficients[0, 8] == start.coefficients[0, 8]
    assert found.frequency == pytest.approx(plain.frequency, rel=1e-12)
    assert peaks(found.coefficients) == pytest.approx(peaks(tilted.coefficients), rel=1e-9)


def test_the_determinant_tells_the_stable_cycle_from_the_unstable_one(rubbing):
    growth, torque, damping = 0.2, 0.05, 0.1
    brake = 8.0 * damping / (3.0 * np.pi)
    root = np.sqrt(growth**2 - 16.0 * brake * torque / np.pi)
    for sign in (1.0, -1.0):
        amplitude = (growth + sign * root) / (2.0 * brake)
        found = newton(rubbing(growth, torque, damping), cosine(1.05 * amplitude, 1), ALONE,
                       phase_of(ALONE, 1, 0))
        assert found.point.coefficients[0, 0] == pytest.approx(amplitude, rel=1e-9)
        assert found.orientation == sign * STABLE_ORIENTATION


def test_without_a_solution_it_says_that_it_did_not_converge(rubbing):
    found = newton(rubbing(0.2, 1.0, 0.1), cosine(2.0, 4), ALONE, phase_of(ALONE, 4, 0))
    assert not found.converged
    assert found.message in ("the residual stopped falling", "no convergence in 25 iterations",
                             "the Jacobian is singular")
    assert found.residual > RESIDUAL_TOLERANCE


def test_a_singular_jacobian_is_a_failure():
    found = newton(System([[1.0]], [[0.0]], [[1.0]]), cosine(2.0, 1), ALONE, phase_of(ALONE, 1, 0))
    assert not found.converged
    assert found.message == "the Jacobian is singular"
