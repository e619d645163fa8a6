"""Checks what the demo left: one picture and one bag that two independent readers agree on."""

import sys
from collections import Counter
from pathlib import Path

from mcap.reader import make_reader
from mcap_ros2.decoder import DecoderFactory
from rosbags.highlevel import AnyReader

TOPICS = {
    "/shimmy/taxi_velocity": "geometry_msgs/msg/TwistStamped",
    "/shimmy/damper/linear_damping": "std_msgs/msg/Float64",
    "/shimmy/damper/quadratic_damping": "std_msgs/msg/Float64",
    "/shimmy/damper/coulomb_torque": "std_msgs/msg/Float64",
    "/shimmy/gear_response": "sensor_msgs/msg/JointState",
    "/shimmy/limit_cycle/amplitude": "sensor_msgs/msg/JointState",
    "/shimmy/limit_cycle/frequency": "std_msgs/msg/Float64",
    "/shimmy/limit_cycle/orbit": "trajectory_msgs/msg/JointTrajectory",
    "/shimmy/limit_cycle/status": "diagnostic_msgs/msg/DiagnosticArray",
}


def read_with_rosbags(bag):
    """Messages of each topic and type, every one deserialised."""
    counts = Counter()
    with AnyReader([bag]) as reader:
        for connection, _, raw in reader.messages():
            reader.deserialize(raw, connection.msgtype)
            counts[connection.topic, connection.msgtype] += 1
    return counts


def read_with_mcap_ros2(bag):
    """The same from the MCAP files alone, without metadata.yaml."""
    counts = Counter()
    for file in sorted(bag.glob("*.mcap")):
        with file.open("rb") as stream:
            reader = make_reader(stream, decoder_factories=[DecoderFactory()])
            for schema, channel, _, _ in reader.iter_decoded_messages():
                counts[channel.topic, schema.name] += 1
    return counts


def main():
    """Exit with a sentence about the first thing that is wrong."""
    out = Path(sys.argv[1])
    bags = [metadata.parent for metadata in out.rglob("metadata.yaml")]
    pictures = [picture for picture in out.rglob("*.png") if picture.stat().st_size > 0]
    if len(bags) != 1 or len(pictures) != 1:
        sys.exit(f"{out} holds {len(bags)} bags and {len(pictures)} pictures, not one of each")
    counts = read_with_rosbags(bags[0])
    # The demo changes the damper, but not by each of its parameters.
    missing = [
        topic
        for topic, msgtype in TOPICS.items()
        if not counts[topic, msgtype] and "/damper/" not in topic
    ]
    if missing:
        sys.exit(f"{bags[0]} has no message of {', '.join(missing)}")
    if not any("/damper/" in topic for topic, _ in counts):
        sys.exit(f"{bags[0]} has no change of the damper")
    strangers = sorted(set(counts) - set(TOPICS.items()))
    if strangers:
        sys.exit(f"{bags[0]} has messages of unknown topic or type: {strangers}")
    if counts != read_with_mcap_ros2(bags[0]):
        sys.exit(f"rosbags and mcap-ros2-support do not find the same messages in {bags[0]}")
    print(f"{bags[0]}: {counts.total()} messages of {len(counts)} topics, read by two readers")


main()
