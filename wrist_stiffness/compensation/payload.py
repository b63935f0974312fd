"""A payload is a weight at a fixed point of the platform; known from measured loads, or told.

Its force is constant in F, along gravity, and its moment follows the pose: that is what tells it
from a contact.  With axes u, v, down of F, its weight W [N] and the moments Q = W * centre [N m], a
payload's load at O has no force along u and v and no moment about down, the force W, and

    moment_u = (R' v) . Q        moment_v = -(R' u) . Q

so one pose shows two of the three components of Q, and other poses the third.  Plain floats: the
arrays have three elements, and this is done for every command.
"""

from __future__ import annotations

from dataclasses import dataclass
from math import hypot, isfinite
from typing import NamedTuple

import numpy as np

from wrist_stiffness.errors import InputError
from wrist_stiffness.lookup.table import Table
from wrist_stiffness.mechanism.compiled import Flags, native
from wrist_stiffness.mechanism.components import Array
from wrist_stiffness.mechanism.geometry import Geometry
from wrist_stiffness.mechanism.vectors import triad
from wrist_stiffness.model.error_model import IN_F, IN_U, Load

SIGMAS = 3.0
"""A threshold is this many standard deviations of what one reading may be wrong by."""

ENOUGH = 10.0
"""After so many readings that are independent a direction counts as known and is learned no
further, so that a contact that grows slowly is not learned as payload."""

Row = tuple[float, float, float]


@dataclass(frozen=True)
class Payload:
    """What the platform carries.

    Parameters
    ----------
    mass_kg : float
        [kg].
    centre_m : (float, float, float)
        Its centre of gravity in U, from O [m].

    Raises
    ------
    InputError
        If a number is not finite or the mass is not positive.
    """

    mass_kg: float
    centre_m: Row

    def __post_init__(self) -> None:
        """Check the numbers."""
        if not (isfinite(self.mass_kg) and self.mass_kg > 0.0):
            raise InputError(f"payload: mass {self.mass_kg} kg is not a positive number")
        if len(self.centre_m) != 3 or not all(map(isfinite, self.centre_m)):
            raise InputError(f"payload: centre {self.centre_m} m is not three finite numbers")


class Thresholds(NamedTuple):
    """A load that departs by more than these is another load.

    Parameters
    ----------
    force, moment : float
        [N], [N m].
    """

    force: float
    moment: float

    def times(self, factor: float) -> Thresholds:
        """Return a multiple of both."""
        return Thresholds(factor * self.force, factor * self.moment)

    def wider(self, reading: Reading, turn: float) -> Thresholds:
        """Return thresholds for a load that may seem turned [rad]."""
        force, moment = hypot(reading.side, reading.weight), hypot(*reading.moments)
        return Thresholds(self.force + turn * force, self.moment + turn * moment)


class Reading(NamedTuple):
    """A load along u, v and down, and what its moments say of a payload.

    Parameters
    ----------
    side : float
        Force across gravity [N].
    weight : float
        Force along gravity [N].
    moments : (float, float, float)
        About u, v and down [N m].
    rows : (Row, Row)
        What the first two moments are of Q [-].
    """

    side: float
    weight: float
    moments: Row
    rows: tuple[Row, Row]

    @classmethod
    def of_row(cls, row: list[float]) -> Reading:
        """Return the reading of its 11 numbers in order."""
        side, weight, u, v, down, a, b, c, d, e, f = row
        return cls(side, weight, (u, v, down), ((a, b, c), (d, e, f)))

    def size(self, limit: Thresholds) -> float:
        """Return the load over the thresholds, the larger of force and moment [-]."""
        force = hypot(self.side, self.weight) / limit.force
        return max(force, hypot(*self.moments) / limit.moment)

    def aside(self, limit: Thresholds) -> float:
        """Return over the thresholds what no payload weighs: across gravity and about it [-]."""
        return max(self.side / limit.force, abs(self.moments[2]) / limit.moment)

    def is_weight(self, limit: Thresholds) -> bool:
        """Tell whether some payload could weigh like this."""
        return self.aside(limit) <= 1.0 and self.weight > limit.force


