"""The lookup table of one wrist: what the offline sweep leaves for the nodes.

It holds the condensed parts (from which every operator is a closed form of the pose) and, at the
nodes of a grid, the operators and the paper's s and phi for its biharmonic splines.  The header
says which of the two `evaluation` uses; the other one is its judge.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from math import hypot
from typing import Any, Literal

from wrist_stiffness.errors import LoadRangeError
from wrist_stiffness.lookup.biharmonic import BiharmonicSpline
from wrist_stiffness.lookup.operators import unpack
from wrist_stiffness.mechanism.components import Array, ElasticComponents
from wrist_stiffness.mechanism.configuration import Configuration
from wrist_stiffness.mechanism.geometry import Geometry
from wrist_stiffness.mechanism.geometry_file import geometry_from_values, mechanism_of
from wrist_stiffness.mechanism.kinematics import Mechanism
from wrist_stiffness.mechanism.statics import ContactOperators, component_shares, contact_operators
from wrist_stiffness.mechanism.workspace import Workspace

Evaluation = Literal["closed_form", "spline"]
EVALUATIONS: tuple[Evaluation, ...] = ("closed_form", "spline")

MAP_COLUMNS = ("s_x", "s_y", "s_z", "s", "phi")
"""Columns of the map of the rated load: shift of O in F, its length [m], rotation angle [rad]."""


@dataclass(frozen=True)
class TableHeader:
    """Where a table comes from and how good it is."""

    geometry: dict[str, Any]  # the values of the geometry file
    interface: str  # interface model of the condensation: `rigid`, `distributing` or `sliding`
    evaluation: Evaluation  # `closed_form` or `spline`: what the nodes use
    kernel: str  # of the splines: `lookup.biharmonic.KERNEL`
    per_axis: int  # grid points along each motor angle
    mesh: dict[str, Any]  # element sizes [mm] and counts
    versions: dict[str, str]  # solver and package versions
    errors: dict[str, Any]  # stated errors of the splines [relative to the local value]


@dataclass(frozen=True)
class Table:
    """Lookup of one wrist."""

    header: TableHeader
    components: ElasticComponents
    nodes: Array  # (n, 2), motor angles of the grid [rad]
    operators: Array  # (n, columns), operators at the nodes, as `lookup.operators.pack` orders them
    # (n, 5), `MAP_COLUMNS` at the nodes for the rated load alone, from the readout fit, Eqs.
    # (1)-(10)
    map_values: Array
    checksum: str = ""  # SHA-256 of header and arrays; empty before the table is written

    @cached_property
    def geometry(self) -> Geometry:
        """The geometry for which the table was made."""
        return geometry_from_values(self.header.geometry, "the table's geometry")

    @cached_property
    def mechanism(self) -> Mechanism:
        """Its kinematic scheme."""
        return mechanism_of(self.geometry)

    @cached_property
    def workspace(self) -> Workspace:
        """Its operative workspace and map domain."""
        return Workspace(self.mechanism, self.geometry.limits)

    @cached_property
    def operator_spline(self) -> BiharmonicSpline:
        """Spline of the operators over the motor angles."""
        return BiharmonicSpline.fit(self.nodes, self.operators)

    @cached_property
    def map_spline(self) -> BiharmonicSpline:
        """Spline of the rated load's s and phi: the paper's maps."""
        return BiharmonicSpline.fit(self.nodes, self.map_values)

    def operators_at(
        self, configuration: Configuration, evaluation: Evaluation | None = None
    ) -> ContactOperators:
        """Elastic operators at a configuration.

        `configuration`: of shape (...), inside the map domain.  `evaluation`: `closed_form` or
        `spline`; what the header says if None.  Gives `ContactOperators`: of shape (...), with own
        weight in the geometry's gravity.
        """
        if (evaluation or self.header.evaluation) == "spline":
            return unpack(self.operator_spline(configuration.theta), self.components, configuration)
        return contact_operators(configuration, self.components, self.geometry.gravity)

    def shares(self, configuration: Configuration) -> Array:
        """Share of each component in the platform's compliance, (..., 8, 6, 6)."""
        return component_shares(configuration, self.components)

    def check_load(self, wrench: Array) -> None:
        """Refuse a load outside the range for which the table was made.

        `wrench` (6,): load on the platform at O [N, N m].  Raises `LoadRangeError` if a force or a
        moment is larger than the geometry's limits or not finite.
        """
        limits = self.geometry.limits
        components = wrench.tolist()
        force, moment = hypot(*components[:3]), hypot(*components[3:])
        most_force, most_moment = limits.most_load
        if not force <= most_force:
            raise LoadRangeError(
                f"load: force {force:.6g} N at O, the table ends at {limits.force:g} N"
            )
        if not moment <= most_moment:
            raise LoadRangeError(
                f"load: moment {moment:.6g} N m at O, the table ends at {limits.moment:g} N m"
            )
