"""From a motion near a limit cycle to the cycle itself, by the cheapest method that will do.

The balance with the harmonics asked for, then with four times as many, then shooting, which has no
error but that of rounding and knows friction that sticks. Which of them answers depends on the
cycle alone and not on where the search for it began.
"""

from __future__ import annotations

import math
from collections.abc import Callable

import numpy as np
from numpy.typing import NDArray

from ..compiling import compiled
from ..gear.matrices import SWIVEL, TYRE_LATERAL
from ..gear.parameters import HALF_TURN
from ..ihb import loops
from ..ihb.harmonics import with_harmonics
from ..ihb.solution import LimitCycle
from ..ihb.system import System
from ..shooting.cycle import Cycle
from .budget import BALANCE_STEPS, Budget
from .orbits import Orbit, accepted, balance_orbit, converge, fourier, shoot
from .settings import AUTO, BALANCE, SHOOTING, Settings

Real = NDArray[np.float64]

# More harmonics than asked for are worth a try where the error is not more than so many times too
# large for them.
_MORE, _HOPE = (8, 16), 2.0
# A period may be taken for so many times what it is.
_MOST_PARTS, _HARDLY = 7, 0.25
# A cycle further than by these factors from the motion is another one.
_SAME_AMPLITUDE, _SAME_FREQUENCY = 1.25, 1.15


class Guess:
    """A motion near a limit cycle.

    ``series`` gives its Fourier coefficients (4, 2N) for N odd harmonics, ``start`` a state (8,)
    on it and the period [s]; ``swivel`` is its amplitude [rad], ``frequency`` in rad/s.
    """

    def __init__(self, series: Callable[[int], Real], frequency: float, swivel: float,
                 start: Callable[[], tuple[Real, float]]) -> None:
        self.series, self.frequency, self.swivel, self.start = series, frequency, swivel, start

    def near(self, orbit: Orbit) -> bool:
        """Whether ``orbit`` can be the cycle that this is near to, and no angle of it passes half
        a turn, beyond which nothing holds a motion."""
        return (float(orbit.amplitude[:TYRE_LATERAL].max()) <= HALF_TURN
                and abs(math.log(orbit.swivel / self.swivel)) < math.log(_SAME_AMPLITUDE)
                and abs(math.log(2.0 * math.pi * orbit.frequency_hz / self.frequency))
                < math.log(_SAME_FREQUENCY))


def guess_from_motion(positions: Real, state: Real, period: float) -> Guess:
    """The motion through ``state`` (8,) with ``positions`` (m, 4) over one ``period`` [s].

    Where the swivel has hardly anything of that period, but of a part of it, it is the part.
    """
    spectrum = np.fft.rfft(positions, axis=0).T * (2.0 / len(positions))
    swivel = np.abs(spectrum[SWIVEL, 1:_MOST_PARTS + 1])
    parts = int(np.argmax(swivel)) + 1
    if swivel[0] > _HARDLY * swivel[parts - 1]:
        parts = 1

    def series(harmonics: int) -> Real:
        odd = spectrum[:, parts * np.arange(1, 2 * harmonics, 2)]
        return np.concatenate([odd.real, -odd.imag], axis=1)

    return Guess(series, 2.0 * np.pi * parts / period, float(np.abs(positions[:, SWIVEL]).max()),
                 lambda: (state, period / parts))


def guess_from_orbit(orbit: Orbit) -> Guess:
    """A limit cycle, of this system or of one that differs little."""
    def series(harmonics: int) -> Real:
        if isinstance(orbit.source, LimitCycle):
            return with_harmonics(orbit.source.coefficients, harmonics)
        return fourier(orbit, harmonics)

    return Guess(series, 2.0 * np.pi * orbit.frequency_hz, orbit.swivel, orbit.initial_state)


def refined(system: System, guess: Guess, settings: Settings, budget: Budget) -> Orbit | None:
    """The limit cycle near ``guess`` as accurately as the settings ask for, or None.

    One that is not stable is shooting's. None where there is none or, for lack of shooting, its
    stability cannot be told. Raises BudgetError.
    """
    series, missed = _by_balance(system, guess, settings, budget)
    if series is not None or settings.method == BALANCE:
        return series
    shot = shoot(system, *guess.start(), budget)
    if shot is None or not guess.near(shot):
        return None
    if shot.stable and missed:
        # The guess may have been too far off for the balance.
        series = balanced(system, guess_from_orbit(shot), settings, budget)
    return series or shot


def balanced(system: System, guess: Guess, settings: Settings, budget: Budget) -> Orbit | None:
    """As refined, by the balance alone."""
    return _by_balance(system, guess, settings, budget)[0]


def balance_near(system: System, guess: Guess, settings: Settings, budget: Budget
                 ) -> Orbit | None:
    """The stable cycle of the balance near ``guess``, whatever its error; or None."""
    budget.spend(BALANCE_STEPS)
    orbit = _balanced(system, guess.series(settings.harmonics), guess.frequency)
    return orbit if orbit is not None and orbit.stable and guess.near(orbit) else None


def upward_passage(orbit: Orbit) -> Real:
    """The state (8,), (q, dq/dt), at which the swivel passes zero upwards."""
    cycle = orbit.source
    return cycle.state if isinstance(cycle, Cycle) else _passage(
        cycle.coefficients, cycle.frequency)


@compiled
def _passage(coefficients: Real, frequency: float) -> Real:
    """The same of a series with ``coefficients`` (n, 2N) and ``frequency`` [rad/s], shape (2n,)."""
    count, width = coefficients.shape
    x = np.empty((count, width // 2), np.complex128)
    for row in range(count):
        for k in range(width // 2):
            x[row, k] = complex(coefficients[row, k], -coefficients[row, width // 2 + k])
    places = np.empty(width + 2)
    best, steepest = 0.0, 0.0
    for place in places[:loops.zeros(x[SWIVEL], places)]:
        _, slope = loops.series(x[SWIVEL], np.exp(1j * place))
        if abs(slope) > abs(steepest):
            best, steepest = place, slope
    state = np.empty(2 * count)
    # Half a period later everything has the other sign.
    sign = 1.0 if steepest > 0.0 else -1.0
    for row in range(count):
        value, slope = loops.series(x[row], np.exp(1j * best))
        state[row], state[count + row] = sign * value, sign * frequency * slope
    return state


def _by_balance(system: System, guess: Guess, settings: Settings, budget: Budget
                ) -> tuple[Orbit | None, bool]:
    """The balance's stable cycle with as few harmonics as will do, or None; and whether it has
    none at all near ``guess``."""
    numbers = [settings.harmonics] if settings.method != SHOOTING else []
    if settings.method == AUTO:
        numbers += [number for number in _MORE if number > settings.harmonics]
    promising = 0.0
    for harmonics in numbers:
        if harmonics < promising:
            continue
        budget.spend(BALANCE_STEPS)
        orbit = _balanced(system, guess.series(harmonics), guess.frequency)
        if orbit is None or not guess.near(orbit):
            return None, True
        if orbit.stable is True and accepted(orbit, settings):
            return orbit, False
        # The error falls at least about as 1/N.
        promising = harmonics * orbit.error / (_HOPE * settings.accuracy)
    return None, False


def _balanced(system: System, coefficients: Real, frequency: float) -> Orbit | None:
    cycle = converge(system, coefficients, frequency)
    return None if cycle is None else balance_orbit(system, cycle)
