"""The launch file, against stand-ins with the signatures of ROS 2 Jazzy's launch and launch_ros.

These are not on PyPI. The stand-ins accept only documented arguments and record what they are
given; that the real ones accept it too is checked where they are installed.
"""

import runpy
import sys
from dataclasses import dataclass, field
from pathlib import Path
from types import ModuleType

import pytest

ROOT = Path(__file__).resolve().parents[2]
LAUNCH_FILE = ROOT / "launch" / "shimmy_launch.py"


@dataclass
class LaunchDescription:
    entities: list


@dataclass
class LaunchConfiguration:
    name: str

    def perform(self, context):
        return context[self.name]


@dataclass
class FindPackageShare:
    package: str

    def perform(self, context):
        assert self.package == "shimmy_ros"
        return str(ROOT)


@dataclass
class PathJoinSubstitution:
    parts: list

    def perform(self, context):
        return str(Path(*(evaluate(part, context) for part in self.parts)))


@dataclass
class DeclareLaunchArgument:
    name: str
    default_value: object = field(kw_only=True)
    description: str = field(kw_only=True)
    choices: list | None = field(kw_only=True, default=None)


@dataclass
class SetEnvironmentVariable:
    name: str
    value: object


@dataclass(kw_only=True)
class OpaqueFunction:
    function: object


@dataclass(kw_only=True)
class LifecycleNode:
    package: str
    executable: str
    name: str
    namespace: str
    parameters: list
    output: str


STAND_INS = {
    "launch": [LaunchDescription],
    "launch.actions": [DeclareLaunchArgument, OpaqueFunction, SetEnvironmentVariable],
    "launch.substitutions": [LaunchConfiguration, PathJoinSubstitution],
    "launch_ros": [],
    "launch_ros.actions": [LifecycleNode],
    "launch_ros.substitutions": [FindPackageShare],
}


def evaluate(value, context):
    return value if isinstance(value, str) else value.perform(context)


@pytest.fixture
def launch(monkeypatch):
    """Execute the launch file with arguments; returns the environment and the nodes by name."""
    for name, members in STAND_INS.items():
        module = ModuleType(name)
        vars(module).update({member.__name__: member for member in members})
        monkeypatch.setitem(sys.modules, name, module)
    description = runpy.run_path(str(LAUNCH_FILE))["generate_launch_description"]()

    def execute(**arguments):
        context, environment, nodes = dict(arguments), {}, {}
        for entity in description.entities:
            if isinstance(entity, DeclareLaunchArgument):
                value = context.setdefault(entity.name, evaluate(entity.default_value, context))
                assert entity.choices is None or value in entity.choices
            elif isinstance(entity, SetEnvironmentVariable):
                assert not nodes, "the environment has to be set before a node starts"
                environment[entity.name] = evaluate(entity.value, context)
            else:
                nodes.update({node.name: node for node in entity.function(context)})
        return environment, nodes

    return execute


def test_by_default_both_nodes_start_on_the_reference_gear_and_on_this_host(launch):
    environment, nodes = launch()
    assert environment == {"ROS_AUTOMATIC_DISCOVERY_RANGE": "LOCALHOST", "ROS_STATIC_PEERS": ""}
    assert set(nodes) == {"predictor", "simulator"}
    for name, node in nodes.items():
        assert (node.package, node.executable, node.namespace) == ("shimmy_ros", name, "shimmy")
        assert node.parameters == [str(ROOT / "config" / "reference_gear.yaml")]
        assert Path(node.parameters[0]).is_file()


def test_arguments_reach_the_nodes(launch):
    environment, nodes = launch(
        namespace="rig/nose",
        gear_file="/gear.yaml",
        params_file="/nodes.yaml",
        bag_directory="/bags",
        use_sim_time="true",
        discovery_range="SUBNET",
        static_peers="10.0.0.2;10.0.0.3",
    )
    assert environment == {
        "ROS_AUTOMATIC_DISCOVERY_RANGE": "SUBNET",
        "ROS_STATIC_PEERS": "10.0.0.2;10.0.0.3",
    }
    assert {node.namespace for node in nodes.values()} == {"rig/nose"}
    files = ["/gear.yaml", "/nodes.yaml"]
    assert nodes["predictor"].parameters == [*files, {"use_sim_time": True}]
    assert nodes["simulator"].parameters == [
        *files,
        {"use_sim_time": True, "bag_directory": "/bags"},
    ]


def test_ros_itself_accepts_the_launch_file():
    pytest.importorskip("launch_ros.actions")
    description = runpy.run_path(str(LAUNCH_FILE))["generate_launch_description"]()
    names = {argument.name for argument in description.get_launch_arguments()}
    assert {"namespace", "gear_file", "params_file", "bag_directory", "use_sim_time"} <= names
