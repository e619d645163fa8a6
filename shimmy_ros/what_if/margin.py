"""How far each parameter is from the nearest fold: where shimmy would end, or would begin.

Scaling an orbit by s turns (C_d, T_CF) into (C_d / s, s T_CF), so that folds depend on these two
through their product alone: the fold in T_CF gives the one in C_d by the same factor.
"""

from __future__ import annotations

import math
from collections.abc import Generator
from dataclasses import dataclass, field

from ..cycles.branches import ContinuationError, Line, follow
from ..cycles.orbits import Orbit
from ..cycles.settings import Settings
from ..cycles.stable_cycle import stable_cycle
from ..cycles.verdict import Verdict
from ..gear.parameters import VELOCITY_RANGE, Damper, ranges
from ..gear.system import OperatingPoint, family_between
from ..ihb.solution import Outcome
from .answer import NOT_CONVERGED, number
from .query import VELOCITY, value_of, with_values
from .reply import Json

LINEAR, QUADRATIC, COULOMB = ranges(Damper)
_PARAMETERS = (VELOCITY, LINEAR, QUADRATIC, COULOMB)
# How far to look, in multiples of the present value, but at least up to these values.
_FACTOR = 100.0
_LEAST = {LINEAR: 100.0, QUADRATIC: 1000.0, COULOMB: 1000.0}
# Friction, relative to the present, under which a cycle may exist where none does.
_WEAKER = (0.5, 0.25, 0.1, 0.0)
# Steps of a search for a cycle.
_STEP, _LEAST_STEP = 0.05, 0.5


@dataclass
class _Folds:
    """The fold ``below`` and ``above`` the present value of a parameter, and what went wrong."""

    below: float | None = None
    above: float | None = None
    problems: list[str] = field(default_factory=list)

    def to_json(self, value: float, searched: tuple[float, float]) -> Json:
        distances = [abs(fold - value) for fold in (self.below, self.above) if fold is not None]
        return {"value": value, "below": self.below, "above": self.above,
                "distance": min(distances) if distances else None, "searched": list(searched)}


def margin(point: OperatingPoint, settings: Settings, verdict: Verdict | None = None
           ) -> Generator[None, None, Json]:
    """The nearest folds in taxi velocity and in each parameter of the damper.

    Where there is a limit cycle, these end it; where every motion dies, they begin one; and where
    motion grows without bound or is not periodic, they end another stable cycle, if there is one.
    ``verdict`` is what the point comes to, if that is known. Raises ArithmeticError where it is not
    to be known.
    """
    yield
    if verdict is None:
        verdict = stable_cycle(point, settings)
    if verdict.failed:
        raise ArithmeticError(verdict.reason)
    followed = next(iter(verdict.stable_cycles), None)
    bounds = {name: _bounds(name, point, settings.minimum_velocity) for name in _PARAMETERS}
    folds = {}
    message = ""
    for name in (VELOCITY, LINEAR, COULOMB):
        if followed is not None:
            folds[name] = yield from _ends(point, followed, name, bounds[name], settings)
        elif verdict.outcome is not Outcome.NO_LIMIT_CYCLE:
            folds[name] = _Folds()
            message = f"{verdict.message}; there is no limit cycle that could end in a fold"
        elif name == COULOMB:
            folds[name] = yield from _weaker(point, settings)
        else:
            folds[name] = yield from _births(point, name, bounds[name], settings)
    folds[QUADRATIC] = _scaled(point, folds[COULOMB])
    if followed is not None and verdict.orbit is None:
        message = f"{verdict.message}; the folds are those of another stable cycle"
    problems = [sentence for item in folds.values() for sentence in item.problems]
    return {
        "outcome": NOT_CONVERGED if problems else verdict.outcome.value,
        "folds": {name: folds[name].to_json(value_of(point, name), bounds[name])
                  for name in _PARAMETERS},
        "message": "; ".join(problems) or message,
    }


