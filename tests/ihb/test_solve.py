from dataclasses import replace
from itertools import pairwise

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from shimmy_ros.ihb.balance import balance
from shimmy_ros.ihb.elements import Coulomb, OddElement, QuadraticDamping
from shimmy_ros.ihb.harmonics import shifted, velocity_zeros
from shimmy_ros.ihb.newton import STABLE_ORIENTATION
from shimmy_ros.ihb.solution import LimitCycle, Outcome
from shimmy_ros.ihb.solve import follow, solve_cold, solve_warm
from shimmy_ros.ihb.system import Family, System

# growth, torque, damping; amplitude and frequency by shooting, to all digits given.
RUBBING = [
    (0.2, 0.0, 0.1, 2.358901328, 0.999081526),
    (0.2, 0.05, 0.1, 1.977690577, 0.999673640),
    (0.5, 0.1, 0.2, 2.675197961, 0.996826861),
]
# With one harmonic, where the outer and the inner cycle meet.
FOLD_TORQUE = 3.0 * np.pi**2 * 0.2**2 / (128.0 * 0.1)


def amplitude_of(result):
    assert result.outcome is Outcome.LIMIT_CYCLE, result.message
    return float(result.limit_cycle.amplitude()[0])


def friction_family():
    """growth 0.2 and damping 0.1 along the torque."""
    change = System([[0.0]], [[0.0]], [[0.0]], (Coulomb(0, 1.0),))
    return Family(lambda torque: System(
        [[1.0]], [[-0.2]], [[1.0]], (Coulomb(0, torque), QuadraticDamping(0, 0.1))),
        lambda torque: change)


def chain(growth, torque):
    """Six masses between walls; the first is driven, the fourth rubs, the last is damped."""
    count = 6
    stiffness = 2.0 * np.eye(count) - np.eye(count, k=1) - np.eye(count, k=-1)
    damping = 0.05 * stiffness
    damping[0, 0] -= growth
    return System(np.eye(count), damping, stiffness,
                  (Coulomb(3, torque), QuadraticDamping(5, 0.3)))


@pytest.mark.parametrize("mu", [1e-3, 1e-2, 0.1])
def test_the_weak_van_der_pol_oscillator_is_that_of_perturbation_theory(van_der_pol, mu):
    result = solve_cold(van_der_pol(mu), 6)
    assert amplitude_of(result) == pytest.approx(2.0 + mu**2 / 96.0, abs=mu**4)
    assert result.limit_cycle.frequency == pytest.approx(1.0 - mu**2 / 16.0, abs=mu**4)


def test_the_van_der_pol_oscillator_converges_to_its_published_values(van_der_pol):
    errors = []
    for harmonics in (1, 2, 4, 8, 16):
        result = solve_cold(van_der_pol(1.0), harmonics)
        errors.append((abs(amplitude_of(result) - 2.00861986087484),
                       abs(result.limit_cycle.period - 6.66328685932313)))
    assert errors[-1] == pytest.approx((0.0, 0.0), abs=1e-8)
    assert all(better[1] < worse[1] for worse, better in pairwise(errors))


@pytest.mark.parametrize("mu", [0.1, 1.0, 1.5])
def test_an_element_may_hold_its_linear_part_as_well(van_der_pol, mu):
    whole = OddElement(
        (0,), lambda q, v: mu * (q**2 - 1.0) * v, lambda q, v: (2.0 * mu * q * v)[None],
        lambda q, v: (mu * (q**2 - 1.0))[None])
    found = solve_cold(System([[1.0]], [[0.0]], [[1.0]], (whole,)), 12)
    expected = solve_cold(van_der_pol(mu), 12)
    assert amplitude_of(found) == pytest.approx(amplitude_of(expected), rel=1e-9)
    assert found.limit_cycle.frequency == pytest.approx(expected.limit_cycle.frequency, rel=1e-9)


def test_a_relaxation_oscillation_is_followed_from_a_gentle_one(van_der_pol):
    family = Family(van_der_pol, lambda mu: System(
        [[0.0]], [[-1.0]], [[0.0]], van_der_pol(1.0).elements))
    start = solve_cold(van_der_pol(1.0), 32).limit_cycle
    result = follow(family, start, 1.0, 5.0)
    assert amplitude_of(result) == pytest.approx(2.0215, abs=2e-4)
    assert result.limit_cycle.period == pytest.approx(11.6122, abs=1e-3)
    back = follow(family, result.limit_cycle, 5.0, 1.0)
    assert np.allclose(back.limit_cycle.coefficients, start.coefficients, atol=1e-8)


