"""What a simulation gives back: its motion at chosen times, interpolated between the steps."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from ..gear.matrices import DAMPER, SWIVEL, TYRE_LATERAL
from ..gear.parameters import Damper, Range
from .interpolation import hermite
from .rolling_state import DAMPER_RATE, STATES, STRUT_TILT_RATE, TYRE_TORSION, Vector

COORDINATES = 4
PERIOD_RANGE = Range("s", "time between samples", 1e-6, 1e6)


@dataclass(frozen=True)
class Samples:
    """The motion at m times.

    time : (m,) s
    state : (m, 8) as in `rolling_state`
    velocity : (m, 4) rates of strut tilt, swivel, damper [rad/s] and tyre lateral [m/s]
    effort : (m, 4) torques that act on the coordinates [N m]: friction on the swivel, damping on
        the damper, zero on the other two
    """

    time: NDArray[np.float64]
    state: NDArray[np.float64]
    velocity: NDArray[np.float64]
    effort: NDArray[np.float64]

    @property
    def position(self) -> NDArray[np.float64]:
        """Strut tilt, swivel, damper [rad] and tyre lateral [m], shape (m, 4)."""
        return self.state[:, :COORDINATES]


def sample_grid(start: float, until: float, period: float) -> NDArray[np.float64]:
    """The multiples of ``period`` in (start, until], all in s; for samples without gap or overlap.

    Raises ParameterError for a period that is not positive.
    """
    period = PERIOD_RANGE.check("period", period)
    times = np.arange(np.floor(start / period), np.ceil(until / period) + 1.0) * period
    return times[(times > start) & (times <= until)]


class Segment(NamedTuple):
    """A step, or the part of it before an event: valid from ``start`` until ``stop`` [s].

    ``begin`` and ``end`` (16,) are state and derivative at the ends of the whole ``length`` [s];
    ``friction`` is the friction torque [N m], NaN where the swivel sticks.
    """

    start: float
    stop: float
    length: float
    begin: Vector
    end: Vector
    friction: float


def states(segments: Sequence[Segment], time: NDArray[np.float64]) -> NDArray[np.float64]:
    """The state, shape (m, 8), at each ``time`` (m,) [s] in the segment of the same place."""
    start = np.array([segment.start for segment in segments])[:, np.newaxis]
    length = np.array([segment.length for segment in segments])[:, np.newaxis]
    begin = np.array([segment.begin for segment in segments])
    end = np.array([segment.end for segment in segments])
    return hermite((time[:, np.newaxis] - start) / length, length, begin[:, :STATES],
                   begin[:, STATES:], end[:, :STATES], end[:, STATES:])


def sample(segments: Sequence[Segment], time: NDArray[np.float64], damper: Damper,
           lateral_rate: Vector, holding_torque: Vector) -> Samples:
    """Motion and torques at each ``time`` (m,) [s] in the segment of the same place.

    ``lateral_rate`` and ``holding_torque`` are the rows (8,) that give y' [m/s] and the torque
    [N m] that holds the swivel.
    """
    count = len(segments)
    velocity, effort = np.zeros((count, COORDINATES)), np.zeros((count, COORDINATES))
    if not count:
        return Samples(time, np.zeros((0, STATES)), velocity, effort)
    state = states(segments, time)
    moving = np.isfinite([segment.stop for segment in segments])
    friction = np.array([segment.friction for segment in segments])
    rate = state[:, DAMPER_RATE]
    velocity[:, :TYRE_LATERAL] = state[:, STRUT_TILT_RATE:TYRE_TORSION]
    # Products summed row by row, so that no number depends on how many are sampled together.
    velocity[:, TYRE_LATERAL] = np.where(moving, (state * lateral_rate).sum(axis=1), 0.0)
    effort[:, SWIVEL] = np.where(np.isnan(friction), (state * holding_torque).sum(axis=1), friction)
    effort[:, DAMPER] = -(damper.linear_damping + damper.quadratic_damping * np.abs(rate)) * rate
    return Samples(time, state, velocity, effort)
