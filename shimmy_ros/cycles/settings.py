"""How limit cycles are to be computed, and within which limits the model holds."""

from __future__ import annotations

from dataclasses import dataclass, field

from ..gear.parameters import (
    DEFAULT_MINIMUM_VELOCITY,
    MINIMUM_VELOCITY_RANGE,
    Limits,
    ParameterError,
    Range,
)

AUTO, BALANCE, SHOOTING = "auto", "ihb", "shooting"
METHODS = (AUTO, BALANCE, SHOOTING)

DEFAULT_HARMONICS = 4
MAXIMUM_HARMONICS = 64
HARMONICS_RANGE = Range("harmonics", "number of odd harmonics", 1, MAXIMUM_HARMONICS)

DEFAULT_ACCURACY = 0.01
ACCURACY_RANGE = Range("1", "relative error allowed of amplitudes and frequency", 1e-9, 0.5)

DEFAULT_BUDGET = 1.0
BUDGET_RANGE = Range(
    "s", "work that an answer may take, in seconds of one core of 2020's making; counted and not "
    "timed, so that the answer does not depend on the machine", 0.001, 1000.0)


@dataclass(frozen=True)
class Settings:
    """What an answer depends on besides the operating point.

    harmonics : N of the balance
    accuracy : the estimated relative error up to which an answer is good enough
    method : one of METHODS. AUTO begins with N harmonics, takes more where these are not accurate
        enough, and changes to shooting where the swivel sticks; the others stay with one method
    minimum_velocity : below it the tyre does not roll [m/s]
    limits : beyond them a limit cycle is no ordinary answer
    budget : see BUDGET_RANGE

    Raises ParameterError.
    """

    harmonics: int = DEFAULT_HARMONICS
    accuracy: float = DEFAULT_ACCURACY
    method: str = AUTO
    minimum_velocity: float = DEFAULT_MINIMUM_VELOCITY
    limits: Limits = field(default_factory=Limits)
    budget: float = DEFAULT_BUDGET

    def __post_init__(self) -> None:
        if self.method not in METHODS:
            raise ParameterError(f"method is {self.method!r}, but must be one of "
                                 f"{', '.join(METHODS)}")
        object.__setattr__(self, "harmonics", check_harmonics(self.harmonics))
        for name, range_ in (("accuracy", ACCURACY_RANGE), ("budget", BUDGET_RANGE),
                             ("minimum_velocity", MINIMUM_VELOCITY_RANGE)):
            object.__setattr__(self, name, range_.check(name, getattr(self, name)))


def check_harmonics(harmonics: int) -> int:
    """``harmonics`` as an int, or ParameterError."""
    number = HARMONICS_RANGE.check("harmonics", harmonics)
    if number != int(number):
        raise ParameterError(
            f"harmonics is {number:g}, but must be a whole number in {HARMONICS_RANGE.describe()}")
    return int(number)
