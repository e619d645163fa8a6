"""What else a verdict promises: no history, bounded work, one answer whoever asks, and its cost.

``python -m benchmarks.verdicts.checks walk|history|extremes|agreement`` prints what it found and
ends with status 1 where a promise is broken. Times are of this machine; the walk's median is set
against a bare warm-started solve measured in turn with it.
"""

from __future__ import annotations

import argparse
import sys
import time
from collections.abc import Iterator
from dataclasses import replace

import numpy as np

from shimmy_ros.cycles.amplitude_map import AmplitudeMap
from shimmy_ros.cycles.diagram import Diagram
from shimmy_ros.cycles.grid import GridPoints, predict_grid
from shimmy_ros.cycles.prediction import Predictor
from shimmy_ros.cycles.settings import Settings
from shimmy_ros.cycles.stable_cycle import stable_cycle
from shimmy_ros.cycles.sweep import sweep_points
from shimmy_ros.cycles.verdict import Verdict
from shimmy_ros.gear.axes import VELOCITY, Axis
from shimmy_ros.gear.parameter_file import reference_parameters
from shimmy_ros.gear.parameters import Damper, Gear, ParameterError, Range, changed, ranges
from shimmy_ros.gear.system import OperatingPoint, gear_system
from shimmy_ros.ihb.solve import solve_warm
from shimmy_ros.what_if.desk import Desk
from shimmy_ros.what_if.query import Present
from shimmy_ros.what_if.reply import to_text

from .random_gears import random_gear

_SAME = 1e-6
_KINDS = "abc"


def walk(count: int, seed: int, velocity_step: float, torque_step: float) -> bool:
    """A random walk of the reference gear over V 8 to 100 m/s and T_CF 0 to 300 N m."""
    points = list(_walk(count, seed, velocity_step, torque_step))
    predictor = Predictor()
    start = predictor.predict(OperatingPoint(*reference_parameters(), 40.0)).orbit
    assert start is not None
    bare_start = start.series
    verdicts, bare = np.empty(count), np.empty(count)
    for point in points[:50]:
        predictor.predict(point)
    again = np.empty(count)
    for number, point in enumerate(points):
        begin = time.process_time()
        predictor.predict(point)
        verdicts[number] = time.process_time() - begin
        begin = time.process_time()
        predictor.predict(point)
        again[number] = time.process_time() - begin
        near = replace(points[0], velocity=40.0 + 0.5 * (number % 2))
        begin = time.process_time()
        bare_start = solve_warm(gear_system.__wrapped__(near), bare_start).limit_cycle or bare_start
        bare[number] = time.process_time() - begin
    percentiles = 1e3 * np.percentile(verdicts, [50, 90, 99, 99.9, 100])
    print("verdict: median {:.3f} ms, 90 % {:.2f}, 99 % {:.2f}, 99.9 % {:.2f}, largest {:.1f}"
          .format(*percentiles))
    print(f"the same point again: largest {1e3 * again.max():.3f} ms; a bare warm solve: median "
          f"{1e3 * np.median(bare):.3f} ms; verdict against it "
          f"{percentiles[0] / np.median(bare) / 1e3:.1f}")
    return True


def history(count: int, seed: int, velocities: int) -> bool:
    """Forward, backward and cold over velocities, on gears with several stable cycles."""
    differing = checked = 0
    for kind, number, point in _several(seed):
        if checked == count:
            break
        checked += 1
        low, high = max(1.0, 0.6 * point.velocity), min(200.0, 1.4 * point.velocity)
        points = [replace(point, velocity=float(v)) for v in np.linspace(low, high, velocities)]
        forward, backward = Predictor(), Predictor()
        answers = zip([forward.predict(p) for p in points],
                      reversed([backward.predict(p) for p in reversed(points)]),
                      [stable_cycle(p) for p in points], strict=True)
        bad = sum(not (_same(one, cold) and _same(other, cold)) for one, other, cold in answers)
        differing += bad
        print(f"{kind} {number}: {bad} of {velocities} differ", flush=True)
    print(f"{differing} differ on {checked} gears")
    return differing == 0


def extremes(count: int, seed: int) -> bool:
    """Parameters anywhere in their ranges, their ends and denormal numbers included."""
    random = np.random.default_rng(seed)
    gear, damper = reference_parameters()
    outcomes: dict[str, int] = {}
    slowest = 0.0
    done = 0
    while done < count:
        try:
            point = OperatingPoint(
                Gear(**{name: _anywhere(random, range_, getattr(gear, name))
                        for name, range_ in ranges(Gear).items()}),
                Damper(**{name: _anywhere(random, range_, getattr(damper, name))
                          for name, range_ in ranges(Damper).items()}),
                float(random.choice([1.0, 40.0, 200.0, random.uniform(1.0, 200.0)])))
        except ParameterError:
            continue
        done += 1
        begin = time.process_time()
        outcome = stable_cycle(point).outcome.value
        slowest = max(slowest, time.process_time() - begin)
        outcomes[outcome] = outcomes.get(outcome, 0) + 1
    print(f"{outcomes}; the slowest took {slowest:.2f} s")
    return True


