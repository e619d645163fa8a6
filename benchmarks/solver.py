"""Benchmarks of the solver: case (10, 20) of the reference gear, N = 4, one BLAS thread."""

from __future__ import annotations

import itertools
from collections.abc import Iterator

import numpy as np
from scipy.integrate import solve_ivp
from scipy.linalg.lapack import dgesv

from shimmy_ros.cycles.grid import GridPoints, predict_grid
from shimmy_ros.cycles.settings import Settings
from shimmy_ros.gear.parameter_file import reference_parameters
from shimmy_ros.gear.system import OperatingPoint, family_between, gear_system
from shimmy_ros.ihb.balance import recovered
from shimmy_ros.ihb.continuation import branch
from shimmy_ros.ihb.elements import Coulomb, QuadraticDamping
from shimmy_ros.ihb.solution import LimitCycle
from shimmy_ros.ihb.solve import placed, solve_cold, solve_warm
from shimmy_ros.ihb.stability import stability
from shimmy_ros.ihb.system import System
from shimmy_ros.shooting.continuation import continue_branch
from shimmy_ros.shooting.periodic import limit_cycle
from shimmy_ros.simulation.simulation import Simulation

from .measuring import Spread, exponent, ratio, seconds_of, spread

HARMONICS = 4
VELOCITY, STEP = 40.0, 0.5
GEAR, DAMPER = reference_parameters()


def cycle_of(system: System, harmonics: int) -> LimitCycle:
    """The cold start's limit cycle; there is one, or the benchmark ends."""
    cycle = solve_cold(system, harmonics).limit_cycle
    if cycle is None:
        raise RuntimeError("no limit cycle to start from")
    return cycle


def at(velocity: float) -> OperatingPoint:
    """The operating point at a velocity [m/s]."""
    return OperatingPoint(GEAR, DAMPER, velocity)


class Warm:
    """A point whose velocity is STEP away from the one before, matrices included."""

    def __init__(self) -> None:
        self._cycles = {v: cycle_of(gear_system(at(v)), HARMONICS)
                        for v in (VELOCITY, VELOCITY + STEP)}
        self._velocities = itertools.cycle(self._cycles)
        self.iterations = solve_warm(gear_system(at(VELOCITY + STEP)),
                                     self._cycles[VELOCITY]).iterations

    def __call__(self) -> None:
        velocity = next(self._velocities)
        start = self._cycles[2.0 * VELOCITY + STEP - velocity]
        if solve_warm(gear_system(at(velocity)), start).limit_cycle is None:
            raise RuntimeError("a warm start failed")


def warm_figures() -> Iterator[tuple[str, Spread, str]]:
    """Ratios of everything else to a warm-started point."""
    warm = Warm()
    random = np.random.default_rng(0)
    matrix, right = random.random((32, 32)) + np.eye(32), random.random(32)

    def lapack() -> None:
        for _ in range(warm.iterations):
            dgesv(matrix, right)

    found, first, second = ratio((warm, 400), (lapack, 400), 15)
    yield ("warm_vs_lapack", found, f"{1e6 * first.median:.0f} us a point with {warm.iterations} "
           f"iterations, {1e6 * second.median:.0f} us for as many dgesv 32 x 32")
    system = gear_system(at(VELOCITY))
    found, first, _ = ratio((lambda: cycle_of(system, HARMONICS), 20), (warm, 100), 15)
    yield "cold_vs_warm", found, f"{1e6 * first.median:.0f} us a cold start"
    found, first, _ = ratio((integrate_to_steady_state, 1), (warm, 200), 3)
    yield ("integration_vs_warm", found, f"{first.median:.2f} s for LSODA to an amplitude within "
           "0.1 % of the steady state, from a kick")
    found, first, _ = ratio((shooting_points, 1), (warm, 200), 3)
    found = Spread(*(value / _SHOOTING_POINTS for value in found))
    yield ("shooting_vs_warm", found,
           f"{1e3 * first.median / _SHOOTING_POINTS:.0f} ms a point of the shooting branch")


def integrate_to_steady_state() -> None:
    """What the equations ask of a user without a method: LSODA from a kick that just starts
    shimmy, ten cycles at a time, until the swivel's peaks agree to 0.1 % over ten cycles."""
    system = gear_system(at(VELOCITY))
    inverse = np.linalg.inv(system.mass)

    def rates(_: float, y: np.ndarray) -> np.ndarray:
        force = -system.damping @ y[4:] - system.stiffness @ y[:4]
        force[1] -= DAMPER.coulomb_torque * np.sign(y[5])
        force[2] -= DAMPER.quadratic_damping * abs(y[6]) * y[6]
        return np.concatenate([y[4:], inverse @ force])

    state = np.zeros(8)
    state[5] = _SMALL_KICK
    for _ in range(20):
        piece = solve_ivp(rates, (0.0, 10.0 / _FREQUENCY_HZ), state, method="LSODA",
                          rtol=1e-6, atol=1e-9)
        state = piece.y[:, -1]
        swivel = np.abs(piece.y[1])
        peaks = swivel[1:-1][(swivel[1:-1] > swivel[:-2]) & (swivel[1:-1] >= swivel[2:])]
        if abs(peaks[0] / peaks[-1] - 1.0) < 1e-3:
            if abs(peaks[-1] / _STEADY_AMPLITUDE - 1.0) > 1e-3:
                raise RuntimeError("the integration settled elsewhere")
            return
    raise RuntimeError("the integration did not settle")


# The trigger is 0.505 rad/s.
_SMALL_KICK = 0.6
_STEADY = cycle_of(gear_system(at(VELOCITY)), 64)
_STEADY_AMPLITUDE, _FREQUENCY_HZ = float(_STEADY.amplitude()[1]), _STEADY.frequency_hz
_SHOOTING_POINTS = 5


