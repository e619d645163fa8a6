"""The policy: what a point comes to, against independent integration, and whatever came before."""

import json
import math
from dataclasses import fields, replace
from pathlib import Path

import numpy as np
import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

from benchmarks.verdicts.grading import Grade, graded
from benchmarks.verdicts.random_gears import random_gear
from benchmarks.verdicts.truths import NOT_PERIODIC, read_truths
from shimmy_ros.cycles.budget import STEPS_PER_SECOND
from shimmy_ros.cycles.kicks import KICKS
from shimmy_ros.cycles.prediction import Predictor
from shimmy_ros.cycles.settings import AUTO, BALANCE, SHOOTING, Settings
from shimmy_ros.cycles.stable_cycle import stable_cycle
from shimmy_ros.gear.parameter_file import reference_parameters
from shimmy_ros.gear.parameters import Damper, Gear, ParameterError, changed, ranges
from shimmy_ros.gear.system import OperatingPoint, gear_system
from shimmy_ros.ihb.solution import Outcome
from shimmy_ros.ihb.solve import solve_cold
from shimmy_ros.shooting.continuation import continue_branch
from shimmy_ros.simulation.simulation import Simulation, SimulationError

GEAR, _ = reference_parameters()
DATA = Path(__file__).parents[1] / "data"
VERDICTS = json.loads((DATA / "verdicts.json").read_text(encoding="utf-8"))
TRUTHS = read_truths(DATA / "verdict_truths.json")
# Of the references themselves, and of what settles in them.
ALLOWED = 1e-3


def at(velocity, quadratic_damping=10.0, coulomb_torque=20.0, linear_damping=2.0, **values):
    return OperatingPoint(changed(GEAR, **values),
                          Damper(linear_damping, quadratic_damping, coulomb_torque), velocity)


# Where friction holds the swivel, strut and tyre have another mode of shimmy: with little friction
# the one near 18 Hz is left, with more that near 14 Hz, and in between both at once.
TWO_MODES = Gear(
    strut_inertia=71.6, wheel_mass=23.35, trunnion_to_axle=0.9154, trail=0.0907,
    swivel_inertia=0.8634, wheel_polar_inertia=0.6583, wheel_radius=0.3457, damper_inertia=0.00443,
    strut_tilt_stiffness=463500.0, damper_linkage_stiffness=61540.0, strut_rake=0.1148,
    tyre_lateral_stiffness=285500.0, tyre_torsional_stiffness=2984.0, rolling_alpha=28.75,
    rolling_beta=11.21, rolling_gamma=0.862)


def two_modes(torque):
    return OperatingPoint(TWO_MODES, Damper(2.345, 43.87, torque), 66.6)


def random_point(kind, index):
    return OperatingPoint(*random_gear(kind, 11, index))


def numbers(verdict):
    return np.append(verdict.amplitude, verdict.frequency_hz)


def assert_same_answer(one, other, tolerance=1e-6):
    assert one.outcome is other.outcome, (one.message, other.message)
    if other.orbit is not None:
        assert numbers(one) == pytest.approx(numbers(other), rel=tolerance)


# --- against independent integration ------------------------------------------------------------

@pytest.mark.parametrize("number", range(len(VERDICTS)))
def test_sixty_gears_come_to_what_independent_integration_says(number):
    case = VERDICTS[number]
    verdict = stable_cycle(OperatingPoint(Gear(**case["gear"]), Damper(**case["damper"]),
                                          case["taxi_velocity"]))
    assert verdict.outcome.value == case["truth"], verdict.message
    if verdict.orbit is not None:
        off = [np.abs(numbers(verdict) / [cycle["strut_tilt"], cycle["swivel"], cycle["damper"],
                                          cycle["tyre_lateral"], cycle["frequency"]] - 1.0).max()
               for cycle in case["stable_cycles"]]
        assert min(off) <= max(verdict.error, ALLOWED)
        assert verdict.orbit.stable is True
        assert verdict.orbit.multiplier < 1.0
    if verdict.kick is not None:
        fates = case["after_kick"]
        word = {Outcome.LIMIT_CYCLE: "cycle", Outcome.UNBOUNDED: "grows"}[verdict.outcome]
        assert fates[f"{verdict.kick.grows:g}"] == word
        assert all(fate == "dies" for kick, fate in fates.items()
                   if float(kick) < verdict.kick.grows)


