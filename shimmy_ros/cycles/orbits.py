"""One limit cycle of the gear as a value, found by harmonic balance or by exact shooting.

The balance takes the friction's sign from isolated zeros of the swivel rate; where the swivel
sticks that law ends, and near a fold N harmonics may be too few. Shooting has neither limit and
costs more.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from ..gear.matrices import SWIVEL
from ..gear.parameters import HALF_TURN
from ..ihb.accuracy import estimate_error
from ..ihb.harmonics import Complex, shifted, to_complex
from ..ihb.newton import STABLE_ORIENTATION, solve_point
from ..ihb.solution import LimitCycle
from ..ihb.solve import CHECK_TOLERANCE, placed
from ..ihb.stability import StickingError, stability
from ..ihb.system import System
from ..shooting.cycle import Cycle
from ..shooting.flow import FlowError
from ..shooting.periodic import MOST_SEARCH_STEPS, Outcome, limit_cycle
from .budget import SERIES_STEPS, Budget
from .settings import AUTO, BALANCE, DEFAULT_BUDGET, SHOOTING, Settings

Real = NDArray[np.float64]

SERIES_HARMONICS = 64
_SAMPLES = 1024
# What is asked of multipliers: fewest steps in half a period, and relative error.
_STEPS, _TOLERANCE = 8, 1e-3
# Multipliers closer to 1 are looked at twice.
_MARGIN = 2e-3


@dataclass(frozen=True)
class Orbit:
    """One limit cycle.

    method : BALANCE or SHOOTING
    amplitude : peaks of (strut tilt, swivel, damper, tyre lateral); rad, rad, rad, m
    frequency_hz : Hz
    stable : None where the method cannot tell: the balance where the swivel sticks
    multiplier : largest modulus of the full period's Floquet multipliers, the one of a shift in
        time apart; NaN where unknown
    sticks : whether the swivel is held by friction for part of the cycle
    estimate : gives ``error`` when it is asked for the first time
    harmonics : N of the balance, 0 of shooting
    source : what the method found
    """

    method: str
    amplitude: Real
    frequency_hz: float
    stable: bool | None
    multiplier: float
    sticks: bool
    estimate: Callable[[], float]
    harmonics: int
    source: LimitCycle | Cycle

    @cached_property
    def error(self) -> float:
        """Estimated relative error of amplitudes and frequency.

        That of shooting is how far the orbit is from closing.
        """
        return self.estimate()

    @property
    def residual(self) -> float:
        """The relative residual of the balance, or by how much shooting's orbit does not close."""
        return self.source.residual if isinstance(self.source, LimitCycle) else self.error

    @cached_property
    def series(self) -> LimitCycle:
        """The orbit as a Fourier series; that of shooting's has SERIES_HARMONICS harmonics."""
        if isinstance(self.source, LimitCycle):
            return self.source
        cycle = LimitCycle(fourier(self, SERIES_HARMONICS), 2.0 * np.pi * self.frequency_hz,
                           STABLE_ORIENTATION)
        return LimitCycle(aligned(cycle), cycle.frequency, cycle.orientation)

    def peak_velocity(self) -> Real:
        """Peak of |dq/dt| of each coordinate, shape (4,); rad/s, rad/s, rad/s, m/s."""
        if isinstance(self.source, LimitCycle):
            return self.source.peak_velocity()
        states = self.source.sample(np.linspace(0.0, 0.5 * self.source.period, 2 * _SAMPLES))
        return np.asarray(np.abs(states[len(states) // 2:]).max(axis=1))

    @property
    def swivel(self) -> float:
        """Swivel amplitude [rad]."""
        return float(self.amplitude[SWIVEL])

    def initial_state(self) -> tuple[Real, float]:
        """The state (8,), (q, dq/dt), where the swivel passes zero upwards; and the period [s]."""
        cycle = self.source
        if isinstance(cycle, Cycle):
            return cycle.state, cycle.period
        # Whoever only follows a verdict need not import it.
        from scipy.optimize import brentq

        times = np.linspace(0.0, cycle.period, _SAMPLES + 1)
        swivel = cycle.position(times)[SWIVEL]
        before = int(np.flatnonzero((swivel[:-1] < 0.0) & (swivel[1:] >= 0.0))[0])
        start = np.array([brentq(lambda t: cycle.position(np.array([t]))[SWIVEL, 0],
                                 times[before], times[before + 1], xtol=1e-14)])
        return (np.concatenate([cycle.position(start)[:, 0], cycle.velocity(start)[:, 0]]),
                cycle.period)

    def same_as(self, other: Orbit, tolerance: float = 1e-5) -> bool:
        """Whether both are the same cycle within ``tolerance``.

        Where one is not of the other's method, their estimated errors are allowed for as well.
        """
        alike = (self.method, self.harmonics) == (other.method, other.harmonics)
        allowed = tolerance if alike else tolerance + self.error + other.error
        return bool(
            np.all(np.abs(self.amplitude - other.amplitude) <= allowed * other.amplitude)
            and abs(self.frequency_hz - other.frequency_hz) <= allowed * other.frequency_hz)


def accepted(orbit: Orbit, settings: Settings) -> bool:
    """Whether ``orbit`` is of the right method and as accurate as the settings ask for."""
    if orbit.method == SHOOTING:
        return settings.method != BALANCE
    if settings.method != AUTO:
        return settings.method == BALANCE
    # Beyond half a turn the equations have cycles and no gear has: the balance will do.
    return not orbit.sticks and (orbit.error <= settings.accuracy or orbit.swivel > HALF_TURN)


def balance_orbit(system: System, cycle: LimitCycle) -> Orbit:
    """The orbit that the balance found, with its stability and its error estimated."""
    def error() -> float:
        return estimate_error(system, cycle).largest

    try:
        floquet = stability(system, cycle, _STEPS, _TOLERANCE)
    except StickingError:
        return Orbit(BALANCE, cycle.amplitude(), cycle.frequency_hz, None, float("nan"), True,
                     error, cycle.harmonics, cycle)
    multipliers = floquet.full_period
    multiplier = float(np.max(np.abs(multipliers), initial=0.0))
    return Orbit(BALANCE, cycle.amplitude(), cycle.frequency_hz,
                 _stable(cycle, floquet.reliable, multipliers, floquet.shift_error), multiplier,
                 False, error, cycle.harmonics, cycle)


def _stable(cycle: LimitCycle, reliable: bool, multipliers: Complex, shift_error: float
            ) -> bool | None:
    """Whether the full period's ``multipliers`` are those of a stable cycle; None in doubt."""
    if cycle.orientation != STABLE_ORIENTATION:
        return False
    if not reliable:
        return None
    sizes = np.abs(multipliers)
    if np.all(sizes < 1.0 - _MARGIN):
        return True
    if np.any(sizes >= 1.0 + 2.0 * shift_error):
        return False
    # In a fold the determinant changes sign exactly where a cycle becomes unstable; what the
    # multipliers say near 1 is as good as that of the shift in time.
    largest = multipliers[np.argmax(sizes)]
    return True if largest.real > 0.0 and abs(largest.imag) <= _MARGIN else None


def shooting_orbit(cycle: Cycle, residual: float) -> Orbit:
    """The orbit that shooting found, closing up to a relative ``residual``."""
    return Orbit(SHOOTING, cycle.amplitude, float(cycle.frequency / (2.0 * np.pi)), cycle.stable,
                 float(np.abs(cycle.multipliers).max()), cycle.sticks, lambda: residual, 0, cycle)


def shoot(system: System, state: Real, period: float, budget: Budget | None = None
          ) -> Orbit | None:
    """The cycle near the motion from ``state`` (8,) with ``period`` [s], by shooting, or None.

    Raises BudgetError.
    """
    budget = budget or Budget.of(DEFAULT_BUDGET)
    most_steps = min(MOST_SEARCH_STEPS, budget.series)
    try:
        result = limit_cycle(system, state, period, most_steps=most_steps)
    except (FlowError, ValueError):
        # Numbers at the ends of floating point make no model either.
        return None
    # A search that the budget has cut short is none.
    cut = result.cycle is None and result.steps >= most_steps < MOST_SEARCH_STEPS
    budget.spend(budget.left + 1 if cut else SERIES_STEPS * result.steps)
    if result.outcome is not Outcome.LIMIT_CYCLE or result.cycle is None:
        return None
    return shooting_orbit(result.cycle, result.residual)


def converge(system: System, coefficients: Real, frequency: float) -> LimitCycle | None:
    """The balance's cycle near ``coefficients`` (4, 2N) and ``frequency`` [rad/s], or None."""
    active = system.nonlinear_dofs
    if not active:
        return None
    phase, point = placed(system, LimitCycle(coefficients, frequency, 0), active)
    try:
        found = solve_point(system, point, active, phase)
    except (ValueError, np.linalg.LinAlgError):
        # The iterates came to rest, or to a resonance without damping.
        return None
    if not (found.convergence.converged and found.residual <= CHECK_TOLERANCE):
        return None
    return LimitCycle(found.coefficients, found.convergence.point.frequency,
                      found.convergence.orientation, found.residual)


def balance_near(system: System, orbit: Orbit, harmonics: int) -> Orbit | None:
    """The balance's counterpart of ``orbit``, with N ``harmonics``, or None."""
    if isinstance(orbit.source, LimitCycle) and orbit.source.harmonics == harmonics:
        return orbit
    cycle = converge(system, fourier(orbit, harmonics), 2.0 * np.pi * orbit.frequency_hz)
    return None if cycle is None else balance_orbit(system, cycle)


def aligned(cycle: LimitCycle) -> Real:
    """The cycle's coefficients (4, 2N) from where the swivel's first harmonic has its peak."""
    first = to_complex(cycle.coefficients)[SWIVEL, 0]
    return shifted(cycle.coefficients, -float(np.angle(first)))


def fourier(orbit: Orbit, harmonics: int) -> Real:
    """The first ``harmonics`` odd Fourier coefficients of ``orbit``, shape (4, 2N)."""
    turns = np.arange(_SAMPLES) / _SAMPLES
    if isinstance(orbit.source, Cycle):
        samples = orbit.source.sample(turns * orbit.source.period)[:4]
    else:
        samples = orbit.source.position(turns * orbit.source.period)
    spectrum = np.fft.rfft(samples, axis=1)[:, 1:2 * harmonics:2] * (2.0 / _SAMPLES)
    return np.concatenate([spectrum.real, -spectrum.imag], axis=1)
