"""A planned point with its speeds and accelerations, taken through a correction of its angles."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace

import numpy as np

from wrist_stiffness.errors import InputError, SingularPoseError, UnreachablePoseError
from wrist_stiffness.mechanism.components import Array

STEP = 5e-3
"""Half width of the central differences [rad].  The search error of a correction, 1e-10 rad, gives
2e-8 of a speed and 2e-5 of a speed squared in an acceleration; corrections vary over degrees."""

LARGEST = 1e9
"""No joint is so far or so fast, in any unit; its square is still a number."""


@dataclass(frozen=True)
class PlannedPoint:
    """One point of a trajectory.

    Parameters
    ----------
    positions : (n,) float
        Of all joints [rad].
    velocities, accelerations : (n,) or (0,) float
        Empty where the plan has none [rad/s, rad/s^2].
    """

    positions: Array
    velocities: Array
    accelerations: Array


def planned_point(
    count: int,
    positions: Sequence[float],
    velocities: Sequence[float] = (),
    accelerations: Sequence[float] = (),
) -> PlannedPoint:
    """Return a point of a trajectory from what a message says of it.

    Parameters
    ----------
    count : int
        How many joints the trajectory names.
    positions, velocities, accelerations : sequence of float
        One a joint; the last two may be empty [rad, rad/s, rad/s^2].

    Returns
    -------
    PlannedPoint
        As arrays.

    Raises
    ------
    InputError
        If a number of values is wrong or a value is not finite or beyond all bounds.
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


def corrected_point(
    corrected: Callable[[Array], Array], places: Sequence[int], point: PlannedPoint
) -> PlannedPoint:
    """Return a point of the corrected path with the derivatives that belong to it.

    Where a plan runs through theta(t), the motors run through c(theta(t)), at the speed
    c' theta_dot and the acceleration c' theta_ddot + c'' (theta_dot, theta_dot).

    Parameters
    ----------
    corrected : callable
        Corrected motor angles at angles (2,) [rad].
    places : (2,) sequence of int
        Where the motors stand among the joints.
    point : PlannedPoint
        Of the plan.

    Returns
    -------
    PlannedPoint
        Other joints unchanged; speeds and accelerations where the plan has them.

    Raises
    ------
    WristError
        If the point itself cannot be corrected.
    """
    at = list(places)
    theta = point.positions[at]
    there = corrected(theta)
    positions = point.positions.copy()
    positions[at] = there
    velocities, accelerations = point.velocities.copy(), point.accelerations.copy()
    curvature = np.zeros(2)
    if len(velocities):
        velocities[at], curvature = _derivatives(corrected, theta, there, point.velocities[at])
    if len(accelerations):
        along, _ = _derivatives(corrected, theta, there, point.accelerations[at])
        accelerations[at] = along + curvature
    return replace(point, positions=positions, velocities=velocities, accelerations=accelerations)


def _derivatives(
    corrected: Callable[[Array], Array], theta: Array, there: Array, direction: Array
) -> tuple[Array, Array]:
    """First and second derivative along a direction, by central differences."""
    size = float(np.linalg.norm(direction))
    if size == 0.0:
        return np.zeros(2), np.zeros(2)

    def beside(angles: Array) -> Array:
        try:
            return corrected(angles)
        except (UnreachablePoseError, SingularPoseError):
            # At the border of the domain the correction has faded to none.
            return angles

    step = STEP / size * direction
    after, before = beside(theta + step), beside(theta - step)
    return (
        (after - before) * (0.5 * size / STEP),
        (after - 2.0 * there + before) * (size / STEP) ** 2,
    )
