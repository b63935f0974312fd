"""Start a node by its name, so that a signal ends it cleanly while its libraries are being loaded.

That takes a second, in which Python itself would raise a KeyboardInterrupt wherever it happens to
be, or die of SIGTERM; `ros2 launch` calls both a crash.
"""

from __future__ import annotations

import os
import signal
import sys
from functools import partial
from importlib import import_module
from types import FrameType
from typing import NoReturn


def start(name: str) -> None:
    """Load the module of a node by its name, and run the node, a class of that name."""
    for number in (signal.SIGINT, signal.SIGTERM):
        signal.signal(number, _end)
    node = getattr(import_module(f"wrist_stiffness.ros.{name}"), name.title().replace("_", ""))
    import_module("wrist_stiffness.ros.run").run(node)


def _end(number: int, frame: FrameType | None) -> NoReturn:
    """End at once: nothing has been said or written yet.  `run` listens in its own way."""
    os._exit(0)


# The installed executables.
pose_error_predictor = partial(start, "pose_error_predictor")
angle_corrector = partial(start, "angle_corrector")
model_monitor = partial(start, "model_monitor")
cell_simulator = partial(start, "cell_simulator")


if __name__ == "__main__":
    start(sys.argv[1])
