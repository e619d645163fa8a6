import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.integrate import solve_ivp

from shimmy_ros.ihb.elements import Coulomb, OddElement, QuadraticDamping
from shimmy_ros.ihb.system import System
from shimmy_ros.shooting.flow import FlowError, ParameterRate, advance
from shimmy_ros.shooting.modes import model_of

MASS = np.array([[1.0, 0.2], [0.2, 0.7]])
STIFFNESS = np.array([[3.0, -2.0], [-2.0, 5.0]])


def two_masses(first=0.6, second=0.0, drag=0.3, damping=-0.05):
    return model_of(System(MASS, damping * np.eye(2), STIFFNESS, (
        Coulomb(0, first), Coulomb(1, second), QuadraticDamping(1, drag))))


def one_mass(torque):
    return model_of(System([[1.0]], [[0.0]], [[1.0]], (Coulomb(0, torque),)))


def test_the_friction_oscillator_loses_two_torques_in_every_swing_and_then_sticks():
    motion = advance(one_mass(0.08), [1.0, 0.0], 30.0)
    turns = np.cumsum(np.full(6, np.pi))
    assert motion.sample(turns)[0] == pytest.approx(
        [(-1.0)**k * (1.0 - 0.16 * k) for k in range(1, 7)], abs=1e-13)
    assert [phase.stop for phase in motion.phases((0,))[:-1]] == pytest.approx(turns, abs=1e-12)
    assert [phase.directions for phase in motion.phases((0,))] == [(-1,), (1,)] * 3 + [(0,)]
    assert motion.zeros(1) == pytest.approx(turns[:-1], abs=1e-12)
    assert motion.end[1] == 0.0
    assert motion.peaks() == pytest.approx([1.0], abs=1e-15)


@given(st.tuples(*[st.floats(-2.0, 2.0)] * 4), st.floats(0.01, 3.0), st.floats(0.01, 3.0))
@settings(max_examples=30, deadline=None)
def test_energy_falls_by_friction_times_the_way_it_has_acted_on(state, first, second):
    state = np.array(state)
    motion = advance(two_masses(first, second, drag=0.0, damping=0.0), state, 8.0)

    def energy(x):
        return 0.5 * (x[2:] @ MASS @ x[2:] + x[:2] @ STIFFNESS @ x[:2])

    lost = 0.0
    for dof, torque in ((0, first), (1, second)):
        turns = np.concatenate([[0.0], motion.zeros(2 + dof), [8.0]])
        bounds = [0.0, *motion.pieces.starts, 8.0]
        path = motion.sample(np.sort(np.concatenate([turns, bounds])))[dof]
        lost += torque * np.abs(np.diff(path)).sum()
    assert energy(motion.end) + lost == pytest.approx(energy(state), rel=1e-12, abs=1e-12)


def test_a_motion_with_two_coordinates_that_stick_agrees_with_time_stepping():
    model = two_masses(1.1, 0.7, damping=-0.3)
    state = np.array([-1.5, -1.7, -0.4, -1.4])
    motion = advance(model, state, 6.0)
    assert {phase.directions for phase in motion.phases((0, 1))} >= {(0, 1), (1, 0), (0, 0)}
    # Moreau's scheme: the friction of a step solves the law at its end, by Gauss and Seidel.
    step = 5e-4
    place, speed, friction = state[:2], state[2:], np.zeros(2)
    mobility = np.linalg.inv(MASS)
    for _ in range(round(6.0 / step)):
        middle = place + 0.5 * step * speed
        force = -STIFFNESS @ middle + 0.3 * speed - [0.0, 0.3 * abs(speed[1]) * speed[1]]
        for _ in range(12):
            for dof in range(2):
                after = speed + step * mobility @ (force - friction)
                friction[dof] = np.clip(friction[dof] + after[dof] / (step * mobility[dof, dof]),
                                        -model.friction[dof], model.friction[dof])
        speed = speed + step * mobility @ (force - friction)
        place = middle + 0.5 * step * speed
    assert motion.end == pytest.approx(np.concatenate([place, speed]), abs=3e-3)


