"""Where a motion settles: a first guess of a stable cycle, by following the flow."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike

from ..ihb.system import System
from .flow import advance
from .modes import Real, model_of
from .periodic import checked_section, checked_state

_MOST_CROSSINGS = 9


class Settled(NamedTuple):
    """A state (2n,) at which the section coordinate passes zero, and the period [s] of the motion.

    ``change`` is how far the state is from minus that of half a period before, in the largest
    component relative to its size: 0 on a cycle.
    """

    state: Real
    period: float
    change: float


def settle(system: System, state: ArrayLike, duration: float, *,
           section: int | None = None) -> Settled | None:
    """The end of the motion from ``state`` (2n,) over ``duration`` [s], or None if it came to rest.

    Rest means that coordinate ``section``, by default the first with friction, passes zero fewer
    than three times, or not any more towards the end.

    Raises ValueError for arguments that do not fit and for elements that shooting does not know,
    and FlowError.
    """
    model = model_of(system)
    section = checked_section(model, section)
    trajectory = advance(model, checked_state(model, "state", state), duration)
    times = trajectory.zeros(section)[-_MOST_CROSSINGS:]
    if times.size < 3 or duration - times[-1] > 2.0 * (times[-1] - times[-3]):
        return None
    states = trajectory.sample(times)
    size = trajectory.magnitude()[:, None]
    distance = (np.abs(states[:, -1:] + states[:, -2::-2]) / size).max(axis=0)
    # A motion that passes zero several times in half a period returns after an odd number of them.
    nearest = int(np.flatnonzero(distance <= 2.0 * distance.min())[0])
    return Settled(states[:, -1], 2.0 * float(times[-1] - times[-2 - 2 * nearest]),
                   float(distance[nearest]))
