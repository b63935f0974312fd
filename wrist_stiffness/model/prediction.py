"""What a model predicts: of one sample, and of a block of samples."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from wrist_stiffness.mechanism.components import Array
from wrist_stiffness.mechanism.configuration import Configuration
from wrist_stiffness.mechanism.rigid_motion import exp_twist, log_motion


@dataclass(frozen=True)
class Prediction:
    """Predicted pose error of the platform, T_err = exp(twist)."""

    twist: Array  # (6,), at O in F, own weight included [m, rad]
    configuration: Configuration = field(repr=False)
    active: NDArray[np.bool_] = field(repr=False)  # (m,), flange sectors in contact
    # configuration and twist -> covariance (6, 6) of what the table says
    of_table: Callable[[Configuration, Array], Array] = field(repr=False)
    # pair of (6,), X and Y of the pose sensor in F [m, rad]; None for nothing
    sensor: tuple[Array | None, Array | None] = (None, None)
    # returns the covariance (6, 6) from the effects' parameters
    of_parameters: Callable[[], Array] | None = field(default=None, repr=False)
    added_covariance: Array | None = None  # (6, 6), covariance beyond the model: of the load
    warnings: tuple[str, ...] = ()  # effects that were left out or have left first order

    @cached_property
    def covariance(self) -> Array:
        """Covariance of the twist, (6, 6); made where it is asked for, as a search does not."""
        covariance = self.of_table(self.configuration, self.twist)
        if self.of_parameters is not None:
            covariance = covariance + self.of_parameters()
        if self.added_covariance is not None:
            covariance = covariance + self.added_covariance
        return covariance

    @cached_property
    def measured(self) -> Array:
        """What the pose sensor would say of the twist, (6,) [m, rad]."""
        return seen(self.twist, *self.sensor)

    @property
    def motion(self) -> tuple[Array, Array]:
        """Rotation R_err (3, 3) and shift s (3,) [m]."""
        return exp_twist(self.twist)

    @property
    def shift_norm(self) -> float:
        """Length of s [m]."""
        return float(np.linalg.norm(self.motion[1]))

    @property
    def phi(self) -> float:
        """Angle of R_err [rad]."""
        return float(np.linalg.norm(self.twist[3:]))


@dataclass(frozen=True)
class BlockPrediction:
    """Predicted pose errors of n samples."""

    twist: Array  # (n, 6), at O in F, own weight included [m, rad]; NaN where refused
    measured: Array  # (n, 6), what the pose sensor would say [m, rad]
    # (n,), False where a sample is outside the table's domain or load range or not finite; the
    # effects' memory passes over such samples as a node does
    accepted: NDArray[np.bool_]
    warnings: tuple[str, ...]  # each once
    # signals without which effects were left out, by the effects' names
    lacking: Mapping[str, str] = field(default_factory=dict)


def seen(twist: Array, left: Array | None, right: Array | None) -> Array:
    """Return the twist that the pose sensor reports, log(exp(X) exp(xi) exp(Y)).

    `twist` (..., 6): xi [m, rad]; `left`, `right` (..., 6): X and Y of the sensor [m, rad].
    """
    if left is None and right is None:
        return twist
    rotation, shift = exp_twist(twist)
    if right is not None:
        turned, moved = exp_twist(right)
        shift = shift + (rotation @ moved[..., None])[..., 0]
        rotation = rotation @ turned
    if left is not None:
        turned, moved = exp_twist(left)
        shift = moved + (turned @ shift[..., None])[..., 0]
        rotation = turned @ rotation
    return log_motion(rotation, shift)
