"""`time_delay`: a stamp is late, so a sample shows what was some time ago."""

from __future__ import annotations

import numpy as np

from wrist_stiffness.mechanism.components import Array
from wrist_stiffness.mechanism.rigid_motion import exp_twist, log_motion
from wrist_stiffness.simulation.block import Block
from wrist_stiffness.simulation.laws.law import MOTOR, Law


class DelayLine:
    """Signals some time ago, by linear interpolation between the samples that were.

    Parameters
    ----------
    delay_s : float
        [s].
    """

    def __init__(self, delay_s: float) -> None:
        self._delay_s = delay_s
        self._time_s = np.zeros(0)
        self._values: Array | None = None

    def __call__(self, time_s: Array, values: Array) -> Array:
        """Return the values (n, d) as they were; before the start, the first one."""
        known = values if self._values is None else np.concatenate([self._values, values])
        times = np.concatenate([self._time_s, time_s])
        wanted = time_s - self._delay_s
        out = np.column_stack([np.interp(wanted, times, column) for column in known.T])
        # One sample before the oldest that can still be asked for has to stay.
        first = max(int(np.searchsorted(times, times[-1] - self._delay_s)) - 1, 0)
        self._time_s, self._values = times[first:], known[first:]
        return out


class TimeDelay(Law):
    """A late stamp on pose, load or one motor angle.

    Parameters
    ----------
    component : str
        pose_sensor, load_sensor, motor_1 or motor_2.
    delay_s : float
        [s].
    """

    def __init__(self, component: str, delay_s: float) -> None:
        self._component = component
        self._line = DelayLine(delay_s)

    def read_angles(self, time_s: Array, angles: Array) -> Array:
        """Read one motor late."""
        if self._component not in MOTOR:
            return angles
        out = angles.copy()
        column = MOTOR[self._component]
        out[:, column] = self._line(time_s, angles[:, column : column + 1])[:, 0]
        return out

    def read_load(self, block: Block, wrench: Array) -> Array:
        """Read the load late."""
        return self._line(block.time_s, wrench) if self._component == "load_sensor" else wrench

    def read_pose(self, block: Block, rotation: Array, shift: Array) -> tuple[Array, Array]:
        """Read the pose late; between samples it is interpolated about O."""
        if self._component != "pose_sensor":
            return rotation, shift
        turn = log_motion(rotation, np.zeros_like(shift))[:, 3:]
        late = self._line(block.time_s, np.concatenate([shift, turn], axis=-1))
        return exp_twist(np.concatenate([np.zeros_like(shift), late[:, 3:]], axis=-1))[0], late[
            :, :3
        ]
