"""The simulation against limit cycles known from elsewhere and against scipy's Radau method."""

import json
import math
from pathlib import Path

import numpy as np
import pytest
from scipy.integrate import solve_ivp

from shimmy_ros.gear.matrices import damping_matrix, mass_matrix, stiffness_matrix
from shimmy_ros.gear.parameter_file import reference_parameters
from shimmy_ros.gear.parameters import Damper
from shimmy_ros.simulation.measurement import measure_cycles
from shimmy_ros.simulation.rolling_state import tyre_kinematics
from shimmy_ros.simulation.samples import sample_grid
from shimmy_ros.simulation.simulation import Simulation

GEAR, _ = reference_parameters()
KNOWN = json.loads((Path(__file__).parents[1] / "data" / "limit_cycles.json").read_text())["cases"]


def settled(case, tolerance=1e-4, period=0.0005):
    damper = Damper(2.0, case["quadratic_damping"], case["coulomb_torque"])
    simulation = Simulation(GEAR, damper, case["taxi_velocity"], tolerance=tolerance)
    simulation.kick(2.5 * math.pi * case["frequency"] * case["amplitude"][1])
    simulation.advance(6.0)
    return simulation.advance(7.0, sample_grid(6.0, 7.0, period))


@pytest.mark.parametrize("case", KNOWN, ids=lambda case: "{}_{}_{}".format(
    case["quadratic_damping"], case["coulomb_torque"], case["taxi_velocity"]))
def test_a_run_settles_on_the_known_limit_cycle(case):
    run = settled(case)
    for position, rate, amplitude in zip(run.position.T, run.velocity.T, case["amplitude"],
                                         strict=True):
        cycles = measure_cycles(run.time, position, rate)
        assert len(cycles.amplitude) >= 5
        np.testing.assert_allclose(cycles.amplitude, amplitude, rtol=2e-4)
        np.testing.assert_allclose(cycles.frequency, case["frequency"], rtol=2e-5)


def test_all_known_cycles_are_there():
    points = {(case["quadratic_damping"], case["coulomb_torque"]) for case in KNOWN}
    assert points == {(5, 5), (10, 20), (20, 15), (50, 10)}
    assert len(KNOWN) == 44


@pytest.mark.parametrize("case", KNOWN[::4], ids=lambda case: "{}_{}_{}".format(
    case["quadratic_damping"], case["coulomb_torque"], case["taxi_velocity"]))
def test_500_samples_a_second_are_enough_to_measure_the_swivel(case):
    run = settled(case, period=0.002)
    for rate in (run.velocity[:, 1], None):
        cycles = measure_cycles(run.time, run.position[:, 1], rate)
        np.testing.assert_allclose(cycles.amplitude, case["amplitude"][1], rtol=2e-4)
        np.testing.assert_allclose(cycles.frequency, case["frequency"], rtol=2e-4)


class Radau:
    """The system of second order, M q'' + C q' + K q = f, with set-valued friction, by scipy."""

    def __init__(self, damper, velocity):
        self.limit, self.quadratic = damper.coulomb_torque, damper.quadratic_damping
        self.velocity = velocity
        self.mass = mass_matrix(GEAR)
        self.damping = damping_matrix(GEAR, damper.linear_damping, velocity)
        self.stiffness = stiffness_matrix(GEAR, velocity)
        self.switches = 0

    def forces(self, x):
        force = -self.damping @ x[4:] - self.stiffness @ x[:4]
        force[2] -= self.quadratic * abs(x[6]) * x[6]
        return force

    def slope(self, x, friction):
        force = self.forces(x)
        if friction is None:
            free = np.ix_([0, 2, 3], [0, 2, 3])
            acceleration = np.zeros(4)
            acceleration[[0, 2, 3]] = np.linalg.solve(self.mass[free], force[[0, 2, 3]])
        else:
            force[1] += friction
            acceleration = np.linalg.solve(self.mass, force)
        return np.concatenate([x[4:], acceleration])

    def holding(self, x):
        acceleration = self.slope(x, None)[4:]
        return (self.mass @ acceleration - self.forces(x))[1]

    def run(self, x, times):
        now, states, x = 0.0, [], x.copy()
        friction = -math.copysign(self.limit, x[5])
        while now < times[-1]:
            if friction is None:
                def event(_, x):
                    return abs(self.holding(x)) - self.limit
                event.direction = 1.0
            else:
                def event(_, x):
                    return x[5]
                event.direction = friction
            event.terminal = True
            left = times[len(states):]
            solution = solve_ivp(lambda _, x, f=friction: self.slope(x, f), (now, times[-1]), x,
                                 method="Radau", rtol=1e-9, atol=1e-11, t_eval=left,
                                 events=event, first_step=1e-7)
            states.extend(np.reshape(solution.y, (8, -1)).T)
            if solution.status == 0:
                break
            self.switches += 1
            now, x = solution.t_events[0][0], solution.y_events[0][0].copy()
            x[5] = 0.0
            if friction is None or abs(self.holding(x)) > self.limit:
                friction = math.copysign(self.limit, self.holding(x))
            else:
                friction = None
        return np.array(states)


RUNS = {
    "cycle": (40.0, Damper(2.0, 10.0, 20.0), 9.0, 4),
    "stick_slip": (10.0, Damper(2.0, 50.0, 10.0), 0.3, 5),
    "fast_stick_slip": (80.0, Damper(2.0, 10.0, 25.0), 0.6, 5),
    "large": (60.0, Damper(2.0, 5.0, 5.0), 100.0, 4),
}


@pytest.mark.parametrize("name", RUNS)
def test_a_run_is_that_of_an_independent_integration(name):
    velocity, damper, kick, switches = RUNS[name]
    times = np.arange(1, 61) * 0.005
    start = np.zeros(8)
    start[5] = kick
    reference = Radau(damper, velocity)
    expected = reference.run(start, times)
    assert reference.switches >= switches
    tyre = tyre_kinematics(GEAR)
    scale = abs(expected).max(0)
    errors = []
    for tolerance in (1e-4, 1e-5, 1e-6):
        simulation = Simulation(GEAR, damper, velocity, tolerance=tolerance)
        simulation.kick(kick)
        run = simulation.advance(times[-1], times)
        np.testing.assert_allclose(
            run.velocity[:, 3], -velocity * (run.state @ (tyre.torsion + tyre.heading)),
            rtol=1e-9, atol=1e-12)
        got = np.column_stack([run.position, run.velocity])
        errors.append((abs(got - expected) / scale).max(0))
    smooth = [0, 1, 2, 3, 4, 5, 7]
    assert errors[0][smooth].max() < 1e-3
    assert errors[0][6] < 1e-2
    assert errors[2][smooth].max() < 1e-5
    assert errors[2][6] < 2e-4
    assert errors[2].max() < 0.1 * errors[0].max()
