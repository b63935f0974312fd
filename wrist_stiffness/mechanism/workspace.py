"""Where the wrist may work: operative workspace, map domain, distance to their borders."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from wrist_stiffness.errors import SingularPoseError, UnreachablePoseError
from wrist_stiffness.mechanism.compiled import mechanism_constants, native
from wrist_stiffness.mechanism.components import Array
from wrist_stiffness.mechanism.configuration import Configuration
from wrist_stiffness.mechanism.geometry import Limits
from wrist_stiffness.mechanism.kinematics import Mechanism, angles_text
from wrist_stiffness.mechanism.vectors import triad

BORDER_POINTS = 721


@dataclass(frozen=True)
class Workspace:
    """Joint-space regions of one wrist."""

    mechanism: Mechanism
    limits: Limits

    @cached_property
    def operative_border(self) -> Array:
        """Motor angles on the border of the operative workspace, a closed line (n, 2) [rad].

        Raises `UnreachablePoseError` if the wrist cannot reach the operative tilt in every
        direction.
        """
        azimuth = np.linspace(0.0, 2.0 * np.pi, BORDER_POINTS)
        n0 = self.mechanism.n0
        across = triad(n0, self.mechanism.b0)[:, 1:] @ np.stack([np.cos(azimuth), np.sin(azimuth)])
        tilt = self.limits.operative_tilt
        normals = np.cos(tilt) * n0 + np.sin(tilt) * across.T
        return self.mechanism.inverse_near(normals, np.zeros((BORDER_POINTS, 2)))

    @cached_property
    def rectangle(self) -> tuple[Array, Array]:
        """Lower and upper motor angles of the map domain, (2,) each [rad].

        The bounding rectangle of the operative workspace, widened by the margin about its centre.
        """
        lower, upper = self.operative_border.min(axis=0), self.operative_border.max(axis=0)
        centre, half = (lower + upper) / 2.0, (upper - lower) / 2.0
        return centre - self.limits.map_margin * half, centre + self.limits.map_margin * half

    @cached_property
    def constants(self) -> Array:
        """What the compiled formulas must know."""
        return mechanism_constants(self.mechanism, self.rectangle, self.limits)

    def operative(self, theta: Array) -> NDArray[np.bool_]:
        """Tell which poses lie in the operative workspace, (...) for `theta` (..., 2) [rad]."""
        theta = np.asarray(theta, dtype=float)
        inside = np.asarray(self.domain(theta))
        inside[inside] = self.mechanism.tilt(theta[inside]) <= self.limits.operative_tilt
        return inside

    def domain(self, theta: Array) -> NDArray[np.bool_]:
        """Tell which poses lie in the map domain, (...) for `theta` (..., 2) [rad]; not so NaN."""
        theta = np.asarray(theta, dtype=float)
        lower, upper = self.rectangle
        inside = np.asarray(np.all((theta >= lower) & (theta <= upper), axis=-1))
        radicand = self.mechanism.closure_radicand(theta[inside])
        inside[inside] = radicand >= self.limits.singularity**2
        return inside

    def grid(self, per_axis: int) -> Array:
        """Return the poses of an equally spaced grid over the rectangle that lie in the domain.

        `per_axis`: points along each motor angle; 5 gives the paper's 25 poses.  Gives (n, 2):
        motor angles [rad].
        """
        poses = self.rectangle_grid(per_axis)
        return poses[self.domain(poses)]

    def rectangle_grid(self, per_axis: int) -> Array:
        """Return an equally spaced grid over the whole rectangle, (n, n, 2) [rad].

        The first motor angle runs along the first axis.
        """
        lower, upper = self.rectangle
        axes = [np.linspace(lower[i], upper[i], per_axis) for i in range(2)]
        return np.stack(np.meshgrid(*axes, indexing="ij"), axis=-1)

    def configuration(self, theta: Array) -> Configuration:
        """Forward kinematics of one pose that must lie in the map domain.

        `theta` (2,): motor angles [rad].  Raises `InputError` if an angle is not finite;
        `UnreachablePoseError` if the pose is outside the domain's rectangle or the loop does not
        close; `SingularPoseError` if |D| is below its limit.
        """
        theta = np.array(theta, dtype=float)
        if native is not None:
            row = np.empty(native.CONFIGURATION)
            if not native.forward(self.constants, theta, row, np.empty(1, dtype=np.uint8)):
                return Configuration.of_row(row)
        # It says why there is none.
        configuration = self.mechanism.forward(theta)
        low, high = self.rectangle
        if not ((low <= theta) & (theta <= high)).all():
            low, high = np.degrees(self.rectangle)
            raise UnreachablePoseError(
                f"motor angles {angles_text(theta)} outside the table's domain "
                f"({low[0]:.2f} to {high[0]:.2f}, {low[1]:.2f} to {high[1]:.2f})"
            )
        determinant = abs(float(configuration.singularity))
        if determinant < self.limits.singularity:
            raise SingularPoseError(
                f"motor angles {angles_text(theta)}: |D| = {determinant:.3f} "
                f"below the limit {self.limits.singularity:g}"
            )
        return configuration
