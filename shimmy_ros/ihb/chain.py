"""Many systems in a row, each warm-started from the one before: for grids of points."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from . import loops
from .balance import split_coordinates
from .loops import Index, Real
from .newton import NEWTON_SETTINGS
from .solution import LimitCycle
from .solve import CHECK_TOLERANCE, LARGEST_WARM_CHANGE, LARGEST_WARM_FREQUENCY_CHANGE


@dataclass(frozen=True)
class Stack:
    """P systems of n coordinates with the same elements on the same coordinates.

    ``mass``, ``damping`` and ``stiffness`` have shape (P, n, n); one Coulomb element on the
    coordinate ``coulomb`` has ``torques`` (P,), one velocity-squared element on ``quadratic``
    ``coefficients`` (P,); all of these are positive.
    """

    mass: Real
    damping: Real
    stiffness: Real
    coulomb: int
    torques: Real
    quadratic: int
    coefficients: Real

    def __len__(self) -> int:
        return len(self.damping)

    def part(self, start: int, stop: int) -> Stack:
        """The systems from ``start`` to ``stop``."""
        part = slice(start, stop)
        return Stack(self.mass[part], self.damping[part], self.stiffness[part], self.coulomb,
                     self.torques[part], self.quadratic, self.coefficients[part])


@dataclass(frozen=True)
class Chain:
    """The first points of a stack, as many as could be solved one from the other.

    ``amplitude`` (P', n), ``frequency`` (P',) [rad/s], ``iterations`` and ``residual`` (P',), and
    the ``cycle`` of the last of them, if any.
    """

    amplitude: Real
    frequency: Real
    iterations: Index
    residual: Real
    cycle: LimitCycle | None


def solve_chain(stack: Stack, start: LimitCycle) -> Chain:
    """Solve ``stack`` one after the other, beginning with ``start``, a cycle near the first.

    ``start`` has the phase that the solvers give: no sine of its Coulomb element's coordinate.
    Ends before the first point that does not converge near its guess, on the same side of a fold,
    with a residual that passes the check.
    """
    count, dofs = len(stack), stack.mass.shape[1]
    active = tuple(sorted({stack.coulomb, stack.quadratic}))
    kept, dropped = split_coordinates(dofs, active)
    amplitude, frequency = np.empty((count, dofs)), np.empty(count)
    iterations, residual = np.empty(count, dtype=np.int64), np.empty(count)
    reference = active.index(stack.coulomb)
    solved, point, last = loops.solve_chain(
        stack.mass, stack.damping, stack.stiffness, kept, dropped,
        np.array([reference]), stack.torques[:, None].copy(),
        np.array([active.index(stack.quadratic)]), stack.coefficients[:, None].copy(),
        np.ascontiguousarray(start.coefficients[list(active)]), start.frequency,
        start.orientation, reference * 2 * start.harmonics + start.harmonics, *NEWTON_SETTINGS,
        LARGEST_WARM_CHANGE, LARGEST_WARM_FREQUENCY_CHANGE, CHECK_TOLERANCE,
        amplitude, frequency, iterations, residual)
    cycle = None
    if solved:
        end = solved - 1
        coefficients = loops.recover(stack.mass[end], stack.damping[end], stack.stiffness[end],
                                     kept, dropped, point, last)
        cycle = LimitCycle(coefficients, last, start.orientation)
    return Chain(amplitude[:solved], frequency[:solved], iterations[:solved], residual[:solved],
                 cycle)
