"""The stable cycle that an oscillation reaches which grows once the friction is overcome."""

from __future__ import annotations

import math

from ..gear.system import OperatingPoint, gear_system
from ..ihb.solution import Outcome
from ..ihb.solve import solve_cold
from .branches import AUTO, BALANCE, ContinuationError, Settings
from .orbits import Orbit, balance_near, balance_orbit, shoot
from .settling import SettlingError, settled_orbit

# An estimate may be off by these factors.
_SAME_AMPLITUDE, _SAME_FREQUENCY = 3.5, 1.7


def growing_cycle(point: OperatingPoint, settings: Settings) -> Orbit | None:
    """The cycle at ``point``, or None where there is none.

    Raises ContinuationError where the search did not converge.
    """
    # With few harmonics the balance sees folds too early or too late, and none where it sticks. But
    # where nothing sticks, or nothing limits the motion, it is right.
    if settings.method == BALANCE or (
            point.damper.coulomb_torque == 0.0 or point.damper.quadratic_damping == 0.0):
        quick, outcome = _from_balance(point, settings)
        if outcome is Outcome.FAILED:
            raise ContinuationError("the balance did not converge")
        return quick
    try:
        orbit = settled_orbit(point)
    except SettlingError as error:
        orbit, _ = _from_balance(point, settings)
        if orbit is None:
            raise ContinuationError(str(error)) from error
    if orbit is not None and settings.method == AUTO and not orbit.sticks:
        balanced = balance_near(gear_system(point), orbit, settings.harmonics)
        if balanced is not None and settings.accepts(balanced) and balanced.same_as(orbit):
            return balanced
    return orbit


def _from_balance(point: OperatingPoint, settings: Settings) -> tuple[Orbit | None, Outcome]:
    """The cycle that the balance finds without a guess, confirmed, and the balance's outcome."""
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
