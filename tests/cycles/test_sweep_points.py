"""Sweeps: what each value comes to, and the motion that stays on its branch up to a fold."""

from dataclasses import replace

import numpy as np
import pytest

from shimmy_ros.cycles import diagram as diagram_module
from shimmy_ros.cycles.diagram import Diagram
from shimmy_ros.cycles.settings import Settings
from shimmy_ros.cycles.stable_cycle import stable_cycle
from shimmy_ros.cycles.sweep import sweep_points
from shimmy_ros.cycles.verdict import Verdict
from shimmy_ros.gear.axes import Axis
from shimmy_ros.gear.parameter_file import reference_parameters
from shimmy_ros.gear.parameters import Damper, Limits
from shimmy_ros.gear.system import OperatingPoint
from shimmy_ros.ihb.solution import Outcome

GEAR, _ = reference_parameters()
FRICTION = Axis("damper.coulomb_torque")


def point_at(velocity, quadratic=10.0, torque=20.0):
    return OperatingPoint(GEAR, Damper(2.0, quadratic, torque), velocity)


def swept(point, values, settings=None):
    """The diagram, and the answers up and down by their values."""
    diagram = Diagram(point, FRICTION, values, settings or Settings())
    judged = list(diagram.judge())
    assert [verdict.point for verdict in judged] == [
        diagram.at(index) for index in range(len(values))]
    for _ in diagram.trace_stable():
        pass
    up, down = list(sweep_points(diagram, True)), list(sweep_points(diagram, False))
    assert [answer.value for answer in up] == list(values)
    assert [answer.value for answer in down] == list(values)[::-1]
    return diagram, up, down[::-1]


def test_where_one_cycle_is_stable_both_directions_have_the_verdict():
    values = [130.0, 140.0, 150.0, 160.0, 170.0, 180.0]
    diagram, up, down = swept(point_at(40.0), values)
    for index, answers in enumerate(zip(up, down, strict=True)):
        verdict = diagram.verdicts[index]
        for answer in answers:
            assert answer.outcome is verdict.outcome
            assert answer.orbit is verdict.orbit
            assert answer.kick_leads_here is True
            assert (answer.further, answer.beyond_limits) == (0, ())
    assert [answer.outcome for answer in up] == (
        4 * [Outcome.LIMIT_CYCLE] + 2 * [Outcome.NO_LIMIT_CYCLE])


def test_between_two_folds_a_sweep_depends_on_its_direction():
    values = list(np.linspace(2.0, 8.0, 13))
    diagram, up, down = swept(point_at(7.0), values)
    folds = sorted(point.value for point in diagram.points if point.is_fold)
    np.testing.assert_allclose(folds, [3.7296, 6.6654], atol=2e-3)
    for index, value in enumerate(values):
        rows = up[index], down[index]
        assert all(row.outcome is Outcome.LIMIT_CYCLE for row in rows)
        verdict = diagram.verdicts[index].orbit
        if folds[0] < value < folds[1]:
            assert up[index].orbit.swivel > 1.5 * down[index].orbit.swivel
            # One of the two is where a kick leads.
            assert sorted(row.kick_leads_here for row in rows) == [False, True]
            assert [row.further for row in rows] == [1, 1]
        else:
            assert up[index].orbit is down[index].orbit is verdict
            assert all(row.kick_leads_here and row.further == 0 for row in rows)
        for row in rows:
            assert row.kick_leads_here == (row.orbit is verdict)


@pytest.fixture
def told(monkeypatch):
    """What values of the friction are to come to, by outcome; all others as they do."""
    outcomes = {}

    def verdict(point, settings, start):
        outcome = outcomes.get(point.damper.coulomb_torque)
        if outcome is None:
            return stable_cycle(point, settings, start)
        envelope = np.array([0.0, 0.6, 0.0, 0.0]) if outcome is Outcome.NOT_PERIODIC else None
        return Verdict(point, settings, outcome, reason="as told", envelope=envelope)

    monkeypatch.setattr(diagram_module, "stable_cycle", verdict)
    return outcomes


def test_every_outcome_is_a_row(told):
    told |= {180.0: Outcome.UNBOUNDED, 190.0: Outcome.NOT_PERIODIC, 200.0: Outcome.NOT_CONVERGED}
    diagram, up, down = swept(point_at(40.0), [150.0, 160.0, 170.0, 180.0, 190.0, 200.0])
    for rows in (up, down):
        assert [row.outcome for row in rows] == [
            Outcome.LIMIT_CYCLE, Outcome.LIMIT_CYCLE, Outcome.NO_LIMIT_CYCLE, Outcome.UNBOUNDED,
            Outcome.NOT_PERIODIC, Outcome.NOT_CONVERGED]
        assert [row.kick_leads_here for row in rows] == 5 * [True] + [None]
        assert rows[4].envelope[1] == 0.6
        assert rows[4].beyond_limits == ("swivel",)
    assert diagram.losses == ["damper.coulomb_torque 200: as told"]


def test_motion_stays_on_its_branch_where_a_kick_leads_elsewhere(told):
    """Up to the fold at 163.8 N m, whatever becomes of a kick."""
    told |= {150.0: Outcome.UNBOUNDED, 160.0: Outcome.NO_LIMIT_CYCLE}
    _, up, down = swept(point_at(40.0), [130.0, 140.0, 150.0, 160.0, 170.0])
    assert [row.outcome for row in up] == 4 * [Outcome.LIMIT_CYCLE] + [Outcome.NO_LIMIT_CYCLE]
    assert [row.kick_leads_here for row in up] == [True, True, False, False, True]
    # Downwards nothing was followed before.
    assert [row.outcome for row in down[2:]] == [
        Outcome.UNBOUNDED, Outcome.NO_LIMIT_CYCLE, Outcome.NO_LIMIT_CYCLE]
    assert [row.further for row in down] == [0, 0, 1, 1, 0]
    assert all(row.kick_leads_here for row in down)


def test_cycles_beyond_the_limits_are_marked_along_the_branch():
    settings = replace(Settings(), limits=Limits(0.1, 0.2, 0.3))
    diagram, up, _ = swept(point_at(40.0), [20.0, 80.0, 140.0], settings)
    assert up[0].beyond_limits == ("swivel",)
    assert up[-1].beyond_limits == ()
    for point in diagram.points:
        assert point.beyond_limits == (("swivel",) if point.orbit.swivel > 0.1 else ())
