"""The real nodes as processes, alone in a DDS domain, and a bench that talks to them.

Every test waits for what it expects to happen, for as long as a loaded machine may need.
"""

from __future__ import annotations

import importlib
import math
import os
import signal
import subprocess
import sys
import time
import warnings
from collections import defaultdict
from pathlib import Path
from types import SimpleNamespace

import pytest
import yaml

from shimmy_ros.cycles.prediction import Predictor
from shimmy_ros.gear.parameter_file import reference_parameters
from shimmy_ros.gear.system import OperatingPoint
from shimmy_ros.nodes.domain import OwnDomain

ROOT = Path(__file__).parents[2]
CONTRACT = yaml.safe_load((ROOT / "msgs_spec" / "topics.yaml").read_text(encoding="utf-8"))
TOPICS = {topic["name"]: topic for topic in CONTRACT["topics"]}
NAMESPACE = "/test"
PATIENCE_S = 60.0
RESEND_S = 2.0
ANSWERS = ("limit_cycle/amplitude", "limit_cycle/frequency", "limit_cycle/orbit",
           "limit_cycle/status")


def load(type_name):
    """The class of a type such as std_msgs/msg/Float64."""
    package, kind, name = type_name.split("/")
    return getattr(importlib.import_module(f"{package}.{kind}"), name)


def _program(kind):
    """What Python has to run for a node of shimmy_ros, or for one that the tests make of it."""
    own = Path(__file__).with_name(f"{kind}.py")
    return [str(own)] if own.exists() else ["-m", f"shimmy_ros.nodes.{kind}"]


class NodeProcess:
    """A node of shimmy_ros as a process of its own; what it prints and logs is in ``log()``."""

    def __init__(self, kind, arguments, environment, directory):
        self.kind = kind
        self._log = directory / f"{kind}_{time.monotonic_ns()}.log"
        with self._log.open("w") as log:
            self._process = subprocess.Popen(
                [sys.executable, *_program(kind), "--ros-args", "-r", f"__ns:={NAMESPACE}",
                 *arguments],
                env=environment, cwd=directory, stdin=subprocess.DEVNULL, stdout=log, stderr=log)

    @property
    def ended(self):
        return self._process.poll() is not None

    @property
    def number(self):
        """The process id."""
        return self._process.pid

    def log(self):
        return self._log.read_text(errors="replace")

    def send_signal(self, number):
        self._process.send_signal(number)

    def wait(self):
        """Its exit status, once it has ended of its own accord."""
        return self._process.wait(PATIENCE_S)

    def stop(self, number=signal.SIGINT):
        self.send_signal(number)
        return self.wait()

    def kill(self):
        self._process.kill()
        self._process.wait()


