"""The midpoint rule's matrices and step, and when friction is bound to hold a swivel."""

from dataclasses import fields
from itertools import pairwise

import numpy as np
import pytest
from scipy.linalg import expm

from shimmy_ros.cycles.motion import STATES, End, Motion
from shimmy_ros.gear.matrices import DAMPER, STRUT_TILT, SWIVEL, TYRE_LATERAL
from shimmy_ros.gear.parameter_file import reference_parameters
from shimmy_ros.gear.parameters import Damper, ParameterError, changed
from shimmy_ros.gear.system import OperatingPoint, gear_system

GEAR, _ = reference_parameters()
FREE = [STRUT_TILT, TYRE_LATERAL]
LOCKED = [STRUT_TILT, DAMPER, TYRE_LATERAL]


def law_at(point, step=None):
    return Motion(point, gear_system(point), step).law


def random_points(count, spread=0.4):
    """Gears around the reference, some of them with a castor angle and a trail of either sign."""
    rng = np.random.default_rng(7)
    found = []
    while len(found) < count:
        values = {item.name: getattr(GEAR, item.name) * np.exp(rng.uniform(-spread, spread))
                  for item in fields(GEAR)}
        if rng.random() < 0.5:
            values |= {"trail": rng.uniform(-0.2, 0.2), "strut_rake": rng.uniform(-0.5, 0.5),
                       "rolling_gamma": rng.uniform(-3.0, 3.0)}
        try:
            gear = changed(GEAR, **values)
        except ParameterError:
            continue
        found.append(OperatingPoint(gear, Damper(rng.uniform(0.0, 10.0), rng.uniform(0.0, 50.0),
                                                 rng.uniform(1.0, 50.0)), rng.uniform(1.0, 100.0)))
    return found


POINTS = random_points(60)


def first_order(system, rows):
    """The matrix of x' = A x for the coordinates ``rows``, the others held."""
    grid = np.ix_(rows, rows)
    inverse = np.linalg.inv(system.mass[grid])
    size = len(rows)
    matrix = np.zeros((2 * size, 2 * size))
    matrix[:size, size:] = np.eye(size)
    matrix[size:, :size] = -inverse @ system.stiffness[grid]
    matrix[size:, size:] = -inverse @ system.damping[grid]
    return matrix


def locked_torques(point, state, steps, step):
    """The torque that holds the swivel at times ``step`` apart, by exact integration.

    The damper's own damping is left out, which takes energy: with it the torque is less.
    """
    system = gear_system(point)
    grid = np.ix_(LOCKED, LOCKED)
    inverse = np.linalg.inv(system.mass[grid])
    swivel = state[SWIVEL]
    damping = system.damping.copy()
    # Swivel and damper are not coupled by a rate.
    damping[DAMPER, DAMPER] = 0.0
    # The swivel's angle is constant: its column of the stiffness is a force.
    matrix = np.zeros((7, 7))
    matrix[:3, 3:6] = np.eye(3)
    matrix[3:6, :3] = -inverse @ system.stiffness[grid]
    matrix[3:6, 3:6] = -inverse @ damping[grid]
    matrix[3:6, 6] = -inverse @ system.stiffness[LOCKED, SWIVEL]
    forward = expm(step * matrix)
    rows = np.concatenate([state[LOCKED], state[4 + np.array(LOCKED)], [swivel]])
    torques = []
    for _ in range(steps):
        rates = matrix @ rows
        torques.append(system.stiffness[SWIVEL, LOCKED] @ rows[:3]
                       + system.stiffness[SWIVEL, SWIVEL] * swivel
                       + system.damping[SWIVEL, LOCKED] @ rows[3:6]
                       + system.mass[SWIVEL, LOCKED] @ rates[3:6])
        rows = forward @ rows
    return np.array(torques)


def bound(law, state):
    """What the law says the torque stays below."""
    swivel = state[SWIVEL]
    away = np.append(state[FREE] - swivel * law.equilibrium, state[4 + np.array(FREE)])
    return (abs(law.held * swivel) + np.abs(law.torques @ away).sum()
            + np.hypot(law.linkage * (state[DAMPER] - swivel),
                       law.impedance * state[4 + DAMPER]))


def random_state(rng):
    state = rng.normal(size=STATES) * np.array([1e-3, 1e-2, 1e-2, 1e-3, 0.1, 1.0, 1.0, 0.1])
    state *= rng.choice([0.0, 1.0], STATES, p=[0.3, 0.7])
    state[4 + SWIVEL] = 0.0
    return state


def test_the_matrices_are_those_of_the_rule():
    for point in POINTS[:10]:
        system, law = gear_system(point), law_at(point, 1e-3)
        assert law.step == 1e-3
        np.testing.assert_allclose(law.mass, 2e3 * system.mass, rtol=1e-15)
        rule = law.mass + system.damping + 0.5e-3 * system.stiffness
        np.testing.assert_allclose(law.inverse @ rule, np.eye(4), atol=1e-9)
        assert (law.torque, law.quadratic) == (
            point.damper.coulomb_torque, point.damper.quadratic_damping)


