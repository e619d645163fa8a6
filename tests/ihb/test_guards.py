"""A branch neither jumps to rest, nor turns back onto itself, nor loses a piece where the number of
velocity zeros changes."""

from itertools import islice, pairwise, takewhile

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from shimmy_ros.cycles.branches import Line, follow
from shimmy_ros.cycles.orbits import converge, shoot
from shimmy_ros.cycles.settings import SHOOTING, Settings
from shimmy_ros.cycles.stable_cycle import stable_cycle
from shimmy_ros.gear.matrices import SWIVEL
from shimmy_ros.gear.parameter_file import reference_parameters
from shimmy_ros.gear.parameters import changed
from shimmy_ros.gear.system import OperatingPoint, family_between
from shimmy_ros.ihb.arclength import ContinuationError, Evaluation, trace
from shimmy_ros.ihb.continuation import branch
from shimmy_ros.ihb.elements import Coulomb, OddElement, QuadraticDamping
from shimmy_ros.ihb.harmonics import evaluate, peaks, velocity_zeros
from shimmy_ros.ihb.newton import Point, phase_of
from shimmy_ros.ihb.solve import placed, solve_cold
from shimmy_ros.ihb.system import Family, System

GROWTH, DAMPING = 0.2, 0.1
BRAKE = 8.0 * DAMPING / (3.0 * np.pi)
FOLD = np.pi * GROWTH**2 / (16.0 * BRAKE)
NOTHING = [[0.0]]
BY_TORQUE = System(NOTHING, NOTHING, NOTHING, (Coulomb(0, 1.0),))


@settings(max_examples=20)
@given(st.floats(1e-3, 10.0), st.floats(0.2, 5.0), st.floats(0.02, 0.98), st.sampled_from([1, 3]))
def test_whatever_the_step_a_branch_goes_round_its_fold_once_and_down_towards_rest(
        rubbing, first_step, scale, part, harmonics):
    family = Family(lambda torque: rubbing(GROWTH, torque, DAMPING), lambda torque: BY_TORQUE)
    torque = part * FOLD
    cycle = solve_cold(family.system(torque), harmonics).limit_cycle
    points = branch(family, Point(cycle.coefficients, cycle.frequency), torque, scale * FOLD, 1,
                    (0,), phase_of((0,), harmonics, 0), first_step)
    largest = cycle.coefficients[0, 0]
    found = list(takewhile(lambda point: point.point.coefficients[0, 0] > 1e-3 * largest,
                           islice(points, 300)))
    amplitude = np.array([point.point.coefficients[0, 0] for point in found])
    assert len(found) < 300
    # Down to a thousandth in small steps, without a jump, and never the same way twice.
    assert amplitude[-1] < 3e-3 * largest
    assert np.all(np.diff(amplitude) < 0.0)
    assert np.all(amplitude[1:] > 0.5 * amplitude[:-1])
    expected = np.pi / 4.0 * (GROWTH - BRAKE * amplitude) * amplitude
    allowed = (1e-8 if harmonics == 1 else 5e-3) * FOLD
    assert np.max(np.abs([point.parameter for point in found] - expected)) < allowed
    fold = [point.is_fold for point in found]
    assert fold.count(True) == 1
    before, after = found[:fold.index(True)], found[fold.index(True) + 1:]
    assert all(point.slope > 0.0 and point.orientation == -1 for point in before)
    assert all(point.slope < 0.0 and point.orientation == 1 for point in after)


class Passing:
    """x^2 - p^2 = d^2: two curves that come as near as 2 d; for d = 0 they cross."""

    def __init__(self, distance):
        self._square = distance**2

    def evaluate(self, y):
        x, p = y
        residual = x**2 - p**2 - self._square
        return Evaluation(np.array([residual]), np.array([[2.0 * x, -2.0 * p]]),
                          abs(residual) / (x**2 + p**2 + self._square))

    def sizes(self, y):
        return np.ones(2)


