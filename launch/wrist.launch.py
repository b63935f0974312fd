"""`ros2 launch wrist_stiffness wrist.launch.py [cell:=true]`: the nodes, and the virtual cell."""

from launch import LaunchDescription
from launch.actions import DeclareLaunchArgument
from launch.conditions import IfCondition
from launch.substitutions import LaunchConfiguration
from launch_ros.actions import Node

from wrist_stiffness.workflows.node_list import SIMULATOR_NODE, WRIST_NODES, NodeEntry


def start(entry: NodeEntry, condition: IfCondition | None = None) -> Node:
    """Return the launch action of one entry of the node list."""
    return Node(
        package="wrist_stiffness",
        executable=entry.executable,
        name=entry.name,
        parameters=[entry.parameters],
        remappings=list(entry.remappings),
        condition=condition,
    )


def generate_launch_description() -> LaunchDescription:
    """Return all nodes; the simulator only with `cell:=true`."""
    return LaunchDescription(
        [
            DeclareLaunchArgument(
                "cell", default_value="false", description="start the virtual wrist as well"
            ),
            *(start(entry) for entry in WRIST_NODES),
            start(SIMULATOR_NODE, IfCondition(LaunchConfiguration("cell"))),
        ]
    )
