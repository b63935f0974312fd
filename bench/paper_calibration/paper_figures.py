"""What Palmieri (2015) published, and the same figures of a modelled wrist.

Palmieri, "On the positioning error of a 2-DOF spherical parallel wrist with flexible links and
joints - an FEM approach", Mech. Sci. 6, 9-16, 2015: Tables 1 and 2 and the text's two maxima.
Everything here is in micrometres and millidegrees; the paper prints hundredths of a degree.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from wrist_stiffness.lookup.response import rated_map
from wrist_stiffness.mechanism.components import Array, ElasticComponents
from wrist_stiffness.mechanism.geometry import Geometry
from wrist_stiffness.mechanism.geometry_file import mechanism_of
from wrist_stiffness.mechanism.statics import contact_operators
from wrist_stiffness.mechanism.workspace import Workspace

COLUMNS = ("s_x", "s_y", "s_z", "s", "phi")
UNITS = ("µm", "µm", "µm", "µm", "mdeg")
TO_UNITS = np.array([1e6, 1e6, 1e6, 1e6, 1e3 * 180.0 / np.pi])
"""From `lookup.table.MAP_COLUMNS` in SI units."""

PAPER_GRID = 5
"""Poses along each motor angle: the paper's 25 configurations."""

FINE_GRID = 61
"""Poses along each motor angle where a map is read off."""


@dataclass(frozen=True)
class Figures:
    """The published figures of one wrist.

    Parameters
    ----------
    operative : (3, 5) float
        Mean, minimum and maximum of `COLUMNS` inside the operative workspace.
    map_maximum : (2,) float
        Largest s and phi of the whole map.
    """

    operative: Array
    map_maximum: Array

    @classmethod
    def of(
        cls, values: Array, operative: NDArray[np.bool_], border: Array | None = None
    ) -> Figures:
        """Take the figures of `COLUMNS` (n, 5) at n poses, of which some are `operative` (n,).

        Extremes are also looked for along its `border` (m, 5), where most of them are.
        """
        inside = values[operative]
        mean, held = inside.mean(axis=0), inside if border is None else np.vstack([inside, border])
        statistics = np.stack([mean, held.min(axis=0), held.max(axis=0)])
        return cls(statistics, values[:, 3:].max(axis=0))


PUBLISHED = Figures(
    operative=np.array(
        [
            [1.17, 0.53, -8.39, 8.73, 12.9],
            [-2.06, -2.12, -13.51, 5.50, 6.4],
            [5.12, 5.63, -5.11, 14.78, 36.1],
        ]
    ),
    map_maximum=np.array([70.0, 55.0]),
)


@dataclass(frozen=True)
class PaperExperiment:
    """The paper's experiment on one wrist: 1 N downward, load only, flanges in contact.

    Parameters
    ----------
    geometry : Geometry
        The wrist; its load point decides where the load acts.
    components : ElasticComponents
        Its condensed parts.
    """

    geometry: Geometry
    components: ElasticComponents

    @property
    def workspace(self) -> Workspace:
        """Operative workspace and map domain."""
        return Workspace(mechanism_of(self.geometry), self.geometry.limits)

    def solve(self, theta: Array) -> Array:
        """Solve the wrist at poses (n, 2) [rad]: `COLUMNS` in the paper's units, (n, 5)."""
        configuration = mechanism_of(self.geometry).forward(theta)
        operators = contact_operators(configuration, self.components, np.zeros(3))
        return rated_map(configuration, operators, self.geometry) * TO_UNITS

    def nodes(self) -> Array:
        """Return the poses of the paper's grid, (25, 2) [rad]."""
        return self.workspace.grid(PAPER_GRID)

    def paper_spline(self, per_axis: int = PAPER_GRID) -> Callable[[Array], Array]:
        """Interpolate as the paper did: Sandwell's biharmonic spline through a grid of poses.

        Green's functions r^2 (ln r - 1) alone, as in MATLAB's griddata 'v4', in the unit box.
        """
        nodes = self.workspace.grid(per_axis)
        size = np.ptp(nodes, axis=0)

        def green(poses: Array) -> Array:
            away = (poses[:, None] - nodes) / size
            square = (away**2).sum(axis=-1)
            return square * (0.5 * np.log(np.maximum(square, np.finfo(float).tiny)) - 1.0)

        weights = np.linalg.solve(green(nodes), self.solve(nodes))
        return lambda poses: green(poses) @ weights

    def by_spline(self) -> Figures:
        """Figures of the 25-pose spline: the paper's way."""
        return self._figures(self.paper_spline())

    def by_nodes(self) -> Figures:
        """Figures of the 25 poses themselves, those inside the border for the statistics."""
        nodes = self.nodes()
        values = self.solve(nodes)
        return Figures.of(values, self.workspace.operative(nodes))

    def by_closed_form(self) -> Figures:
        """Figures of the wrist itself, solved at every pose of a fine grid."""
        return self._figures(self.solve)

    def fine_poses(self) -> Array:
        """Return the poses of a fine grid over the map domain, (n, 2) [rad]."""
        return self.workspace.grid(FINE_GRID)

    def _figures(self, values_at: Callable[[Array], Array]) -> Figures:
        poses = self.fine_poses()
        workspace = self.workspace
        border = values_at(workspace.operative_border)
        return Figures.of(values_at(poses), workspace.operative(poses), border)
