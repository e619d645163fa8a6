"""What is true of a gear: the fates of kicks on a ladder, and what they come to; kept in files."""

from __future__ import annotations

import json
from collections.abc import Iterable, Iterator
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any

import numpy as np

from shimmy_ros.gear.parameters import Damper, Gear

from .integrator import Cycle, Fate, IntegrationError, Integrator
from .random_gears import random_gear

COARSE = (0.5, 2.0, 8.0, 30.0)
FINE = tuple(sorted({*COARSE, *(float(f"{kick:.3g}") for kick in np.geomspace(0.01, 30.0, 20))}))
"""Kicks of the swivel at rest [rad/s]."""

LIMIT_CYCLE, NO_LIMIT_CYCLE = "limit_cycle", "no_limit_cycle"
UNBOUNDED, NOT_PERIODIC, UNDECIDED = "unbounded", "not_periodic", "undecided"
OUTCOMES = (LIMIT_CYCLE, NO_LIMIT_CYCLE, UNBOUNDED, NOT_PERIODIC)
_COMES_TO = {Fate.CYCLE: LIMIT_CYCLE, Fate.GROWS: UNBOUNDED, Fate.BOUNDED: NOT_PERIODIC,
             Fate.UNDECIDED: UNDECIDED}
# Two motions that settle within this, relatively, have settled on the same cycle.
_SAME = 1e-4


@dataclass(frozen=True)
class Kicked:
    """The fate of one kick [rad/s], and the number of its cycle among the truth's, if any."""

    kick: float
    fate: Fate
    cycle: int | None


@dataclass(frozen=True)
class Truth:
    """What integration in time says of a gear.

    The smallest kick that does not die decides; ``outcome`` is UNDECIDED if a motion that matters
    was too slow for the time allowed. ``kind``, ``seed`` and ``index`` name a random gear.
    """

    kind: str
    seed: int
    index: int
    gear: Gear
    damper: Damper
    velocity: float
    kicked: tuple[Kicked, ...]
    cycles: tuple[Cycle, ...]

    @property
    def decisive(self) -> Kicked | None:
        """The smallest kick that does not die, or None if all die."""
        return next((item for item in self.kicked if item.fate is not Fate.DIES), None)

    @property
    def outcome(self) -> str:
        """One of OUTCOMES, or UNDECIDED."""
        decisive = self.decisive
        return NO_LIMIT_CYCLE if decisive is None else _COMES_TO[decisive.fate]

    @property
    def cycle(self) -> Cycle | None:
        """The cycle that the decisive kick leads to."""
        decisive = self.decisive
        return (None if decisive is None or decisive.cycle is None
                else self.cycles[decisive.cycle])

    @property
    def name(self) -> str:
        """Kind, seed and index, as the command takes them."""
        return f"{self.kind} seed {self.seed} index {self.index}"

    def on(self, ladder: Iterable[float]) -> Truth:
        """The truth that only the kicks of ``ladder`` show."""
        wanted = set(ladder)
        return Truth(self.kind, self.seed, self.index, self.gear, self.damper, self.velocity,
                     tuple(item for item in self.kicked if item.kick in wanted), self.cycles)


def truth_of(kind: str, seed: int, index: int, ladder: Iterable[float] = COARSE) -> Truth:
    """Integrate the motions of a random gear after every kick of ``ladder`` [rad/s]."""
    gear, damper, velocity = random_gear(kind, seed, index)
    integrator = Integrator(gear, damper, velocity)
    kicked: list[Kicked] = []
    cycles: list[Cycle] = []
    for kick in sorted(ladder):
        try:
            motion = integrator.fate(kick)
        except IntegrationError:
            # It says nothing of the gear, as a motion too slow to decide.
            kicked.append(Kicked(kick, Fate.UNDECIDED, None))
            continue
        number = None
        if motion.cycle is not None:
            found = motion.cycle
            number = next((n for n, cycle in enumerate(cycles)
                           if difference(cycle, found) < _SAME), len(cycles))
            if number == len(cycles):
                cycles.append(found)
        kicked.append(Kicked(kick, motion.fate, number))
    return Truth(kind, seed, index, gear, damper, velocity, tuple(kicked), tuple(cycles))


def difference(cycle: Cycle, other: Cycle) -> float:
    """The largest relative difference of amplitudes and frequency."""
    first = np.append(cycle.amplitude, cycle.frequency_hz)
    second = np.append(other.amplitude, other.frequency_hz)
    return float(np.max(np.abs(first / second - 1.0)))


def to_json(truth: Truth) -> str:
    """One line."""
    values: dict[str, Any] = asdict(truth)
    values["truth"] = truth.outcome
    values["kicked"] = [{"kick": item.kick, "fate": item.fate.value, "cycle": item.cycle}
                        for item in truth.kicked]
    return json.dumps(values)


def from_json(values: dict[str, Any]) -> Truth:
    """The inverse of to_json, of the parsed line."""
    return Truth(
        values["kind"], values["seed"], values["index"], Gear(**values["gear"]),
        Damper(**values["damper"]), values["velocity"],
        tuple(Kicked(item["kick"], Fate(item["fate"]), item["cycle"])
              for item in values["kicked"]),
        tuple(Cycle(tuple(item["amplitude"]), item["frequency_hz"], item["sticks"], item["odd"])
              for item in values["cycles"]))


def read_truths(path: Path) -> list[Truth]:
    """The truths of a file of JSON lines, or of one JSON array."""
    text = path.read_text(encoding="utf-8")
    if text.lstrip().startswith("["):
        return [from_json(values) for values in json.loads(text)]
    return [from_json(json.loads(line)) for line in _whole_lines(text)]


def found_truths(kind: str, seed: int, gears: int, ladder: tuple[float, ...], path: Path | None
                 ) -> Iterator[Truth]:
    """The truths of the first ``gears`` of a kind and seed, read from ``path`` or found and added.

    A file that was cut in the middle of a line goes on after its last whole one.
    """
    known: dict[int, Truth] = {}
    if path is not None and path.exists():
        text = path.read_text(encoding="utf-8")
        if not text.endswith("\n"):
            path.write_text("".join(line + "\n" for line in _whole_lines(text)), encoding="utf-8")
        known = {truth.index: truth for truth in read_truths(path)
                 if (truth.kind, truth.seed) == (kind, seed)
                 and {item.kick for item in truth.kicked} >= set(ladder)}
    for index in range(gears):
        if index in known:
            yield known[index].on(ladder)
            continue
        truth = truth_of(kind, seed, index, ladder)
        if path is not None:
            with path.open("a", encoding="utf-8") as stream:
                stream.write(to_json(truth) + "\n")
        yield truth


def _whole_lines(text: str) -> list[str]:
    return text[:text.rfind("\n") + 1].splitlines()
