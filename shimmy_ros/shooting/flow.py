"""The flow: Taylor series of high order from event to event, with its derivatives.

Within a mode the series of the state x follows from q'' = A x + b + G w, w_i = s_i (q'_i)^2, by a
recurrence, and so does that of its derivatives. A step ends at the first event: an active
velocity that comes to zero, or a holding force that reaches the friction T. Where the velocity v
of a coordinate comes to zero, and the field changes from f- to f+, the derivatives X change by
saltation, X+ = X- + (f+ - f-) (X-)_v / (f-)_v. This covers reversal and sticking; in the latter
the row of v becomes zero and the rank drops. At a release the field is continuous, and so is X.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike

from .modes import Model, signs_at
from .steps import GROWS, TOO_LONG, Rates, run
from .trajectory import Trajectory

MOST_STEPS = 200_000


class FlowError(ArithmeticError):
    """The motion grows without bound or switches without end; found out after ``steps``."""

    def __init__(self, message: str, steps: int) -> None:
        super().__init__(message)
        self.steps = steps


class ParameterRate(NamedTuple):
    """Two models at parameter values ``width`` apart, on either side of the one that moves."""

    below: Model
    above: Model
    width: float


def advance(model: Model, state: ArrayLike, duration: float, *, derivatives: bool = False,
            rate: ParameterRate | None = None, most_steps: int = MOST_STEPS) -> Trajectory:
    """The motion from ``state`` (2n,) over ``duration`` [s], in at most ``most_steps``.

    ``derivatives`` asks for those by the initial state, and ``rate`` for that by a parameter as
    well. The last terms of every series are below 1e-16 of the largest value that the component
    has had, and 1e-12 for derivatives.

    Raises ValueError for a duration that is not positive and finite, and FlowError.
    """
    if not (np.isfinite(duration) and duration > 0.0):
        raise ValueError(f"duration is {duration} s, but must be positive and finite")
    size, modes = 2 * model.dofs, model.modes
    start = np.array(state, dtype=np.float64)
    signs = signs_at(modes, start, np.zeros(len(model.active), dtype=np.int64))
    rates = Rates(modes, modes, 1.0, False)
    if rate is not None:
        rates = Rates(rate.below.modes, rate.above.modes, float(rate.width), True)
    derivatives = derivatives or rate is not None
    rows = np.zeros((size, 1 + size * derivatives + (rate is not None)))
    if derivatives:
        rows[:, 1:1 + size] = np.eye(size)
        rows[modes.velocities[signs == 0]] = 0.0
    rows[:, 0] = start
    status, time, steps, pieces = run(modes, rates, rows, signs, float(duration), most_steps)
    if status == GROWS:
        raise FlowError(f"the motion grows without bound after {time:g} s", steps)
    if status == TOO_LONG:
        raise FlowError(f"the motion takes more than {most_steps} steps over {duration:g} s: it "
                        "grows without bound or switches without end", steps)
    return Trajectory(
        pieces, float(duration), rows[:, 0].copy(),
        rows[:, 1:1 + size].copy() if derivatives else None,
        rows[:, -1].copy() if rate is not None else None, steps)