class Bench:
    """Sends what a rig sends, with rclpy's own messages, and collects what comes back.

    ``received`` has the messages of each topic that listen() named, in their order.
    """

    def __init__(self, domain):
        rclpy = importlib.import_module("rclpy")
        executors = importlib.import_module("rclpy.executors")
        node = importlib.import_module("rclpy.node")
        self._qos = importlib.import_module("rclpy.qos")
        self._context = rclpy.Context()
        rclpy.init(args=[], context=self._context, domain_id=domain.number)
        self.node = node.Node("bench", namespace=NAMESPACE, context=self._context)
        self._executor = executors.SingleThreadedExecutor(context=self._context)
        self._executor.add_node(self.node)
        self.received = defaultdict(list)
        self._subscriptions = {}
        self._publishers = {}
        self._clients = {}
        self._stamp = 1000

    def close(self):
        self._executor.shutdown()
        self.node.destroy_node()
        self._context.try_shutdown()

    def wait_until(self, condition, what, patience_s=PATIENCE_S):
        """Spin until ``condition`` holds; returns what it gave."""
        end = time.monotonic() + patience_s
        while not (result := condition()):
            assert time.monotonic() < end, f"waited {patience_s:g} s in vain for {what}"
            self._executor.spin_once(timeout_sec=0.02)
        return result

    def spin_for(self, seconds):
        """Listen for a while, to see that something does not come."""
        end = time.monotonic() + seconds
        while time.monotonic() < end:
            self._executor.spin_once(timeout_sec=0.01)

    def drain(self, topic, quiet_s=0.3):
        """Take what is on its way, until nothing has come for a while."""
        before = -1
        while len(self.received[topic]) != before:
            before = len(self.received[topic])
            self.spin_for(quiet_s)

    def profile(self, topic, depth=5000):
        """The contract's QoS, with a queue that loses nothing while the machine is busy."""
        qos, policy = TOPICS[topic]["qos"], self._qos
        return policy.QoSProfile(
            depth=depth, history=policy.HistoryPolicy[qos["history"].upper()],
            reliability=policy.ReliabilityPolicy[qos["reliability"].upper()],
            durability=policy.DurabilityPolicy[qos["durability"].upper()])

    def listen(self, *topics):
        for topic in topics:
            self._subscriptions[topic] = self.node.create_subscription(
                load(TOPICS[topic]["type"]), topic, self.received[topic].append,
                self.profile(topic))

    def publisher(self, topic):
        if topic not in self._publishers:
            self._publishers[topic] = self.node.create_publisher(
                load(TOPICS[topic]["type"]), topic, self.profile(topic))
        return self._publishers[topic]

    def create_clock_publisher(self):
        return self.node.create_publisher(load("rosgraph_msgs/msg/Clock"), "/clock", 10)

    def join(self, *kinds):
        """Wait until the nodes and the bench have found each other on every topic."""
        # The simulator listens to what it records, too.
        inputs = {name: sum((kind in topic["subscribers"])
                            + (kind == "simulator" and topic["recorded"]) for kind in kinds)
                  for name, topic in TOPICS.items() if "rig" in topic["publishers"]}
        answers = {topic: sum(kind in TOPICS[topic]["publishers"] for kind in kinds)
                   for topic in self._subscriptions}
        self.wait_until(
            lambda: all(self.publisher(name).get_subscription_count() == count
                        for name, count in inputs.items())
            and all(self._subscriptions[topic].get_publisher_count() == count
                    for topic, count in answers.items()),
            f"{' and '.join(kinds)} to join")

    # --- the rig's part -------------------------------------------------------------------

    def stamp(self):
        """A new stamp in s, later than any before."""
        self._stamp += 1
        return self._stamp

    def send_velocity(self, velocity, stamp=None):
        """Send a sample; returns its stamp [s]."""
        message = load("geometry_msgs/msg/TwistStamped")()
        message.header.stamp.sec = self.stamp() if stamp is None else stamp
        message.twist.linear.x = float(velocity)
        self.publisher("taxi_velocity").publish(message)
        return message.header.stamp.sec

    def send_damper(self, name, value):
        self.publisher(f"damper/{name}").publish(load("std_msgs/msg/Float64")(data=float(value)))

    def ask(self, velocity):
        """Send a velocity and return the predictor's whole answer to it."""
        stamp, sent_at = self.stamp(), -math.inf

        def answered():
            nonlocal sent_at
            if time.monotonic() > sent_at + RESEND_S:  # a best-effort sample may be lost
                self.send_velocity(velocity, stamp)
                sent_at = time.monotonic()
            return self.answer(stamp)

        return self.wait_until(answered, f"an answer to {velocity} m/s")

    def answer(self, stamp):
        """The last answer if it carries ``stamp`` [s] and all of it is there, and else None."""
        messages = {name.split("/")[1]: self.received[name][-1:] for name in ANSWERS}
        if not all(messages.values()):
            return None
        answer = SimpleNamespace(**{name: found[0] for name, found in messages.items()})
        if {message.header.stamp.sec
                for message in (answer.amplitude, answer.orbit, answer.status)} != {stamp}:
            return None
        # The frequency has no stamp, but belongs to an orbit of its period.
        period = [point.time_from_start for point in answer.orbit.points][-1:]
        cycles = [(time.sec + 1e-9 * time.nanosec) * answer.frequency.data for time in period]
        if math.isnan(answer.frequency.data) == bool(cycles) or any(
                abs(count - 1.0) > 1e-6 for count in cycles):
            return None
        answer.values = values_of(answer.status.status[0])
        return answer

    def await_answer(self, condition, what):
        """Wait for an answer that meets ``condition`` and return it."""
        def found():
            status = self.received["limit_cycle/status"]
            answer = self.answer(status[-1].header.stamp.sec) if status else None
            return answer if answer is not None and condition(answer) else None

        return self.wait_until(found, what)

    # --- services -------------------------------------------------------------------------

    def call(self, service, type_name, **request):
        """Call a service once and return its response."""
        type_ = load(type_name)
        if service not in self._clients:
            self._clients[service] = self.node.create_client(type_, service)
        client = self._clients[service]
        self.wait_until(client.service_is_ready, f"service {service}")
        future = client.call_async(type_.Request(**request))
        self.wait_until(future.done, f"a response of {service}")
        return future.result()

    def parameter_messages(self, **values):
        """Parameters for a request; ``a__b`` stands for a.b."""
        parameter = importlib.import_module("rclpy.parameter").Parameter
        return [parameter(name.replace("__", "."), value=value).to_parameter_msg()
                for name, value in values.items()]

    def set_parameters(self, node, **values):
        """Set parameters one after the other; returns success and reason of each."""
        results = self.call(f"{node}/set_parameters", "rcl_interfaces/srv/SetParameters",
                            parameters=self.parameter_messages(**values)).results
        return [(result.successful, result.reason) for result in results]

    def get_parameters(self, node, *names):
        response = self.call(f"{node}/get_parameters", "rcl_interfaces/srv/GetParameters",
                             names=names)
        value = importlib.import_module("rclpy.parameter").parameter_value_to_python
        return [value(item) for item in response.values]

    def change_state(self, node, transition):
        """Ask for a lifecycle transition by its name; whether it succeeded."""
        number = getattr(load("lifecycle_msgs/msg/Transition"), f"TRANSITION_{transition.upper()}")
        return self.call(f"{node}/change_state", "lifecycle_msgs/srv/ChangeState",
                         transition=load("lifecycle_msgs/msg/Transition")(id=number)).success

    def state(self, node):
        """The name of the lifecycle state."""
        return self.call(f"{node}/get_state", "lifecycle_msgs/srv/GetState").current_state.label

    # --- diagnostics ----------------------------------------------------------------------

    def await_diagnostics(self, conditions, what, meanwhile=lambda: None):
        """Wait for a status of each part from now on that meets its condition; returns them.

        ``meanwhile`` is done again and again.
        """
        reports = self.received["/diagnostics"]
        begin = len(reports)
        found = {}

        def all_found():
            meanwhile()
            for report in reports[begin:]:
                for status in report.status:
                    if status.name in conditions and conditions[status.name](status):
                        found[status.name] = status
            return len(found) == len(conditions)

        self.wait_until(all_found, what)
        return found

    def await_diagnostic(self, part, condition, what, meanwhile=lambda: None):
        """Wait for a status of one part."""
        return self.await_diagnostics({part: condition}, what, meanwhile)[part]


