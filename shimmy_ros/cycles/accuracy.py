"""The limit cycle of the gear to a requested accuracy, by the cheapest method that reaches it.

Harmonic balance with up to 64 harmonics, as far as its estimated error can still get there; then
shooting, which has none of this error, from the balance's cycle, or, where there is none or too bad
a one, from where a simulation settles.
"""

from __future__ import annotations

from dataclasses import dataclass

from ..gear.parameters import Range
from ..gear.system import OperatingPoint, gear_system
from ..ihb import accuracy as balance_accuracy
from ..ihb.solution import Outcome
from .orbits import Orbit, balance_orbit, shoot
from .settling import SettlingError, settled_orbit

ACCURACY_RANGE = Range("1", "relative error allowed of amplitudes and frequency", 1e-9, 0.5)
MAXIMUM_HARMONICS = 64
# With so many harmonics the error has come to fall as 1/N, if the friction's jumps dominate it.
_ENOUGH_TO_TELL = 16
_SAME = 0.05


@dataclass(frozen=True)
class Answer:
    """``orbit``, whose ``error`` is the estimate, is there exactly if there is a limit cycle."""

    outcome: Outcome
    orbit: Orbit | None
    message: str


def solve_to_accuracy(point: OperatingPoint, accuracy: float) -> Answer:
    """The limit cycle that a growing oscillation reaches at ``point``.

    The estimated relative errors of all its amplitudes and its frequency are below ``accuracy``.
    Raises ParameterError.
    """
    accuracy = ACCURACY_RANGE.check("accuracy", accuracy)
    system = gear_system(point)
    largest = _ENOUGH_TO_TELL
    result, estimate = balance_accuracy.solve_to_accuracy(system, accuracy, largest=largest)
    if estimate is not None and accuracy < estimate.largest <= (
            accuracy * MAXIMUM_HARMONICS / largest):
        result, estimate = balance_accuracy.solve_to_accuracy(
            system, accuracy, result.limit_cycle, MAXIMUM_HARMONICS)
    if estimate is not None and estimate.largest <= accuracy and result.limit_cycle is not None:
        orbit = balance_orbit(system, result.limit_cycle)
        return Answer(result.outcome, orbit,
                      f"limit cycle found with {orbit.harmonics} harmonics")
    if result.limit_cycle is not None:
        rough = balance_orbit(system, result.limit_cycle)
        shot = shoot(system, *rough.initial_state())
        allowed = max(rough.error, _SAME) * rough.swivel
        if shot is not None and shot.stable and abs(shot.swivel - rough.swivel) <= allowed:
            return _by_shooting(shot)
    if point.damper.coulomb_torque == 0.0 or point.damper.quadratic_damping == 0.0:
        # Nothing sticks, or nothing limits the motion: the balance is right.
        if result.limit_cycle is None:
            return Answer(result.outcome, None, result.message)
        return Answer(Outcome.FAILED, None, "did not converge to the accuracy asked for")
    try:
        settled = settled_orbit(point)
    except SettlingError as error:
        return Answer(Outcome.FAILED, None, f"did not converge: {error}")
    if settled is None:
        return Answer(Outcome.NO_LIMIT_CYCLE, None, "no limit cycle: none grows from rest, or the "
                      "motions die that start beyond it")
    return _by_shooting(settled)


def _by_shooting(orbit: Orbit) -> Answer:
    return Answer(Outcome.LIMIT_CYCLE, orbit, "limit cycle found by shooting")
