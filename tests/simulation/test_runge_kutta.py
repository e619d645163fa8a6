import math
from itertools import pairwise

import numpy as np
import pytest
from scipy.integrate import solve_ivp
from scipy.linalg import expm

from shimmy_ros.gear.parameter_file import reference_parameters
from shimmy_ros.gear.parameters import changed
from shimmy_ros.simulation.rolling_state import DAMPER_RATE, STATES, SWIVEL_RATE, rolling_model
from shimmy_ros.simulation.runge_kutta import ORDER, Step, StepValues

GEAR, _ = reference_parameters()
ROW = np.eye(STATES)[SWIVEL_RATE]
START = np.array([0.01, -0.08, -0.07, 0.02, -1.0, 6.0, 7.0, -0.01])


def run(model, length, count, friction=0.0, linear=0.0, quadratic=0.0, matrix=None):
    """State after ``count`` steps of ``length``, and the error estimated for the first."""
    step = Step(model.slipping if matrix is None else matrix,
                np.column_stack([model.friction_input, model.damper_input]), length, ROW,
                np.eye(STATES))
    assert step.usable
    values = StepValues()
    values.start[:], values.friction[:] = START, friction
    first_error = None
    for _ in range(count):
        step.take(values, linear, quadratic)
        first_error = values.error.copy() if first_error is None else first_error
        values.start[:] = values.state
    return values, first_error


def orders(errors):
    return [math.log2(coarse / fine) for coarse, fine in pairwise(errors)]


def test_a_linear_gear_converges_to_the_exponential_with_the_order_of_the_method():
    model, span = rolling_model(changed(GEAR, damper_inertia=0.5)).at(40.0), 1 / 16
    affine = np.zeros((STATES + 1, STATES + 1))
    affine[:STATES, :STATES] = model.slipping
    affine[:STATES, STATES] = model.friction_input * -20.0
    exact = (expm(span * affine) @ np.append(START, 1.0))[:STATES]
    errors = [np.linalg.norm(run(model, span / count, count, friction=-20.0)[0].state - exact)
              for count in (256, 512, 1024)]
    assert orders(errors) == pytest.approx([ORDER, ORDER], abs=0.2)


def test_a_quadratic_damper_converges_with_the_order_of_the_method():
    model, span = rolling_model(changed(GEAR, damper_inertia=0.5)).at(40.0), 1 / 128
    linear, quadratic = 2.0, 10.0

    def slope(_, x):
        rate = x[DAMPER_RATE]
        assert rate > 0.0  # smooth only as long as it does not turn round
        return model.slipping @ x - model.damper_input * (linear + quadratic * rate) * rate

    exact = solve_ivp(slope, (0.0, span), START, method="DOP853", rtol=1e-13, atol=1e-14).y[:, -1]
    errors = [np.linalg.norm(run(model, span / count, count, 0.0, linear, quadratic)[0].state
                             - exact) for count in (8, 16, 32)]
    assert orders(errors) == pytest.approx([ORDER, ORDER], abs=0.25)


def test_the_error_estimate_is_of_the_order_that_step_control_takes_it_for():
    model = rolling_model(changed(GEAR, damper_inertia=0.5)).at(40.0)
    estimates = [np.linalg.norm(run(model, 2.0**-level, 1, -20.0, 2.0, 10.0)[1])
                 for level in (10, 11, 12)]
    assert orders(estimates) == pytest.approx([ORDER, ORDER], abs=0.25)


def test_what_lies_at_the_end_of_a_step_fits_together():
    model = rolling_model(GEAR).at(40.0)
    weights = np.arange(64.0).reshape(8, 8)
    watched = np.linspace(-1.0, 1.0, STATES)
    step = Step(model.slipping, np.column_stack([model.friction_input, model.damper_input]),
                1e-3, watched, weights)
    values = StepValues()
    values.start[:], values.friction[:] = START, -20.0
    step.take(values, 2.0, 10.0)
    rate = values.state[DAMPER_RATE]
    derivative = (model.slipping @ values.state - 20.0 * model.friction_input
                  - model.damper_input * (2.0 + 10.0 * abs(rate)) * rate)
    np.testing.assert_allclose(values.knot[STATES:], derivative, rtol=1e-8, atol=1e-6)
    np.testing.assert_allclose(values.watched,
                               [watched @ values.state, watched @ values.knot[STATES:]], rtol=1e-9)
    np.testing.assert_allclose(values.scaled, weights @ values.state, rtol=1e-9)


@pytest.mark.parametrize("quadratic", [0.0, 1e3, 1e6])
@pytest.mark.parametrize("inertia", [1e-6, 1e-3])
def test_a_stiff_damper_is_held_on_its_slow_motion(inertia, quadratic):
    gear = changed(GEAR, damper_inertia=inertia)
    values, _ = run(rolling_model(gear).at(40.0), 1e-3, 20, 0.0, 50.0, quadratic)
    rate = values.state[DAMPER_RATE]
    torque = -(50.0 + quadratic * abs(rate)) * rate
    linkage = gear.damper_linkage_stiffness * (values.state[1] - values.state[2])
    unbalanced = inertia * values.knot[STATES + DAMPER_RATE]
    assert linkage + torque == pytest.approx(unbalanced, rel=1e-6, abs=1e-6)
    assert abs(unbalanced) < 0.1 * abs(torque)


def test_what_stands_still_in_the_system_stands_still_in_the_step():
    model = rolling_model(GEAR).at(40.0)
    values, _ = run(model, 1e-3, 50, 0.0, 2.0, 10.0, matrix=model.sticking)
    assert values.state[1] == START[1]
    assert values.state[SWIVEL_RATE] == START[SWIVEL_RATE]


def test_a_step_across_a_pole_is_not_usable():
    unstable = np.zeros((STATES, STATES))
    unstable[DAMPER_RATE, DAMPER_RATE] = 1e4
    inputs = np.eye(STATES)[:, [SWIVEL_RATE, DAMPER_RATE]]
    for length, usable in ((1e-4, True), (4e-4, False), (1e-3, False)):
        assert Step(unstable, inputs, length, ROW, np.eye(STATES)).usable is usable
