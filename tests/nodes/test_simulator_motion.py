"""The simulated gear on its topic: rest, shimmy after a kick, standstill, changes on the way."""

from __future__ import annotations

from itertools import pairwise

import numpy as np
import pytest

from shimmy_ros.cycles.prediction import Predictor
from shimmy_ros.gear.parameter_file import reference_parameters
from shimmy_ros.gear.parameters import changed
from shimmy_ros.gear.system import OperatingPoint
from shimmy_ros.simulation.measurement import measure_cycles

JOINTS = ["strut_tilt", "swivel", "damper", "tyre_lateral"]
SWIVEL = JOINTS.index("swivel")
STEP_NS = 2_000_000
REFERENCE = {"damper__linear_damping": 2.0, "damper__quadratic_damping": 10.0,
             "damper__coulomb_torque": 20.0, "gear__trail": 0.08, "kick_swivel_rate": 3.0}


@pytest.fixture(scope="module")
def simulator(module_stage):
    """A simulator that records nothing, and the bench that hears it."""
    node = module_stage.start("simulator", record="false")
    module_stage.bench.listen("gear_response", "/diagnostics")
    module_stage.bench.join("simulator")
    return node


@pytest.fixture
def bench(simulator, module_stage):
    """The bench, with the reference gear at rest at the start of a run."""
    bench = module_stage.bench
    assert all(success for success, _ in bench.set_parameters("simulator", **REFERENCE))
    assert bench.change_state("simulator", "deactivate")
    assert bench.change_state("simulator", "activate")
    forget_the_past(bench)
    return bench


def forget_the_past(bench):
    """From here on ``received`` has only responses of the time after the call."""
    now_ns = bench.node.get_clock().now().nanoseconds
    responses = bench.received["gear_response"]
    bench.wait_until(lambda: responses and stamp_ns(responses[-1]) > now_ns, "responses")
    responses.clear()


def pairs(status):
    return {item.key: item.value for item in status.values}


def roll(bench, velocity):
    """Send a velocity until the simulator uses it."""
    bench.await_diagnostic("simulator: motion",
                           lambda status: status.message == f"rolling at {velocity:g} m/s",
                           f"the simulator at {velocity:g} m/s",
                           lambda: bench.send_velocity(velocity))


def kick(bench):
    return bench.call("simulator/kick", "std_srvs/srv/Trigger")


def stamp_ns(message):
    return message.header.stamp.sec * 10**9 + message.header.stamp.nanosec


def settled_cycle(bench):
    """Amplitude [rad] and frequency [Hz] of the swivel once they stay as they are."""
    responses = bench.received["gear_response"]
    looked_at = 0

    def found():
        nonlocal looked_at
        if len(responses) < max(1000, looked_at + 100):
            return None
        looked_at = len(responses)
        recent = responses[-1000:]
        time = [1e-9 * (stamp_ns(message) - stamp_ns(recent[0])) for message in recent]
        cycles = measure_cycles(time, [message.position[SWIVEL] for message in recent],
                                [message.velocity[SWIVEL] for message in recent])
        if len(cycles.amplitude) < 10 or np.ptp(cycles.amplitude) > 5e-4 * cycles.amplitude[-1]:
            return None
        return float(np.mean(cycles.amplitude)), float(np.mean(cycles.frequency))

    return bench.wait_until(found, "a settled oscillation")


def assert_settles_at(bench, point):
    """The oscillation settles within 1 % of the prediction."""
    forget_the_past(bench)
    amplitude, frequency = settled_cycle(bench)
    cycle = Predictor().predict(point).orbit
    assert amplitude == pytest.approx(cycle.amplitude[SWIVEL], rel=0.01)
    assert frequency == pytest.approx(cycle.frequency_hz, rel=0.01)


def test_samples_come_at_500_hz_without_gap_or_duplicate(bench):
    bench.wait_until(lambda: len(bench.received["gear_response"]) > 1500, "three seconds")
    stamps = [stamp_ns(message) for message in bench.received["gear_response"]]
    assert {late - early for early, late in pairwise(stamps)} == {STEP_NS}


def test_without_a_kick_the_gear_stays_exactly_at_rest(bench):
    roll(bench, 60.0)
    forget_the_past(bench)
    bench.wait_until(lambda: len(bench.received["gear_response"]) > 500, "a second")
    for message in bench.received["gear_response"]:
        assert list(message.name) == JOINTS
        assert list(message.position) == list(message.velocity) == list(message.effort) == [0.0] * 4


