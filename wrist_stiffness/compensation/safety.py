"""How commands and corrections may reach the motors: fresh, slewed, faded and within limits."""

from __future__ import annotations

from dataclasses import dataclass
from math import degrees

import numpy as np

from wrist_stiffness.compensation.intake import MotorNames
from wrist_stiffness.compensation.load_history import NANOSECONDS
from wrist_stiffness.errors import InputError, StaleCommandError
from wrist_stiffness.mechanism.components import Array
from wrist_stiffness.mechanism.configuration import Configuration
from wrist_stiffness.mechanism.geometry import Limits
from wrist_stiffness.mechanism.workspace import Workspace

LONGEST_STEP_S = 0.1
"""A pause between commands counts as this much for the slew limit."""


@dataclass(frozen=True)
class SafetySettings:
    """How the correction may change and where it fades."""

    slew: float = float(np.radians(0.5))  # largest change of a motor's correction [rad/s]
    # error that a motor may leave before its correction moves [encoder steps]; at 0.15 it adds at
    # most 13 % to the RMS of the rounding to whole steps
    deadband_steps: float = 0.15
    # within this distance from the border of the table's domain the correction fades [rad]
    domain_fade: float = float(np.radians(2.0))
    singularity_fade: float = 0.05  # the same for |D| above its limit [-]

    def compiled(self, limits: Limits) -> Array:
        """Return what the compiled formulas must know, with the limits of the joints, (8,)."""
        joints = np.stack([limits.joint_lower, limits.joint_upper], axis=1).ravel()
        fades = [self.domain_fade, self.singularity_fade]
        return np.array([self.slew, LONGEST_STEP_S, *fades, *joints])


def guard_weight(
    workspace: Workspace, configuration: Configuration, settings: SafetySettings
) -> Array:
    """Return how much of the correction is applied at poses.

    `workspace`: the table's domain; `configuration`: poses inside it, or one; `settings`: widths of
    the fades.  Gives (...): 1 well inside, 0 at the border, with a continuous slope in between.
    """
    lower, upper = workspace.rectangle
    theta = configuration.theta
    to_border = np.minimum(theta - lower, upper - theta).min(axis=-1) / settings.domain_fade
    determinant = np.abs(configuration.singularity)
    to_singular = (determinant - workspace.limits.singularity) / settings.singularity_fade
    x = between(np.minimum(to_border, to_singular), 0.0, 1.0)
    return x * x * (3.0 - 2.0 * x)


def within_joint_limits(theta: Array, delta: Array, limits: Limits) -> Array:
    """Return the corrected angles (2,), never driven past a joint limit by the correction.

    A command that is a little beyond a limit already is not made worse.
    """
    lowest = np.minimum(limits.joint_lower, theta)
    highest = np.maximum(limits.joint_upper, theta)
    return between(theta + delta, lowest, highest)


def between(values: Array, lowest: Array | float, highest: Array | float) -> Array:
    """Return values within limits; a third of the time of `numpy.clip` on two angles."""
    return np.minimum(np.maximum(values, lowest), highest)


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
