"""Measured cycles beside the prediction that was in force when each of them ended."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np

from ..contract.spec import load_contract
from ..ihb.solution import Outcome
from ..simulation.measurement import measure_cycles
from .kinds import MARKED, of_outcome, stretches
from .recording import Array, Recording

# A motion smaller than this is no shimmy that a rig would measure.
SMALLEST_SWIVEL_RAD = 1e-3


@dataclass(frozen=True)
class Comparison:
    """The swivel's cycles of a run; every array has shape (n,).

    ``time`` [s] is the middle of a cycle, ``velocity`` [m/s] the taxi velocity then; ``amplitude``
    [rad] and ``frequency`` [Hz] are measured, ``predicted_amplitude``, ``predicted_frequency`` and
    ``kind`` (see `kinds`) the last answer before that time (NaN without one).
    """

    time: Array
    velocity: Array
    amplitude: Array
    frequency: Array
    predicted_amplitude: Array
    predicted_frequency: Array
    kind: Array


def compare(recording: Recording) -> Comparison:
    """Measure the swivel's cycles and look up what was predicted for them.

    No cycle reaches over a place where the time of the motion jumps back or stands.
    """
    time, position, rate = recording.response
    swivel = load_contract().joints.index("swivel")
    jumps = np.flatnonzero(np.diff(time) <= 0.0) + 1
    pieces = [
        measure_cycles(*piece, smallest=SMALLEST_SWIVEL_RAD) for piece in zip(
            *(np.split(values, jumps) for values in (time, position[:, swivel], rate[:, swivel])),
            strict=True)]
    middle, measured, frequency = (np.concatenate(values) for values in zip(
        *((0.5 * (cycles.start + cycles.end), cycles.amplitude, cycles.frequency)
          for cycles in pieces), strict=True))
    answered, *predicted = recording.predictions
    return Comparison(
        middle, _held(middle, *recording.velocity), measured, frequency,
        *(_held(middle, answered, values) for values in predicted))


def summary(comparison: Comparison, recording: Recording) -> str:
    """One line: how far apart measurement and prediction are, over what range, and what else the
    answers were."""
    return "; ".join([_agreement(comparison, recording), *_remarks(recording)])


def _agreement(comparison: Comparison, recording: Recording) -> str:
    shimmy = of_outcome(comparison.kind, Outcome.LIMIT_CYCLE)
    answers = sum(recording.outcomes.values())
    if not shimmy.any():
        return (f"{answers} predictions, {comparison.time.size} measured cycles, none of them "
                "where a limit cycle was predicted")
    measured, predicted = comparison.amplitude[shimmy], comparison.predicted_amplitude[shimmy]
    amplitude = np.median(np.abs(measured / predicted - 1.0))
    frequency = np.median(np.abs(
        comparison.frequency[shimmy] / comparison.predicted_frequency[shimmy] - 1.0))
    velocity = comparison.velocity[shimmy]
    return (
        f"shimmy from {velocity.max():.1f} to {velocity.min():.1f} m/s, swivel up to "
        f"{np.degrees(measured.max()):.1f} deg measured and {np.degrees(predicted.max()):.1f} deg "
        f"predicted; over {measured.size} cycles the median difference is "
        f"{100.0 * amplitude:.2f} % in amplitude and {100.0 * frequency:.2f} % in frequency "
        f"({answers} predictions)")


def _remarks(recording: Recording) -> Iterator[str]:
    """For how long, and at which velocities, answers were no ordinary ones."""
    time, _, _, kinds = recording.predictions
    velocity = _held(time, *recording.velocity)
    for name, which in MARKED.items():
        marked = which(kinds)
        if marked.any():
            lasting = sum(end - start for start, end in stretches(marked, time, recording.end))
            yield (f"{name} for {lasting:.1f} s, from {velocity[marked].max():.1f} to "
                   f"{velocity[marked].min():.1f} m/s")


def _held(at: Array, time: Array, value: Array) -> Array:
    """The last ``value`` at or before each time of ``at``; NaN before the first."""
    if not time.size:
        return np.full(at.shape, np.nan)
    index = np.searchsorted(time, at, side="right") - 1
    return np.where(index >= 0, value[np.maximum(index, 0)], np.nan)
