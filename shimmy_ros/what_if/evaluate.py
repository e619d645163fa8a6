"""The points of a query, worked out one after the other in slices."""

from __future__ import annotations

from collections.abc import Callable, Generator, Iterator

import numpy as np
from numpy.typing import NDArray

from ..cycles.accuracy import solve_to_accuracy
from ..cycles.branches import DEFAULT_ACCURACY, Settings
from ..cycles.limit_cycles import FoundCycle, all_cycles
from ..cycles.orbits import BALANCE, SHOOTING, Orbit, shoot
from ..cycles.prediction import DEFAULT_HARMONICS, NOT_ROLLING, Predictor
from ..cycles.trigger import trigger
from ..gear.system import OperatingPoint, gear_system
from ..ihb.accuracy import estimate_error
from ..ihb.solution import LimitCycle, Outcome
from .answer import (
    by_joint,
    failure,
    of_found,
    of_orbit,
    of_prediction,
    of_trigger,
)
from .find import find
from .margin import margin
from .query import ALL_CYCLES, LIMIT_CYCLE, MARGIN, TRIGGER, Query
from .reply import Json

_SAMPLES = 2048

Real = NDArray[np.float64]

Work = Generator[None, None, Json]
"""Work that pauses between slices and returns a result."""


class TooLongError(BaseException):
    """Raised from a signal handler into work that takes too long; no solver takes it for its own.

    The block of the point that was being worked on is given up, and the next one begun.
    """


def evaluate(query: Query) -> Iterator[Json | None]:
    """The answer to each point as soon as it is known, and None where the work may pause."""
    blocks = _blocks(query)
    for number, at, point in query.points():
        answer: Json = {"index": number, "at": at}
        for name, work in blocks.items():
            try:
                answer[name] = yield from work(point)
            except (ArithmeticError, np.linalg.LinAlgError, TooLongError) as error:
                answer[name] = failure(error)
        yield answer


def _blocks(query: Query) -> dict[str, Callable[[OperatingPoint], Work]]:
    settings = Settings(query.harmonics or DEFAULT_HARMONICS,
                        DEFAULT_ACCURACY if query.accuracy is None else query.accuracy)
    predictor = Predictor(settings.harmonics, query.minimum_velocity)
    wanted = query.find
    if wanted is not None:
        return {"find": _rolling(predictor, lambda point: find(wanted, point, settings))}
    cycles = _Cycles()
    known: dict[str, Callable[[OperatingPoint], Work]] = {
        LIMIT_CYCLE: lambda point: _predicted(predictor, point),
        ALL_CYCLES: _rolling(predictor, cycles.work),
        TRIGGER: _rolling(predictor, cycles.trigger),
        MARGIN: _rolling(predictor, lambda point: margin(
            point, settings, query.minimum_velocity)),
    }
    accuracy = query.accuracy
    if accuracy is not None:
        known[LIMIT_CYCLE] = _rolling(predictor, lambda point: _accurate(point, accuracy))
    return {name: known[name] for name in query.returns}


def _rolling(predictor: Predictor, work: Callable[[OperatingPoint], Work]
             ) -> Callable[[OperatingPoint], Work]:
    """``work``, but the predictor's own answer for points at which the tyre does not roll."""

    def guarded(point: OperatingPoint) -> Work:
        if point.velocity < predictor.minimum_velocity:
            return {"outcome": NOT_ROLLING, "message": predictor.predict(point).message}
        return (yield from work(point))

    return guarded


def _predicted(predictor: Predictor, point: OperatingPoint) -> Work:
    prediction = predictor.predict(point)
    yield
    cycle = prediction.limit_cycle
    if cycle is None:
        return of_prediction(prediction, None)
    if cycle.harmonics == prediction.harmonics:
        return of_prediction(prediction, estimate_error(gear_system(point), cycle).largest)
    return {**of_prediction(prediction, _error_of_series(point, cycle)), "method": SHOOTING}


def _error_of_series(point: OperatingPoint, cycle: LimitCycle) -> float:
    """The relative error of an orbit's Fourier series, against the orbit itself."""
    rough = Orbit(BALANCE, cycle.amplitude(), cycle.frequency_hz, None, np.nan, False, np.inf,
                  cycle.harmonics, cycle)
    orbit = shoot(gear_system(point), *rough.initial_state())
    if orbit is None:
        return np.inf
    return float(np.abs(rough.amplitude / orbit.amplitude - 1.0).max()) + orbit.error


def _accurate(point: OperatingPoint, accuracy: float) -> Work:
    yield
    answer = solve_to_accuracy(point, accuracy)
    if answer.orbit is None:
        return {"outcome": answer.outcome.value, "message": answer.message}
    return {
        "outcome": answer.outcome.value,
        "peak_velocity": by_joint(_peak_velocity(answer.orbit)),
        **of_orbit(answer.orbit),
        "message": answer.message,
    }


def _peak_velocity(orbit: Orbit) -> Real:
    if isinstance(orbit.source, LimitCycle):
        return orbit.source.peak_velocity()
    states = orbit.source.sample(np.linspace(0.0, 0.5 * orbit.source.period, _SAMPLES))
    return np.asarray(np.abs(states[len(states) // 2:]).max(axis=1))


class _Cycles:
    """All cycles, found once for each point."""

    def __init__(self) -> None:
        self._last: tuple[OperatingPoint, list[FoundCycle]] | None = None

    def work(self, point: OperatingPoint) -> Work:
        cycles = self._all(point)
        yield
        return {
            "outcome": (Outcome.LIMIT_CYCLE if cycles else Outcome.NO_LIMIT_CYCLE).value,
            "cycles": [of_found(cycle) for cycle in cycles],
        }

    def trigger(self, point: OperatingPoint) -> Work:
        cycles = self._all(point)
        yield
        return of_trigger(trigger(point, cycles))

    def _all(self, point: OperatingPoint) -> list[FoundCycle]:
        if self._last is None or self._last[0] != point:
            self._last = point, all_cycles(point)
        return self._last[1]
