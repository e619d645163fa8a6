"""The half-period map against scipy's Radau on the variational equation, stiff gears included."""

from dataclasses import fields, replace
from functools import cache

import numpy as np
import pytest
from scipy.integrate import solve_ivp

from shimmy_ros.gear.parameter_file import reference_parameters
from shimmy_ros.gear.parameters import Gear, ParameterError, changed
from shimmy_ros.gear.system import OperatingPoint, gear_system
from shimmy_ros.ihb.elements import Coulomb, OddElement, QuadraticDamping
from shimmy_ros.ihb.harmonics import evaluate, velocity_zeros
from shimmy_ros.ihb.solution import LimitCycle, Outcome
from shimmy_ros.ihb.solve import solve_cold
from shimmy_ros.ihb.stability import StickingError, half_period_map, stability
from shimmy_ros.ihb.system import System

STIFF = [(1e-4, 300, 1), (1e-4, 300, 5), (1e-4, 50, 10), (1e-5, 300, 5), (1e-3, 10, 20)]


def gear_point(velocity=40.0, quadratic=10.0, torque=20.0, **values):
    gear, damper = reference_parameters()
    return OperatingPoint(replace(gear, **values), changed(
        damper, quadratic_damping=float(quadratic), coulomb_torque=float(torque)), velocity)


@cache
def random_cycles(count, harmonics):
    """Cycles that do not stick, of gears whose parameters are up to thrice the reference's."""
    rng = np.random.default_rng(5)
    gear, damper = reference_parameters()
    found = []
    while len(found) < count:
        values = {item.name: getattr(gear, item.name) * 3.0**rng.uniform(-1.0, 1.0)
                  for item in fields(Gear) if item.name not in ("strut_rake", "wheel_radius")}
        part = 3.0**rng.uniform(-1.0, 1.0, 3)
        try:
            point = OperatingPoint(replace(gear, **values), changed(
                damper, quadratic_damping=10.0 * part[0], coulomb_torque=20.0 * part[1],
                linear_damping=2.0 * part[2]), rng.uniform(15.0, 100.0))
        except ParameterError:
            continue
        system = gear_system(point)
        result = solve_cold(system, harmonics)
        if result.outcome is not Outcome.LIMIT_CYCLE:
            continue
        try:
            found.append((system, result.limit_cycle, stability(system, result.limit_cycle)))
        except StickingError:
            continue
    return found


def integrated(system, cycle):
    """Every multiplier but the shift's, largest first, and how far that one is from 1."""
    count, frequency = system.dofs, cycle.frequency
    inverse = np.linalg.inv(system.mass)
    size = np.abs(cycle.coefficients).max(axis=1)
    units = np.concatenate([size, size * frequency])
    frictions = {e.dof: e.torque for e in system.elements if isinstance(e, Coulomb)}
    drags = {e.dof: e.coefficient for e in system.elements if isinstance(e, QuadraticDamping)}

    def velocity(tau, dof):
        return frequency * float(evaluate(cycle.coefficients[dof], tau, 1))

    def rates(tau, _=None):
        damping = system.damping.copy()
        for dof, coefficient in drags.items():
            damping[dof, dof] += 2.0 * coefficient * abs(velocity(tau, dof))
        matrix = np.block([[np.zeros((count, count)), np.eye(count)],
                           [-inverse @ system.stiffness, -inverse @ damping]])
        return matrix * units / units[:, None] / frequency

    def saltation(dof, tau):
        place = evaluate(cycle.coefficients, tau)
        speed = frequency * evaluate(cycle.coefficients, tau, 1)
        force = -system.damping @ speed - system.stiffness @ place
        for other, coefficient in drags.items():
            force[other] -= coefficient * abs(speed[other]) * speed[other]
        before = np.sign(velocity(tau - 1e-5, dof))
        jump = inverse[:, dof] * frictions[dof]
        matrix = np.eye(2 * count)
        matrix[count:, count + dof] += 2.0 * before * jump / (inverse @ force - before * jump)[dof]
        return matrix * units / units[:, None]

    kinks = sorted((float(tau), dof) for dof in {*frictions, *drags}
                   for tau in velocity_zeros(cycle.coefficients[dof]))
    state, start = np.eye(2 * count), 0.0
    for end, dof in [*kinks, (np.pi, None)]:
        if end > start:
            run = solve_ivp(
                lambda tau, y: (rates(tau) @ y.reshape(2 * count, -1)).ravel(), (start, end),
                state.ravel(), method="Radau", rtol=1e-8, atol=1e-11,
                jac=lambda tau, _: np.kron(rates(tau), np.eye(2 * count)))
            assert run.success
            state = run.y[:, -1].reshape(2 * count, -1)
        if dof in frictions:
            state = saltation(dof, end) @ state
        start = end
    values = np.linalg.eigvals(-state)
    off = np.abs(values - 1.0)
    rest = np.delete(values, off.argmin())
    return rest[np.argsort(-np.abs(rest))], off.min()


