"""Truths of many gears, the package's verdicts about them, and a table of how they do."""

from __future__ import annotations

import statistics
import sys
import time
from collections import Counter
from collections.abc import Iterable, Iterator, Sequence
from typing import TypeVar

from tqdm import tqdm

from shimmy_ros.gear.system import OperatingPoint

from .grading import Grade, Graded, graded
from .truths import NOT_PERIODIC, OUTCOMES, UNDECIDED, Truth

Item = TypeVar("Item")


def with_progress(items: Iterable[Item], total: int) -> Iterator[Item]:
    """``items``, with a bar if somebody is watching."""
    yield from tqdm(items, total=total, unit="gear", disable=not sys.stderr.isatty())


def ask(truth: Truth) -> Graded:
    """The package's verdict about the gear of ``truth``, graded."""
    from shimmy_ros.cycles.stable_cycle import stable_cycle

    point = OperatingPoint(truth.gear, truth.damper, truth.velocity)
    begun = time.perf_counter()
    verdict = stable_cycle(point)
    return graded(truth, verdict, time.perf_counter() - begun)


def truths_table(truths: Sequence[Truth]) -> list[str]:
    """Counts by outcome, and who is undecided or not periodic."""
    counts = Counter(truth.outcome for truth in truths)
    lines = [f"{len(truths)} gears: " + ", ".join(
        f"{counts[outcome]} {outcome}" for outcome in (*OUTCOMES, UNDECIDED))]
    for outcome in (NOT_PERIODIC, UNDECIDED):
        names = [truth.name for truth in truths if truth.outcome == outcome]
        if names:
            lines.append(f"{outcome}: " + "; ".join(names))
    several = sum(len(truth.cycles) > 1 for truth in truths)
    lines.append(f"gears whose kicks lead to more than one cycle: {several}; with a cycle that "
                 f"sticks: {_having(truths, 'sticks')}; with one that is not odd: "
                 f"{sum(not cycle.odd for truth in truths for cycle in truth.cycles)}")
    return lines


def report(results: Sequence[Graded]) -> list[str]:
    """The table of verdicts, and every gear about which one is not right."""
    lines = []
    for grade in (Grade.WRONG, Grade.INACCURATE, Grade.OTHER_CYCLE, Grade.NO_ANSWER):
        for result in results:
            if result.grade is grade:
                lines.append(_line(result))
    head = f"{'truth':16}{'gears':>7}" + "".join(f"{name:>12}" for name in (
        "right", "other cycle", "inaccurate", "wrong", "dangerous", "no answer"))
    lines += ["", head, "-" * len(head)]
    for outcome in (*OUTCOMES, UNDECIDED):
        group = [result for result in results if result.truth.outcome == outcome]
        if group:
            lines.append(_row(outcome, group))
    lines.append(_row("all", results))
    answered = [result for result in results if result.grade is not Grade.OPEN]
    if answered:
        share = sum(result.grade is Grade.NO_ANSWER for result in answered) / len(answered)
        seconds = [result.seconds for result in answered]
        slowest = max(answered, key=lambda result: result.seconds)
        lines += ["", f"not converged: {100.0 * share:.2f} %",
                  f"time of a verdict: median {statistics.median(seconds):.3g} s, mean "
                  f"{statistics.mean(seconds):.3g} s, longest {slowest.seconds:.3g} s "
                  f"({slowest.truth.name})"]
        offs = [result.off for result in answered
                if result.grade in (Grade.RIGHT, Grade.OTHER_CYCLE) and result.off == result.off]
        if offs:
            lines.append(f"numbers of right cycles: off by {statistics.median(offs):.2g} in the "
                         f"median, {max(offs):.2g} at most")
    return lines


def _having(truths: Sequence[Truth], flag: str) -> int:
    return sum(any(getattr(cycle, flag) for cycle in truth.cycles) for truth in truths)


def _line(result: Graded) -> str:
    truth = result.truth
    true = truth.outcome
    if truth.cycle is not None:
        true += (f" (swivel {truth.cycle.amplitude[1]:.4g} rad, "
                 f"{truth.cycle.frequency_hz:.4g} Hz)")
    decisive = "" if truth.decisive is None else f" from {truth.decisive.kick:g} rad/s"
    danger = ", DANGEROUS" if result.dangerous else ""
    off = "" if result.off != result.off else f", off by {result.off:.2g}"
    return (f"{truth.name}: {result.grade.value}{danger}{off}: says {result.said}; is {true}"
            f"{decisive}")


def _row(name: str, group: Sequence[Graded]) -> str:
    counts = Counter(result.grade for result in group)
    dangerous = sum(result.dangerous for result in group)
    values = (counts[Grade.RIGHT], counts[Grade.OTHER_CYCLE], counts[Grade.INACCURATE],
              counts[Grade.WRONG], dangerous, counts[Grade.NO_ANSWER])
    return f"{name:16}{len(group):7}" + "".join(f"{value:12}" for value in values)
