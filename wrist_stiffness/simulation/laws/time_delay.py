"""`time_delay`: a stamp is late, so a sample shows what was some time ago.

What was at a moment between two samples is known but for what the cell did of its own accord: the
program tells where the motors were sent and what the load was, as functions of time.  Only the
departure from it (bending, hidden laws, corrections) is interpolated.  Interpolated whole, a motion
sampled at 10 Hz is wrong by an eighth of what a delay of 5 ms does.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from wrist_stiffness.mechanism.components import Array
from wrist_stiffness.mechanism.kinematics import Mechanism
from wrist_stiffness.mechanism.rigid_motion import exp_twist, log_motion
from wrist_stiffness.simulation.block import Block
from wrist_stiffness.simulation.laws.law import MOTOR, Law
from wrist_stiffness.simulation.program import Program


@dataclass
class DelayLine:
    """Signals some time ago, by linear interpolation between the samples that were."""

    delay_s: float  # [s]
    start_s: float | None = None  # stamp of the first sample [s]
    # stamps (k,) [s] and values (k, d) of the samples that may still be asked for
    samples: tuple[Array, Array] | None = None

    def moments(self, time_s: Array) -> Array:
        """Return the moments (n,) that samples stamped (n,) show; none is before the start [s]."""
        if self.start_s is None:
            self.start_s = float(time_s[0])
        return np.maximum(time_s - self.delay_s, self.start_s)

    def __call__(self, time_s: Array, values: Array) -> Array:
        """Return the values (n, d) as they were; before the start, the first one."""
        times, known = time_s, values
        if self.samples is not None:
            times, known = map(np.concatenate, zip(self.samples, (time_s, values), strict=True))
        wanted = self.moments(time_s)
        out = np.column_stack([np.interp(wanted, times, column) for column in known.T])
        # One sample before the oldest that can still be asked for has to stay.
        first = max(int(np.searchsorted(times, times[-1] - self.delay_s)) - 1, 0)
        self.samples = times[first:], known[first:]
        return out

    def past(self, time_s: Array, values: Array, nominal: Callable[[Array], Array]) -> Array:
        """Return the same of values (n, d) of which a part (n, d) is known at all times."""
        then = nominal(self.moments(time_s))
        return then + self(time_s, values - nominal(time_s))


class TimeDelay(Law):
    """A late stamp on pose, load or one motor angle.

    `component`: pose_sensor, load_sensor, motor_1 or motor_2; `delay_s` [s]; `mechanism`: turns the
    platform with the motors.
    """

    _program: Program

    def __init__(self, component: str, delay_s: float, mechanism: Mechanism) -> None:
        super().__init__(component)
        self._line, self._speed_line = DelayLine(delay_s), DelayLine(delay_s)
        self._mechanism = mechanism

    def told(self, program: Program) -> None:
        """Keep the program."""
        self._program = program

    def read_shaft(self, time_s: Array, shaft: Array) -> Array:
        """Read one motor late."""
        return self._late_motor(self._line, time_s, shaft, self._program.sent)

    def read_speed(self, time_s: Array, speed: Array) -> Array:
        """See the speed of the same motor late."""
        return self._late_motor(self._speed_line, time_s, speed, self._program.speed)

    def _late_motor(
        self, line: DelayLine, time_s: Array, values: Array, nominal: Callable[[Array], Array]
    ) -> Array:
        if self.component not in MOTOR:
            return values
        out, column = values.copy(), MOTOR[self.component]
        out[:, column] = line.past(time_s, values, nominal)[:, column]
        return out

    def read_load(self, block: Block, wrench: Array) -> Array:
        """Read the load late."""
        if self.component != "load_sensor":
            return wrench
        return self._line.past(
            block.time_s, wrench, lambda at: self._program.load(self._program.phase(at))
        )

    def read_pose(self, block: Block, rotation: Array, shift: Array) -> tuple[Array, Array]:
        """Read the pose late; its turn from where the program has the platform is about O."""
        if self.component != "pose_sensor":
            return rotation, shift
        moments = self._line.moments(block.time_s)
        now, then = (
            self._mechanism.forward(self._program.sent(t)).platform for t in (block.time_s, moments)
        )
        still = np.zeros_like(shift)
        turn = log_motion(rotation @ np.swapaxes(now, -1, -2), still)[:, 3:]
        late = self._line(block.time_s, np.concatenate([shift, turn], axis=-1))
        turned, _ = exp_twist(np.concatenate([still, late[:, 3:]], axis=-1))
        return turned @ then, late[:, :3]
