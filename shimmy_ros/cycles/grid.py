"""Predictions at many operating points of one gear, neighbours warm-starting one another."""

from __future__ import annotations

import itertools
import os
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from ..gear.matrices import NAMES
from ..gear.parameters import Damper, Gear
from ..gear.system import OperatingPoint
from .prediction import Predictor
from .settings import Settings

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

    def point(self, index: int) -> OperatingPoint:
        """One of them. Raises ParameterError for values out of range."""
        return OperatingPoint(
            self.gear,
            Damper(float(self.linear_damping[index]), float(self.quadratic_damping[index]),
                   float(self.coulomb_torque[index])),
            float(self.velocity[index]))


@dataclass(frozen=True)
class GridPredictions:
    """The answers: ``outcome`` (P,) by its value, ``amplitude`` (P, 4), ``frequency`` (P,) Hz,
    ``work`` and ``residual`` (P,) as in a Verdict, and whether the cycle is ``within_limits`` (P,).

    Without a limit cycle frequency and residual are NaN, and the amplitude is as Verdict.amplitude
    has it.
    """

    outcome: NDArray[np.str_]
    amplitude: Real
    frequency: Real
    work: NDArray[np.int64]
    residual: Real
    within_limits: NDArray[np.bool_]


def predict_grid(points: GridPoints, settings: Settings | None = None,
                 threads: int | None = None) -> GridPredictions:
    """Predict every point, on ``threads`` threads (by default one a core).

    Each answer is that of stable_cycle() to within rounding. Raises ParameterError.
    """
    settings = settings or Settings()
    count = threads or os.cpu_count() or 1
    bounds = np.linspace(0, len(points), min(count, max(1, len(points))) + 1).astype(int)
    result = GridPredictions(
        np.empty(len(points), dtype="U16"), np.full((len(points), len(NAMES)), np.nan),
        np.full(len(points), np.nan), np.zeros(len(points), dtype=np.int64),
        np.full(len(points), np.nan), np.ones(len(points), dtype=np.bool_))
    parts = list(itertools.pairwise(bounds.tolist()))
    if len(parts) == 1:
        _predict(points, settings, result, *parts[0])
        return result
    with ThreadPoolExecutor(len(parts)) as pool:
        for done in [pool.submit(_predict, points, settings, result, *part) for part in parts]:
            done.result()
    return result


def _predict(points: GridPoints, settings: Settings, result: GridPredictions, start: int,
             stop: int) -> None:
    """Fill in the answers from ``start`` to ``stop``."""
    predictor = Predictor(settings)
    for index in range(start, stop):
        verdict = predictor.predict(points.point(index))
        result.outcome[index] = verdict.outcome.value
        result.amplitude[index] = verdict.amplitude
        result.frequency[index] = verdict.frequency_hz
        result.work[index] = verdict.work
        result.residual[index] = verdict.residual
        result.within_limits[index] = not verdict.excesses
