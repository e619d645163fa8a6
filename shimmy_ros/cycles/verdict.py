"""What an operating point comes to: one outcome, one stable limit cycle if there is one.

A verdict is about a gear at rest that a kick of the swivel disturbs. Where rest is unstable any
disturbance grows; where it is stable, as friction makes it, the smallest kick that does not die
decides. A prediction is what a growing oscillation would reach, not that there is one.
"""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import dataclass, field
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from ..gear.matrices import NAMES, STRUT_TILT, SWIVEL, deflection_row
from ..gear.parameters import Limits
from ..gear.system import OperatingPoint
from ..ihb.harmonics import peaks
from ..ihb.solution import Outcome
from .kicks import KICKS
from .orbits import Orbit
from .settings import Settings

Real = NDArray[np.float64]

TYRE_DEFLECTION = "tyre_deflection"

# No parameter may differ by more than these parts.
_SAME_KICKS, _SAME_ERROR = 0.002, 0.1
_LITTLE = 0.05

_OPENINGS = {
    Outcome.LIMIT_CYCLE: "limit cycle: a growing oscillation would reach it",
    Outcome.NO_LIMIT_CYCLE: "no limit cycle: motions die",
    Outcome.UNBOUNDED: "unbounded: motion grows beyond half a turn, and no limit cycle holds it",
    Outcome.NOT_PERIODIC: "not periodic: motion stays bounded, but no odd limit cycle attracts it",
    Outcome.NOT_ROLLING: "not rolling",
    Outcome.NOT_CONVERGED: "did not converge",
}


@dataclass(frozen=True)
class Excess:
    """A ``quantity`` that passes its ``limit``: strut_tilt or swivel [rad], or tyre_deflection,
    which counts in radii of the wheel."""

    quantity: str
    value: float
    limit: float

    def __str__(self) -> str:
        unit, of_limit = ("", " wheel radii") if self.quantity == TYRE_DEFLECTION else (" rad",) * 2
        return (f"{self.quantity.replace('_', ' ')} {self.value:.4g}{unit} > "
                f"{self.limit:g}{of_limit}")


def excesses(point: OperatingPoint, orbit: Orbit, limits: Limits) -> tuple[Excess, ...]:
    """By what ``orbit``, stable or not, passes the model's ``limits`` at ``point``.

    Beyond them the equations hold, and the gear does not follow them.
    """
    deflection = deflection_row(point.gear) @ orbit.series.coefficients
    tyre = float(peaks(deflection[None])[0]) / point.gear.wheel_radius
    found = _beyond(orbit.amplitude, limits)
    if tyre > limits.tyre_deflection:
        found = (*found, Excess(TYRE_DEFLECTION, tyre, limits.tyre_deflection))
    return found


def _beyond(amplitude: Real, limits: Limits) -> tuple[Excess, ...]:
    angles = (("strut_tilt", float(amplitude[STRUT_TILT]), limits.strut_tilt),
              ("swivel", float(amplitude[SWIVEL]), limits.swivel))
    return tuple(Excess(*item) for item in angles if item[1] > item[2])


@dataclass(frozen=True)
class Kick:
    """Kicks of the swivel at rest [rad/s]: the smallest tried that does not die, ``grows``, and
    the one before, ``dies``, or 0; the smallest larger one that grows without bound, ``unbounded``,
    where the other does not."""

    dies: float
    grows: float
    unbounded: float | None = None


@dataclass(frozen=True)
class Ladder:
    """Where kicks led to one cycle alone, from one kick on.

    point : where all of them were tried
    estimated, error : where that cycle's error was estimated last, and to what
    """

    point: OperatingPoint
    estimated: OperatingPoint
    error: float

    def holds_at(self, point: OperatingPoint) -> bool:
        """Whether ``point`` is so near that kicks need not be tried again."""
        return _near(self.point, point, _SAME_KICKS)

    def error_holds_at(self, point: OperatingPoint) -> bool:
        """Whether ``point`` is so near that the error can be taken to be much the same."""
        return _near(self.estimated, point, _SAME_ERROR)


def _near(one: OperatingPoint, other: OperatingPoint, part: float) -> bool:
    """Whether no parameter differs by more than a ``part``."""
    if one.gear is not other.gear and one.gear != other.gear:
        return False
    old, new = one.damper, other.damper
    # Friction that stops a swivel as slow as this matters as little as none.
    little = _LITTLE * math.sqrt(one.gear.swivel_inertia * one.gear.damper_linkage_stiffness)
    return (abs(other.velocity - one.velocity) <= part * one.velocity
            and abs(new.linear_damping - old.linear_damping) <= part * old.linear_damping
            and abs(new.quadratic_damping - old.quadratic_damping) <= part * old.quadratic_damping
            and abs(new.coulomb_torque - old.coulomb_torque) <= part * max(
                old.coulomb_torque, little))