def shooting_points() -> None:
    """A stretch of the shooting branch in velocity."""
    cycle = cycle_of(gear_system(at(VELOCITY)), HARMONICS)
    zero = np.zeros(1)
    state = np.concatenate([cycle.position(zero)[:, 0], cycle.velocity(zero)[:, 0]])
    start = limit_cycle(gear_system(at(VELOCITY)), state, cycle.period).cycle
    if start is None:
        raise RuntimeError("shooting found no limit cycle")
    points = continue_branch(lambda v: gear_system(at(v)), start, VELOCITY, direction=1,
                             scale=VELOCITY, bounds=(VELOCITY, 100.0))
    for _ in itertools.islice(points, _SHOOTING_POINTS):
        pass


def branch_figures() -> Iterator[tuple[str, Spread, str]]:
    """A branch point with its Floquet multipliers against one without."""
    family = family_between(at(30.0), at(100.0))
    system = gear_system(at(30.0))
    phase, point = placed(system, cycle_of(system, HARMONICS), system.nonlinear_dofs)

    def points(with_stability: bool) -> None:
        found = branch(family, point, 0.0, 0.3, 1, system.nonlinear_dofs, phase)
        for here in itertools.islice(found, 12):
            if with_stability:
                there = family.system(here.parameter)
                coefficients = recovered(there, *here.point, system.nonlinear_dofs)
                stability(there, LimitCycle(coefficients, here.point.frequency, here.orientation))

    found, first, second = ratio((lambda: points(True), 1), (lambda: points(False), 1), 9)
    yield ("stability_overhead", found, f"{1e3 * first.median / 12:.2f} ms with, "
           f"{1e3 * second.median / 12:.2f} ms without")


def scaling_figures() -> Iterator[tuple[str, Spread, str]]:
    """How the time of a warm point grows with harmonics and with coordinates."""
    sizes = [1, 2, 4, 8, 16, 32, 64]
    exponents = []
    for _ in range(3):
        times = []
        for harmonics in sizes:
            start = cycle_of(gear_system(at(VELOCITY)), harmonics)
            system = gear_system(at(VELOCITY + STEP))
            times.append(seconds_of(lambda s=system, c=start: solve_warm(s, c), 5))
        exponents.append(exponent(sizes[3:], times[3:]))
    yield ("exponent_harmonics", spread(exponents), "from N = 8 to 64; the dense solve of 4N "
           "unknowns is of order N^3, filling its matrix of order N^2: "
           + ", ".join(f"N {n} {1e3 * t:.2f} ms" for n, t in zip(sizes, times, strict=True)))
    sizes = [2, 4, 8, 16, 32, 64]
    exponents = []
    for _ in range(3):
        times = []
        for dofs in sizes:
            start = cycle_of(chain(dofs, 0.2), HARMONICS)
            system = chain(dofs, 0.21)
            times.append(seconds_of(lambda s=system, c=start: solve_warm(s, c), 5))
        exponents.append(exponent(sizes[2:], times[2:]))
    yield ("exponent_dofs", spread(exponents), "from n = 8 to 64; the coordinates without an "
           "element are eliminated harmonic by harmonic, of order n^3 each: "
           + ", ".join(f"n {n} {1e3 * t:.2f} ms" for n, t in zip(sizes, times, strict=True)))


def chain(dofs: int, drive: float) -> System:
    """A chain of masses, the first self-excited by -``drive`` and rubbing, and out of tune with
    the others, so that the cycle stays where it is as the chain grows."""
    stiffness = 2.0 * np.eye(dofs) - 0.3 * (np.eye(dofs, k=1) + np.eye(dofs, k=-1))
    stiffness[0, 0] = 4.0
    damping = 0.02 * np.eye(dofs)
    damping[0, 0] = -drive
    return System(np.eye(dofs), damping, stiffness,
                  (Coulomb(0, 0.05), QuadraticDamping(0, 0.1)))


def grid_figures(cores: int) -> Iterator[tuple[str, Spread, str]]:
    """A grid of 100 x 100 points over velocity and quadratic damping."""
    velocity, quadratic = np.linspace(20.0, 100.0, 100), np.linspace(5.0, 50.0, 100)
    rows = [quadratic if row % 2 == 0 else quadratic[::-1] for row in range(100)]
    points = GridPoints(GEAR, np.repeat(velocity, 100), np.full(10000, DAMPER.linear_damping),
                        np.concatenate(rows), np.full(10000, DAMPER.coulomb_torque))

    def solve(threads: int) -> None:
        found = predict_grid(points, Settings(HARMONICS), threads=threads)
        if not (found.outcome == "limit_cycle").all():
            raise RuntimeError("a point of the grid has no answer")

    found, one, _ = ratio((lambda: solve(1), 1), (lambda: solve(cores), 1), 5)
    rate = Spread(10000 / one.median, 10000 / one.max, 10000 / one.min)
    yield "grid_points_per_second_per_core", rate, "one thread"
    yield "grid_speed_up", found, f"on {cores} cores"


def simulator_figures() -> Iterator[tuple[str, Spread, str]]:
    """Simulated over elapsed time, sampled at 500 Hz, at the simulator's own accuracy."""
    factors = []
    for _ in range(5):
        simulation = Simulation(GEAR, DAMPER, VELOCITY)
        simulation.kick(3.0)
        times = np.arange(1, 2501) / 500.0
        factors.append(5.0 / seconds_of(lambda s=simulation, t=times: s.advance(5.0, t), 1))
    yield "simulator_real_time_factor", spread(factors), "5 s from a kick, V = 40 m/s"
