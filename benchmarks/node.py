"""Benchmarks of the predictor as a process: latency against a bare echo node, start, memory."""

from __future__ import annotations

import contextlib
import signal
import subprocess
import sys
import time
from collections.abc import Iterator
from pathlib import Path

import numpy as np
import rclpy
from geometry_msgs.msg import TwistStamped
from rclpy.executors import SingleThreadedExecutor
from sensor_msgs.msg import JointState

from shimmy_ros.contract.spec import load_contract
from shimmy_ros.nodes.domain import isolated_run
from shimmy_ros.nodes.interface import qos_profile

from .measuring import Spread, spread

_SECONDS = 8.0
_ROUNDS = 3


class Client:
    """Sends velocities and measures how long the answer with the same stamp takes."""

    def __init__(self, namespace: str) -> None:
        contract = load_contract()
        self.node = rclpy.create_node("client", namespace=namespace)
        self.executor = SingleThreadedExecutor()
        self.executor.add_node(self.node)
        self.publisher = self.node.create_publisher(
            TwistStamped, "taxi_velocity", qos_profile(contract.topic("taxi_velocity").qos))
        self.node.create_subscription(
            JointState, "limit_cycle/amplitude", self._answered,
            qos_profile(contract.topic("limit_cycle/amplitude").qos))
        self.sent: dict[int, float] = {}
        self.latencies: list[float] = []

    def wait(self) -> None:
        """Until the other side listens."""
        until = time.monotonic() + 60.0
        while not self.publisher.get_subscription_count():
            self.executor.spin_once(timeout_sec=0.01)
            if time.monotonic() > until:
                raise RuntimeError("nobody listens to the velocity")

    def send(self, number: int) -> None:
        """A velocity that changes a little from sample to sample."""
        message = TwistStamped()
        message.header.stamp.sec, message.header.stamp.nanosec = divmod(number, 10**9)
        message.twist.linear.x = 50.0 + 10.0 * float(np.sin(0.01 * (number % 10**6)))
        self.sent[number] = time.perf_counter()
        self.publisher.publish(message)

    def run(self, rate: float, seconds: float) -> np.ndarray:
        """Latencies [s] of the answers at a sending ``rate`` [Hz]."""
        self.sent.clear()
        self.latencies.clear()
        begun = time.perf_counter()
        first = 10**9 + int(time.monotonic() * 1e3) * 10**4
        count = int(seconds * rate)
        for number in range(count):
            due = begun + number / rate
            while (now := time.perf_counter()) < due:
                self.executor.spin_once(timeout_sec=due - now)
            self.send(first + number)
        until = time.perf_counter() + 1.0
        while time.perf_counter() < until:
            self.executor.spin_once(timeout_sec=0.05)
        if len(self.latencies) < 0.05 * count:
            raise RuntimeError(f"{len(self.latencies)} of {count} samples were answered")
        return np.array(self.latencies)

    def _answered(self, message: JointState) -> None:
        number = message.header.stamp.sec * 10**9 + message.header.stamp.nanosec
        sent = self.sent.pop(number, None)
        if sent is not None:
            self.latencies.append(time.perf_counter() - sent)


@contextlib.contextmanager
def process(module: str, namespace: str) -> Iterator[subprocess.Popen[bytes]]:
    """A node as a process of its own, ended by SIGINT."""
    child = subprocess.Popen([sys.executable, "-m", module, "--ros-args", "-r",
                              f"__ns:={namespace}", "--log-level", "warn"])
    try:
        yield child
    finally:
        child.send_signal(signal.SIGINT)
        child.wait(30)


def node_figures(memory_seconds: float) -> Iterator[tuple[str, Spread, str]]:
    """Latency at 100 Hz and 1 kHz, time to the first answer, memory over a long run at 1 kHz."""
    with isolated_run():
        rclpy.init()
        try:
            yield from _figures(memory_seconds)
        finally:
            rclpy.try_shutdown()


def _figures(memory_seconds: float) -> Iterator[tuple[str, Spread, str]]:
    client, echo = Client("/bench"), Client("/echo")
    started = time.monotonic()
    with process("shimmy_ros.nodes.predictor", "/bench") as predictor:
        client.wait()
        number = 1
        while not client.latencies:
            client.send(number)
            number += 1
            client.executor.spin_once(timeout_sec=0.02)
        first = time.monotonic() - started
        yield "first_answer_s", spread([first]), "from the start of the process"
        with process("benchmarks.echo", "/echo"):
            echo.wait()
            for rate, label in ((100.0, "100hz"), (1000.0, "1khz")):
                yield from _latencies(client, echo, rate, label)
        if memory_seconds > 0.0:
            client.run(1000.0, 5.0)
            before = _resident_mb(predictor.pid)
            client.run(1000.0, memory_seconds)
            after = _resident_mb(predictor.pid)
            yield ("memory_growth_mb", spread([after - before]),
                   f"{after:.1f} MB resident after {memory_seconds:g} s at 1 kHz")


def _latencies(client: Client, echo: Client, rate: float, label: str
               ) -> Iterator[tuple[str, Spread, str]]:
    ours, bare = [], []
    for _ in range(_ROUNDS):
        ours.append(client.run(rate, _SECONDS / _ROUNDS))
        bare.append(echo.run(rate, _SECONDS / _ROUNDS))
    for percent in (50, 99):
        ratios = [float(np.percentile(a, percent) / np.percentile(b, percent))
                  for a, b in zip(ours, bare, strict=True)]
        yield (f"latency_vs_echo_p{percent}_{label}", spread(ratios),
               f"{1e3 * np.percentile(np.concatenate(ours), percent):.2f} ms against "
               f"{1e3 * np.percentile(np.concatenate(bare), percent):.2f} ms")


def _resident_mb(pid: int) -> float:
    text = Path(f"/proc/{pid}/status").read_text(encoding="ascii")
    line = next(line for line in text.splitlines() if line.startswith("VmRSS"))
    return int(line.split()[1]) / 1024.0
