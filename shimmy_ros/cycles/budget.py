"""The work that an answer may take, counted and not timed, so that it is the same everywhere."""

from __future__ import annotations

from dataclasses import dataclass

STEPS_PER_SECOND = 6_000_000
"""Steps of a motion that one core takes in a second, about."""

# Steps of a motion that other work takes about as long as: an attempt of the balance, and a step of
# the series that shooting follows.
BALANCE_STEPS = 10_000
SERIES_STEPS = 70


class BudgetError(ArithmeticError):
    """The work that an answer may take was not enough."""


@dataclass
class Budget:
    """Work that is ``left``, and that was ``spent``, in steps of a motion."""

    left: int
    spent: int = 0

    @classmethod
    def of(cls, seconds: float) -> Budget:
        """What one core does in about so many ``seconds``."""
        return cls(int(seconds * STEPS_PER_SECOND))

    @property
    def series(self) -> int:
        """For how many steps of shooting's series there is work left, at least one."""
        return max(self.left // SERIES_STEPS, 1)

    def spend(self, steps: int) -> None:
        """Take ``steps`` off. Raises BudgetError where there are not so many."""
        self.left -= steps
        self.spent += steps
        if self.left < 0:
            raise BudgetError("an answer would take more work than its budget allows")
