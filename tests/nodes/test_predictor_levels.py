"""What the predictor publishes, reports and logs of each outcome, whatever the solver found."""

from __future__ import annotations

import importlib
import math

import numpy as np
import pytest

from shimmy_ros.contract.records import Level, TaxiVelocity
from shimmy_ros.cycles.prediction import Predictor
from shimmy_ros.cycles.settings import Settings
from shimmy_ros.cycles.verdict import Verdict
from shimmy_ros.gear.parameter_file import reference_parameters
from shimmy_ros.gear.parameters import Limits
from shimmy_ros.gear.system import OperatingPoint
from shimmy_ros.ihb.solution import Outcome
from shimmy_ros.nodes.domain import OwnDomain

POINT = OperatingPoint(*reference_parameters(), 40.0)
SETTINGS = Settings()


def shimmy(**values):
    return Verdict(POINT, outcome=Outcome.LIMIT_CYCLE, reason="the reason",
                   orbit=Predictor().predict(POINT).orbit, **{"settings": SETTINGS} | values)


def other(outcome, **values):
    return Verdict(POINT, SETTINGS, outcome, reason="the reason", **values)


@pytest.fixture(scope="module")
def node():
    """A predictor in this process, active, which nobody hears."""
    rclpy = importlib.import_module("rclpy")
    node_class = importlib.import_module("shimmy_ros.nodes.predictor_node").PredictorNode
    domain, context = OwnDomain(), rclpy.Context()
    rclpy.init(args=[], context=context, domain_id=domain.number)
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(node_class, "_warm_up", lambda self: None)
        node = node_class(context=context)
        assert node.start()
    yield node
    assert node.stop()
    node.destroy_node()
    context.try_shutdown()
    domain.close()


class Given:
    """A predictor with one verdict."""

    def __init__(self, verdict):
        self._verdict = verdict

    def predict(self, point):
        return self._verdict


@pytest.fixture
def answered(node, monkeypatch, capfd):
    """The records of an answer that is ``verdict``, the solver's report and the log."""
    def answer(verdict):
        records = {}
        for name, publisher in node._answer_publishers.items():
            monkeypatch.setattr(publisher, "publish", lambda data, name=name: records.setdefault(
                name, importlib.import_module("shimmy_ros.contract.messages").CODECS[name]
                .decode(data)))
        monkeypatch.setattr(node._session, "predictor", Given(verdict))
        capfd.readouterr()
        node.on_velocity(TaxiVelocity(10**9, 40.0))
        (report,) = [status for status in node.statuses() if status[0] == "solver"]
        return records, report, capfd.readouterr().err

    return answer


CASES = {
    "limit cycle": (shimmy(), Level.OK, Level.OK),
    "beyond the limits": (shimmy(settings=Settings(limits=Limits(swivel=0.1))), Level.WARN,
                          Level.WARN),
    "no limit cycle": (other(Outcome.NO_LIMIT_CYCLE), Level.OK, Level.OK),
    "not rolling": (other(Outcome.NOT_ROLLING), Level.WARN, Level.OK),
    "not periodic": (other(Outcome.NOT_PERIODIC, envelope=np.full(4, 0.1)), Level.WARN,
                     Level.WARN),
    "unbounded": (other(Outcome.UNBOUNDED), Level.ERROR, Level.ERROR),
    "not converged": (other(Outcome.NOT_CONVERGED), Level.ERROR, Level.ERROR),
}


@pytest.mark.parametrize("case", CASES)
def test_every_outcome_has_its_level(answered, case):
    verdict, of_answer, of_report = CASES[case]
    records, (_, level, message, values), _ = answered(verdict)
    (status,) = records["limit_cycle/status"]
    assert (status.level, level) == (of_answer, of_report)
    assert status.message == message
    assert "; the reason" in status.message
    assert status.values["outcome"] == verdict.outcome.value
    assert int(values[f"answers {verdict.outcome.value}"]) >= 1


def test_motion_without_bound_is_infinite_on_the_topic(answered):
    records, *_ = answered(CASES["unbounded"][0])
    assert records["limit_cycle/amplitude"].position == (math.inf,) * 4
    assert records["limit_cycle/amplitude"].velocity == (math.inf,) * 4
    assert math.isnan(records["limit_cycle/frequency"])
    assert len(records["limit_cycle/orbit"].times_ns) == 0


def test_errors_are_logged_and_not_often(node, answered, monkeypatch):
    logged = []
    monkeypatch.setattr(type(node), "get_logger", lambda self: type("Log", (), {
        "error": staticmethod(lambda text, **options: logged.append((text, options))),
        "warning": staticmethod(lambda text, **options: None)}))
    for case, (verdict, level, _) in CASES.items():
        logged.clear()
        answered(verdict)
        assert [text for text, _ in logged] == (
            [f"at 40 m/s: {verdict.message}"] if level is Level.ERROR else []), case
        assert all(options["throttle_duration_sec"] >= 1.0 for _, options in logged)