def test_rest_is_stable_where_the_locked_gears_eigenvalues_decay():
    told = set()
    for point in (*POINTS, *[OperatingPoint(
            changed(GEAR, trail=-0.08, strut_rake=rake), Damper(2.0, 10.0, 20.0), velocity)
            for rake in (-0.5, 0.1) for velocity in (0.5, 1.0, 2.0, 5.0, 50.0)]):
        growth = np.linalg.eigvals(first_order(gear_system(point), FREE)).real.max()
        assert abs(growth) > 1e-9
        assert law_at(point).rest_is_stable is bool(growth < 0.0)
        told.add(bool(growth < 0.0))
    assert told == {True, False}


def test_the_torque_of_the_locked_gear_stays_below_the_bound_and_comes_near_it():
    rng = np.random.default_rng(11)
    closest = 0.0
    for point in [point for point in POINTS if law_at(point).rest_is_stable][:25]:
        law = law_at(point)
        for _ in range(4):
            state = random_state(rng)
            largest = np.abs(locked_torques(point, state, 1500, 2e-4)).max()
            limit = bound(law, state)
            assert largest <= limit * (1.0 + 1e-9)
            closest = max(closest, largest / limit)
    # Two frequencies are in phase some time: the bound is not loose.
    assert closest > 0.95


def test_the_share_of_every_mode_is_exact():
    """On one mode alone, the strut's and tyre's torque is as large as the bound, and decays."""
    point = OperatingPoint(GEAR, Damper(2.0, 10.0, 20.0), 40.0)
    system, law = gear_system(point), law_at(point)
    rates, modes = np.linalg.eig(first_order(system, FREE))
    oscillating = np.flatnonzero(rates.imag > 1.0)
    assert len(oscillating)
    for number in oscillating:
        peaks = []
        for phase in np.linspace(0.0, 2.0 * np.pi, 60):
            mode = (modes[:, number] * np.exp(1j * phase)).real
            state = np.zeros(STATES)
            state[FREE], state[4 + np.array(FREE)] = mode[:2], mode[2:]
            peaks.append(abs(locked_torques(point, state, 1, 1e-4)[0]))
            assert peaks[-1] <= bound(law, state) * (1.0 + 1e-9)
        assert max(peaks) == pytest.approx(bound(law, state), rel=2e-3)
    # The equilibrium, and the swivel turned against it.
    state = np.zeros(STATES)
    state[SWIVEL] = state[DAMPER] = 0.01
    state[FREE] = 0.01 * law.equilibrium
    np.testing.assert_allclose((system.stiffness @ state[:4])[FREE], 0.0, atol=1e-6)
    assert (system.stiffness @ state[:4])[SWIVEL] == pytest.approx(0.01 * law.held, rel=1e-9)


def test_a_motion_is_held_where_the_torque_stays_below_friction_and_nowhere_else():
    rng = np.random.default_rng(13)
    held = released = 0
    for point in POINTS[:30]:
        if not law_at(point).rest_is_stable:
            continue
        state = random_state(rng)
        # Without the damper's own motion: it is too fast for the rule.
        state[DAMPER], state[4 + DAMPER] = state[SWIVEL], 0.0
        largest = np.abs(locked_torques(point, state, 3000, 2e-4)).max()
        for share in (0.9, 1.1, 3.0):
            motion = Motion(OperatingPoint(point.gear, changed(
                point.damper, coulomb_torque=share * largest), point.velocity),
                gear_system(point))
            motion.begin(state)
            end, steps = motion.follow(16, 0.0, np.empty((0, STATES)), 0.0, 0.0)
            if end is End.HELD:
                assert share > 1.0
                held += 1
            else:
                assert steps == 16
                released += 1
    assert held > 10
    assert released > 10


def test_the_step_resolves_the_fastest_mode_but_the_dampers():
    for point in POINTS:
        system, law = gear_system(point), law_at(point)
        fastest = np.abs(np.linalg.eigvals(
            first_order(system, [STRUT_TILT, SWIVEL, TYRE_LATERAL])).imag).max()
        assert 36.0 < 2.0 * np.pi / (fastest * law.step) < 60.0


def test_the_step_follows_what_is_stiffest():
    steps = [law_at(OperatingPoint(changed(GEAR, strut_tilt_stiffness=stiffness),
                                   Damper(2.0, 10.0, 20.0), 40.0)).step
             for stiffness in (1e8, 1e10, 1e12)]
    for one, other in pairwise(steps):
        assert one == pytest.approx(10.0 * other, rel=0.02)