@dataclass(frozen=True)
class Verdict:
    """The answer for one operating point.

    point, settings : what was asked
    outcome : how it ended, see Outcome
    orbit : the stable limit cycle, exactly if the outcome is LIMIT_CYCLE
    envelope : largest magnitudes of (strut tilt, swivel, damper, tyre lateral) in motion that is
        bounded but settles on no cycle, exactly if the outcome is NOT_PERIODIC; rad, rad, rad, m
    further : other stable limit cycles at the point, which other disturbances reach
    rest_is_stable : whether a small disturbance dies; None where that was not asked
    kick : the smallest kick that does not die, where it was looked for
    work : steps of motion, and what took as long, that the answer took
    ladder : what it tells about points nearby, if anything
    warm : whether the point before was used, which changes the cost alone
    reason : why there is no answer, where there is none
    """

    point: OperatingPoint
    settings: Settings
    outcome: Outcome
    orbit: Orbit | None = None
    envelope: Real | None = None
    further: tuple[Orbit, ...] = ()
    rest_is_stable: bool | None = None
    kick: Kick | None = None
    work: int = 0
    warm: bool = False
    reason: str = ""
    ladder: Ladder | None = field(default=None, repr=False)

    def __post_init__(self) -> None:
        if (self.orbit is not None) != (self.outcome is Outcome.LIMIT_CYCLE):
            raise ValueError("a limit cycle belongs to the outcome LIMIT_CYCLE and to no other")
        if (self.envelope is not None) != (self.outcome is Outcome.NOT_PERIODIC):
            raise ValueError("an envelope belongs to the outcome NOT_PERIODIC and to no other")

    @cached_property
    def amplitude(self) -> Real:
        """Amplitudes (4,) for whoever compares them with a limit; rad, rad, rad, m.

        The peaks of a limit cycle, zero without one, infinity for motion that grows without bound,
        the envelope of motion that is not periodic, and NaN where there is no answer.
        """
        if self.orbit is not None:
            return self.orbit.amplitude
        if self.envelope is not None:
            return self.envelope
        value = {Outcome.NO_LIMIT_CYCLE: 0.0, Outcome.UNBOUNDED: np.inf}.get(self.outcome, np.nan)
        return np.full(len(NAMES), value)

    @cached_property
    def peak_velocity(self) -> Real:
        """Peaks of the rates (4,), as ``amplitude``; NaN where only an envelope is known."""
        if self.orbit is not None:
            return self.orbit.peak_velocity()
        return self.amplitude if self.envelope is None else np.full(len(NAMES), np.nan)

    @property
    def frequency_hz(self) -> float:
        """The limit cycle's frequency in Hz; NaN without one."""
        return float("nan") if self.orbit is None else self.orbit.frequency_hz

    @property
    def error(self) -> float:
        """The estimated relative error of the limit cycle's numbers; NaN without one."""
        return float("nan") if self.orbit is None else self.orbit.error

    @property
    def residual(self) -> float:
        """The relative residual of the balance or of shooting; NaN without a limit cycle."""
        return float("nan") if self.orbit is None else self.orbit.residual

    @cached_property
    def message(self) -> str:
        """What the verdict means: which disturbance leads where, and what else is to be known."""
        return "; ".join((_OPENINGS[self.outcome], *self._details()))

    @cached_property
    def excesses(self) -> tuple[Excess, ...]:
        """By what the limit cycle, or the envelope, passes the model's limits.

        Of an envelope the tyre's deflection is not known.
        """
        limits = self.settings.limits
        if self.orbit is not None:
            return excesses(self.point, self.orbit, limits)
        return () if self.envelope is None else _beyond(self.envelope, limits)

    @property
    def stable_cycles(self) -> tuple[Orbit, ...]:
        """All stable cycles that are known at the point, that which decides first."""
        return () if self.orbit is None else (self.orbit, *self.further)

    @property
    def beyond_limits(self) -> str:
        """The same in words; empty where the answer is one that the model vouches for."""
        return ", ".join(map(str, self.excesses))

    @property
    def failed(self) -> bool:
        """Whether the solve did not converge, which is no answer at all."""
        return self.outcome is Outcome.NOT_CONVERGED

    @property
    def stands(self) -> bool:
        """Whether the tyre does not roll, so that there is no answer to give."""
        return self.outcome is Outcome.NOT_ROLLING

    def _details(self) -> Iterator[str]:
        kick = self.kick
        if self.reason:
            yield self.reason
        elif self.outcome is Outcome.NO_LIMIT_CYCLE:
            yield f"kicks of the swivel of up to {KICKS[-1]:g} rad/s die"
        elif self.rest_is_stable is False:
            yield "rest is unstable, and any disturbance leads there"
        elif kick is not None:
            smaller = f", one of {kick.dies:.3g} rad/s dies" if kick.dies else ""
            yield f"a kick of the swivel of {kick.grows:.3g} rad/s leads there{smaller}"
        if self.excesses:
            yield f"beyond the model's limits: {self.beyond_limits}"
        if self.further:
            cycles = "cycle" if len(self.further) == 1 else "cycles"
            yield f"{len(self.further)} further stable {cycles}"
        if kick is not None and kick.unbounded is not None:
            yield f"a kick of {kick.unbounded:.3g} rad/s grows without bound"