def _bounds(name: str, point: OperatingPoint, minimum_velocity: float) -> tuple[float, float]:
    if name == VELOCITY:
        return minimum_velocity, VELOCITY_RANGE.high
    high = max(_FACTOR * value_of(point, name), _LEAST[name])
    return 0.0, min(high, ranges(Damper)[name].high)


def _ends(point: OperatingPoint, orbit: Orbit, name: str, bounds: tuple[float, float],
          settings: Settings) -> Generator[None, None, _Folds]:
    """The folds in which the cycle ``orbit`` ends as a parameter changes."""
    folds = _Folds()
    value = value_of(point, name)
    for side, bound in zip(("below", "above"), bounds, strict=True):
        if bound != value:
            try:
                position = yield from first_fold(
                    point, with_values(point, {name: bound}), orbit, settings)
            except ContinuationError as error:
                folds.problems.append(f"{name} {side} {value:g}: {error}")
            else:
                if position is not None:
                    setattr(folds, side, value + position * (bound - value))
    return folds


def first_fold(start: OperatingPoint, end: OperatingPoint, orbit: Orbit, settings: Settings
               ) -> Generator[None, None, float | None]:
    """Where the cycle ``orbit`` of ``start`` folds on the way to ``end``, from 0 to 1, or None.

    Raises ContinuationError.
    """
    for there in follow(Line(family_between(start, end)), orbit, 0.0, 1, settings):
        if there.is_fold:
            return there.position
        yield
    return None


def _weaker(point: OperatingPoint, settings: Settings) -> Generator[None, None, _Folds]:
    """The friction below which there is a limit cycle."""
    torque = point.damper.coulomb_torque
    for factor in _WEAKER if torque > 0.0 else ():
        weak = with_values(point, {COULOMB: factor * torque})
        yield
        verdict = stable_cycle(weak, settings)
        if verdict.failed:
            return _Folds(problems=[f"{COULOMB} below {torque:g}: {verdict.message}"])
        if verdict.orbit is None:
            continue
        try:
            position = yield from first_fold(weak, point, verdict.orbit, settings)
        except ContinuationError as error:
            return _Folds(problems=[f"{COULOMB} below {torque:g}: {error}"])
        if position is not None:
            return _Folds(below=torque * (factor + position * (1.0 - factor)))
    return _Folds()


def _births(point: OperatingPoint, name: str, bounds: tuple[float, float], settings: Settings
            ) -> Generator[None, None, _Folds]:
    """The folds in which a cycle begins as a parameter moves away from ``point``."""
    folds = _Folds()
    value = value_of(point, name)
    for side, bound in zip(("below", "above"), bounds, strict=True):
        place, last = value, None
        problem = ""
        while place != bound:
            place += math.copysign(max(_STEP * place, _LEAST_STEP), bound - value)
            place = min(max(place, bounds[0]), bounds[1])
            there = with_values(point, {name: place})
            last = stable_cycle(there, settings, last)
            yield
            if last.failed:
                # A fold further on may still be found.
                problem = problem or f"{name} {place:g}: {last.message}"
            if last.orbit is None:
                continue
            try:
                position = yield from first_fold(there, point, last.orbit, settings)
            except ContinuationError as error:
                problem = f"{name} {side} {value:g}: {error}"
                break
            if position is not None:
                setattr(folds, side, place + position * (value - place))
                problem = ""
                break
        if problem:
            folds.problems.append(problem)
    return folds


def _scaled(point: OperatingPoint, friction: _Folds) -> _Folds:
    """The folds in quadratic damping, from those in friction."""
    torque, quadratic = point.damper.coulomb_torque, point.damper.quadratic_damping
    if torque == 0.0 or quadratic == 0.0:
        return _Folds()

    def scaled(fold: float | None) -> float | None:
        return None if fold is None else number(quadratic * fold / torque)

    return _Folds(scaled(friction.below), scaled(friction.above))
