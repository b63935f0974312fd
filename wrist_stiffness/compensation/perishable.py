"""What a command must be to be forwarded: fresh, and within the joint limits."""

from __future__ import annotations

from math import degrees

import numpy as np

from wrist_stiffness.compensation.intake import MotorNames
from wrist_stiffness.compensation.load_history import NANOSECONDS
from wrist_stiffness.errors import InputError, StaleCommandError
from wrist_stiffness.mechanism.components import Array
from wrist_stiffness.mechanism.geometry import Limits


def require_fresh(what: str, stamp_ns: int, now_ns: int, limit_s: float) -> None:
    """Refuse a command that is older than a limit, as ros2_control's reference timeout does.

    `what`: for the message.  `stamp_ns`, `now_ns`: when it was made, and now, by the same clock
    [ns].  `limit_s`: oldest command that is obeyed [s]; 0 for any.  As far ahead of the clock, a
    stamp says that two clocks differ.  Raises `StaleCommandError` with the age and the limit.
    """
    age_s = (now_ns - stamp_ns) / NANOSECONDS
    if limit_s and abs(age_s) > limit_s:
        where = (
            f"{age_s:.3f} s old" if age_s > 0.0 else f"stamped {-age_s:.3f} s ahead of the clock"
        )
        raise StaleCommandError(f"{what}: {where}, the limit is {limit_s:g} s; not forwarded")


def require_within_limits(what: str, theta: Array, limits: Limits, motors: MotorNames) -> None:
    """Refuse angles beyond the joint limits by more than one encoder step.

    `what`: for the message; `theta` (2,): motor angles [rad].  Raises `InputError` with the motor,
    its angle and its limits.
    """
    for motor, (angle, (low, high)) in enumerate(zip(theta.tolist(), limits.reach, strict=True)):
        if not low <= angle <= high:
            name = (motors.motor_1, motors.motor_2)[motor]
            lower, upper = limits.joint_lower[motor], limits.joint_upper[motor]
            raise InputError(
                f"{what}: {name} at {degrees(angle):.6g} deg is beyond its limits of "
                f"{degrees(lower):g} to {degrees(upper):g} deg; not forwarded"
            )


def within_limits(theta: Array, limits: Limits) -> bool:
    """Tell whether `require_within_limits` would refuse none of n pairs of angles (n, 2) [rad]."""
    lowest, highest = np.transpose(limits.reach)
    return bool(((lowest <= theta) & (theta <= highest)).all())
