"""The stable cycle that an oscillation reaches which grows once the friction is overcome."""

from __future__ import annotations

import math
from dataclasses import replace

from ..ihb.solution import Outcome
from ..ihb.solve import solve_cold
from .branches import BALANCE, ContinuationError, Line, Settings, follow
from .orbits import Orbit, balance_orbit, shoot
from .parameters import changed
from .system import OperatingPoint, family_between, gear_system

# Friction from which a branch is followed up to the one asked for.
_WEAKER = (0.5, 0.2, 0.05, 0.0)
# An estimate may be off by these factors.
_SAME_AMPLITUDE, _SAME_FREQUENCY = 3.5, 1.7


def growing_cycle(point: OperatingPoint, settings: Settings) -> Orbit | None:
    """The cycle at ``point``, or None where there is none.

    Raises ContinuationError where the search did not converge.
    """
    quick, outcome = quick_cycle(point, settings)
    if quick is not None:
        return quick
    if settings.method == BALANCE:
        if outcome is Outcome.FAILED:
            raise ContinuationError("the balance did not converge")
        return None
    # With few harmonics the balance sees folds too early or too late, and none where it sticks.
    released = replace(point, damper=changed(point.damper, coulomb_torque=0.0))
    line = Line(family_between(released, point))
    for factor in _WEAKER:
        system = line.system(factor)
        cold = solve_cold(system, settings.harmonics)
        if cold.limit_cycle is not None:
            start = balance_orbit(system, cold.limit_cycle)
            # If need be through two folds, or four.
            for there in follow(line, start, factor, 1, settings):
                if there.position == 1.0 and there.orbit.stable:
                    return there.orbit
            return None
        outcome = cold.outcome
    if outcome is Outcome.FAILED:
        raise ContinuationError("neither the balance nor shooting converged")
    return None


def quick_cycle(point: OperatingPoint, settings: Settings) -> tuple[Orbit | None, Outcome]:
    """The cycle that the balance finds without a guess, confirmed, and the balance's outcome.

    Near folds, and where the swivel sticks, None does not mean that there is no cycle.
    """
    system = gear_system(point)
    cold = solve_cold(system, settings.harmonics)
    if cold.limit_cycle is None:
        return None, cold.outcome
    orbit = balance_orbit(system, cold.limit_cycle)
    if settings.accepts(orbit):
        return orbit, cold.outcome
    shot = shoot(system, *orbit.initial_state())
    if shot is not None and shot.stable and _near(shot, orbit):
        return shot, cold.outcome
    return None, cold.outcome


def _near(shot: Orbit, estimate: Orbit) -> bool:
    return (abs(math.log(shot.swivel / estimate.swivel)) < math.log(_SAME_AMPLITUDE)
            and abs(math.log(shot.frequency_hz / estimate.frequency_hz))
            < math.log(_SAME_FREQUENCY))
