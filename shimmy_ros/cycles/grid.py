"""Predictions at many operating points of one gear, neighbours warm-starting one another."""

from __future__ import annotations

import itertools
import os
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from ..gear.matrices import DAMPER, SWIVEL, velocity_parts
from ..gear.parameters import DEFAULT_MINIMUM_VELOCITY, Damper, Gear
from ..gear.system import OperatingPoint
from ..ihb.chain import Stack, solve_chain
from .prediction import DEFAULT_HARMONICS, Prediction, Predictor

Real = NDArray[np.float64]


@dataclass(frozen=True)
class GridPoints:
    """P operating points of one ``gear``; every array has shape (P,), SI.

    Points that follow one another should lie close together: rows of a grid in alternating
    directions.
    """

    gear: Gear
    velocity: Real
    linear_damping: Real
    quadratic_damping: Real
    coulomb_torque: Real

    def __len__(self) -> int:
        return len(self.velocity)

    def part(self, start: int, stop: int) -> GridPoints:
        """The points from ``start`` to ``stop``."""
        return GridPoints(self.gear, *(
            values[start:stop] for values in (self.velocity, self.linear_damping,
                                              self.quadratic_damping, self.coulomb_torque)))

    def point(self, index: int) -> OperatingPoint:
        """One of them. Raises ParameterError for values out of range."""
        return OperatingPoint(
            self.gear,
            Damper(float(self.linear_damping[index]), float(self.quadratic_damping[index]),
                   float(self.coulomb_torque[index])),
            float(self.velocity[index]))


@dataclass(frozen=True)
class GridPredictions:
    """The answers: ``outcome`` (P,) as in Prediction, ``amplitude`` (P, 4), ``frequency`` (P,) Hz,
    ``iterations`` and ``residual`` (P,). Without a limit cycle amplitude and frequency are NaN."""

    outcome: NDArray[np.str_]
    amplitude: Real
    frequency: Real
    iterations: NDArray[np.int64]
    residual: Real


def predict_grid(points: GridPoints, harmonics: int = DEFAULT_HARMONICS,
                 minimum_velocity: float = DEFAULT_MINIMUM_VELOCITY,
                 threads: int | None = None) -> GridPredictions:
    """Predict every point, on ``threads`` threads (by default one a core).

    Each answer is that of a Predictor to within rounding: what cannot be reached from its
    neighbour in one step is handed to one. Raises ParameterError.
    """
    count = threads or os.cpu_count() or 1
    bounds = np.linspace(0, len(points), min(count, max(1, len(points))) + 1).astype(int)
    parts = [points.part(start, stop) for start, stop in itertools.pairwise(bounds)]
    if len(parts) == 1:
        done = [_predict(parts[0], harmonics, minimum_velocity)]
    else:
        with ThreadPoolExecutor(len(parts)) as pool:
            done = list(pool.map(lambda part: _predict(part, harmonics, minimum_velocity), parts))
    return GridPredictions(
        np.concatenate([part.outcome for part in done]),
        np.concatenate([part.amplitude for part in done]),
        np.concatenate([part.frequency for part in done]),
        np.concatenate([part.iterations for part in done]),
        np.concatenate([part.residual for part in done]))


def _predict(points: GridPoints, harmonics: int, minimum_velocity: float) -> GridPredictions:
    count = len(points)
    result = GridPredictions(
        np.empty(count, dtype="U16"), np.full((count, 4), np.nan), np.full(count, np.nan),
        np.zeros(count, dtype=np.int64), np.full(count, np.nan))
    predictor = Predictor(harmonics, minimum_velocity)
    stack = _stack(points)
    usable = ((points.velocity >= minimum_velocity) & (points.coulomb_torque > 0.0)
              & (points.quadratic_damping > 0.0))
    index = 0
    while index < count:
        prediction = predictor.predict(points.point(index))
        _put(result, index, prediction)
        index += 1
        if prediction.limit_cycle is None or index == count or not usable[index - 1]:
            continue
        unusable = np.flatnonzero(~usable[index:])
        stop = index + int(unusable[0]) if unusable.size else count
        chain = solve_chain(stack.part(index, stop), prediction.limit_cycle)
        solved = slice(index, index + len(chain.frequency))
        result.outcome[solved] = prediction.outcome
        result.amplitude[solved] = chain.amplitude
        result.frequency[solved] = chain.frequency / (2.0 * np.pi)
        result.iterations[solved] = chain.iterations
        result.residual[solved] = chain.residual
        if chain.cycle is not None:
            predictor.remember(points.point(solved.stop - 1), chain.cycle)
        index = solved.stop
    return result


def _put(result: GridPredictions, index: int, prediction: Prediction) -> None:
    cycle = prediction.limit_cycle
    result.outcome[index] = prediction.outcome
    result.iterations[index] = prediction.iterations
    result.residual[index] = prediction.residual
    if cycle is not None:
        result.amplitude[index] = cycle.amplitude()
        result.frequency[index] = cycle.frequency_hz


def _stack(points: GridPoints) -> Stack:
    parts = velocity_parts(points.gear)
    velocity = np.maximum(points.velocity, np.finfo(np.float64).tiny)[:, None, None]
    damping = parts.damping(points.linear_damping, velocity)
    return Stack(
        np.broadcast_to(parts.mass, damping.shape).copy(), damping, parts.stiffness(velocity),
        SWIVEL, points.coulomb_torque, DAMPER, points.quadratic_damping)
