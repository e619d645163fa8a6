"""What the compiled loop works on: plain tuples of arrays and numbers."""

from __future__ import annotations

from enum import IntEnum
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

Real = NDArray[np.float64]

LEVELS = 60
"""Step lengths are the longest one times 2^(-level/2)."""
SECTIONS = 400
"""Sections that are remembered."""


class Problem(NamedTuple):
    """See equations.Equations and equations.HeldRest."""

    matrices: Real
    load: Real
    holding: Real
    weights: Real
    quadratic: float
    friction: float
    free_is_stable: bool
    rest_is_stable: bool
    equilibrium: Real
    torque_per_angle: float
    modes: NDArray[np.complex128]
    gains: Real


class Steps(NamedTuple):
    """What belongs to the steps of a mode (first axis) and a level (second), for s stages.

    ``lengths`` [s], shape (L,). From (x, torques at the stages), shape (9 + s,), ``stages`` (2, L,
    s, 9, 9 + s) gives the states there, and ``watched`` (2, L, s, 9 + s) what an event depends on:
    the swivel's rate, or the torque that holds it. ``error`` (2, L, 9, 9 + s) is the filtered
    estimate of the error, to which ``filtered`` (2, L, 9) times the torque at the start has to be
    added. ``polynomial`` (s + 1, s + 1) as in radau.Radau; ``samples`` (2 s,) are fractions of a
    step at which signs are looked at, and ``sampling`` (2 s, s + 1) gives values there.
    """

    lengths: Real
    stages: Real
    watched: Real
    error: Real
    filtered: Real
    nodes: Real
    polynomial: Real
    samples: Real
    sampling: Real


class Accuracy(NamedTuple):
    """How accurate, and when to stop.

    ``step`` is the estimated error allowed in a step, ``event`` in one that ends with an event,
    relative to the recent size of each variable. A motion has settled if it differs from itself ten
    periods before by less than ``same``. ``steps`` and ``sections`` are the most that are taken.
    """

    step: float
    event: float
    same: float
    steps: int
    sections: int


class Record(NamedTuple):
    """Where a motion is, and what has been seen of it.

    state : (9,), see equations
    clock : (8,), see Clock
    section_states : states at the last SECTIONS sections, (SECTIONS, 9), a ring
    section_peaks : largest |swivel| before each section [rad], (sections,)
    highest, lowest : extremes of the coordinates while sections are counted, (4,)
    """

    state: Real
    clock: Real
    section_states: Real
    section_peaks: Real
    highest: Real
    lowest: Real


MOVING, HELD = 0, 1


class Clock(IntEnum):
    """Indices of Record.clock: time [s]; MOVING or HELD; the sign of the swivel's motion; steps;
    sections; time held [s]; sections in a period, once settled; events."""

    TIME = 0
    MODE = 1
    DIRECTION = 2
    STEPS = 3
    PASSED = 4
    HELD_TIME = 5
    PERIOD = 6
    EVENTS = 7


class End(IntEnum):
    """Why the loop ended; FAILED means that no step is short enough."""

    SETTLED = 0
    RESTS = 1
    GROWS = 2
    OUT_OF_TIME = 3
    FAILED = 4
    COUNTED = 5
