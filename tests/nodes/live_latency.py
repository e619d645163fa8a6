"""Sends velocity samples at 50 Hz to a predictor and notes how long each answer takes.

    python tests/nodes/live_latency.py DOMAIN NAMESPACE VELOCITY OUT

Prints a line once the first sample is answered, goes on until its standard input ends, and writes
to OUT, as JSON, the number of samples sent since and the milliseconds from sending each to hearing
its amplitude. A process of its own, so that nothing else delays it.
"""

from __future__ import annotations

import json
import select
import sys
import time
from pathlib import Path

import rclpy
from rclpy.executors import SingleThreadedExecutor
from rclpy.node import Node

from shimmy_ros.contract.messages import CODECS
from shimmy_ros.contract.records import TaxiVelocity
from shimmy_ros.contract.spec import load_contract
from shimmy_ros.nodes.interface import message_class, qos_profile

PERIOD_S = 0.02
LAST_ANSWERS_S = 1.0
JOIN_S = 60.0


class Probe:
    """A node that sends samples and hears the answers."""

    def __init__(self, domain, namespace):
        self._context = rclpy.Context()
        rclpy.init(args=[], context=self._context, domain_id=domain)
        node = Node("probe", namespace=namespace, context=self._context)
        self._executor = SingleThreadedExecutor(context=self._context)
        self._executor.add_node(node)
        contract = load_contract()
        sample, answer = contract.topic("taxi_velocity"), contract.topic("limit_cycle/amplitude")
        self._publisher = node.create_publisher(
            message_class(sample.type), sample.name, qos_profile(sample.qos))
        node.create_subscription(
            message_class(answer.type), answer.name, self._take, qos_profile(answer.qos), raw=True)
        self._sent = {}
        self.milliseconds = []

    def join(self, velocity):
        """Send samples until one is answered."""
        end = time.perf_counter() + JOIN_S
        while not self.milliseconds:
            assert time.perf_counter() < end, "no predictor answers"
            self.send(velocity)
            self.listen(time.perf_counter() + PERIOD_S)
        self.listen(time.perf_counter() + PERIOD_S)
        self.milliseconds.clear()

    def send(self, velocity):
        stamp = time.time_ns()
        data = CODECS["taxi_velocity"].encode(TaxiVelocity(stamp, velocity))
        self._sent[stamp] = time.perf_counter()
        self._publisher.publish(data)

    def listen(self, until):
        while (left := until - time.perf_counter()) > 0.0:
            self._executor.spin_once(timeout_sec=left)

    def _take(self, data):
        now = time.perf_counter()
        sent = self._sent.pop(CODECS["limit_cycle/amplitude"].decode(data).stamp_ns, None)
        if sent is not None:
            self.milliseconds.append(1e3 * (now - sent))


def main(domain, namespace, velocity, out):
    probe = Probe(int(domain), namespace)
    probe.join(float(velocity))
    print("joined", flush=True)
    begin, count = time.perf_counter(), 0
    while not select.select([sys.stdin], [], [], 0.0)[0]:
        probe.send(float(velocity))
        count += 1
        probe.listen(begin + count * PERIOD_S)
    probe.listen(time.perf_counter() + LAST_ANSWERS_S)
    Path(out).write_text(json.dumps({"sent": count, "milliseconds": probe.milliseconds}))


if __name__ == "__main__":
    main(*sys.argv[1:])
