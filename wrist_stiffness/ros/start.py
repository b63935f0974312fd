"""Start a node by its name, so that a signal ends it cleanly while its libraries are being loaded.

That takes a second, in which Python itself would raise a KeyboardInterrupt wherever it happens to
be, or die of SIGTERM; `ros2 launch` calls both a crash.
"""

from __future__ import annotations

import os
import signal
import sys
from importlib import import_module
from types import FrameType
from typing import NoReturn


def start(name: str) -> None:
    """Load a module of `wrist_stiffness.ros` by its name, and run its node."""
    for number in (signal.SIGINT, signal.SIGTERM):
        signal.signal(number, _end)
    import_module(f"wrist_stiffness.ros.{name}").main()


def _end(number: int, frame: FrameType | None) -> NoReturn:
    """End at once: nothing has been said or written yet.  `run` listens in its own way."""
    os._exit(0)


def pose_error_predictor() -> None:
    """Start this node."""
    start("pose_error_predictor")


def angle_corrector() -> None:
    """Start this node."""
    start("angle_corrector")


def model_monitor() -> None:
    """Start this node."""
    start("model_monitor")


def cell_simulator() -> None:
    """Start this node."""
    start("cell_simulator")


if __name__ == "__main__":
    start(sys.argv[1])
