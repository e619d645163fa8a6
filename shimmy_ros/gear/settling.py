"""The stable limit cycle where harmonic balance does not tell: by simulation, then by shooting.

The balance loses a cycle that sticks, and a few harmonics put the fold in which shimmy ends a few
per cent too early. The cycle of weaker friction is larger than that of the full one: a motion that
starts on it shrinks to the latter, or, if there is none, to rest.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from ..ihb.newton import STABLE_ORIENTATION
from ..ihb.solution import LimitCycle, Outcome, Result
from ..ihb.solve import solve_cold
from ..ihb.system import System
from .matrices import DAMPER, SWIVEL
from .measurement import measure_cycles
from .one_harmonic import fold_torques
from .orbits import Orbit, aligned, balance_orbit, fourier, shoot
from .parameters import MINIMUM_VELOCITY_RANGE, changed
from .rolling_state import STATES, TYRE_TORSION, tyre_kinematics
from .simulation import Simulation, SimulationError
from .system import OperatingPoint, gear_system

Real = NDArray[np.float64]

# Friction so far below a fold of one harmonic, and of the full friction, leaves an easy cycle.
_BELOW_FOLD, _WEAKER = 0.6, 0.9
_HARMONICS = 4
_FOURIER_HARMONICS = 64
_TOLERANCE = 1e-5
_PERIODS = 10
_SAMPLES = 48
_SMALL = 0.01
_MOST_PERIODS = 1500
# Settled motion changes by less from one period to the next; by less still where it proved not to.
_CHANGE, _TIGHTER = 3e-3, 0.1
_SAME = 0.05


class SettlingError(ArithmeticError):
    """The motion neither settled nor died."""


def confirmed(point: OperatingPoint, result: Result) -> Result:
    """What ``result`` of the balance, without a limit cycle, comes to by simulation.

    A cycle found has its Fourier coefficients from shooting.
    """
    try:
        orbit = settled_orbit(point)
    except SettlingError as error:
        return replace(result, outcome=Outcome.FAILED,
                       message=f"did not converge, nor did a simulation tell: {error}")
    if orbit is None:
        if result.outcome is Outcome.NO_LIMIT_CYCLE:
            return result
        return replace(result, outcome=Outcome.NO_LIMIT_CYCLE, message="no limit cycle: the motion "
                       "dies that starts on the cycle of weaker friction")
    cycle = LimitCycle(fourier(orbit, _FOURIER_HARMONICS), 2.0 * np.pi * orbit.frequency_hz,
                       STABLE_ORIENTATION)
    return replace(
        result, outcome=Outcome.LIMIT_CYCLE, residual=orbit.error,
        limit_cycle=replace(cycle, coefficients=aligned(cycle)),
        message="limit cycle found by simulation and shooting, where the balance finds none")


def settled_orbit(point: OperatingPoint) -> Orbit | None:
    """The stable cycle that motion from the cycle of weaker friction reaches; None where it dies.

    None as well where nothing grows from rest even without friction. Raises SettlingError.
    """
    start = _weaker(point)
    if start is None:
        return None
    state, period = start.initial_state()
    simulation = Simulation(point.gear, point.damper, point.velocity, tolerance=_TOLERANCE,
                            minimum_velocity=MINIMUM_VELOCITY_RANGE.low)
    simulation.set_state(rolling_state_of(point, state))
    small, allowed = _SMALL * start.swivel, _CHANGE
    for count in range(_MOST_PERIODS // _PERIODS):
        times = _PERIODS * period * (count + np.linspace(0.0, 1.0, _PERIODS * _SAMPLES + 1))
        try:
            motion = simulation.advance(float(times[-1]), times)
        except SimulationError as error:
            raise SettlingError(str(error)) from error
        if simulation.at_rest:
            return None
        swivel = motion.position[:, SWIVEL]
        cycles = measure_cycles(times, swivel, motion.velocity[:, SWIVEL], smallest=small)
        if len(cycles.amplitude) < 2:
            continue
        before, last = cycles.amplitude[-2:]
        if abs(last - before) > allowed * last:
            continue
        end = int(np.searchsorted(times, cycles.end[-1]))
        orbit = shoot(gear_system(point),
                      np.concatenate([motion.position[end], motion.velocity[end]]),
                      1.0 / cycles.frequency[-1])
        if orbit is not None and orbit.stable and abs(orbit.swivel - last) <= _SAME * last:
            return orbit
        allowed *= _TIGHTER
    raise SettlingError(f"the motion has neither settled nor died after {times[-1]:.3g} s")


def rolling_state_of(point: OperatingPoint, state: Real) -> Real:
    """The state (8,) of `rolling_state` for (q, q') at the velocity of ``point``."""
    result = np.array(state)
    heading = tyre_kinematics(point.gear).heading
    result[TYRE_TORSION] = -state[STATES - 1] / point.velocity - heading[:DAMPER + 2] @ state[:4]
    return result


def _weaker(point: OperatingPoint) -> Orbit | None:
    """The stable cycle with less friction; None if there is none without any."""
    own = point.damper.coulomb_torque
    free = solve_cold(_with_friction(point, 0.0), _HARMONICS)
    if free.outcome is Outcome.NO_LIMIT_CYCLE:
        return None
    for fold in reversed(fold_torques(point)):
        weak = _with_friction(point, min(_BELOW_FOLD * fold, _WEAKER * own))
        cycle = solve_cold(weak, _HARMONICS).limit_cycle
        if cycle is not None:
            return balance_orbit(weak, cycle)
    raise SettlingError(f"no cycle with weaker friction was found to start from: {free.message}")


def _with_friction(point: OperatingPoint, torque: float) -> System:
    return gear_system(replace(point, damper=changed(point.damper, coulomb_torque=torque)))
