"""A predictor's state between messages."""

from __future__ import annotations

import math

import pytest

from shimmy_ros.contract.records import TaxiVelocity
from shimmy_ros.contract.session import Session
from shimmy_ros.cycles.prediction import Predictor
from shimmy_ros.gear.parameter_file import reference_parameters
from shimmy_ros.gear.parameters import ParameterError, changed

SECOND = 10**9


@pytest.fixture
def session():
    return Session(*reference_parameters(), Predictor())


def take(session, stamp_s, velocity=40.0, received_s=5000.0):
    return session.take(TaxiVelocity(int(stamp_s * SECOND), velocity), int(received_s * SECOND))


def test_before_the_first_sample_there_is_nothing_to_predict(session):
    assert session.predict() is None


def test_predictions_start_from_the_one_before(session):
    starts = []
    for stamp, velocity in ((100, 40.0), (101, 40.5), (102, 41.0)):
        assert take(session, stamp, velocity) == ""
        prediction = session.predict()
        assert prediction.point.velocity == velocity
        starts.append(prediction.warm)
    assert starts == [False, True, True]
    assert session.sample == TaxiVelocity(102 * SECOND, 41.0)


def test_changes_count_from_the_next_prediction_on(session):
    take(session, 100)
    before = session.predict()
    session.damper = changed(session.damper, quadratic_damping=20.0)
    after = session.predict()
    assert after.point.damper.quadratic_damping == 20.0
    assert after.orbit.frequency_hz != before.orbit.frequency_hz


def test_time_that_jumps_back_drops_the_warm_start_and_is_said_once(session):
    take(session, 100)
    session.predict()
    assert take(session, 97.5) == "time jumped back by 2.5 s; the next answer starts cold"
    assert not session.predict().warm
    assert take(session, 97.6, 40.5) == ""
    assert session.predict().warm
    assert session.jumps == 1


def test_a_repeated_stamp_and_a_gap_are_no_jump(session):
    for stamp in (100, 100, 100_000):
        assert take(session, stamp) == ""
        session.predict()
    take(session, 100_000, 40.5)
    assert session.predict().warm
    assert session.jumps == 0


def test_a_sample_without_a_stamp_gets_the_time_of_its_receipt(session):
    take(session, 0, received_s=7000.5)
    assert session.sample.stamp_ns == 7_000_500_000_000
    # Whatever clock the other stamps follow, the two do not make each other jump.
    assert [take(session, stamp, received_s=received) for stamp, received in (
        (100, 7001), (0, 7002), (101, 7003), (0, 7004))] == [""] * 4
    assert session.unstamped == 3
    assert "jumped back by 4 s" in take(session, 0, received_s=7000)
    assert "jumped back by 1 s" in take(session, 100)
    assert session.jumps == 2


@pytest.mark.parametrize("velocity", [math.nan, math.inf, -1.0, 201.0])
def test_a_refused_sample_changes_nothing(session, velocity):
    take(session, 100)
    session.predict()
    sample = session.sample
    with pytest.raises(ParameterError, match=r"taxi_velocity is .*but must be in \[0, 200\] m/s"):
        take(session, 50, velocity)
    assert session.sample is sample
    assert (session.jumps, session.unstamped) == (0, 0)
    take(session, 101, 40.5)
    assert session.predict().warm


def test_the_same_messages_give_the_same_bits():
    def run():
        session = Session(*reference_parameters(), Predictor())
        bits = []
        for index in range(40):
            take(session, index, 30.0 + 1.7 * index)
            if index % 7 == 3:
                session.damper = changed(session.damper, coulomb_torque=20.0 - 0.1 * index)
            orbit = session.predict().orbit
            bits.append(None if orbit is None else orbit.series.coefficients.tobytes())
        return bits

    assert run() == run()
