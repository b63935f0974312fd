"""The tare on disk, so that a node that comes back within a while need not be tared again.

Of all that a node knows only the tare may outlive it: a payload may have been set down meanwhile,
and a correction shall not come on by itself.
"""

from __future__ import annotations

import json
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from wrist_stiffness.atomic_file import replacing
from wrist_stiffness.compensation.load_history import Zero
from wrist_stiffness.errors import InputError
from wrist_stiffness.model.block import Load


@dataclass(frozen=True)
class Tare:
    """A zero of the load."""

    zero: Zero  # what is taken off every load
    time_s: float  # when it was taken, by the system's clock [s]
    frames: str  # the parameter `frames` of that time: under another one it is no zero


class KeptTare:
    """The file of one node.

    `folder`: where it lies; empty to keep nothing.  `node`: full name of the node.
    """

    def __init__(self, folder: str, node: str) -> None:
        name = node.strip("/").replace("/", "__")
        self.path = Path(folder).expanduser() / f"{name}.json" if folder else None

    def keep(self, tare: Tare | None) -> None:
        """Write a tare, or remove the one that is kept.

        Raises `InputError` if the file cannot be written.
        """
        if self.path is None:
            return
        try:
            if tare is None:
                self.path.unlink(missing_ok=True)
                return
            self.path.parent.mkdir(parents=True, exist_ok=True)
            content = {
                "wrench_N_Nm": tare.zero.load.wrench.tolist(),
                "scatter_N_Nm": tare.zero.scatter.tolist(),
                "on_platform": tare.zero.load.on_platform,
                "time_s": tare.time_s,
                "frames": tare.frames,
            }
            with replacing(self.path) as written:
                written.write_text(json.dumps(content), encoding="utf-8")
        except OSError as error:
            raise InputError(f"{self.path}: the tare cannot be kept: {error.strerror}") from error

    def read(self, now_s: float, longest_s: float, frames: str) -> Tare | None:
        """Return the tare that is kept.

        `now_s`: the system's clock [s]; `longest_s`: oldest tare that counts [s]; `frames`: the
        parameter `frames` of now.  Gives None where none is kept, or it is too old, of the future
        or of other frames.  Raises `InputError` if the file is none of ours.
        """
        if self.path is None or not self.path.is_file():
            return None
        try:
            content = json.loads(self.path.read_text(encoding="utf-8"))
            wrench = np.array(content["wrench_N_Nm"], dtype=float)
            scatter = np.array(content["scatter_N_Nm"], dtype=float)
            tare = Tare(
                Zero(Load(wrench, bool(content["on_platform"])), scatter),
                float(content["time_s"]),
                content["frames"],
            )
        except (OSError, ValueError, TypeError, KeyError, RecursionError) as error:
            raise InputError(f"{self.path}: is no kept tare: {error}") from error
        numbers = [*wrench.ravel(), *scatter.ravel(), tare.time_s]
        if not wrench.shape == scatter.shape == (6,) or not np.isfinite(numbers).all():
            raise InputError(f"{self.path}: is no kept tare: {numbers}")
        if tare.frames != frames or not 0.0 <= now_s - tare.time_s <= longest_s:
            return None
        return tare