def test_a_kick_starts_the_shimmy_that_was_predicted(bench):
    roll(bench, 60.0)
    response = kick(bench)
    assert response.success
    assert "3 rad/s" in response.message
    assert_settles_at(bench, OperatingPoint(*reference_parameters(), 60.0))
    for message in bench.received["gear_response"][-100:]:
        friction, damping = message.effort[1:3]
        rate, damper_rate = message.velocity[1:3]
        assert friction == (-20.0 if rate > 0.0 else 20.0) or rate == 0.0
        assert damping == pytest.approx(-(2.0 + 10.0 * abs(damper_rate)) * damper_rate, rel=1e-9)
        assert message.effort[0] == message.effort[3] == 0.0


def test_changes_of_damper_and_gear_change_the_shimmy(bench):
    roll(bench, 60.0)
    kick(bench)
    gear, damper = reference_parameters()
    bench.send_damper("quadratic_damping", 20.0)
    bench.send_damper("coulomb_torque", 15.0)
    damper = changed(damper, quadratic_damping=20.0, coulomb_torque=15.0)
    bench.wait_until(lambda: abs(bench.received["gear_response"][-1].effort[1]) == 15.0,
                     "the new friction")
    assert_settles_at(bench, OperatingPoint(gear, damper, 60.0))
    gear = changed(gear, trail=0.1)
    assert bench.set_parameters("simulator", gear__trail=0.1) == [(True, "")]
    assert_settles_at(bench, OperatingPoint(gear, damper, 60.0))
    stamps = [stamp_ns(message) for message in bench.received["gear_response"]]
    assert {late - early for early, late in pairwise(stamps)} == {STEP_NS}


def test_a_small_kick_dies_to_exact_rest(bench):
    roll(bench, 60.0)
    assert bench.set_parameters("simulator", kick_swivel_rate=0.05) == [(True, "")]
    assert kick(bench).success
    bench.wait_until(lambda: any(any(message.velocity) for message
                                 in bench.received["gear_response"]), "the kick")
    bench.await_diagnostic("simulator: motion",
                           lambda status: pairs(status)["at rest"] == "True", "rest")
    count = len(bench.received["gear_response"])
    bench.wait_until(lambda: len(bench.received["gear_response"]) > count + 100, "what follows")
    assert list(bench.received["gear_response"][-1].velocity) == [0.0] * 4


def test_below_the_minimum_velocity_the_gear_stands(bench):
    roll(bench, 60.0)
    kick(bench)
    bench.await_diagnostic(
        "simulator: motion",
        lambda status: "stands: taxi velocity is below the minimum of 1 m/s" in status.message
        and status.level == b"\x00",
        "the gear to stand", lambda: bench.send_velocity(0.5))
    forget_the_past(bench)
    assert kick(bench).success
    bench.wait_until(lambda: len(bench.received["gear_response"]) > 500, "a second")
    positions = np.array([message.position for message in bench.received["gear_response"]])
    assert np.isfinite(positions).all()
    assert 0.0 < np.abs(positions[:, SWIVEL]).max() < 0.5
    lateral = positions[:, JOINTS.index("tyre_lateral")]
    assert np.ptp(lateral) == 0.0  # a standing tyre does not move over the ground


def test_a_gear_that_leaves_the_range_of_the_model_is_put_to_rest(bench, simulator):
    roll(bench, 60.0)
    assert bench.set_parameters("simulator", kick_swivel_rate=1000.0) == [(True, "")]
    forget_the_past(bench)
    assert kick(bench).success
    bench.await_diagnostic("simulator: motion", lambda status: int(pairs(status)["resets"]) >= 1
                           and pairs(status)["at rest"] == "True", "a reset")
    assert "the gear is put to rest" in simulator.log()
    count = len(bench.received["gear_response"])
    bench.wait_until(lambda: len(bench.received["gear_response"]) > count + 100, "what follows")
    assert list(bench.received["gear_response"][-1].position) == [0.0] * 4
    stamps = [stamp_ns(message) for message in bench.received["gear_response"]]
    assert {late - early for early, late in pairwise(stamps)} == {STEP_NS}


def test_a_kick_out_of_range_is_refused(bench):
    ((success, reason),) = bench.set_parameters("simulator", kick_swivel_rate=1e4)
    assert not success
    assert "kick_swivel_rate" in reason
    assert bench.get_parameters("simulator", "kick_swivel_rate") == [3.0]


def test_the_response_is_offered_as_the_contract_says(bench):
    (info,) = bench.node.get_publishers_info_by_topic("/test/gear_response")
    assert info.topic_type == "sensor_msgs/msg/JointState"
    assert info.qos_profile.reliability.name == "RELIABLE"
    assert info.qos_profile.durability.name == "VOLATILE"


def test_nothing_is_recorded_where_nothing_is_wanted(bench, module_stage):
    assert not list(module_stage.directory.rglob("*.mcap"))
