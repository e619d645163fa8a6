"""Both nodes on a clock that a /clock topic drives."""

from __future__ import annotations

import pytest

TICK_NS = 2_000_000


@pytest.fixture
def bench(stage):
    """Both nodes with use_sim_time, and a bench that can set the clock."""
    stage.start("predictor", use_sim_time="true")
    stage.start("simulator", use_sim_time="true", record="false")
    bench = stage.bench
    bench.listen("limit_cycle/amplitude", "limit_cycle/frequency", "limit_cycle/orbit",
                 "limit_cycle/status", "gear_response", "/diagnostics")
    bench.join("predictor", "simulator")
    clock = bench.create_clock_publisher()
    bench.wait_until(lambda: clock.get_subscription_count() == 2, "the nodes to hear the clock")

    def set_clock(time_ns):
        message = clock.msg_type()
        message.clock.sec, message.clock.nanosec = divmod(time_ns, 10**9)
        clock.publish(message)

    def tick(time_ns):
        """Set the clock and wait until the simulation has followed it."""
        bench.wait_until(lambda: set_clock(time_ns) or stamps(bench)[-1:] == [time_ns],
                         f"the simulation at {time_ns} ns")

    def jump(time_ns):
        """Set the clock and let it go on until the simulation is there; returns the time then."""
        now_ns = time_ns

        def arrived():
            nonlocal now_ns
            now_ns += TICK_NS
            set_clock(now_ns)
            return stamps(bench) and time_ns <= stamps(bench)[-1] <= now_ns

        bench.wait_until(arrived, f"the simulation at {time_ns} ns")
        tick(now_ns)
        return now_ns

    bench.tick, bench.jump = tick, jump
    return bench


def stamps(bench):
    return [message.header.stamp.sec * 10**9 + message.header.stamp.nanosec
            for message in bench.received["gear_response"]]


def test_time_is_the_clocks(bench):
    # Before the first /clock there is no time, but there are answers and reports of health.
    assert bench.ask(40.0).values["outcome"] == "limit_cycle"
    for kind in ("predictor", "simulator"):
        bench.await_diagnostic(f"{kind}: inputs", lambda status: True, f"a report of the {kind}")
    assert not bench.received["gear_response"]

    start_ns = 100 * 10**9
    bench.tick(start_ns)
    # Steps of the publishing period and multiples of it: no sample falls between two of them.
    now_ns = start_ns
    for ticks in [1] * 50 + [7] * 10 + [25] * 4:
        now_ns += ticks * TICK_NS
        bench.tick(now_ns)
    assert stamps(bench) == list(range(start_ns, now_ns + 1, TICK_NS))

    # The clock stands: so does the simulation, but the nodes report.
    bench.await_diagnostic("simulator: motion", lambda status: True, "a report")
    assert stamps(bench)[-1] == now_ns

    # Back and far ahead: the simulation goes on from there.
    for jump_ns in (20 * 10**9, 3000 * 10**9):
        count = len(stamps(bench))
        now_ns = bench.jump(jump_ns)
        now_ns += 5 * TICK_NS
        bench.tick(now_ns)
        later = stamps(bench)[count:]
        assert jump_ns <= later[0]
        assert later == list(range(later[0], now_ns + 1, TICK_NS))
    bench.await_diagnostic(
        "simulator: motion",
        lambda status: {item.key: item.value for item in status.values}["clock jumps"] == "2",
        "the jumps to be counted")
