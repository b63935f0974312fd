"""The nodes of a wrist and of the virtual cell: one list for the launch file and for `cell`."""

from __future__ import annotations

import sys
from collections.abc import Mapping
from dataclasses import dataclass, field, replace

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
    """One node to start.

    Parameters
    ----------
    executable : str
        Name of the executable and of the module in `wrist_stiffness.ros`.
    name : str
        Name of the node.
    parameters : dict
        Values by parameter name.
    remappings : tuple of (str, str)
        (standard, actual) topic names.
    """

    executable: str
    name: str
    parameters: dict[str, ParameterValue] = field(default_factory=dict)
    remappings: tuple[tuple[str, str], ...] = ()

    def having(self, parameters: Mapping[str, ParameterValue]) -> NodeEntry:
        """Return the same entry with further parameters."""
        return replace(self, parameters={**self.parameters, **parameters})

    def command(self) -> list[str]:
        """Return the process arguments that start this node with the running interpreter."""
        arguments = [sys.executable, "-m", f"wrist_stiffness.ros.{self.executable}", "--ros-args"]
        arguments += ["-r", f"__node:={self.name}"]
        for parameter, value in self.parameters.items():
            text = str(value).lower() if isinstance(value, bool) else str(value)
            arguments += ["-p", f"{parameter}:={text}"]
        for standard, actual in self.remappings:
            arguments += ["-r", f"{standard}:={actual}"]
        return arguments


WRIST_NODES = tuple(
    NodeEntry(executable=name, name=name)
    for name in ("pose_error_predictor", "angle_corrector", "model_monitor")
)
"""The nodes beside a real wrist."""

SIMULATOR_NODE = NodeEntry(executable="cell_simulator", name="cell_simulator")
"""The virtual wrist, with its motors, load and pose sensor."""

RECORDER_NODE = NodeEntry(executable="recorder", name="recorder")
"""Writes the wrist's topics into a recording; `ros2 bag` does where ROS is installed."""
