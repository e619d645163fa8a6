"""Both nodes as managed nodes: who starts them, and what they do in which state."""

from __future__ import annotations

import pytest

PARTIES = ("predictor", "simulator")


@pytest.fixture
def bench(stage):
    """A bench that listens to both nodes."""
    stage.bench.listen("limit_cycle/amplitude", "limit_cycle/frequency", "limit_cycle/orbit",
                       "limit_cycle/status", "gear_response", "/diagnostics")
    return stage.bench


def sent(bench):
    """How many answers and responses there were."""
    return len(bench.received["limit_cycle/status"]), len(bench.received["gear_response"])


def test_nodes_can_be_started_by_somebody_else(stage, bench):
    nodes = [stage.start("predictor", autostart="false"),
             stage.start("simulator", autostart="false", record="false")]
    for party in PARTIES:
        assert bench.state(party) == "unconfigured"
        assert not bench.change_state(party, "activate")
    assert bench.node.count_subscribers("/test/taxi_velocity") == 0

    # Inactive nodes hear and report, but say nothing.
    for party in PARTIES:
        assert bench.change_state(party, "configure")
        assert bench.state(party) == "inactive"
    bench.join(*PARTIES)
    for party in PARTIES:
        bench.await_diagnostic(
            f"{party}: inputs",
            lambda status: {item.key: item.value for item in status.values}
            ["taxi_velocity"] == "40.0", f"the {party} to hear",
            lambda: bench.send_velocity(40.0))
    bench.send_damper("quadratic_damping", 20.0)
    for party in PARTIES:
        bench.await_diagnostic(
            f"{party}: inputs",
            lambda status: {item.key: item.value for item in status.values}
            ["quadratic_damping"] == "20.0", f"the {party} to hear")
    bench.await_diagnostic("simulator: motion", lambda status: status.message == "not active",
                           "the simulator to say that it is not active")
    kick = bench.call("simulator/kick", "std_srvs/srv/Trigger")
    assert not kick.success
    assert "not active" in kick.message
    assert sent(bench) == (0, 0)

    # What was heard meanwhile counts from the start.
    for party in PARTIES:
        assert bench.change_state(party, "activate")
        assert bench.state(party) == "active"
    answer = bench.await_answer(lambda answer: True, "an answer to the last velocity heard")
    assert answer.values["taxi_velocity"] == "40.0"
    assert answer.values["quadratic_damping"] == "20.0"
    bench.wait_until(lambda: sent(bench)[1] > 100, "responses")
    bench.await_diagnostic("simulator: motion",
                           lambda status: status.message == "rolling at 40 m/s", "the simulator")

    # Back to silence.
    for party in PARTIES:
        assert bench.change_state(party, "deactivate")
        assert bench.state(party) == "inactive"
    bench.drain("gear_response")
    before = sent(bench)
    bench.send_velocity(50.0)
    for party in PARTIES:
        bench.await_diagnostic(
            f"{party}: inputs",
            lambda status: {item.key: item.value for item in status.values}
            ["taxi_velocity"] == "50.0", f"the {party} to hear",
            lambda: bench.send_velocity(50.0))
    assert sent(bench) == before

    # Cleaned up, a node has no topics; configured and activated it is as before.
    for party in PARTIES:
        assert bench.change_state(party, "cleanup")
        assert bench.state(party) == "unconfigured"
    bench.wait_until(lambda: bench.node.count_publishers("/test/gear_response") == 0
                     and bench.node.count_subscribers("/test/taxi_velocity") == 0
                     and bench.node.count_publishers("/diagnostics") == 0, "the topics to go")
    for party in PARTIES:
        assert bench.change_state(party, "configure")
        assert bench.change_state(party, "activate")
    bench.join(*PARTIES)
    assert bench.ask(60.0).values["outcome"] == "limit_cycle"
    bench.wait_until(lambda: sent(bench)[1] > before[1], "responses")

    for party in PARTIES:
        assert bench.change_state(party, "active_shutdown")
        assert bench.state(party) == "finalized"
    for node in nodes:
        assert node.stop() == 0, node.log()


def test_a_run_that_cannot_begin_leaves_the_node_unconfigured(stage, bench, tmp_path):
    taken = tmp_path / "bag"
    taken.mkdir()
    simulator = stage.start("simulator", autostart="false", bag_directory=taken)
    assert bench.change_state("simulator", "configure")
    assert not bench.change_state("simulator", "activate")
    assert bench.state("simulator") == "unconfigured"
    assert f"could not activate: bag {taken} exists already" in simulator.log()
    taken.rmdir()
    assert bench.change_state("simulator", "configure")
    assert bench.change_state("simulator", "activate")
    bench.wait_until(lambda: sent(bench)[1] > 0, "responses")
    # Something went wrong on the way, and the status says so.
    assert simulator.stop() == 1
    assert (taken / "metadata.yaml").is_file()
