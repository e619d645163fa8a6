"""Random gears, truths in files, and the grades of verdicts; the package is not asked."""

from dataclasses import replace
from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pytest

from benchmarks.verdicts.campaign import report, truths_table
from benchmarks.verdicts.grading import Grade, graded
from benchmarks.verdicts.integrator import Cycle, Fate
from benchmarks.verdicts.random_gears import KINDS, random_gear
from benchmarks.verdicts.truths import (
    COARSE,
    LIMIT_CYCLE,
    NO_LIMIT_CYCLE,
    UNBOUNDED,
    UNDECIDED,
    Kicked,
    Truth,
    difference,
    found_truths,
    read_truths,
    to_json,
    truth_of,
)

STORED = Path(__file__).parent.parent / "data" / "verdict_truths.json"
SMALL = Cycle((0.01, 0.1, 0.1, 0.02), 10.0, False, True)
LARGE = Cycle((0.02, 0.2, 0.2, 0.04), 12.0, False, True)


def truth(*fates, cycles=(SMALL, LARGE)):
    numbers = [cycles.index(fate) if isinstance(fate, Cycle) else None for fate in fates]
    return Truth("a", 1, 0, *random_gear("a", 1, 0), tuple(
        Kicked(kick, Fate.CYCLE if isinstance(fate, Cycle) else fate, number)
        for kick, fate, number in zip(COARSE, fates, numbers, strict=True)), tuple(cycles))


def verdict(outcome, cycle=None, error=1e-5, factor=1.0):
    values = np.full(4, np.nan) if cycle is None else factor * np.array(cycle.amplitude)
    return SimpleNamespace(outcome=SimpleNamespace(value=outcome), amplitude=values, error=error,
                           frequency_hz=np.nan if cycle is None else cycle.frequency_hz,
                           message="")


@pytest.mark.parametrize("letter", sorted(KINDS))
def test_a_gear_is_repeatable_and_its_own(letter):
    assert random_gear(letter, 1, 7) == random_gear(letter, 1, 7)
    assert len({random_gear(letter, seed, index) for seed in (1, 2) for index in (7, 8)}) == 4


def test_the_smallest_kick_that_does_not_die_decides():
    assert truth(*[Fate.DIES] * 4).outcome == NO_LIMIT_CYCLE
    assert truth(Fate.DIES, Fate.GROWS, SMALL, Fate.DIES).outcome == UNBOUNDED
    decided = truth(Fate.DIES, LARGE, SMALL, Fate.UNDECIDED)
    assert decided.outcome == LIMIT_CYCLE
    assert decided.cycle == LARGE
    assert truth(Fate.DIES, Fate.UNDECIDED, SMALL, SMALL).outcome == UNDECIDED
    assert decided.on(COARSE[2:]).cycle == SMALL


@pytest.mark.parametrize(("true", "said", "grade", "dangerous"), [
    (truth(SMALL, SMALL, LARGE, LARGE), verdict(LIMIT_CYCLE, SMALL), Grade.RIGHT, False),
    (truth(SMALL, SMALL, LARGE, LARGE), verdict(LIMIT_CYCLE, LARGE), Grade.OTHER_CYCLE, False),
    (truth(LARGE, LARGE, SMALL, SMALL), verdict(LIMIT_CYCLE, SMALL), Grade.OTHER_CYCLE, True),
    (truth(SMALL, SMALL, LARGE, LARGE), verdict(LIMIT_CYCLE, SMALL, factor=1.01),
     Grade.INACCURATE, False),
    (truth(SMALL, SMALL, LARGE, LARGE), verdict(LIMIT_CYCLE, SMALL, 0.02, 1.01),
     Grade.RIGHT, False),
    (truth(SMALL, SMALL, LARGE, LARGE), verdict(LIMIT_CYCLE, SMALL, factor=0.5),
     Grade.WRONG, True),
    (truth(SMALL, SMALL, LARGE, LARGE), verdict(NO_LIMIT_CYCLE), Grade.WRONG, True),
    (truth(SMALL, SMALL, LARGE, LARGE), verdict(UNBOUNDED), Grade.WRONG, False),
    (truth(SMALL, SMALL, LARGE, LARGE), verdict("not_converged"), Grade.NO_ANSWER, False),
    (truth(*[Fate.GROWS] * 4), verdict(LIMIT_CYCLE, SMALL), Grade.WRONG, True),
    (truth(*[Fate.GROWS] * 4), verdict(UNBOUNDED), Grade.RIGHT, False),
    (truth(*[Fate.DIES] * 4), verdict(LIMIT_CYCLE, SMALL), Grade.WRONG, False),
    (truth(*[Fate.UNDECIDED] * 4), verdict(LIMIT_CYCLE, SMALL), Grade.OPEN, False),
])
def test_grades(true, said, grade, dangerous):
    result = graded(true, said, 0.1)
    assert (result.grade, result.dangerous) == (grade, dangerous)
    assert result.bad == (grade in (Grade.WRONG, Grade.INACCURATE))
    assert (result.truth.name in "\n".join(report([result]))) or grade in (Grade.RIGHT, Grade.OPEN)


def test_a_file_cut_in_a_line_goes_on_and_is_not_done_twice(tmp_path):
    path = tmp_path / "truths.jsonl"
    first = list(found_truths("b", 3, 3, (0.5, 8.0), path))
    text = path.read_text()
    path.write_text(text[:-40])
    assert list(found_truths("b", 3, 3, (0.5, 8.0), path)) == first
    assert path.read_text() == text
    assert read_truths(path) == first
    assert "3 gears" in truths_table(first)[0]
    # A finer ladder is asked for: what is there does not have it.
    finer = list(found_truths("b", 3, 2, (0.5, 2.0, 8.0), path))
    assert [len(found.kicked) for found in finer] == [3, 3]


def test_stored_truths_are_what_their_gears_do():
    stored = read_truths(STORED)
    assert len(stored) == 40
    assert {found.outcome for found in stored} >= {LIMIT_CYCLE, NO_LIMIT_CYCLE, UNBOUNDED}
    for before in stored[2::8]:
        now = truth_of(before.kind, before.seed, before.index, COARSE)
        same = before.on(COARSE)
        assert (now.gear, now.damper, now.velocity) == (
            before.gear, before.damper, before.velocity)
        assert [item.fate for item in now.kicked] == [item.fate for item in same.kicked]
        for mine, theirs in zip(now.kicked, same.kicked, strict=True):
            if mine.cycle is not None:
                assert difference(now.cycles[mine.cycle], before.cycles[theirs.cycle]) < 1e-5


def test_a_line_has_the_truth_in_words():
    assert f'"truth": "{LIMIT_CYCLE}"' in to_json(replace(truth(*[SMALL] * 4), index=5))