@pytest.mark.parametrize(("growth", "torque", "damping", "amplitude", "frequency"), RUBBING)
def test_friction_and_damping_converge_to_the_cycle_that_shooting_finds(
        rubbing, growth, torque, damping, amplitude, frequency):
    errors = []
    for harmonics in (1, 4, 16, 64):
        result = solve_cold(rubbing(growth, torque, damping), harmonics)
        errors.append((abs(amplitude_of(result) / amplitude - 1.0),
                       abs(result.limit_cycle.frequency / frequency - 1.0)))
    assert max(errors[0]) < 0.005
    assert errors[1][0] < 1e-5
    assert errors[3][0] < 3e-8
    # The jumps of the friction leave an error in the frequency that falls as 1 / N.
    assert errors[3][1] < (1e-9 if torque == 0.0 else 5e-6)
    for worse, better in pairwise(errors):
        assert better[0] < 0.3 * worse[0]
        assert better[1] < 0.4 * worse[1]


@pytest.mark.parametrize("scale", [1e-3, 0.1, 30.0])
def test_a_cycle_scales_with_its_torque_and_inversely_with_its_damping(rubbing, scale):
    plain, scaled = (solve_cold(system, 4) for system in (
        rubbing(0.5, 0.1, 0.2), rubbing(0.5, 0.1 * scale, 0.2 / scale)))
    assert amplitude_of(scaled) == pytest.approx(scale * amplitude_of(plain), rel=1e-9)
    assert scaled.limit_cycle.frequency == pytest.approx(plain.limit_cycle.frequency, rel=1e-9)


def test_what_is_found_says_how(rubbing):
    result = solve_cold(rubbing(0.2, 0.05, 0.1), 4)
    assert result.message == "limit cycle found"
    assert not result.warm
    assert result.iterations >= 2
    assert 0.0 <= result.residual <= 1e-9
    assert result.limit_cycle.harmonics == 4
    assert result.limit_cycle.orientation == STABLE_ORIENTATION


@pytest.mark.parametrize("harmonics", [1, 3, 8])
def test_every_coordinate_of_a_chain_is_balanced(harmonics):
    system = chain(0.5, 0.05)
    result = solve_cold(system, harmonics)
    cycle = result.limit_cycle
    assert cycle.coefficients.shape == (6, 2 * harmonics)
    assert result.residual < 1e-10
    everything = tuple(range(6))
    assert balance(system, cycle.coefficients, cycle.frequency, everything).error < 1e-10
    # What the driven mass takes in a period is what dampers and friction use up.
    velocity = cycle.velocity(np.arange(20000) * cycle.period / 20000)
    assert np.all(np.max(np.abs(velocity), axis=1) > 0.01)
    linear = np.mean(np.sum(velocity * (system.damping @ velocity), axis=0))
    friction = 0.05 * np.mean(np.abs(velocity[3]))
    quadratic = 0.3 * np.mean(np.abs(velocity[5]) ** 3)
    assert friction + quadratic == pytest.approx(-linear, rel=1e-6)


def test_one_coordinate_may_carry_every_element(rubbing):
    element = OddElement((0,), lambda q, v: 0.3 * q**3, lambda q, v: (0.9 * q**2)[None],
                         lambda q, v: (0.0 * q)[None])
    plain = rubbing(0.2, 0.05, 0.1)
    result = solve_cold(replace(plain, elements=(*plain.elements, element)), 6)
    assert result.limit_cycle.frequency > 1.2
    assert velocity_zeros(result.limit_cycle.coefficients[0]).size == 1


@pytest.mark.parametrize(("growth", "torque", "damping", "message"), [
    (0.2, 0.0, 0.0, "the system is linear"),
    (-0.2, 0.0, 0.1, "no oscillation grows from rest"),
    (-0.2, 0.5, 0.1, "no oscillation grows from rest"),
    (0.2, 0.5, 0.0, "no oscillation grows from rest to one at which it would stop"),
    (0.2, 1.0, 0.1, "the branch ends in a fold"),
])
@pytest.mark.parametrize("harmonics", [1, 6])
def test_no_limit_cycle_is_an_answer(rubbing, growth, torque, damping, message, harmonics):
    result = solve_cold(rubbing(growth, torque, damping), harmonics)
    assert result.outcome is Outcome.NO_LIMIT_CYCLE
    assert result.limit_cycle is None
    assert message in result.message


@pytest.mark.parametrize("harmonics", [1, 6])
@pytest.mark.parametrize("drag", [0.1, 3.0])
def test_what_cannot_be_decided_is_a_failure(harmonics, drag):
    """A ball between two hollows leaves the top without turning, for one of them."""
    hollows = OddElement((0,), lambda q, v: q**3, lambda q, v: (3.0 * q**2)[None],
                         lambda q, v: (0.0 * q)[None])
    system = System([[1.0]], [[drag]], [[-1.0]], (hollows,))
    result = solve_cold(system, harmonics)
    assert result.outcome is Outcome.NOT_CONVERGED
    assert result.message == (
        "did not converge: no motion that grows from rest settles to a cycle")