@pytest.mark.parametrize("truth", TRUTHS, ids=lambda truth: truth.name)
def test_forty_gears_come_to_their_truths(truth):
    verdict = stable_cycle(OperatingPoint(truth.gear, truth.damper, truth.velocity))
    grade = graded(truth, verdict, 0.0)
    assert grade.grade is Grade.RIGHT, grade
    if verdict.orbit is not None:
        assert verdict.orbit.stable is True
        assert verdict.orbit.multiplier < 1.0
    if truth.outcome == NOT_PERIODIC:
        assert np.all(verdict.envelope > 0.0)


def test_a_truth_of_every_outcome_is_there():
    assert {truth.outcome for truth in TRUTHS} == {
        "limit_cycle", "no_limit_cycle", "unbounded", "not_periodic"}


# By integration in time: the fate of each kick of the ladder, and swivel amplitudes.
SEVERAL = {
    ("b", 397): ("cccc", (0.00676, 0.57296)), ("b", 543): ("cccc", (0.00885, 0.01551)),
    ("b", 688): ("dccc", (0.03456, 0.01648)), ("c", 114): ("cccc", (0.00251, 0.00862)),
    ("c", 190): ("cccc", (0.00045, 0.13087)), ("c", 458): ("cccc", (0.0027, 0.16816))}


@pytest.mark.parametrize("gear", SEVERAL, ids=str)
def test_where_kicks_lead_to_two_cycles_the_smallest_decides_and_both_are_told(gear):
    fates, swivels = SEVERAL[gear]
    verdict = stable_cycle(random_point(*gear))
    assert verdict.outcome is Outcome.LIMIT_CYCLE
    assert verdict.stable_cycles == (verdict.orbit, *verdict.further)
    assert [orbit.swivel for orbit in verdict.stable_cycles] == pytest.approx(
        swivels, rel=max(0.01, verdict.error))
    assert all(orbit.stable for orbit in verdict.stable_cycles)
    first = fates.index("c")
    assert verdict.kick.grows == KICKS[first]
    assert verdict.kick.dies == (KICKS[first - 1] if first else 0.0)
    assert "1 further stable cycle" in verdict.message


# By integration in time, as `benchmarks.verdicts` does it. Most of them settle slowly.
@pytest.mark.parametrize(("letter", "index", "outcome", "swivel"), [
    ("b", 151, "limit_cycle", 0.02552), ("b", 331, "not_periodic", None),
    ("b", 644, "limit_cycle", 0.02371), ("b", 198, "no_limit_cycle", None),
    ("c", 182, "no_limit_cycle", None)])
def test_slow_motions_come_to_their_truths(letter, index, outcome, swivel):
    verdict = stable_cycle(random_point(letter, index))
    assert verdict.outcome.value == outcome, verdict.message
    if swivel is not None:
        assert verdict.orbit.swivel == pytest.approx(swivel, rel=max(verdict.error, ALLOWED))


def test_slow_growth_of_a_stiff_gear_is_not_taken_for_rest():
    """Half a period is some 70 of the shortest, and longer with friction."""
    gear, damper, velocity = random_gear("b", 77, 967)
    simulation = Simulation(gear, damper, velocity)
    simulation.kick(2.0)
    with pytest.raises(SimulationError, match="leaves the range of the model"):
        simulation.advance(10.0)
    verdict = stable_cycle(OperatingPoint(gear, damper, velocity))
    assert verdict.outcome is Outcome.UNBOUNDED
    assert verdict.kick.grows == 2.0


