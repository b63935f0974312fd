"""`ros2 launch wrist_stiffness wrist.launch.py`: the nodes of one wrist, and the virtual cell."""

from launch import LaunchContext, LaunchDescription
from launch.actions import DeclareLaunchArgument, LogInfo, OpaqueFunction
from launch_ros.actions import Node

from wrist_stiffness.commands.node_list import (
    CELL_PARAMETERS,
    LAUNCH_ARGUMENTS,
    SIMULATOR_NODE,
    WRIST_NODES,
    truth,
    unknown_arguments,
)
from wrist_stiffness.commands.parameter_file import not_meant


def start(context: LaunchContext) -> list[LogInfo | Node]:
    """Return the actions that start the nodes with the arguments that were given."""
    given = context.launch_configurations
    cell = truth("cell", given["cell"])
    simulated = {"use_sim_time": truth("use_sim_time", given["use_sim_time"])}
    namespace = given["namespace"].strip("/")
    prefix = given["frame_prefix"] or (f"{namespace}/" if namespace else "")
    parameters: list[dict[str, object] | str] = [simulated, {"frame_prefix": prefix}]
    if given["params_file"]:
        parameters.append(given["params_file"])
    if given["model_file"]:
        parameters.append({"model_file": given["model_file"]})
    entries = [*WRIST_NODES, *([SIMULATOR_NODE] if cell else [])]
    warnings = unknown_arguments(given)
    if given["params_file"]:
        names = [f"/{namespace}/{entry.name}".replace("//", "/") for entry in entries]
        warnings += not_meant(given["params_file"], names)
    nodes = [
        Node(
            package="wrist_stiffness",
            executable=entry.name,
            name=entry.name,
            namespace=given["namespace"],
            parameters=[*([CELL_PARAMETERS] if cell else []), entry.parameters, *parameters],
            respawn=truth("respawn", given["respawn"]),
            respawn_delay=1.0,
        )
        for entry in entries
    ]
    return [*(LogInfo(msg=line) for line in warnings), *nodes]


def generate_launch_description() -> LaunchDescription:
    """Return the arguments, and what is started with them."""
    arguments = [
        DeclareLaunchArgument(name, default_value=default, description=text)
        for name, (default, text) in LAUNCH_ARGUMENTS.items()
    ]
    return LaunchDescription([*arguments, OpaqueFunction(function=start)])