def test_friction_of_no_strength_changes_nothing(rubbing):
    plain = rubbing(0.2, 0.0, 0.1)
    idle = replace(plain, elements=(Coulomb(0, 0.0), *plain.elements))
    expected, found = (solve_cold(system, 5).limit_cycle for system in (plain, idle))
    assert np.allclose(found.coefficients, expected.coefficients, atol=1e-9)


@pytest.mark.parametrize("part", [0.5, 0.9, 0.99, 0.999, 0.9999])
def test_up_to_the_fold_a_cold_start_finds_the_outer_cycle(rubbing, part):
    torque = part * FOLD_TORQUE
    root = np.sqrt(1.0 - part)
    outer = 3.0 * np.pi * 0.2 / (16.0 * 0.1) * (1.0 + root)
    result = solve_cold(rubbing(0.2, torque, 0.1), 1)
    assert amplitude_of(result) == pytest.approx(outer, rel=1e-7)
    beyond = solve_cold(rubbing(0.2, (2.0 - part) * FOLD_TORQUE, 0.1), 1)
    assert beyond.outcome is Outcome.NO_LIMIT_CYCLE


def outer_and_inner(part):
    """Cycles of one harmonic at ``part`` of the fold's torque, with their orientations."""
    middle, root = 3.0 * np.pi * 0.2 / (16.0 * 0.1), np.sqrt(1.0 - part)
    return [LimitCycle(np.array([[middle * (1.0 + sign * root), 0.0]]), 1.0,
                       int(sign * STABLE_ORIENTATION)) for sign in (1.0, -1.0)]


@given(st.floats(0.05, 0.999), st.floats(0.05, 0.999))
def test_a_warm_start_keeps_to_its_branch(rubbing, before, after):
    family = friction_family()
    torque = after * FOLD_TORQUE
    for start, expected in zip(outer_and_inner(before), outer_and_inner(after), strict=True):
        amplitude = expected.coefficients[0, 0]
        near = solve_warm(rubbing(0.2, torque, 0.1), start)
        if near.outcome is not Outcome.NOT_CONVERGED:
            assert amplitude_of(near) == pytest.approx(amplitude, rel=1e-6)
        followed = follow(family, start, before * FOLD_TORQUE, torque)
        assert amplitude_of(followed) == pytest.approx(amplitude, rel=1e-6)
        assert followed.limit_cycle.orientation == expected.orientation
        assert near.warm
        assert followed.warm


@given(st.floats(0.05, 0.99), st.floats(1.001, 5.0))
def test_a_branch_followed_beyond_its_fold_ends_in_it(before, after):
    start = outer_and_inner(before)[0]
    result = follow(friction_family(), start, before * FOLD_TORQUE, after * FOLD_TORQUE)
    assert result.outcome is Outcome.NO_LIMIT_CYCLE
    share = 100.0 * (1.0 - before) / (after - before)
    assert f"the branch ends in a fold {share:.1f} % of the way" in result.message


def test_a_warm_start_is_short_and_does_not_mind_the_phase(rubbing):
    start = solve_cold(rubbing(0.2, 0.05, 0.1), 6).limit_cycle
    cold = solve_cold(rubbing(0.2, 0.052, 0.1), 6)
    turned = replace(start, coefficients=shifted(start.coefficients, 2.3))
    for beginning in (start, turned):
        warm = solve_warm(rubbing(0.2, 0.052, 0.1), beginning)
        assert warm.iterations <= 4
        assert np.allclose(warm.limit_cycle.coefficients, cold.limit_cycle.coefficients, atol=1e-9)


def test_a_warm_start_that_ends_too_far_away_fails(rubbing):
    start = solve_cold(rubbing(0.2, 0.0, 0.1), 4).limit_cycle
    result = solve_warm(rubbing(0.2, 0.0, 0.2), start)
    assert result.outcome is Outcome.NOT_CONVERGED
    assert result.message == "did not converge to a cycle near enough to be of the same branch"
    other = solve_warm(rubbing(0.2, 0.0, 0.1), replace(start, orientation=-STABLE_ORIENTATION))
    assert other.outcome is Outcome.NOT_CONVERGED
    gone = solve_warm(rubbing(-0.2, 0.0, 0.1), start)
    assert gone.outcome is Outcome.NOT_CONVERGED


def test_a_warm_start_of_a_linear_system_finds_no_cycle(rubbing):
    start = solve_cold(rubbing(0.2, 0.05, 0.1), 4).limit_cycle
    assert solve_warm(rubbing(0.2, 0.0, 0.0), start).outcome is Outcome.NO_LIMIT_CYCLE


def test_following_to_where_one_is_changes_nothing(rubbing):
    start = solve_cold(rubbing(0.2, 0.05, 0.1), 4).limit_cycle
    result = follow(friction_family(), start, 0.05, 0.05)
    assert np.allclose(result.limit_cycle.coefficients, start.coefficients, atol=1e-12)
