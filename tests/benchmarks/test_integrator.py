"""The integrator of the verdicts, against closed forms, the energy law and other integrations."""

import functools
import json
from pathlib import Path

import numpy as np
import pytest
from scipy.linalg import expm

from benchmarks.verdicts.equations import (
    DAMPER_RATE,
    FRICTION,
    LATERAL,
    SIZE,
    SWIVEL,
    SWIVEL_RATE,
    TILT,
    TILT_RATE,
    TORSION,
    energy_matrix,
)
from benchmarks.verdicts.integrator import MEASURING, Fate, Integrator
from benchmarks.verdicts.radau import radau
from benchmarks.verdicts.records import HELD, Clock, End
from shimmy_ros.gear.parameter_file import reference_parameters
from shimmy_ros.gear.parameters import Damper, Gear

DATA = Path(__file__).parent.parent / "data"
GEAR = reference_parameters()[0]


def read(name):
    return json.loads((DATA / name).read_text(encoding="utf-8"))


def trajectory(integrator, record, steps):
    """States (n, 9) and times (n,) after every step from ``record``, events included."""
    states, times = [record.state.copy()], [record.clock[Clock.TIME]]
    for _ in range(steps):
        integrator.run(record, MEASURING._replace(steps=1))
        states.append(record.state.copy())
        times.append(record.clock[Clock.TIME])
    return np.array(states), np.array(times)


@pytest.mark.parametrize("stages", [3, 5])
def test_the_method_is_radaus(stages):
    method = radau(stages)
    powers = np.arange(2 * stages - 1)
    # Weights integrate what the order 2 s - 1 promises, stages what collocation does.
    assert method.matrix[-1] @ method.nodes[:, None] ** powers == pytest.approx(1 / (powers + 1))
    few = np.arange(stages)
    assert method.matrix @ method.nodes[:, None] ** few == pytest.approx(
        method.nodes[:, None] ** (few + 1) / (few + 1))
    # Stiffly accurate, so that the damping of the fastest parts is complete.
    assert np.ones(stages) @ np.linalg.solve(method.matrix.T, method.matrix[-1]) == pytest.approx(1)


def power(damper, velocity, states):
    """dE/dt [W] of states (n, 9) by the model's energy law, shape (n,)."""
    x = states.T
    sine, cosine = np.sin(GEAR.strut_rake), np.cos(GEAR.strut_rake)
    deflection = (x[LATERAL] - (GEAR.trunnion_to_axle + GEAR.wheel_radius * cosine) * x[TILT]
                  - (GEAR.trail + GEAR.wheel_radius * sine) * x[SWIVEL])
    heading = cosine * x[SWIVEL] - sine * x[TILT]
    tilt = cosine * x[TILT] + sine * x[SWIVEL]
    fed = velocity * (
        GEAR.tyre_torsional_stiffness * x[TORSION] * (
            GEAR.rolling_alpha * deflection - GEAR.rolling_beta * x[TORSION]
            + GEAR.rolling_gamma * tilt)
        - GEAR.tyre_lateral_stiffness * deflection * (heading + x[TORSION]))
    rate = np.abs(x[DAMPER_RATE])
    return fed - ((damper.linear_damping + damper.quadratic_damping * rate) * rate**2
                  + damper.coulomb_torque * np.abs(x[SWIVEL_RATE]))


def test_the_equations_obey_the_energy_law():
    damper, velocity = Damper(2.0, 10.0, 20.0), 40.0
    system = Integrator(GEAR, damper, velocity).system
    states = np.random.default_rng(1).normal(size=(20, SIZE))
    states[:, FRICTION] = np.sign(states[:, SWIVEL_RATE]) * damper.coulomb_torque
    rate = states[:, DAMPER_RATE]
    slopes = (states @ system.matrices[0].T
              + np.outer(damper.quadratic_damping * np.abs(rate) * rate, system.load))
    change = np.einsum("ni,ij,nj->n", states, energy_matrix(GEAR), slopes)
    assert change == pytest.approx(power(damper, velocity, states), rel=1e-9, abs=1e-6)


def test_a_motion_with_friction_obeys_the_energy_law():
    # So much friction that the swivel reverses, and sticks now and then.
    damper, velocity = Damper(2.0, 10.0, 150.0), 20.0
    integrator = Integrator(GEAR, damper, velocity)
    record = integrator.kicked(3.0)
    states, times = trajectory(integrator, record, 12000)
    powers = power(damper, velocity, states)
    energy = 0.5 * np.einsum("ni,ij,nj->n", states, energy_matrix(GEAR), states)
    gained = np.cumsum(0.5 * np.diff(times) * (powers[1:] + powers[:-1]))
    assert record.clock[Clock.EVENTS] >= 3
    assert record.clock[Clock.HELD_TIME] > 0.0
    assert energy[1:] - energy[0] == pytest.approx(gained, abs=1e-5 * energy[0])


