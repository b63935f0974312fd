"""Weighs on one wrist: reads loads along gravity, and turns payloads into loads."""

from __future__ import annotations

from dataclasses import dataclass
from math import sqrt

import numpy as np

from wrist_stiffness.compensation.payload import Payload, PayloadEstimate, Reading, Row
from wrist_stiffness.lookup.table import Table
from wrist_stiffness.mechanism.compiled import Flags, native
from wrist_stiffness.mechanism.components import Array
from wrist_stiffness.mechanism.geometry import Geometry
from wrist_stiffness.mechanism.vectors import frame_about
from wrist_stiffness.model.error_model import IN_F, IN_U, Load


class Scales:
    """What payloads and other loads weigh on one wrist.

    `geometry`: gravity, and the largest moment of the table: a payload beyond it is refused anyway.
    """

    def __init__(self, geometry: Geometry) -> None:
        self.geometry = geometry
        self._g = float(np.linalg.norm(geometry.gravity))
        down = geometry.gravity / self._g if self._g else np.array([0.0, 0.0, -1.0])
        self._axes: list[list[float]] = [*frame_about(down)[:, 1:].T.tolist(), down.tolist()]
        # (10,), axes u, v and down, and gravity, as compiled formulas take them
        self.constants = np.append(self._axes, self._g)

    def read(self, table: Table, theta: Array, load: Load) -> Reading:
        """Read a load.

        `theta` (2,): motor angles [rad].  Raises `WristError` if the pose or the load is out of
        range.
        """
        if native is not None:
            rows, usable = self.rows_of(
                table, theta, load.wrench, IN_U if load.on_platform else IN_F
            )
            if usable[0]:
                return Reading.of_row(rows[0].tolist())
        # A payload may stand in for it, but a load beyond the table is a fault in any case; turning
        # a wrench changes neither of its sizes, so its frame does not matter.
        table.check_load(load.wrench)
        at = table.workspace.configuration(theta)
        return self.reading(load.in_base(at).tolist(), at.platform.tolist())

    def rows_of(
        self, table: Table, theta: Array, wrench: Array, on_platform: Flags
    ) -> tuple[Array, Flags]:
        """Read many loads, compiled.

        `theta`, `wrench` (n, 2), (n, 6): motor angles [rad], loads at O [N, N m]; `on_platform`
        (n,) bool: which loads are in U, not in F.  Gives (n, 11) float, (n,) bool: what
        `Reading.of_row` takes, and where that could be had.
        """
        n = len(on_platform)
        rows, status = np.empty((n, native.READING)), np.empty(n, dtype=np.uint8)
        constants = table.workspace.constants
        native.read_load(constants, self.constants, theta, wrench, on_platform, rows, status)
        return rows, status == 0

    def reading(self, wrench: list[float], rotation: list[list[float]]) -> Reading:
        """Return a load (6,) at O in F [N, N m] on the platform that is turned by (3, 3)."""
        force_u, force_v, weight = self.along(wrench[:3])
        side = sqrt(force_u * force_u + force_v * force_v)
        if not self._g:
            # Nothing weighs: whatever acts is a contact.
            side, weight = sqrt(side * side + weight * weight), 0.0
        return Reading(side, weight, self.along(wrench[3:]), self.rows(rotation))

    def rows(self, rotation: list[list[float]]) -> tuple[Row, Row]:
        """Return what the moments about u and v are of Q, on the platform turned by (3, 3)."""
        (ux, uy, uz), (vx, vy, vz), _ = self._axes
        (r00, r01, r02), (r10, r11, r12), (r20, r21, r22) = rotation
        first = (
            vx * r00 + vy * r10 + vz * r20,
            vx * r01 + vy * r11 + vz * r21,
            vx * r02 + vy * r12 + vz * r22,
        )
        second = (
            -ux * r00 - uy * r10 - uz * r20,
            -ux * r01 - uy * r11 - uz * r21,
            -ux * r02 - uy * r12 - uz * r22,
        )
        return first, second

    def along(self, vector: list[float]) -> Row:
        """Return a vector (3,) in F along u, v and down."""
        x, y, z = vector
        (ux, uy, uz), (vx, vy, vz), (dx, dy, dz) = self._axes
        return ux * x + uy * y + uz * z, vx * x + vy * y + vz * z, dx * x + dy * y + dz * z

    def load(
        self, payload: PayloadEstimate, rows: tuple[Row, Row], share: float
    ) -> tuple[float, ...]:
        """Return a share of a payload's load at the pose of a reading's rows, (6,) in F."""
        (ux, uy, uz), (vx, vy, vz), (dx, dy, dz) = self._axes
        weight = share * payload.weight
        first, second = payload.shown(rows)
        first, second = share * first, share * second
        return (
            weight * dx,
            weight * dy,
            weight * dz,
            ux * first + vx * second,
            uy * first + vy * second,
            uz * first + vz * second,
        )

    def unknown(self, reading: Reading) -> PayloadEstimate:
        """Return the estimate of a payload of which a reading's weight is all that is known."""
        return PayloadEstimate.of(reading.weight, (0.0, 0.0, 0.0), self.geometry.limits.moment)

    def estimate(self, payload: Payload) -> PayloadEstimate:
        """Return a payload as an estimate that is known."""
        weight = payload.mass_kg * self._g
        x, y, z = payload.centre_m
        return PayloadEstimate.of(weight, (weight * x, weight * y, weight * z), 0.0)

    def payload(self, estimate: PayloadEstimate) -> Payload:
        """Return an estimate as a payload."""
        x, y, z = (moment / estimate.weight for moment in estimate.moments)
        return Payload(estimate.weight / self._g, (x, y, z))


@dataclass(frozen=True)
class Held:
    """What a plan is corrected for, from `Supervisor.held`."""

    # `scales`, `payload`: None where there is no payload
    scales: Scales | None
    payload: PayloadEstimate | None
    followed: Load | None  # where every load is followed
    share: float  # part of the correction that is applied [-]
    valid: bool  # whether the load was known and corrected for, as `Supervision.valid`
    threshold: float  # a moment by which a load would be another one [N m]

    def load(self, rotation: Array) -> Load:
        """Return the load on the platform that is turned by (3, 3), U -> F."""
        if self.followed is not None:
            return self.followed
        if self.scales is None or self.payload is None:
            return Load(np.zeros(6))
        rows = self.scales.rows(rotation.tolist())
        return Load(np.array(self.scales.load(self.payload, rows, 1.0)))

    def known(self, rotation: Array) -> bool:
        """Tell whether that load is known: one pose shows but a part of a payload's centre."""
        if self.scales is None or self.payload is None:
            return self.valid
        open_moment = self.payload.open_moment(self.scales.rows(rotation.tolist()))
        return self.valid and open_moment <= self.threshold
