"""Starts predictor and simulator in one namespace; by default they are heard on this host alone.

`ros2 launch shimmy_ros shimmy_launch.py --show-args` lists the arguments.
"""

from launch import LaunchDescription
from launch.actions import DeclareLaunchArgument, OpaqueFunction, SetEnvironmentVariable
from launch.substitutions import LaunchConfiguration, PathJoinSubstitution
from launch_ros.actions import LifecycleNode
from launch_ros.substitutions import FindPackageShare

PACKAGE = "shimmy_ros"


def generate_launch_description():
    """The arguments, how far DDS reaches, and then the two nodes."""
    reference_gear = PathJoinSubstitution(
        [FindPackageShare(PACKAGE), "config", "reference_gear.yaml"]
    )
    return LaunchDescription(
        [
            DeclareLaunchArgument(
                "namespace", default_value="shimmy", description="Namespace of both nodes."
            ),
            DeclareLaunchArgument(
                "gear_file",
                default_value=reference_gear,
                description="Params file with the groups gear, damper and, if need be, limits.",
            ),
            DeclareLaunchArgument(
                "params_file",
                default_value="",
                description="A further params file for either node; overrides gear_file.",
            ),
            DeclareLaunchArgument(
                "bag_directory",
                default_value="",
                description="Where the simulator puts its bag; empty: as its parameters say.",
            ),
            DeclareLaunchArgument(
                "use_sim_time",
                default_value="false",
                choices=["true", "false"],
                description="Take the time from /clock.",
            ),
            DeclareLaunchArgument(
                "discovery_range",
                default_value="LOCALHOST",
                choices=["OFF", "LOCALHOST", "SUBNET", "SYSTEM_DEFAULT"],
                description="ROS_AUTOMATIC_DISCOVERY_RANGE; SUBNET reaches other hosts.",
            ),
            DeclareLaunchArgument(
                "static_peers",
                default_value="",
                description="ROS_STATIC_PEERS: further hosts, separated by semicolons.",
            ),
            SetEnvironmentVariable(
                "ROS_AUTOMATIC_DISCOVERY_RANGE", LaunchConfiguration("discovery_range")
            ),
            SetEnvironmentVariable("ROS_STATIC_PEERS", LaunchConfiguration("static_peers")),
            OpaqueFunction(function=_nodes),
        ]
    )


def _nodes(context):
    """Both nodes with the parameters that were asked for, and no others.

    An empty value handed to a node would hide the one in a params file.
    """

    def argument(name):
        return LaunchConfiguration(name).perform(context)

    files = [argument("gear_file")]
    if argument("params_file"):
        files.append(argument("params_file"))
    clock = {"use_sim_time": True} if argument("use_sim_time") == "true" else {}
    own = {"predictor": dict(clock), "simulator": dict(clock)}
    if argument("bag_directory"):
        own["simulator"]["bag_directory"] = argument("bag_directory")
    return [
        LifecycleNode(
            package=PACKAGE,
            executable=name,
            name=name,
            namespace=argument("namespace"),
            parameters=[*files, parameters] if parameters else files,
            output="screen",
        )
        for name, parameters in own.items()
    ]