class Hairpin:
    """x^2 = d^2 (1 - p): up to p = 1 and back, both ways as near as 2 d."""

    def __init__(self, distance):
        self._square = distance**2

    def evaluate(self, y):
        x, p = y
        residual = x**2 - self._square * (1.0 - p)
        return Evaluation(np.array([residual]), np.array([[2.0 * x, self._square]]),
                          abs(residual) / self._square)

    def sizes(self, y):
        return np.ones(2)


def from_one_end(curve, start, end):
    return np.array([point.y for point in takewhile(
        lambda point: abs(point.y[1]) < end, islice(trace(curve, np.array(start), 1), 400))])


@pytest.mark.parametrize("distance", [0.5, 0.1, 0.05, 0.01, 0.003])
def test_a_curve_that_passes_close_by_is_not_jumped_to(distance):
    found = from_one_end(Passing(distance), [2.0, -2.0], 2.5)
    assert found[-1, 1] > 2.0
    assert np.all(found[:, 0] >= distance)
    assert np.all(np.diff(found[:, 1]) > 0.0)


def test_curves_that_cross_are_passed_straight():
    found = from_one_end(Passing(0.0), [2.013, -2.013], 2.5)
    assert found[-1, 1] > 2.0
    assert found[:, 0] == pytest.approx(-found[:, 1], abs=1e-9)


@pytest.mark.parametrize("distance", [0.5, 0.2, 0.05, 0.02])
def test_in_a_hairpin_no_step_leads_to_the_way_back(distance):
    found = from_one_end(Hairpin(distance), [distance, 0.0], 2.0)
    assert np.all(np.diff(found[:, 0]) < 0.0)
    assert found[-1, 0] < -distance
    assert found[:, 1].max() > 0.97
    turn = int(np.argmax(found[:, 1]))
    assert np.all(np.diff(found[:turn + 1, 1]) > 0.0)
    assert np.all(np.diff(found[turn:, 1]) < 0.0)


def rattling(stiffness, torque, quadratic):
    """A van der Pol oscillator drives a mass that, near thrice its frequency, turns more often.

    Friction and damper are on the mass, whose ``stiffness`` sets its own frequency.
    """
    driving = OddElement(
        (0,), lambda q, v: q**2 * v, lambda q, v: (2.0 * q * v)[None], lambda q, v: (q**2)[None])
    braking = (*([Coulomb(1, torque)] if torque else []),
               *([QuadraticDamping(1, quadratic)] if quadratic else []))
    return System(np.eye(2), np.diag([-1.0, 0.1]), np.array([[1.0, 0.0], [-1.0, stiffness]]),
                  (driving, *braking))


def alone(stiffness, torque, quadratic, harmonics=5):
    """The cycle by Newton's method from that without friction and damper on the mass."""
    easy = solve_cold(rattling(stiffness, 0.0, 0.0), harmonics).limit_cycle
    return converge(rattling(stiffness, torque, quadratic), easy.coefficients, easy.frequency)


def rattling_branch(torque, quadratic, start, direction, harmonics=5, first_step=0.05):
    """Its points over the stiffness, with the number of reversals of the mass in half a period."""
    change = System(np.zeros((2, 2)), np.zeros((2, 2)), np.diag([0.0, 1.0]))
    family = Family(lambda stiffness: rattling(stiffness, torque, quadratic),
                    lambda stiffness: change)
    system = family.system(start)
    phase, point = placed(system, alone(start, torque, quadratic, harmonics), (0, 1))
    for here in branch(family, point, start, 5.0, direction, (0, 1), phase, first_step):
        yield here, velocity_zeros(here.point.coefficients[1]).size


