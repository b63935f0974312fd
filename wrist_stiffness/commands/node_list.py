"""The nodes of a wrist and of the virtual cell: one list for the launch file and for `cell`."""

from __future__ import annotations

import sys
from collections.abc import Iterable, Mapping
from dataclasses import dataclass, field, replace

from wrist_stiffness.errors import InputError, meant

RATES_HZ = (1.0, 2000.0)
"""Slowest and fastest samples of the virtual cell."""

LARGEST_SEED = 2**31 - 1
"""Of the virtual cell; a ROS parameter holds it, and so does every seed of NumPy."""

UNANSWERED = 3
"""Exit code of the virtual cell after a run in which a node fell silent."""

ParameterValue = bool | int | float | str

PARENT_PID = "WRIST_STIFFNESS_PARENT"
"""Environment variable: the process with which a node shall end, however that ends."""


@dataclass(frozen=True)
class NodeEntry:
    """One node to start."""

    name: str  # of the node, of its executable and of the module in `wrist_stiffness.ros`
    parameters: dict[str, ParameterValue] = field(default_factory=dict)  # values by parameter name

    def having(self, parameters: Mapping[str, ParameterValue]) -> NodeEntry:
        """Return the same entry with further parameters."""
        return replace(self, parameters={**self.parameters, **parameters})

    def command(self) -> list[str]:
        """Return the process arguments that start this node with the running interpreter."""
        arguments = [sys.executable, "-m", "wrist_stiffness.ros.start", self.name]
        arguments += ["--ros-args", "-r", f"__node:={self.name}"]
        for parameter, value in self.parameters.items():
            text = str(value).lower() if isinstance(value, bool) else str(value) or "''"
            arguments += ["-p", f"{parameter}:={text}"]
        return arguments


LAUNCH_ARGUMENTS = {
    "model_file": ("", "model of all nodes; empty for that of the parameters, or the shipped one"),
    "params_file": ("", "ROS 2 parameter file for all nodes"),
    "namespace": ("", "of the nodes and their topics, so that wrists live side by side"),
    "frame_prefix": ("", "before the names of frames; empty for NAMESPACE/ where there is one"),
    "use_sim_time": ("false", "take the time from /clock"),
    "respawn": ("false", "start a node again that ended"),
    "cell": ("false", "start the virtual wrist as well"),
}
"""Of the launch file: default and meaning by name."""

CELL_PARAMETERS: dict[str, ParameterValue] = {
    "load_policy": "follow",
    "tare_needed": False,
    "state_folder": "",
    "command_age_limit_s": 0.0,
}
"""The virtual cell's loads are weights: they do not depend on the motion, so there is no loop; and
they come tared.  Its time is that of its samples, which falls behind on a busy machine."""


def truth(name: str, text: str) -> bool:
    """Return what a launch argument says that is true or false (InputError if neither)."""
    values = {"true": True, "1": True, "false": False, "0": False}
    if text.lower() not in values:
        raise InputError(f"{name}: {text!r} is neither true nor false")
    return values[text.lower()]


def unknown_arguments(given: Iterable[str]) -> list[str]:
    """Return a warning for each launch argument that the launch file does not know.

    It may be one of a launch file that includes it: so it is no error.
    """
    warnings = []
    for name in given:
        if name not in LAUNCH_ARGUMENTS:
            guess = meant(name, LAUNCH_ARGUMENTS)
            warnings.append(f"WARNING: wrist.launch.py has no argument {name}{guess}")
    return warnings


WRIST_NODES = tuple(
    NodeEntry(name) for name in ("pose_error_predictor", "angle_corrector", "model_monitor")
)
"""The nodes beside a real wrist."""

SIMULATOR_NODE = NodeEntry("cell_simulator")
"""The virtual wrist, with its motors, load and pose sensor."""

RECORDER_NODE = NodeEntry("recorder")
"""Writes the wrist's topics into a recording; `ros2 bag` does where ROS is installed."""