def test_motion_on_a_cycle_that_is_not_odd_is_bounded_and_said_to_be_on_no_odd_one():
    """Integration settles on one whose halves differ, with a swivel amplitude of 1.2713e-4 rad."""
    verdict = stable_cycle(random_point("c", 535))
    assert verdict.outcome is Outcome.NOT_PERIODIC
    assert "no odd limit cycle attracts it" in verdict.message
    assert verdict.envelope[1] == pytest.approx(1.2713e-4, rel=0.01)


# --- cases --------------------------------------------------------------------------------------

@pytest.mark.parametrize(("velocity", "quadratic", "torque", "linear", "rest_is_stable"), [
    (40.0, 0.0, 0.0, 2.0, False), (40.0, 0.0, 0.0, 0.0, False), (40.0, 0.0, 20.0, 2.0, True),
    (40.0, 0.0, 20.0, 0.0, True)])
def test_without_quadratic_damping_the_reference_gear_grows_without_bound(
        velocity, quadratic, torque, linear, rest_is_stable):
    verdict = stable_cycle(at(velocity, quadratic, torque, linear))
    assert verdict.outcome is Outcome.UNBOUNDED
    assert verdict.rest_is_stable is rest_is_stable
    assert verdict.message.startswith("unbounded: motion grows beyond half a turn")
    assert ("rest is unstable, and any disturbance leads there" in verdict.message) is (
        not rest_is_stable)
    assert ("a kick of the swivel of 0.5 rad/s leads there" in verdict.message) is rest_is_stable
    assert np.all(np.isinf(verdict.amplitude))


@pytest.mark.parametrize(("point", "harmonics", "without", "sticks"), [
    # So few put the first one's fold too early, and more lose the second, which sticks.
    (at(90.0, 50.0, 60.0), 4, Outcome.NO_LIMIT_CYCLE, False),
    (at(10.0, 50.0, 21.0), 8, Outcome.NOT_CONVERGED, True)])
def test_a_cycle_that_few_harmonics_miss_is_found(point, harmonics, without, sticks):
    assert solve_cold(gear_system(point), harmonics).outcome is without
    verdict = stable_cycle(point, Settings(harmonics))
    assert verdict.outcome is Outcome.LIMIT_CYCLE
    assert verdict.orbit.stable
    assert verdict.orbit.sticks is sticks
    simulation = Simulation(point.gear, point.damper, point.velocity, tolerance=1e-6)
    simulation.kick(verdict.kick.grows)
    settled = simulation.advance(8.0, np.arange(7.5, 8.0, 1e-4)).position
    assert verdict.amplitude == pytest.approx(np.abs(settled).max(axis=0), rel=2e-3)


def test_the_cycle_is_found_up_to_the_very_fold():
    start = stable_cycle(at(90.0, 50.0, 60.0), Settings(method=SHOOTING)).orbit.source
    fold = next(item.parameter for item in continue_branch(
        lambda torque: gear_system(at(90.0, 50.0, torque)), start, 60.0, direction=1, scale=60.0,
        largest_step=0.5) if item.fold)
    below, above = (stable_cycle(at(90.0, 50.0, factor * fold)) for factor in (0.999, 1.001))
    assert below.outcome is Outcome.LIMIT_CYCLE
    assert 0.9 < below.orbit.multiplier < 1.0
    assert above.outcome is Outcome.NO_LIMIT_CYCLE
    assert above.kick is None


def test_where_nothing_grows_motions_die():
    verdict = stable_cycle(at(4.0))
    assert verdict.outcome is Outcome.NO_LIMIT_CYCLE
    assert verdict.rest_is_stable is True
    assert np.all(verdict.amplitude == 0.0)


@pytest.mark.parametrize(("torque", "frequency"), [
    (2.0, 18.21), (3.0, 18.15), (5.85, 14.79), (19.0, 13.32), (21.0, None)])
