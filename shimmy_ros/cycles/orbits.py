"""One limit cycle of the gear as a value, found by harmonic balance or by exact shooting.

The balance takes the friction's sign from isolated zeros of the swivel rate; where the swivel
sticks that law ends, and near a fold N harmonics may be too few. Shooting has neither limit and
costs more.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.optimize import brentq

from ..gear.matrices import SWIVEL
from ..ihb.accuracy import estimate_error
from ..ihb.balance import balance, recovered
from ..ihb.harmonics import shifted, to_complex
from ..ihb.newton import STABLE_ORIENTATION, newton
from ..ihb.solution import LimitCycle
from ..ihb.solve import placed
from ..ihb.stability import StickingError, stability
from ..ihb.system import System
from ..shooting.cycle import Cycle
from ..shooting.flow import FlowError
from ..shooting.periodic import Outcome, limit_cycle

Real = NDArray[np.float64]

BALANCE, SHOOTING = "ihb", "shooting"
_SAMPLES = 1024


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
    error : estimated relative error of amplitudes and frequency; that of shooting is how far the
        orbit is from closing
    harmonics : N of the balance, 0 of shooting
    source : what the method found
    """

    method: str
    amplitude: Real
    frequency_hz: float
    stable: bool | None
    multiplier: float
    sticks: bool
    error: float
    harmonics: int
    source: LimitCycle | Cycle

    @property
    def swivel(self) -> float:
        """Swivel amplitude [rad]."""
        return float(self.amplitude[SWIVEL])

    def initial_state(self) -> tuple[Real, float]:
        """The state (8,), (q, dq/dt), where the swivel passes zero upwards; and the period [s]."""
        cycle = self.source
        if isinstance(cycle, Cycle):
            return cycle.state, cycle.period
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


def balance_orbit(system: System, cycle: LimitCycle) -> Orbit:
    """The orbit that the balance found, with its stability and its error estimated."""
    error = estimate_error(system, cycle).largest
    try:
        floquet = stability(system, cycle)
    except StickingError:
        return Orbit(BALANCE, cycle.amplitude(), cycle.frequency_hz, None, float("nan"), True,
                     error, cycle.harmonics, cycle)
    multiplier = float(np.max(np.abs(floquet.full_period), initial=0.0))
    # The determinant changes sign exactly in the fold, the multiplier passes 1 nearby.
    stable = (cycle.orientation == STABLE_ORIENTATION
              and multiplier < 1.0 + 2.0 * floquet.shift_error)
    return Orbit(BALANCE, cycle.amplitude(), cycle.frequency_hz, stable, multiplier, False, error,
                 cycle.harmonics, cycle)


def shooting_orbit(cycle: Cycle, residual: float) -> Orbit:
    """The orbit that shooting found, closing up to a relative ``residual``."""
    return Orbit(SHOOTING, cycle.amplitude, float(cycle.frequency / (2.0 * np.pi)), cycle.stable,
                 float(np.abs(cycle.multipliers).max()), cycle.sticks, residual, 0, cycle)


def shoot(system: System, state: Real, period: float) -> Orbit | None:
    """The cycle near the motion from ``state`` (8,) with ``period`` [s], by shooting, or None."""
    try:
        result = limit_cycle(system, state, period)
    except FlowError:
        return None
    if result.outcome is not Outcome.LIMIT_CYCLE or result.cycle is None:
        return None
    return shooting_orbit(result.cycle, result.residual)


def converge(system: System, coefficients: Real, frequency: float) -> LimitCycle | None:
    """The balance's cycle near ``coefficients`` (4, 2N) and ``frequency`` [rad/s], or None."""
    active = system.nonlinear_dofs
    guess = LimitCycle(coefficients, frequency, 0)
    phase, point = placed(system, guess, active)
    try:
        found = newton(system, point, active, phase)
    except (ValueError, np.linalg.LinAlgError):
        # The iterates came to rest, or to a resonance without damping.
        return None
    if not found.converged:
        return None
    every = recovered(system, found.point.coefficients, found.point.frequency, active)
    full = balance(system, every, found.point.frequency, tuple(range(system.dofs)))
    if not full.error <= 1e-9:
        return None
    return LimitCycle(every, found.point.frequency, found.orientation)


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
