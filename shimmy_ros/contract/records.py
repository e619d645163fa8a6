"""What the messages say, as plain values: stamps in nanoseconds, SI units, no ROS.

The Float64 topics need no record: their value is a float.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from enum import IntEnum

import numpy as np
from numpy.typing import NDArray

from ..gear.matrices import NAMES

JOINTS: tuple[str, ...] = NAMES
"""Joint names in the order of every array below: rad, rad, rad, m (per s for velocities)."""


class MessageError(ValueError):
    """A record or bytes that do not fit their message; one sentence says why."""


class Level(IntEnum):
    """The levels of a diagnostic_msgs/DiagnosticStatus."""

    OK = 0
    WARN = 1
    ERROR = 2
    STALE = 3


@dataclass(frozen=True)
class TaxiVelocity:
    """Forward ``velocity`` [m/s] of the aircraft, measured at ``stamp_ns``."""

    stamp_ns: int
    velocity: float


@dataclass(frozen=True)
class GearResponse:
    """State of the gear at ``stamp_ns``: four values each, in the order of JOINTS.

    ``effort`` holds the friction torque on the swivel and the torque of the damper [N m].
    Raises MessageError for another number of values.
    """

    stamp_ns: int
    position: tuple[float, ...]
    velocity: tuple[float, ...]
    effort: tuple[float, ...]

    def __post_init__(self) -> None:
        _check_length("position", self.position)
        _check_length("velocity", self.velocity)
        _check_length("effort", self.effort)


@dataclass(frozen=True)
class LimitCycleAmplitude:
    """Peak position and velocity over the limit cycle, four each.

    Zero without one, infinite for motion that grows without bound, the bounds of motion that is not
    periodic (whose velocities are NaN), and NaN where nothing is known.

    ``stamp_ns`` is that of the velocity sample. Raises MessageError for another number of values.
    """

    stamp_ns: int
    position: tuple[float, ...]
    velocity: tuple[float, ...]

    def __post_init__(self) -> None:
        _check_length("position", self.position)
        _check_length("velocity", self.velocity)


@dataclass(frozen=True, eq=False)
class LimitCycleOrbit:
    """One period of the limit cycle at m times, the last of which is the period.

    ``times_ns`` has shape (m,), int64, from 0; ``positions`` and ``velocities`` have shape
    (m, 4). Where there is no limit cycle, m = 0. Raises MessageError for other shapes.
    """

    stamp_ns: int
    times_ns: NDArray[np.int64]
    positions: NDArray[np.float64]
    velocities: NDArray[np.float64]

    def __post_init__(self) -> None:
        shape = (len(self.times_ns), len(JOINTS))
        for name in ("positions", "velocities"):
            if getattr(self, name).shape != shape:
                raise MessageError(f"{name} of an orbit have shape {getattr(self, name).shape}, "
                                   f"but must have shape {shape}")


@dataclass(frozen=True)
class Status:
    """One DiagnosticStatus of an array with ``stamp_ns``; ``values`` in the order to be sent."""

    stamp_ns: int
    name: str
    hardware_id: str
    level: Level
    message: str
    values: Mapping[str, str]


def _check_length(name: str, values: tuple[float, ...]) -> None:
    if len(values) != len(JOINTS):
        raise MessageError(f"{name} has {len(values)} values, but must have {len(JOINTS)}: "
                           f"{', '.join(JOINTS)}")