def test_shimmy_in_another_mode_than_without_friction_is_found(torque, frequency):
    verdict = stable_cycle(two_modes(torque))
    if frequency is None:
        assert verdict.outcome is Outcome.NO_LIMIT_CYCLE
    else:
        assert verdict.outcome is Outcome.LIMIT_CYCLE
        assert verdict.frequency_hz == pytest.approx(frequency, abs=0.015)


@pytest.mark.parametrize("torque", [3.5, 3.75])
def test_both_modes_at_once_are_not_periodic(torque):
    point = two_modes(torque)
    verdict = stable_cycle(point)
    assert verdict.outcome is Outcome.NOT_PERIODIC
    assert verdict.orbit is None
    simulation = Simulation(point.gear, point.damper, point.velocity)
    simulation.kick(verdict.kick.grows)
    motion = np.abs(simulation.advance(70.0, np.arange(30.0, 70.0, 1e-3)).position)
    assert verdict.envelope == pytest.approx(motion.max(axis=0), rel=0.08)
    # Its peaks rise and fall, and it does not end.
    peaks = motion[:, 1].reshape(-1, 100).max(axis=1)
    assert np.ptp(peaks[len(peaks) // 2:]) > 0.2 * peaks.max()
    assert peaks.min() > 0.1 * peaks.max()


# The tyre leads the strut: with so much rake the contact runs ahead of the axis.
@pytest.mark.parametrize("velocity", [0.5, 0.7, 1.0, 2.0, 5.0, 20.0, 60.0, 200.0])
def test_with_the_contact_ahead_of_the_axis_there_is_an_answer_at_any_velocity(velocity):
    point = at(velocity, trail=-0.08, strut_rake=-0.5)
    verdict = stable_cycle(point, Settings(minimum_velocity=0.5))
    assert verdict.outcome is Outcome.UNBOUNDED
    assert stable_cycle(replace(point, velocity=0.49),
                        Settings(minimum_velocity=0.5)).outcome is Outcome.NOT_ROLLING


# So stiff a part is as good as rigid, and the softer one's cycle is known.
@pytest.mark.parametrize(("name", "values"), [
    ("damper_linkage_stiffness", (1e7, 1e8, 2.15e8, 1e9, 1e10, 1e12)),
    ("strut_tilt_stiffness", (1e8, 1e9, 1e10, 2.15e10, 1e11, 1e12)),
    ("tyre_lateral_stiffness", (1e8, 1e9, 1e10, 1e12))])
@pytest.mark.parametrize("velocity", [10.0, 40.0])
def test_a_gear_with_a_rigid_part_is_not_said_to_be_at_rest(name, values, velocity):
    soft = stable_cycle(at(velocity, **{name: values[0]}))
    assert soft.outcome is Outcome.LIMIT_CYCLE
    said = {}
    for value in values[1:]:
        stiff = stable_cycle(at(velocity, **{name: value}))
        said[value] = stiff.outcome.value
        # More work than allowed is an honest answer.
        if stiff.outcome is Outcome.LIMIT_CYCLE:
            # The strut's tilt goes to zero as it becomes stiff.
            assert numbers(stiff)[1:] == pytest.approx(numbers(soft)[1:], rel=0.03)
    assert set(said.values()) <= {"limit_cycle", "not_converged"}, said


# --- what came before changes nothing -----------------------------------------------------------

INVARIANT = {"two modes": two_modes(5.0), "b 397": random_point("b", 397),
             "b 543": random_point("b", 543), "b 688": random_point("b", 688),
             "c 114": random_point("c", 114), "c 458": random_point("c", 458),
             "reference": at(40.0), "near the fold": at(40.0, 10.0, 160.0)}


@pytest.mark.parametrize("name", INVARIANT)
def test_over_the_velocity_warm_answers_are_the_cold_ones(name):
    point = INVARIANT[name]
    points = [replace(point, velocity=float(velocity))
              for velocity in point.velocity * np.linspace(0.8, 1.25, 25)]
    cold = [stable_cycle(item) for item in points]
    assert Outcome.NOT_CONVERGED not in {verdict.outcome for verdict in cold}
    for order in (1, -1):
        predictor, warm = Predictor(), 0
        for item, expected in list(zip(points, cold, strict=True))[::order]:
            verdict = predictor.predict(item)
            warm += verdict.warm
            assert_same_answer(verdict, expected)
        # What shooting found is found anew.
        assert warm > 0 or all(verdict.orbit is None or verdict.orbit.method == SHOOTING
                               for verdict in cold)


def test_what_is_known_next_door_of_other_cycles_changes_nothing():
    """A verdict's further cycles are carried along; the decisive one is the same."""
    point = random_point("b", 543)
    near = replace(point, velocity=1.02 * point.velocity)
    start, cold = stable_cycle(point), stable_cycle(near)
    assert len(start.further) == len(cold.further) == 1
    warm = stable_cycle(near, start=start)
    assert warm.warm
    assert_same_answer(warm, cold)
    assert warm.further[0].swivel == pytest.approx(cold.further[0].swivel, rel=1e-6)
    # The other one decided where it came from, and does not here.
    swapped = replace(start, orbit=start.further[0], further=(start.orbit,), ladder=None)
    assert_same_answer(stable_cycle(near, start=swapped), cold)


@st.composite
def points(draw):
    return OperatingPoint(GEAR, Damper(draw(st.floats(0.0, 10.0)), draw(st.floats(1.0, 60.0)),
                                       draw(st.one_of(st.just(0.0), st.floats(0.0, 100.0)))),
                          draw(st.floats(5.0, 100.0)))


def nearby(point, factors):
    damper = point.damper
    return OperatingPoint(point.gear, Damper(
        damper.linear_damping * factors[0], damper.quadratic_damping * factors[1],
        damper.coulomb_torque * factors[2]), point.velocity * factors[3])


# Near a fold the last digits of a cycle are rounding's.
@settings(max_examples=60, deadline=None, derandomize=True)
@given(point=points(), step=st.tuples(*[st.floats(0.9, 1.1)] * 4))
def test_a_neighbours_verdict_changes_nothing(point, step):
    near = nearby(point, step)
    cold = stable_cycle(near)
    warm = stable_cycle(near, start=stable_cycle(point))
    assert not cold.failed
    assert_same_answer(warm, cold)


@pytest.mark.parametrize("letter", ["a", "b", "c"])
def test_a_neighbours_verdict_changes_nothing_on_other_gears(letter):
    rng = np.random.default_rng(31)
    different = []
    for index in range(25):
        point = OperatingPoint(*random_gear(letter, 31, index))
        near = nearby(point, rng.uniform(0.93, 1.07, 4))
        cold = stable_cycle(near)
        warm = stable_cycle(near, start=stable_cycle(point))
        if warm.outcome is not cold.outcome or numbers(warm) != pytest.approx(
                numbers(cold), rel=1e-6 if cold.orbit is not None else 0.05, nan_ok=True):
            different.append((index, warm.message, cold.message))
    assert different == []


def test_a_cycle_of_small_kicks_alone_is_found_where_next_door_all_kicks_die():
    gear, damper, velocity = random_gear("b", 31, 4919)
    point = OperatingPoint(gear, damper, velocity)
    start = stable_cycle(point)
    assert start.outcome is Outcome.NO_LIMIT_CYCLE
    near = replace(point, velocity=1.0625 * velocity)
    cold = stable_cycle(near)
    assert cold.outcome is Outcome.LIMIT_CYCLE
    assert cold.kick.grows < KICKS[0]
    assert_same_answer(stable_cycle(near, start=start), cold)


# The equations' cycle next door has an angle just below half a turn, and that here just above it.
@pytest.mark.parametrize(("letter", "index", "factor"), [
    ("b", 1981, 0.9762552349991371), ("c", 1064, 0.9209925248693066)])
def test_a_cycle_that_comes_to_pass_half_a_turn_is_growth_without_bound(letter, index, factor):
    gear, damper, velocity = random_gear(letter, 77, index)
    start = stable_cycle(OperatingPoint(gear, damper, velocity))
    assert start.outcome is Outcome.LIMIT_CYCLE
    near = OperatingPoint(gear, damper, factor * velocity)
    cold = stable_cycle(near)
    assert cold.outcome is Outcome.UNBOUNDED
    assert_same_answer(stable_cycle(near, start=start), cold)


def test_a_cycle_of_the_equations_beyond_half_a_turn_holds_nothing():
    """Integration in time passes half a turn after every kick."""
    verdict = stable_cycle(OperatingPoint(*random_gear("a", 77, 3636)))
    assert verdict.outcome is Outcome.UNBOUNDED
    assert verdict.kick.grows == KICKS[0]


def test_a_verdict_of_other_settings_is_not_used():
    start = stable_cycle(at(40.0), Settings(harmonics=6))
    verdict = stable_cycle(at(40.5), Settings(), start)
    assert not verdict.warm
    assert verdict.orbit.harmonics == 4


# --- budget, settings, bad numbers --------------------------------------------------------------

@pytest.mark.parametrize("point", [at(40.0), at(10.0, 50.0), at(7.0), two_modes(3.5)])
def test_a_tiny_budget_is_said_to_be_too_small_every_time(point):
    small = Settings(budget=0.001)
    verdicts = [stable_cycle(point, small) for _ in range(2)]
    for verdict in verdicts:
        assert verdict.outcome is Outcome.NOT_CONVERGED
        assert verdict.failed
        assert verdict.message == ("did not converge; an answer would take more work than its "
                                   "budget allows")
        assert np.isnan(verdict.amplitude).all()
    assert verdicts[0].work == verdicts[1].work > 0


def test_the_budget_decides_on_nothing_but_whether_there_is_an_answer():
    enough = stable_cycle(at(40.0))
    assert 0 < enough.work < STEPS_PER_SECOND
    answered = 0
    for budget in (0.001, 0.002, 0.005, 0.02, 0.1, 10.0):
        verdict = stable_cycle(at(40.0), Settings(budget=budget))
        if not verdict.failed:
            assert_same_answer(verdict, enough, 1e-12)
            assert verdict.work == enough.work
            answered += 1
        # What is short of an answer is not more than what an answer takes.
        assert verdict.failed == (int(budget * STEPS_PER_SECOND) < enough.work)
    assert answered >= 2


def test_the_same_point_has_the_same_verdict_every_time():
    for point in (at(40.0), two_modes(3.5), random_point("b", 688)):
        one, other = stable_cycle(point), stable_cycle(point)
        np.testing.assert_array_equal(numbers(one), numbers(other))
        assert (one.outcome, one.kick, one.work, one.message) == (
            other.outcome, other.kick, other.work, other.message)


@pytest.mark.parametrize("velocity", [0.0, 0.5, 0.999])
def test_below_the_minimum_velocity_the_tyre_does_not_roll(velocity):
    verdict = stable_cycle(at(velocity))
    assert verdict.outcome is Outcome.NOT_ROLLING
    assert verdict.stands
    assert not verdict.failed
    assert verdict.work == 0
    assert verdict.message == (
        f"not rolling; taxi velocity {velocity:g} m/s is below the minimum of 1 m/s, where the "
        "rolling law does not hold")


@pytest.mark.parametrize("velocity", [math.nan, math.inf, -1.0, 200.1])
def test_bad_velocities_are_refused(velocity):
    with pytest.raises(ParameterError, match=r"taxi_velocity is .*, but must be in \[0, 200\] m/s"):
        stable_cycle(at(velocity))


@pytest.mark.parametrize("point", [at(40.0), at(20.0, 20.0, 15.0), at(10.0, 50.0, 10.0)])
def test_the_settings_are_respected(point):
    for harmonics in (1, 3, 6):
        verdict = stable_cycle(point, Settings(harmonics, method=BALANCE))
        assert (verdict.orbit.method, verdict.orbit.harmonics) == (BALANCE, harmonics)
    exact = stable_cycle(point, Settings(method=SHOOTING))
    assert (exact.orbit.method, exact.orbit.harmonics) == (SHOOTING, 0)
    for accuracy in (0.1, 1e-2, 1e-3, 1e-5):
        for harmonics in (1, 4):
            verdict = stable_cycle(point, Settings(harmonics, accuracy, AUTO))
            assert verdict.error <= accuracy
            off = np.abs(numbers(verdict) / numbers(exact) - 1.0).max()
            assert off <= verdict.error + 1e-9
            assert verdict.settings.accuracy == accuracy


def test_what_the_balance_cannot_represent_is_not_said_to_be_aperiodic():
    """A cycle that sticks is none of the balance's, but periodic all the same."""
    point = at(10.0, 50.0, 20.0)
    assert stable_cycle(point).orbit.sticks
    assert stable_cycle(point, Settings(method=BALANCE)).outcome in (
        Outcome.NOT_CONVERGED, Outcome.LIMIT_CYCLE)


def values_of(range_):
    """Any number in a range: its ends, tiny and denormal ones, and over all orders."""
    ends = [range_.low, range_.high]
    if range_.low <= 0.0:
        ends += [0.0, 5e-324, 1e-310, 2.3e-308, 1e-200]
    low = max(range_.low, 1e-6)
    return st.one_of(
        st.sampled_from(ends), st.floats(range_.low, range_.high),
        st.floats(math.log(low), math.log(range_.high)).map(
            lambda x: min(range_.high, max(range_.low, math.exp(x)))))


@st.composite
def extreme_points(draw):
    """Anything that is allowed; the mass matrix decides on the trail."""
    values = {name: draw(values_of(range_)) for name, range_ in ranges(Gear).items()}
    limit = math.sqrt(values["strut_inertia"] * values["swivel_inertia"]) / (
        values["wheel_mass"] * values["trunnion_to_axle"])
    values["trail"] = draw(st.sampled_from([0.0, 5e-324, -1.0, 1.0, 0.5, -1e-3])) * min(
        5.0, 0.999 * limit)
    damper = {name: draw(values_of(range_)) for name, range_ in ranges(Damper).items()}
    try:
        gear = Gear(**values)
    except ParameterError:
        gear = Gear(**values | {"trail": 0.0})
    return OperatingPoint(gear, Damper(**damper), draw(st.one_of(
        st.sampled_from([0.0, 1.0, 200.0, 0.01]), st.floats(0.0, 200.0))))


@settings(max_examples=150, deadline=None, derandomize=True,
          suppress_health_check=[HealthCheck.too_slow])
@given(point=extreme_points(), minimum=st.sampled_from([0.01, 1.0]),
       method=st.sampled_from([AUTO, AUTO, BALANCE, SHOOTING]))
def test_whatever_is_allowed_has_an_answer(point, minimum, method):
    asked = Settings(minimum_velocity=minimum, budget=0.02, method=method)
    verdict = stable_cycle(point, asked)
    assert isinstance(verdict.outcome, Outcome)
    assert verdict.message
    assert (verdict.orbit is not None) == (verdict.outcome is Outcome.LIMIT_CYCLE)
    if verdict.orbit is not None:
        assert np.isfinite(numbers(verdict)).all()
        assert verdict.excesses is not None
    if verdict.failed:
        assert verdict.reason
    again = stable_cycle(point, asked, verdict)
    assert again.outcome is verdict.outcome or Outcome.NOT_CONVERGED in (
        again.outcome, verdict.outcome)


# One parameter of the reference gear at an end of its range.
@pytest.mark.parametrize("name", [item.name for item in fields(Gear)])
def test_an_end_of_one_range_has_an_answer(name):
    range_ = ranges(Gear)[name]
    for value in (range_.low, range_.high):
        try:
            point = at(40.0, **{name: value})
        except ParameterError:
            continue
        verdict = stable_cycle(point, Settings(budget=0.1))
        assert verdict.message