def assert_as_integrated(system, cycle):
    found = stability(system, cycle)
    expected, shift_error = integrated(system, cycle)
    assert found.reliable
    assert abs(found.multipliers[0]) == pytest.approx(abs(expected[0]), rel=1e-4)
    assert np.abs(found.multipliers) == pytest.approx(np.abs(expected), abs=2e-4)
    assert found.shift_error == pytest.approx(shift_error, abs=2e-4)


@pytest.mark.parametrize("harmonics", [4, 16])
@pytest.mark.parametrize("velocity", [20.0, 40.0, 100.0])
def test_the_reference_gears_multipliers_are_those_of_an_integration(velocity, harmonics):
    system = gear_system(gear_point(velocity))
    assert_as_integrated(system, solve_cold(system, harmonics).limit_cycle)


@pytest.mark.parametrize("harmonics", [4, 16])
@pytest.mark.parametrize(("inertia", "quadratic", "torque"), STIFF)
def test_so_are_those_of_a_gear_with_a_stiff_damper(inertia, quadratic, torque, harmonics):
    system = gear_system(gear_point(quadratic=quadratic, torque=torque, damper_inertia=inertia))
    assert_as_integrated(system, solve_cold(system, harmonics).limit_cycle)


@pytest.mark.parametrize("number", range(12))
def test_so_are_those_of_random_gears(number):
    system, cycle, found = random_cycles(12, 4)[number]
    if found.shift_error <= 0.1:
        assert_as_integrated(system, cycle)
    else:
        assert not found.reliable
        assert integrated(system, cycle)[1] == pytest.approx(found.shift_error, rel=1e-3)


def test_where_the_integration_begins_does_not_matter():
    """stability begins at a kink, half_period_map at tau = 0."""
    system = gear_system(gear_point())
    cycle = solve_cold(system, 8).limit_cycle
    found = stability(system, cycle, tolerance=1e-7)
    values = np.linalg.eigvals(-half_period_map(system, cycle, tolerance=1e-7))
    rest = np.delete(values, np.abs(values - 1.0).argmin())
    assert np.sort(np.abs(rest)) == pytest.approx(np.sort(np.abs(found.multipliers)), abs=1e-6)


def resting_on(damping, general=False):
    """A circle as a cycle of two oscillators, the second of which is at rest with a ``damping``."""
    ring = OddElement((0,), lambda q, v: (q**2 + v**2) * v, lambda q, v: (2.0 * q * v)[None],
                      lambda q, v: (q**2 + 3.0 * v**2)[None])
    bare = OddElement((1,), lambda q, v: damping * v, lambda q, v: (0.0 * q)[None],
                      lambda q, v: (damping + 0.0 * v)[None])
    system = System(np.eye(2), np.diag([-1.0, 0.0 if general else damping]), np.eye(2),
                    (ring, *([bare] if general else [])))
    return system, LimitCycle(np.array([[1.0, 0.0], [0.0, 0.0]]), 1.0, -1)


@pytest.mark.parametrize("general", [False, True])
@pytest.mark.parametrize("damping", [0.5, 50.0, 1e6, -0.5, -20.0])
def test_a_damped_mode_dies_and_a_growing_one_grows(damping, general):
    system, cycle = resting_on(damping, general)
    found = stability(system, cycle)
    roots = np.roots([1.0, damping, 1.0])
    expected = max([*np.abs(np.exp(np.pi * roots)), np.exp(-np.pi)])
    assert found.reliable
    assert abs(found.multipliers[0]) == pytest.approx(expected, rel=2e-4)
    assert found.stable is (damping > 0.0)


@pytest.mark.parametrize("general", [False, True])
@pytest.mark.parametrize("damping", [-1e3, -1e9])
def test_growth_too_quick_for_numbers_is_neither_stable_nor_reliable(damping, general):
    found = stability(*resting_on(damping, general))
    assert not found.reliable
    assert not found.stable
    assert np.all(np.isnan(found.multipliers))
