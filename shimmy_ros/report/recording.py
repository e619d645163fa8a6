"""A recorded run as arrays: what drove the gear, how it moved, and what was predicted."""

from __future__ import annotations

from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ..bag.reader import read_messages
from ..contract.messages import CODECS
from ..contract.records import LimitCycleOrbit
from ..contract.spec import load_contract
from .kinds import kind_of_status

Array = NDArray[np.float64]

_DAMPER = ("damper/linear_damping", "damper/quadratic_damping", "damper/coulomb_torque")


@dataclass(frozen=True)
class Recording:
    """A run, times in s from its first velocity sample.

    velocity : (times (v,), taxi velocity (v,) [m/s])
    response : (times (m,), positions (m, 4), rates (m, 4)), the order of the contract's joints
    predictions : (times (p,), swivel amplitude (p,) [rad], frequency (p,) [Hz], kind (p,)); the
        kind of answer says what the amplitude means, see `kinds`; the frequency is NaN without a
        limit cycle
    damper_changes : (time [s], name, value) of each
    outcomes : how many answers of each kind there were
    damage : what is wrong with the bag; empty when it is whole
    """

    velocity: tuple[Array, Array]
    response: tuple[Array, Array, Array]
    predictions: tuple[Array, Array, Array, Array]
    damper_changes: tuple[tuple[float, str, float], ...]
    outcomes: dict[str, int]
    damage: tuple[str, ...]

    @property
    def end(self) -> float:
        """The time [s] of the last sample of the velocity; 0 without any."""
        time = self.velocity[0]
        return float(time[-1]) if time.size else 0.0


@dataclass
class _Collected:
    velocity: list[tuple[int, float]] = field(default_factory=list)
    response: list[Any] = field(default_factory=list)
    amplitudes: list[tuple[int, int, float]] = field(default_factory=list)
    frequencies: dict[int, list[float]] = field(default_factory=dict)
    kinds: dict[int, list[float]] = field(default_factory=dict)
    changes: list[tuple[int, str, float]] = field(default_factory=list)
    outcomes: dict[str, int] = field(default_factory=dict)


def read_recording(bag: Path, namespace: str) -> Recording:
    """Read the run of ``namespace`` from ``bag``. Raises BagError, MessageError.

    Answers are placed at the time at which they were recorded: one to a change of the damper
    carries the stamp of a velocity sample before it.
    """
    contract = load_contract()
    names = {topic.resolved(namespace): topic.name for topic in contract.recorded}
    swivel = contract.joints.index("swivel")
    got = _Collected()
    messages = read_messages(bag, tuple(names))
    for message in messages:
        name = names[message.topic]
        record = CODECS[name].decode(message.data)
        if name == "taxi_velocity":
            got.velocity.append((message.log_time_ns, record.velocity))
        elif name == "gear_response":
            got.response.append(record)
        elif name == "limit_cycle/amplitude":
            got.amplitudes.append(
                (record.stamp_ns, message.log_time_ns, record.position[swivel]))
        elif name == "limit_cycle/orbit":
            got.frequencies.setdefault(record.stamp_ns, []).append(_frequency(record))
        elif name == "limit_cycle/status":
            values = record[0].values
            outcome = values.get("outcome", "")
            got.outcomes[outcome] = got.outcomes.get(outcome, 0) + 1
            got.kinds.setdefault(record[0].stamp_ns, []).append(kind_of_status(values))
        elif name in _DAMPER:
            got.changes.append((message.log_time_ns, name, record))
    start = got.velocity[0][0] if got.velocity else 0
    answers = _joined(got.amplitudes, got.frequencies, got.kinds)
    return Recording(
        (_times([t for t, _ in got.velocity], start), np.array([v for _, v in got.velocity])),
        (_times([r.stamp_ns for r in got.response], start),
         np.array([r.position for r in got.response]).reshape(-1, len(contract.joints)),
         np.array([r.velocity for r in got.response]).reshape(-1, len(contract.joints))),
        (_times([answer[0] for answer in answers], start),
         *np.array([answer[1:] for answer in answers]).reshape(-1, 3).T),
        tuple((1e-9 * (t - start), name, value) for t, name, value in got.changes),
        got.outcomes,
        tuple(messages.damage))


def _frequency(orbit: LimitCycleOrbit) -> float:
    return 1e9 / float(orbit.times_ns[-1]) if len(orbit.times_ns) else np.nan


def _joined(amplitudes: list[tuple[int, int, float]], frequencies: dict[int, list[float]],
            kinds: dict[int, list[float]]) -> list[tuple[int, float, float, float]]:
    """Log time, amplitude, frequency and kind of each answer, in order.

    Amplitude, orbit and status belong together by their stamps. Where several answers have the same
    one, the last ones do: what a recorder misses of one topic it misses at the beginning.
    """
    joined = [(time_ns, amplitude, frequencies[stamp_ns].pop(), kinds[stamp_ns].pop())
              for stamp_ns, time_ns, amplitude in reversed(amplitudes)
              if frequencies.get(stamp_ns) and kinds.get(stamp_ns)]
    return joined[::-1]


def _times(stamps_ns: list[int], start_ns: int) -> Array:
    return 1e-9 * (np.array(stamps_ns, dtype=np.int64) - start_ns).astype(np.float64)
