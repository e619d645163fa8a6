"""The points of a query, worked out one after the other in slices."""

from __future__ import annotations

from collections.abc import Callable, Generator, Iterator

import numpy as np

from ..cycles.limit_cycles import FoundCycle, all_cycles
from ..cycles.prediction import Predictor
from ..cycles.trigger import trigger
from ..gear.system import OperatingPoint
from .answer import failure, of_found, of_trigger, of_verdict
from .find import find
from .margin import margin
from .query import ALL_CYCLES, LIMIT_CYCLE, MARGIN, TRIGGER, Query
from .reply import Json

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
    settings = query.settings
    predictor = Predictor(settings)
    wanted = query.find
    if wanted is not None:
        return {"find": _rolling(predictor, lambda point: find(wanted, point, settings))}
    cycles = _Cycles(predictor)
    known: dict[str, Callable[[OperatingPoint], Work]] = {
        LIMIT_CYCLE: lambda point: _predicted(predictor, point),
        ALL_CYCLES: _rolling(predictor, cycles.work),
        TRIGGER: _rolling(predictor, cycles.trigger),
        MARGIN: _rolling(predictor, lambda point: margin(
            point, settings, predictor.predict(point))),
    }
    return {name: known[name] for name in query.returns}


def _rolling(predictor: Predictor, work: Callable[[OperatingPoint], Work]
             ) -> Callable[[OperatingPoint], Work]:
    """``work``, but the predictor's own answer for points at which the tyre does not roll."""

    def guarded(point: OperatingPoint) -> Work:
        if point.velocity < predictor.settings.minimum_velocity:
            verdict = predictor.predict(point)
            return {"outcome": verdict.outcome.value, "message": verdict.message}
        return (yield from work(point))

    return guarded


def _predicted(predictor: Predictor, point: OperatingPoint) -> Work:
    yield
    return of_verdict(predictor.predict(point))


class _Cycles:
    """All cycles, found once for each point."""

    def __init__(self, predictor: Predictor) -> None:
        self._predictor = predictor
        self._last: tuple[OperatingPoint, list[FoundCycle]] | None = None

    def work(self, point: OperatingPoint) -> Work:
        cycles = self._all(point)
        yield
        verdict = self._predictor.predict(point)
        return {
            "outcome": verdict.outcome.value,
            "cycles": [of_found(point, cycle, self._predictor.settings) for cycle in cycles],
            "message": verdict.message,
        }

    def trigger(self, point: OperatingPoint) -> Work:
        cycles = self._all(point)
        yield
        return of_trigger(point, trigger(point, cycles, self._predictor.predict(point)),
                          self._predictor.settings)

    def _all(self, point: OperatingPoint) -> list[FoundCycle]:
        if self._last is None or self._last[0] != point:
            self._last = point, all_cycles(point, self._predictor.predict(point).stable_cycles)
        return self._last[1]