@pytest.mark.parametrize(("torque", "quadratic"), [(0.0, 0.3), (0.01, 0.0), (0.01, 0.1)])
def test_no_piece_is_lost_where_a_coordinate_begins_to_turn_thrice(torque, quadratic):
    ups = list(takewhile(lambda pair: pair[0].parameter < 14.0,
                         rattling_branch(torque, quadratic, 2.0, 1)))
    counts = [count for _, count in ups]
    assert counts[0] == 1
    assert counts[-1] == 3
    assert counts == sorted(counts)
    assert ups[-1][0].parameter > 12.0
    for (before, _), (after, _) in pairwise(ups):
        assert before.parameter < after.parameter < before.parameter + 2.0
        size = np.linalg.norm(before.point.coefficients, axis=1)
        change = np.linalg.norm(after.point.coefficients - before.point.coefficients, axis=1)
        assert np.all(change < 0.5 * size)
    # The same from the other side, and at every point found without the branch.
    downs = list(takewhile(lambda pair: pair[0].parameter > 3.0,
                           rattling_branch(torque, quadratic, 12.0, -1)))
    assert {count for _, count in downs} == {1, 3}
    for here, _ in [*ups[1::4], *downs[1::4]]:
        single = alone(here.parameter, torque, quadratic)
        assert single.frequency == pytest.approx(here.point.frequency, rel=1e-9)
        assert single.amplitude() == pytest.approx(peaks(here.point.coefficients), rel=1e-8)


def test_where_friction_would_hold_between_two_new_zeros_the_branch_ends_with_an_error():
    """The balance knows no sticking: it says where it ends, and does not skip the place."""
    points = []
    with pytest.raises(ContinuationError, match=r"could not be followed beyond parameter 6\.3"):
        points.extend(rattling_branch(0.2, 0.0, 5.0, 1, 8))
    last, count = points[-1]
    assert count == 1
    tau = np.linspace(0.0, np.pi, 2000)
    speed = evaluate(last.point.coefficients[1], tau, 1)
    dips = (np.abs(speed[1:-1]) < np.abs(speed[:-2])) & (np.abs(speed[1:-1]) < np.abs(speed[2:]))
    lowest = np.sort(np.abs(speed[1:-1][dips]))
    # One reversal, and one place at which the velocity all but touches zero.
    assert len(lowest) == 2
    assert lowest[1] < 1e-3 * np.abs(speed).max()


def test_no_piece_is_lost_where_the_gears_swivel_begins_to_stick():
    """At every friction below the fold: one stable cycle, and behind the fold the unstable one."""
    gear, damper = reference_parameters()

    def at(torque):
        return OperatingPoint(gear, changed(damper, quadratic_damping=10.0, coulomb_torque=torque),
                              10.0)

    torques = np.array([40.0, 80.0, 90.0, 95.0, 104.0])
    low, high = 30.0, 140.0
    line = Line(family_between(at(low), at(high)))
    start = stable_cycle(at(80.0)).orbit
    stops = tuple((torques - low) / (high - low))
    points = [*follow(line, start, (80.0 - low) / (high - low), -1, Settings(), stops)][::-1]
    points += [*follow(line, start, (80.0 - low) / (high - low), 1, Settings(), stops)][1:]
    (fold,) = [index for index, point in enumerate(points) if point.is_fold]
    for stop in stops:
        places = [index for index, point in enumerate(points) if point.position == stop]
        assert len(places) == 2
        outer, inner = (points[index].orbit for index in places)
        assert places[0] < fold < places[1]
        assert outer.stable
        assert inner.stable is False
        assert inner.swivel < outer.swivel
        # Found again by shooting from where it is.
        for orbit in (outer, inner):
            again = shoot(line.system(stop), *orbit.initial_state())
            assert again.same_as(orbit)
    assert {point.orbit.sticks for point in points} == {False, True}
    # Sticking sets in on the stable side, where shooting takes over.
    assert any(point.orbit.sticks and point.orbit.stable for point in points)
    assert all(point.orbit.method == SHOOTING for point in points if point.orbit.sticks)
    swivel = np.array([point.orbit.amplitude[SWIVEL] for point in points])
    assert np.all(np.abs(np.diff(np.log(swivel))) < 0.5)