def agreement(count: int, seed: int) -> bool:
    """predict, ask, sweep, map and grid at random points, within the stated errors."""
    wrong = 0
    for number in range(count):
        point = OperatingPoint(*random_gear(_KINDS[number % 3], seed, number))
        torque = point.damper.coulomb_torque
        values = (point.velocity, 1.02 * point.velocity)
        torques = (torque, 1.02 * torque)
        diagram = Diagram(point, Axis(VELOCITY), values, Settings())
        for _ in diagram.judge():
            pass
        plane = AmplitudeMap(point, Axis(VELOCITY), Axis("damper.coulomb_torque"), values, torques,
                             Settings())
        for _ in plane.fill():
            pass
        cold = stable_cycle(point)
        node = plane.rows[0][0]
        asked = _asked(point)
        grid = predict_grid(GridPoints(point.gear, *(np.array([value]) for value in (
            point.velocity, point.damper.linear_damping, point.damper.quadratic_damping, torque))))
        rows = [row for row in sweep_points(diagram, True) if row.value == point.velocity]
        found = [(cold.outcome.value, cold.frequency_hz), (node.outcome.value, node.frequency_hz),
                 (asked["outcome"], asked["frequency"]),
                 (str(grid.outcome[0]), float(grid.frequency[0])),
                 (rows[0].outcome.value, rows[0].orbit and rows[0].orbit.frequency_hz)]
        allowed = 2.0 * (cold.error if cold.orbit is not None else 0.0) + _SAME
        alike = len({outcome for outcome, _ in found}) == 1 and (cold.orbit is None or all(
            abs(frequency / cold.frequency_hz - 1.0) <= allowed for _, frequency in found))
        if not alike:
            wrong += 1
            print(f"point {number}: {found}")
    print(f"{wrong} of {count} points differ")
    return wrong == 0


def _asked(point: OperatingPoint) -> dict[str, object]:
    desk = Desk()
    settings = Settings()
    desk.take(0, to_text({}), Present(point.gear, point.damper, point.velocity, settings), 10)
    while desk.busy:
        desk.step()
    (reply,) = desk.replies()
    answer: dict[str, object] = reply.answer["points"][0]["limit_cycle"]
    return answer


def _same(one: Verdict, other: Verdict) -> bool:
    if (one.outcome, len(one.further)) != (other.outcome, len(other.further)):
        return False
    if one.orbit is None or other.orbit is None:
        return True
    return bool(np.abs(one.amplitude / other.amplitude - 1.0).max() <= _SAME
                and abs(one.frequency_hz / other.frequency_hz - 1.0) <= _SAME)


def _several(seed: int) -> Iterator[tuple[str, int, OperatingPoint]]:
    """Random gears at a point where kicks lead to more than one stable cycle."""
    number = 0
    while True:
        for kind in _KINDS:
            point = OperatingPoint(*random_gear(kind, seed, number))
            verdict = stable_cycle(point)
            if verdict.further:
                yield kind, number, point
        number += 1


def _walk(count: int, seed: int, velocity_step: float, torque_step: float
          ) -> Iterator[OperatingPoint]:
    random = np.random.default_rng(seed)
    gear, damper = reference_parameters()
    velocity, torque = 40.0, 60.0
    for _ in range(count):
        velocity += random.normal(0.0, velocity_step)
        torque += random.normal(0.0, torque_step)
        velocity = 100.0 - abs(100.0 - (8.0 + abs(velocity - 8.0)))
        torque = 300.0 - abs(300.0 - abs(torque))
        yield OperatingPoint(gear, changed(damper, coulomb_torque=torque), velocity)


def _anywhere(random: np.random.Generator, allowed: Range, usual: float) -> float:
    """A value of a range: its ends, the usual one, a denormal one, or anything in between."""
    kind = random.random()
    if kind < 0.25:
        return allowed.low if kind < 0.12 else allowed.high
    if kind < 0.3 and allowed.low <= 5e-324:
        return 5e-324
    if kind < 0.6:
        return usual
    largest = 10.0 ** random.uniform(-6.0, np.log10(allowed.high))
    return float(-largest if allowed.low < 0.0 and kind < 0.8 else largest)


def main() -> int:
    """Run one of them."""
    parser = argparse.ArgumentParser(prog="python -m benchmarks.verdicts.checks",
                                     description=__doc__)
    parser.add_argument("check", choices=("walk", "history", "extremes", "agreement"))
    parser.add_argument("--count", type=int, default=0, help="points or gears")
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("--steps", type=float, nargs=2, default=(0.5, 2.0), metavar=("V", "T"),
                        help="of the walk, m/s and N m (default: %(default)s)")
    parser.add_argument("--velocities", type=int, default=121, help="of the history check")
    options = parser.parse_args()
    if options.check == "walk":
        held = walk(options.count or 5000, options.seed, *options.steps)
    elif options.check == "history":
        held = history(options.count or 20, options.seed, options.velocities)
    elif options.check == "extremes":
        held = extremes(options.count or 5000, options.seed)
    else:
        held = agreement(options.count or 300, options.seed)
    return 0 if held else 1


if __name__ == "__main__":
    sys.exit(main())
