"""Velocities in messages of any type."""

from __future__ import annotations

import numpy as np
import pytest
from rosbags.typesys import Stores, get_typestore

from shimmy_ros.bag.errors import BagError
from shimmy_ros.bag.message import BagMessage, Channel
from shimmy_ros.contract.records import MessageError, TaxiVelocity
from shimmy_ros.replay.fields import velocity_reader

STORE = get_typestore(Stores.ROS2_JAZZY)
LOG_NS, STAMP_NS = 7_000_000_000, 5_000_000_001


def build(type_name, **fields):
    """A message whose other fields are zero or empty."""
    values = {}
    for name, (kind, detail) in STORE.fielddefs[type_name][1]:
        if name in fields:
            values[name] = fields[name]
        elif kind.name == "BASE":
            values[name] = "" if detail[0] == "string" else 0
        elif kind.name == "NAME":
            values[name] = build(detail)
        else:
            values[name] = np.zeros(0 if kind.name == "SEQUENCE" else detail[1])
    return STORE.types[type_name](**values)


def stamped(type_name, nanoseconds=STAMP_NS, **fields):
    time = build("builtin_interfaces/msg/Time", sec=nanoseconds // 10**9,
                 nanosec=nanoseconds % 10**9)
    return build(type_name, header=build("std_msgs/msg/Header", stamp=time), **fields)


def twist(velocity):
    return build("geometry_msgs/msg/Twist", linear=build("geometry_msgs/msg/Vector3", x=velocity))


def channel(type_name):
    text, _ = STORE.generate_msgdef(type_name, ros_version=2)
    return Channel("/v", type_name, "cdr", text.encode(), "ros2msg")


def read(message, field=""):
    of = channel(message.__msgtype__)
    data = bytes(STORE.serialize_cdr(message, message.__msgtype__))
    return velocity_reader(of, field)(BagMessage(of, LOG_NS, LOG_NS, data))


@pytest.mark.parametrize(("message", "field", "stamp"), [
    (stamped("geometry_msgs/msg/TwistStamped", twist=twist(33.5)), "", STAMP_NS),
    (twist(33.5), "", LOG_NS),
    (stamped("nav_msgs/msg/Odometry", twist=build(
        "geometry_msgs/msg/TwistWithCovariance", twist=twist(33.5), covariance=np.zeros(36)),
        pose=build("geometry_msgs/msg/PoseWithCovariance", covariance=np.zeros(36))), "", STAMP_NS),
    (build("std_msgs/msg/Float64", data=33.5), "", LOG_NS),
    (build("std_msgs/msg/Float32", data=33.5), "data", LOG_NS),
    (build("std_msgs/msg/Int16", data=33), "data", LOG_NS),
    (build("std_msgs/msg/Float64MultiArray", data=np.array([1.0, 33.5])), "data[1]", LOG_NS),
    (stamped("sensor_msgs/msg/JointState", name=["a"], velocity=np.array([33.5]),
             position=np.zeros(0), effort=np.zeros(0)), "velocity[0]", STAMP_NS),
    (stamped("trajectory_msgs/msg/JointTrajectory", joint_names=[], points=[
        build("trajectory_msgs/msg/JointTrajectoryPoint", velocities=np.array([0.0, 33.5]))]),
        "points[0].velocities[1]", STAMP_NS),
    (stamped("geometry_msgs/msg/TwistStamped", twist=twist(1.0)), "header.stamp.sec", STAMP_NS),
    (stamped("geometry_msgs/msg/TwistStamped", 0, twist=twist(33.5)), "", 0),
])
def test_a_velocity_is_found(message, field, stamp):
    expected = {"data": 33.0}.get(field) if "Int16" in message.__msgtype__ else 33.5
    if field == "header.stamp.sec":
        expected = 5.0
    assert read(message, field) == TaxiVelocity(stamp, expected)


@pytest.mark.parametrize(("type_name", "field", "sentence"), [
    ("sensor_msgs/msg/Imu", "", "must be one of geometry_msgs/msg/TwistStamped, .*/v:field.path"),
    ("geometry_msgs/msg/Twist", "linear.w", "which has no field linear.w; it has linear, angular"),
    ("geometry_msgs/msg/Twist", "linear", "field linear of topic /v is no number"),
    ("geometry_msgs/msg/Twist", "linear.x.y", "has no field linear.x.y"),
    ("geometry_msgs/msg/Twist", "linear[0]", r"has no field linear\[0\]"),
    ("std_msgs/msg/String", "data", "field data of topic /v is no number"),
    ("std_msgs/msg/Bool", "data", "field data of topic /v is no number"),
    ("std_msgs/msg/Float64MultiArray", "data", "field data of topic /v is no number"),
    *[("geometry_msgs/msg/Twist", path, "is no path such as twist.linear.x")
      for path in (".", "linear..x", ".linear.x", "linear.", "a b", "[0]", "data[x]", "data[-1]")],
])
def test_what_is_no_number_is_refused(type_name, field, sentence):
    with pytest.raises(BagError, match=sentence):
        velocity_reader(channel(type_name), field)


def test_messages_without_the_number_are_refused():
    with pytest.raises(MessageError, match=r"no value \[3\], but 2 values"):
        read(build("std_msgs/msg/Float64MultiArray", data=np.zeros(2)), "data[3]")
    of = channel("geometry_msgs/msg/TwistStamped")
    with pytest.raises(MessageError, match="7 bytes are no geometry_msgs/msg/TwistStamped"):
        velocity_reader(of)(BagMessage(of, 0, 0, b"\0\1\0\0abc"))
    late = stamped("geometry_msgs/msg/TwistStamped", twist=twist(1.0))
    late.header.stamp.nanosec = 10**9
    with pytest.raises(MessageError, match="nanosec of a stamp is 1000000000"):
        read(late)
