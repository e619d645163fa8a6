"""A bare node that answers a velocity with the predictor's messages, their numbers constant."""

from __future__ import annotations

import contextlib
import sys

import rclpy
from diagnostic_msgs.msg import DiagnosticArray, DiagnosticStatus, KeyValue
from geometry_msgs.msg import TwistStamped
from rclpy.executors import ExternalShutdownException
from sensor_msgs.msg import JointState
from std_msgs.msg import Float64
from trajectory_msgs.msg import JointTrajectory, JointTrajectoryPoint

from shimmy_ros.contract.answers import ORBIT_INTERVALS
from shimmy_ros.contract.records import JOINTS
from shimmy_ros.contract.spec import load_contract
from shimmy_ros.nodes.interface import qos_profile


def main() -> int:
    """Echo until interrupted."""
    rclpy.init()
    node = rclpy.create_node("echo")
    contract = load_contract()
    numbers = [0.1, 0.2, 0.3, 0.4]
    names = list(JOINTS)
    amplitude = JointState(name=names, position=numbers, velocity=numbers)
    frequency = Float64(data=12.0)
    orbit = JointTrajectory(joint_names=names, points=[
        JointTrajectoryPoint(positions=numbers, velocities=numbers)
        for _ in range(ORBIT_INTERVALS + 1)])
    status = DiagnosticArray(status=[DiagnosticStatus(
        name="echo: status", hardware_id="echo", message="limit cycle found",
        values=[KeyValue(key=f"key {i}", value="0.123456789") for i in range(10)])])
    messages = {"limit_cycle/amplitude": amplitude, "limit_cycle/frequency": frequency,
                "limit_cycle/orbit": orbit, "limit_cycle/status": status}
    publishers = {
        name: node.create_publisher(type(message), name, qos_profile(contract.topic(name).qos))
        for name, message in messages.items()}

    def answer(sample: TwistStamped) -> None:
        for name, message in messages.items():
            if name != "limit_cycle/frequency":
                message.header.stamp = sample.header.stamp
            publishers[name].publish(message)

    node.create_subscription(TwistStamped, "taxi_velocity", answer,
                             qos_profile(contract.topic("taxi_velocity").qos))
    with contextlib.suppress(KeyboardInterrupt, ExternalShutdownException):
        rclpy.spin(node)
    return 0


if __name__ == "__main__":
    sys.exit(main())