def values_of(status):
    """The key-value pairs of a DiagnosticStatus."""
    return {item.key: item.value for item in status.values}


class Stage:
    """A domain with a bench in it; every node that is started here is ended here."""

    def __init__(self, directory):
        self.directory = directory
        self.domain = OwnDomain()
        self.bench = Bench(self.domain)
        self._nodes = []

    def start(self, kind, *arguments, **parameters):
        """Start a node; ``a__b=1.0`` sets its parameter a.b."""
        given = [word for name, value in parameters.items()
                 for word in ("-p", f"{name.replace('__', '.')}:={value}")]
        environment = os.environ | {"ROS_DOMAIN_ID": str(self.domain.number)}
        node = NodeProcess(kind, [*given, *arguments], environment, self.directory)
        self._nodes.append(node)
        return node

    def close(self):
        """End what still runs, as a user would; each has to end with status 0."""
        running = [node for node in self._nodes if not node.ended]
        try:
            for node in running:
                node.send_signal(signal.SIGINT)
            statuses = {node.kind: node.wait() for node in running}
        finally:
            for node in running:
                node.kill()
            self.bench.close()
            self.domain.close()
        logs = "\n".join(node.log() for node in self._nodes)
        assert not any(statuses.values()), f"{statuses}\n{logs}"
        assert "Traceback" not in logs, logs


@pytest.fixture(scope="session", autouse=True)
def isolation(tmp_path_factory):
    """Nothing speaks beyond this host, and the logs go where they are cleaned up."""
    pytest.importorskip("rclpy", reason="the nodes need ROS 2 Jazzy's rclpy")
    with warnings.catch_warnings():
        # The generated messages import a lark that is older than Python 3.11.
        warnings.simplefilter("ignore", DeprecationWarning)
        importlib.import_module("rosidl_generator_py")
    # Compiles the solver for the nodes, too, whose first answer would be late otherwise.
    predictor, (gear, damper) = Predictor(), reference_parameters()
    for velocity in (40.0, 41.0):
        predictor.predict(OperatingPoint(gear, damper, velocity))
    with pytest.MonkeyPatch.context() as patch:
        patch.setenv("ROS_AUTOMATIC_DISCOVERY_RANGE", "LOCALHOST")
        patch.setenv("ROS_LOG_DIR", str(tmp_path_factory.mktemp("ros_log")))
        patch.delenv("ROS_STATIC_PEERS", raising=False)
        yield


@pytest.fixture
def stage(tmp_path):
    """A stage for one test."""
    stage = Stage(tmp_path)
    yield stage
    stage.close()


@pytest.fixture(scope="module")
def module_stage(tmp_path_factory):
    """A stage for all tests of a module."""
    stage = Stage(tmp_path_factory.mktemp("stage"))
    yield stage
    stage.close()


@pytest.fixture
def values():
    """The key-value pairs of a DiagnosticStatus, as a function."""
    return values_of


@pytest.fixture(scope="module")
def both(module_stage):
    """Both nodes, and the bench that hears them."""
    nodes = {"predictor": module_stage.start("predictor"),
             "simulator": module_stage.start("simulator", record="false")}
    bench = module_stage.bench
    bench.listen("limit_cycle/amplitude", "limit_cycle/frequency", "limit_cycle/orbit",
                 "limit_cycle/status", "gear_response", "/diagnostics")
    bench.join("predictor", "simulator")
    return SimpleNamespace(bench=bench, nodes=nodes)