class PayloadEstimate:
    """Weight and moments of a payload by a Kalman filter of a constant.

    Parameters
    ----------
    weight : float
        [N].
    moments : (float, float, float)
        Weight times centre in U [N m].
    open_moment : float
        Standard deviation of each moment [N m]; 0 where they are known.
    """

    def __init__(self, weight: float, moments: Row, open_moment: float) -> None:
        variance = open_moment * open_moment
        self.weight, self.moments = weight, moments
        self._readings = 0.0 if variance else ENOUGH
        self._spread = (variance, 0.0, 0.0, variance, 0.0, variance)

    def rest(self, reading: Reading) -> Reading:
        """Return what of a load the payload does not explain."""
        first, second = self.shown(reading.rows)
        about_u, about_v, about_down = reading.moments
        moments = (about_u - first, about_v - second, about_down)
        return Reading(reading.side, reading.weight - self.weight, moments, reading.rows)

    def shown(self, rows: tuple[Row, Row]) -> tuple[float, float]:
        """Return the payload's moments about u and v at a pose [N m]."""
        (ax, ay, az), (bx, by, bz) = rows
        x, y, z = self.moments
        return ax * x + ay * y + az * z, bx * x + by * y + bz * z

    def open_moment(self, rows: tuple[Row, Row]) -> float:
        """Return how far its moments at a pose may be from what is known of them [N m]."""
        return SIGMAS * max(_quadratic(self._spread, row) for row in rows) ** 0.5

    def explains(self, reading: Reading, limit: Thresholds, counts: float) -> bool:
        """Tell whether a load is the payload's, within thresholds and what poses left open.

        If so, it is learned from, as so much of a reading that is independent of those before [-].
        """
        side, weight, (about_u, about_v, about_down), (row_u, row_v) = reading
        force = weight - self.weight
        if side * side + force * force > limit.force * limit.force:
            return False
        (ax, ay, az), (bx, by, bz), (x, y, z) = row_u, row_v, self.moments
        left_u = about_u - (ax * x + ay * y + az * z)
        left_v = about_v - (bx * x + by * y + bz * z)
        noise = limit.moment * limit.moment / (SIGMAS * SIGMAS)
        of_u, of_v = _quadratic(self._spread, row_u), _quadratic(self._spread, row_v)
        moment = left_u * left_u / (noise + of_u) + left_v * left_v / (noise + of_v)
        if moment + about_down * about_down / noise > SIGMAS * SIGMAS:
            return False
        if not counts:
            return True
        if self._readings < ENOUGH:
            self._readings += counts
            self.weight += counts * force / self._readings
        if ENOUGH * of_u > noise:
            self._learn(row_u, about_u, noise / counts)
        if ENOUGH * of_v > noise:
            self._learn(row_v, about_v, noise / counts)
        return True

    def _learn(self, row: Row, value: float, noise: float) -> None:
        xx, xy, xz, yy, yz, zz = self._spread
        a, b, c = row
        px, py, pz = xx * a + xy * b + xz * c, xy * a + yy * b + yz * c, xz * a + yz * b + zz * c
        variance = a * px + b * py + c * pz
        x, y, z = self.moments
        gain = 1.0 / (variance + noise)
        step = gain * (value - a * x - b * y - c * z)
        self.moments = x + px * step, y + py * step, z + pz * step
        self._spread = (
            xx - gain * px * px,
            xy - gain * px * py,
            xz - gain * px * pz,
            yy - gain * py * py,
            yz - gain * py * pz,
            zz - gain * pz * pz,
        )


def _quadratic(spread: tuple[float, ...], row: Row) -> float:
    xx, xy, xz, yy, yz, zz = spread
    a, b, c = row
    return a * a * xx + b * b * yy + c * c * zz + 2.0 * (a * b * xy + a * c * xz + b * c * yz)


class Scales:
    """Weighs on one wrist: reads loads along gravity, and turns payloads into loads.

    Parameters
    ----------
    geometry : Geometry
        Gravity, and the largest moment of the table: a payload beyond it is refused anyway.
    """

    def __init__(self, geometry: Geometry) -> None:
        self.geometry = geometry
        self._g = float(np.linalg.norm(geometry.gravity))
        down = geometry.gravity / self._g if self._g else np.array([0.0, 0.0, -1.0])
        frame = triad(down, np.eye(3)[np.argmin(np.abs(down))])
        self._axes: list[list[float]] = [*frame[:, 1:].T.tolist(), down.tolist()]
        self._constants = np.append(self._axes, self._g)

    def read(self, table: Table, theta: Array, load: Load) -> Reading:
        """Read a load.

        Parameters
        ----------
        table : Table
            Its domain and range of loads.
        theta : (2,) float
            Motor angles [rad].
        load : Load
            On the platform there.

        Raises
        ------
        WristError
            If the pose or the load is out of range.
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

        Parameters
        ----------
        table : Table
            Its domain and range of loads.
        theta, wrench : (n, 2), (n, 6) float
            Motor angles [rad], loads at O [N, N m].
        on_platform : (n,) bool
            Which loads are in U, not in F.

        Returns
        -------
        (n, 11) float, (n,) bool
            What `Reading.of_row` takes, and where that could be had.
        """
        n = len(on_platform)
        rows, status = np.empty((n, native.READING)), np.empty(n, dtype=np.uint8)
        constants = table.workspace.constants
        native.read_load(constants, self._constants, theta, wrench, on_platform, rows, status)
        return rows, status == 0

    def reading(self, wrench: list[float], rotation: list[list[float]]) -> Reading:
        """Return a load (6,) at O in F [N, N m] on the platform that is turned by (3, 3)."""
        force_u, force_v, weight = self.along(wrench[:3])
        side = hypot(force_u, force_v)
        if not self._g:
            # Nothing weighs: whatever acts is a contact.
            side, weight = hypot(side, weight), 0.0
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
        return PayloadEstimate(reading.weight, (0.0, 0.0, 0.0), self.geometry.limits.moment)

    def estimate(self, payload: Payload) -> PayloadEstimate:
        """Return a payload as an estimate that is known."""
        weight = payload.mass_kg * self._g
        x, y, z = payload.centre_m
        return PayloadEstimate(weight, (weight * x, weight * y, weight * z), 0.0)

    def payload(self, estimate: PayloadEstimate) -> Payload:
        """Return an estimate as a payload."""
        x, y, z = (moment / estimate.weight for moment in estimate.moments)
        return Payload(estimate.weight / self._g, (x, y, z))


@dataclass(frozen=True)
class Held:
    """What a plan is corrected for, from `Supervisor.held`.

    Parameters
    ----------
    scales, payload : Scales, PayloadEstimate or None
        None where there is no payload.
    followed : Load or None
        Where every load is followed.
    share : float
        Part of the correction that is applied [-].
    valid : bool
        Whether the load was known and corrected for, as `Supervision.valid`.
    threshold : float
        A moment by which a load would be another one [N m].
    """

    scales: Scales | None
    payload: PayloadEstimate | None
    followed: Load | None
    share: float
    valid: bool
    threshold: float

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