def test_a_smooth_motion_agrees_with_another_integrator():
    model = two_masses(0.0, 0.0)

    def field(_, x):
        force = -STIFFNESS @ x[:2] + 0.05 * x[2:] - [0.0, 0.3 * abs(x[3]) * x[3]]
        return np.concatenate([x[2:], np.linalg.solve(MASS, force)])

    state = [0.5, -1.5, 1.0, 0.3]
    other = solve_ivp(field, (0.0, 10.0), state, method="DOP853", rtol=1e-12, atol=1e-13)
    assert advance(model, state, 10.0).end == pytest.approx(other.y[:, -1], abs=1e-9)


@given(st.tuples(*[st.floats(-2.0, 2.0)] * 4))
@settings(max_examples=20, deadline=None)
def test_the_flow_is_odd(state):
    model = two_masses(0.6, 0.2)
    forth, back = (advance(model, sign * np.array(state), 5.0) for sign in (1.0, -1.0))
    assert np.array_equal(forth.end, -back.end)
    assert np.array_equal(forth.reflected().sample([1.0, 4.0]), back.sample([1.0, 4.0]))


# One coordinate turns, sticks and is released; two do so in turns; and, in the third, the second
# one's turning round releases the first at that moment.
DERIVATIVES = [
    (two_masses(), [-0.6, 0.7, -1.5, -1.8], [(-1,), (1,), (0,), (-1,), (0,), (1,), (-1,)]),
    (two_masses(1.1, 0.7, damping=-0.3), [-1.5, -1.7, -0.4, -1.4],
     [(-1, 1), (0, 1), (1, 1), (1, -1), (1, 0), (1, 1), (-1, 1), (-1, -1), (-1, 0)]),
    (two_masses(0.5, 1.2, damping=-0.3), [-1.3, -1.8, 1.3, 0.3],
     [(-1, -1), (1, -1), (0, -1), (1, 1)]),
]


@pytest.mark.parametrize(("model", "state", "directions"), DERIVATIVES)
@pytest.mark.parametrize("duration", [0.7, 2.2, 3.6, 4.8, 5.5])
def test_the_derivatives_by_the_state_agree_with_differences(model, state, directions, duration):
    phases = [phase.directions for phase in advance(model, state, 5.5).phases(model.frictional)]
    assert any(phases[at:at + len(directions)] == directions for at in range(len(phases)))
    motion = advance(model, state, duration, derivatives=True)
    step = 1e-6
    differences = np.column_stack([
        (advance(model, state + step * unit, duration).end
         - advance(model, state - step * unit, duration).end) / (2.0 * step)
        for unit in np.eye(4)])
    assert motion.transition == pytest.approx(differences, abs=2e-7)
    assert motion.end == pytest.approx(advance(model, state, duration).end, abs=1e-12)


@pytest.mark.parametrize("duration", [0.7, 2.2, 3.6, 5.0])
def test_the_derivative_by_a_parameter_agrees_with_differences(duration):
    def model(value):
        return two_masses(1.1 * value, 0.7 / value, 0.3 * value**2, -0.3 * value)

    state = np.array([-1.5, -1.7, -0.4, -1.4])
    rate = ParameterRate(model(1.0 - 1e-5), model(1.0 + 1e-5), 2e-5)
    motion = advance(model(1.0), state, duration, rate=rate)
    step = 1e-6
    difference = (advance(model(1.0 + step), state, duration).end
                  - advance(model(1.0 - step), state, duration).end) / (2.0 * step)
    assert motion.by_parameter == pytest.approx(difference, abs=2e-7)
    assert motion.transition == pytest.approx(
        advance(model(1.0), state, duration, derivatives=True).transition, abs=1e-11)


