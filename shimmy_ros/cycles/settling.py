"""The stable limit cycle where harmonic balance does not tell: by following motions, then shooting.

The balance loses a cycle that sticks, and a few harmonics put the fold in which shimmy ends a few
per cent too early. The cycle without friction is larger than that with it: a motion that starts on
it shrinks to the latter, or, if there is none, to rest. Friction can also have shimmy in another
mode than without it; a kick of the swivel sets off all of them.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from ..gear.matrices import SWIVEL
from ..gear.parameters import changed
from ..gear.system import OperatingPoint, gear_system
from ..ihb.newton import STABLE_ORIENTATION
from ..ihb.solution import LimitCycle, Outcome, Result
from ..ihb.solve import solve_cold
from ..simulation.rolling_state import STATES
from .midpoint import Motion
from .orbits import Orbit, aligned, balance_orbit, fourier, shoot

Real = NDArray[np.float64]

_HARMONICS = 4
_FOURIER_HARMONICS = 64
# Steps in a period; where motion has settled that is no cycle, so many times as many, and again.
_STEPS, _FINER, _MOST_STEPS = 400, 4, 6400
# Motions are looked at after so many periods, and given up after so many.
_PERIODS, _MOST_PERIODS = 10, 1000
# A swivel that has stuck for so many periods is at rest.
_STUCK = 5.0
# The kick, as a multiple of the swivel's rate on the cycle without friction.
_KICK = 2.0
# On average over ten, settled motion changes by less from one cycle to the next; by less still
# where it proved not to be settled.
_CHANGE, _TIGHTER = 1e-3, 0.5
_SAME = 0.05
# Motion that dies but has changed by less on its way may have passed a cycle by.
_LINGERING, _NEAR = 1e-3, 0.2


class SettlingError(ArithmeticError):
    """The motion neither settled nor died."""


def confirmed(point: OperatingPoint, result: Result) -> Result:
    """What ``result`` of the balance, without a limit cycle, comes to by following motions.

    A cycle found has its Fourier coefficients from shooting.
    """
    try:
        orbit = settled_orbit(point)
    except SettlingError as error:
        return replace(result, outcome=Outcome.FAILED,
                       message=f"did not converge, nor did motions tell: {error}")
    if orbit is None:
        if result.outcome is Outcome.NO_LIMIT_CYCLE:
            return result
        return replace(result, outcome=Outcome.NO_LIMIT_CYCLE, message="no limit cycle: the motion "
                       "dies that starts on the cycle without friction")
    cycle = LimitCycle(fourier(orbit, _FOURIER_HARMONICS), 2.0 * np.pi * orbit.frequency_hz,
                       STABLE_ORIENTATION)
    return replace(
        result, outcome=Outcome.LIMIT_CYCLE, residual=orbit.error,
        limit_cycle=replace(cycle, coefficients=aligned(cycle)),
        message="limit cycle found by simulation and shooting, where the balance finds none")


def settled_orbit(point: OperatingPoint) -> Orbit | None:
    """The stable cycle that motions from beyond it reach; None where they die.

    None as well where nothing grows from rest even without friction. Raises SettlingError.
    """
    free = solve_cold(gear_system(replace(
        point, damper=changed(point.damper, coulomb_torque=0.0))), _HARMONICS)
    if free.outcome is Outcome.NO_LIMIT_CYCLE:
        return None
    if free.limit_cycle is None:
        raise SettlingError(f"no cycle without friction was found to start from: {free.message}")
    period = free.limit_cycle.period
    for start in _starts(point, free.limit_cycle):
        orbit = _settled(point, start, period)
        if orbit is not None:
            return orbit
    return None


def _starts(point: OperatingPoint, free: LimitCycle) -> Iterator[Real]:
    """States (8,), (q, dq/dt), on the cycle without friction and after a kick."""
    released = replace(point, damper=changed(point.damper, coulomb_torque=0.0))
    state, _ = balance_orbit(gear_system(released), free).initial_state()
    yield state
    kicked = np.zeros(STATES)
    kicked[len(state) // 2 + SWIVEL] = _KICK * state[len(state) // 2 + SWIVEL]
    yield kicked


def _settled(point: OperatingPoint, start: Real, period: float) -> Orbit | None:
    """The stable cycle in which the motion from ``start`` ends; None where it dies."""
    steps, allowed = _STEPS, _CHANGE
    motion = Motion(point, start, period / steps)
    peaks, periods, states = np.empty(0), np.empty(0), np.empty((0, STATES))
    for _ in range(_MOST_PERIODS // _PERIODS):
        cycles = motion.advance(_PERIODS * steps)
        peaks = np.append(peaks, cycles.peak)
        periods = np.append(periods, cycles.period)
        states = np.concatenate([states, cycles.state])
        changes = _changes(peaks)
        if motion.stuck > _STUCK * period:
            # Steps are not exact: at the very fold a cycle that is there would not be reached.
            slowest = int(np.argmin(changes)) if changes.size else 0
            if not (changes.size and changes[slowest] <= _LINGERING):
                return None
            return _stable_near(point, states[slowest + _PERIODS], peaks[slowest + _PERIODS],
                                periods[slowest + _PERIODS], _NEAR)
        if changes.size and changes[-1] <= allowed:
            orbit = _stable_near(point, states[-1], peaks[-1], periods[-1], _SAME)
            if orbit is not None:
                return orbit
            allowed *= _TIGHTER
            if steps < _MOST_STEPS:
                steps *= _FINER
                motion = Motion(point, states[-1], period / steps)
                peaks, periods, states = np.empty(0), np.empty(0), np.empty((0, STATES))
    raise SettlingError(f"a motion has neither settled nor died after {_MOST_PERIODS * period:.3g} "
                        "s")


def _changes(peaks: Real) -> Real:
    """The relative change of each peak from the tenth before, per cycle."""
    return np.abs(np.log(peaks[_PERIODS:] / peaks[:-_PERIODS])) / _PERIODS


def _stable_near(point: OperatingPoint, state: Real, peak: float, period: float, nearness: float
                 ) -> Orbit | None:
    """The stable cycle to which shooting leads, if its swivel amplitude is near ``peak``."""
    orbit = shoot(gear_system(point), state, float(period))
    if orbit is None or not orbit.stable or abs(orbit.swivel / peak - 1.0) > nearness:
        return None
    return orbit
