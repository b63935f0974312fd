"""A planned point with its speeds and accelerations, taken through a correction of its angles."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from wrist_stiffness.errors import InputError
from wrist_stiffness.mechanism.components import Array

STEP = 5e-3
"""Half width of the central differences [rad].  The search error of a correction, 1e-10 rad, gives
2e-8 of a speed and 2e-5 of a speed squared in an acceleration; corrections vary over degrees."""

LARGEST = 1e9
"""No joint is so far or so fast, in any unit; its square is still a number."""


@dataclass(frozen=True)
class PlannedPoint:
    """One point of a trajectory."""

    positions: Array  # (n,), of all joints [rad]
    # `velocities`, `accelerations`: (n,) or (0,), empty where the plan has none [rad/s, rad/s^2]
    velocities: Array
    accelerations: Array


def planned_point(
    count: int,
    positions: Sequence[float],
    velocities: Sequence[float] = (),
    accelerations: Sequence[float] = (),
) -> PlannedPoint:
    """Return a point of a trajectory from what a message says of it.

    `positions`, `velocities`, `accelerations`: one a joint; the last two may be empty [rad, rad/s,
    rad/s^2].  Raises `InputError` if a number of values is wrong or a value is not finite or beyond
    all bounds.
    """
    named = {"positions": positions, "velocities": velocities, "accelerations": accelerations}
    for name, values in named.items():
        if len(values) != count and (name == "positions" or len(values)):
            raise InputError(f"trajectory: {len(values)} {name} for {count} names")
        if not np.all(np.abs(values) < LARGEST):
            raise InputError(
                f"trajectory: {name} {list(values)} are not finite or beyond {LARGEST:g}"
            )
    return PlannedPoint(*(np.array(values, dtype=float) for values in named.values()))


def neighbours(point: PlannedPoint, places: Sequence[int]) -> list[Array]:
    """Return the motor angles whose corrections say how a point of the corrected path moves.

    `places` (2,) sequence of int: where the motors stand among the joints.  Gives list of (2,)
    float: the point itself, then one step ahead and one back along its speed and along its
    acceleration, where the plan has them and they are not zero [rad].
    """
    at = list(places)
    theta = point.positions[at]
    found = [theta]
    for derivative in (point.velocities, point.accelerations):
        if len(derivative) and derivative[at].any():
            # Unlike the root of a sum of squares, `hypot` is not zero for the smallest numbers.
            step = STEP * (derivative[at] / np.hypot(*derivative[at]))
            found += [theta + step, theta - step]
    return found


def corrected_point(
    point: PlannedPoint, places: Sequence[int], corrected: Sequence[Array]
) -> PlannedPoint:
    """Return a point of the corrected path with the derivatives that belong to it.

    Where a plan runs through theta(t), the motors run through c(theta(t)), at the speed
    c' theta_dot and the acceleration c' theta_ddot + c'' (theta_dot, theta_dot), by central
    differences.

    `places` (2,) sequence of int: where the motors stand among the joints; `corrected` sequence of
    (2,): corrected motor angles at the point's `neighbours` [rad].  Gives `PlannedPoint`: other
    joints unchanged; speeds and accelerations where the plan has them.
    """
    at = list(places)
    there, beside = corrected[0], iter(corrected[1:])
    positions = point.positions.copy()
    positions[at] = there
    velocities, accelerations = point.velocities.copy(), point.accelerations.copy()
    if len(velocities) and velocities[at].any():
        size = float(np.hypot(*velocities[at]))
        after, before = next(beside), next(beside)
        velocities[at] = (after - before) * (0.5 * size / STEP)
        curvature = (after - 2.0 * there + before) * (size / STEP) ** 2
    else:
        curvature = np.zeros(2)
    if len(accelerations):
        along = np.zeros(2)
        if accelerations[at].any():
            size = float(np.hypot(*accelerations[at]))
            after, before = next(beside), next(beside)
            along = (after - before) * (0.5 * size / STEP)
        accelerations[at] = along + curvature
    return replace(point, positions=positions, velocities=velocities, accelerations=accelerations)