def test_sticking_loses_the_rank_of_the_velocity():
    motion = advance(two_masses(3.0), [0.1, -0.5, 1.0, 0.3], 2.0, derivatives=True)
    assert motion.phases((0,))[-1].directions == (0,)
    assert not motion.transition[2].any()
    assert np.linalg.matrix_rank(motion.transition) == 3


def test_a_state_that_friction_holds_stays_where_it_is():
    motion = advance(two_masses(3.0, 5.0), [0.3, 0.2, 0.0, 0.0], 50.0)
    assert np.array_equal(motion.end, [0.3, 0.2, 0.0, 0.0])


def test_unbounded_growth_is_an_error():
    model = model_of(System([[1.0]], [[-0.1]], [[1.0]], (QuadraticDamping(0, -1.0),)))
    with pytest.raises(FlowError, match="grows without bound"):
        advance(model, [0.0, 1.0], 100.0)


def test_a_bound_on_the_steps_is_kept_and_an_error_tells_how_many_there_were():
    motion = advance(two_masses(), [-0.6, 0.7, -1.5, -1.8], 300.0)
    assert motion.steps >= len(motion.pieces.starts) > 200
    stops = motion.pieces.starts + motion.pieces.lengths
    assert motion.pieces.starts[1:] == pytest.approx(stops[:-1], abs=1e-12)
    with pytest.raises(FlowError, match="more than 50 steps") as caught:
        advance(two_masses(), [-0.6, 0.7, -1.5, -1.8], 300.0, most_steps=50)
    assert caught.value.steps == 50


def test_two_coordinates_may_turn_and_stick_at_the_same_moment():
    # Two oscillators that know nothing of each other.
    pair = model_of(System(np.eye(2), np.zeros((2, 2)), np.eye(2), (
        Coulomb(0, 0.08), Coulomb(1, 0.08))))
    motion = advance(pair, [1.0, 1.0, 0.0, 0.0], 30.0, derivatives=True)
    alone = advance(one_mass(0.08), [1.0, 0.0], 30.0, derivatives=True)
    assert motion.end == pytest.approx(np.repeat(alone.end, 2), abs=1e-13)
    assert motion.transition[::2, ::2] == pytest.approx(alone.transition, abs=1e-11)
    assert motion.transition[1::2, 1::2] == pytest.approx(alone.transition, abs=1e-11)
    assert motion.transition[::2, 1::2] == pytest.approx(np.zeros((2, 2)), abs=1e-11)
    assert [phase.directions for phase in motion.phases((0, 1)) if phase.stop - phase.start > 1e-9
            ] == [(-1, -1), (1, 1)] * 3 + [(0, 0)]


@pytest.mark.parametrize("duration", [0.0, -1.0, np.nan, np.inf])
def test_the_duration_is_positive(duration):
    with pytest.raises(ValueError, match="duration"):
        advance(one_mass(0.1), [1.0, 0.0], duration)


def test_systems_that_shooting_does_not_know_are_refused():
    with pytest.raises(ValueError, match="coordinate 0 is -1"):
        model_of(System([[1.0]], [[0.0]], [[1.0]], (Coulomb(0, -1.0),)))
    with pytest.raises(ValueError, match="OddElement"):
        model_of(System([[1.0]], [[0.0]], [[1.0]], (
            OddElement((0,), lambda q, v: q**3, lambda q, v: 3.0 * q[None]**2,
                       lambda q, v: 0.0 * v[None]),)))
    with pytest.raises(ValueError, match="positive definite"):
        model_of(System([[-1.0]], [[0.0]], [[1.0]], (Coulomb(0, 1.0),)))


def test_elements_on_one_coordinate_add_up():
    model = model_of(System([[1.0]], [[0.0]], [[1.0]], (
        Coulomb(0, 0.1), Coulomb(0, 0.2), QuadraticDamping(0, 1.0), QuadraticDamping(0, 2.0))))
    assert model.active == (0,)
    assert model.friction == pytest.approx([0.3])
    assert model.drag == pytest.approx([3.0])