def test_a_linear_gear_decays_as_the_matrix_exponential():
    integrator = Integrator(GEAR, Damper(30.0, 0.0, 0.0), 8.0)
    record = integrator.kicked(2.0)
    start = record.state.copy()
    integrator.run(record, MEASURING._replace(steps=400))
    time = record.clock[Clock.TIME]
    exact = expm(integrator.system.matrices[0] * time) @ start
    assert time > 0.5
    assert record.state[:FRICTION] == pytest.approx(exact[:FRICTION],
                                                    abs=1e-8 * np.abs(exact).max())


def test_without_friction_and_growth_a_motion_dies_and_with_growth_it_grows():
    assert Integrator(GEAR, Damper(30.0, 0.0, 0.0), 4.0).fate(2.0).fate is Fate.DIES
    assert Integrator(GEAR, Damper(2.0, 0.0, 20.0), 40.0).fate(0.5).fate is Fate.GROWS


def test_a_held_swivel_stays_where_it_is_while_the_rest_moves_linearly():
    integrator = Integrator(GEAR, Damper(2.0, 0.0, 1e5), 40.0)
    record = integrator.kicked(0.0)
    record.state[[TILT, SWIVEL, TILT_RATE, TORSION]] = 0.01, 0.02, 0.3, 0.01
    record.clock[Clock.MODE] = HELD
    start = record.state.copy()
    integrator.run(record, MEASURING._replace(steps=60), goal=1)
    time = record.clock[Clock.TIME]
    exact = expm(integrator.system.matrices[1] * time) @ start
    assert record.state[SWIVEL] == 0.02
    assert record.clock[Clock.HELD_TIME] == time > 1e-3
    assert record.state == pytest.approx(exact, abs=1e-9)


def test_friction_lets_go_exactly_when_its_torque_is_reached():
    friction = 40.0
    integrator = Integrator(GEAR, Damper(2.0, 10.0, friction), 40.0)
    record = integrator.kicked(0.0)
    record.state[TILT] = 0.01
    record.clock[Clock.MODE] = HELD
    holding = integrator.system.holding
    for _ in range(500):
        if record.clock[Clock.MODE] != HELD:
            break
        assert abs(holding @ record.state) <= friction * (1.0 + 1e-9)
        assert integrator.run(record, MEASURING._replace(steps=1), goal=1) is End.OUT_OF_TIME
    assert record.clock[Clock.EVENTS] == 1
    assert abs(holding @ record.state) == pytest.approx(friction, rel=1e-9)
    assert record.state[SWIVEL] == record.state[SWIVEL_RATE] == 0.0
    assert record.state[FRICTION] == np.sign(holding @ record.state) * friction


@pytest.mark.parametrize("number", [0, 20, 40])
def test_cycles_of_the_reference_gear(number):
    case = read("limit_cycles.json")["cases"][number]
    integrator = Integrator(GEAR, Damper(2.0, case["quadratic_damping"], case["coulomb_torque"]),
                            case["taxi_velocity"])
    motion = integrator.fate(8.0)
    assert motion.fate is Fate.CYCLE
    assert motion.cycle.odd
    assert motion.cycle.amplitude == pytest.approx(case["amplitude"], rel=1e-5)
    assert motion.cycle.frequency_hz == pytest.approx(case["frequency"], rel=1e-5)


@functools.cache
def verdicts():
    return read("verdicts.json")


@pytest.mark.parametrize("number", range(0, 60, 3))
def test_fates_of_kicks_are_those_of_another_integration(number):
    case = verdicts()[number]
    integrator = Integrator(Gear(**case["gear"]), Damper(**case["damper"]), case["taxi_velocity"])
    motions = {kick: integrator.fate(float(kick)) for kick in case["after_kick"]}
    assert {kick: motion.fate.value for kick, motion in motions.items()} == case["after_kick"]
    for motion in motions.values():
        if motion.cycle is None:
            continue
        cycle = np.append(motion.cycle.amplitude, motion.cycle.frequency_hz)
        others = [[other[name] for name in ("strut_tilt", "swivel", "damper", "tyre_lateral",
                                            "frequency")] for other in case["stable_cycles"]]
        assert min(np.abs(cycle / other - 1.0).max() for other in np.array(others)) < 1e-5
