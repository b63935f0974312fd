"""A payload is a weight at a fixed point of the platform; known from measured loads, or told.

Its force is constant in F, along gravity, and its moment follows the pose: that is what tells it
from a contact.  With axes u, v, down of F, its weight W [N] and the moments Q = W * centre [N m], a
payload's load at O has no force along u and v and no moment about down, the force W, and

    moment_u = (R' v) . Q        moment_v = -(R' u) . Q

so one pose shows two of the three components of Q, and other poses the third.  Plain floats: the
arrays have three elements, and this is done for every command.
"""

from __future__ import annotations

from collections.abc import Sequence
from ctypes import Structure, c_double
from dataclasses import dataclass
from math import isfinite, sqrt
from typing import NamedTuple

from wrist_stiffness.errors import InputError

SIGMAS = 3.0
"""A threshold is this many standard deviations of what one reading may be wrong by."""

ENOUGH = 10.0
"""After so many readings that are independent a direction counts as known and is learned no
further, so that a contact that grows slowly is not learned as payload."""

Row = tuple[float, float, float]


@dataclass(frozen=True)
class Payload:
    """What the platform carries.

    Raises `InputError` if a number is not finite or the mass is not positive.
    """

    mass_kg: float  # [kg]
    centre_m: Row  # its centre of gravity in U, from O [m]

    def __post_init__(self) -> None:
        """Check the numbers."""
        if not (isfinite(self.mass_kg) and self.mass_kg > 0.0):
            raise InputError(f"payload: mass {self.mass_kg} kg is not a positive number")
        if len(self.centre_m) != 3 or not all(map(isfinite, self.centre_m)):
            raise InputError(f"payload: centre {self.centre_m} m is not three finite numbers")


class Thresholds(NamedTuple):
    """A load that departs by more than these is another load."""

    # `force`, `moment` [N], [N m]
    force: float
    moment: float

    def times(self, factor: float) -> Thresholds:
        """Return a multiple of both."""
        return Thresholds(factor * self.force, factor * self.moment)

    def wider(self, reading: Reading, turn: float) -> Thresholds:
        """Return thresholds for a load that may seem turned [rad]."""
        force, moment = reading.lengths
        return Thresholds(self.force + turn * force, self.moment + turn * moment)


class Reading(NamedTuple):
    """A load along u, v and down, and what its moments say of a payload."""

    side: float  # force across gravity [N]
    weight: float  # force along gravity [N]
    moments: Row  # about u, v and down [N m]
    rows: tuple[Row, Row]  # what the first two moments are of Q [-]

    @classmethod
    def of_row(cls, row: list[float]) -> Reading:
        """Return the reading of its 11 numbers in order."""
        side, weight, u, v, down, a, b, c, d, e, f = row
        return cls(side, weight, (u, v, down), ((a, b, c), (d, e, f)))

    @property
    def lengths(self) -> tuple[float, float]:
        """Force and moment [N, N m]."""
        side, weight, (u, v, down), _ = self
        # Not `hypot`, which rounds otherwise from one library to another.
        return sqrt(side * side + weight * weight), sqrt(u * u + v * v + down * down)

    def size(self, limit: Thresholds) -> float:
        """Return the load over the thresholds, the larger of force and moment [-]."""
        force, moment = self.lengths
        return max(force / limit.force, moment / limit.moment)

    def aside(self, limit: Thresholds) -> float:
        """Return over the thresholds what no payload weighs: across gravity and about it [-]."""
        return max(self.side / limit.force, abs(self.moments[2]) / limit.moment)

    def is_weight(self, limit: Thresholds) -> bool:
        """Tell whether some payload could weigh like this."""
        return self.aside(limit) <= 1.0 and self.weight > limit.force


class PayloadEstimate(Structure):
    """Weight and moments of a payload by a Kalman filter of a constant; `Estimate` of `wrist.h`."""

    _fields_ = [
        ("known", c_double),  # whether there is one at all
        ("weight", c_double),  # [N]
        ("moments", c_double * 3),  # weight times centre in U [N m]
        ("readings", c_double),  # that were learned from, as far as they are independent [-]
        ("spread", c_double * 6),  # covariance of the moments: xx, xy, xz, yy, yz, zz [N^2 m^2]
    ]
    moments: Sequence[float]
    spread: Sequence[float]

    @classmethod
    def of(cls, weight: float, moments: Row, open_moment: float) -> PayloadEstimate:
        """Return an estimate; `open_moment`: standard deviation of each moment, 0 where known."""
        variance = open_moment * open_moment
        readings = 0.0 if variance else ENOUGH
        return cls(1.0, weight, moments, readings, (variance, 0.0, 0.0, variance, 0.0, variance))

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
        return SIGMAS * sqrt(max(_quadratic(self.spread, row) for row in rows))

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
        of_u, of_v = _quadratic(self.spread, row_u), _quadratic(self.spread, row_v)
        moment = left_u * left_u / (noise + of_u) + left_v * left_v / (noise + of_v)
        if moment + about_down * about_down / noise > SIGMAS * SIGMAS:
            return False
        if not counts:
            return True
        if self.readings < ENOUGH:
            self.readings += counts
            self.weight += counts * force / self.readings
        if ENOUGH * of_u > noise:
            self._learn(row_u, about_u, noise / counts)
        if ENOUGH * of_v > noise:
            self._learn(row_v, about_v, noise / counts)
        return True

    def _learn(self, row: Row, value: float, noise: float) -> None:
        xx, xy, xz, yy, yz, zz = self.spread
        a, b, c = row
        px, py, pz = xx * a + xy * b + xz * c, xy * a + yy * b + yz * c, xz * a + yz * b + zz * c
        variance = a * px + b * py + c * pz
        x, y, z = self.moments
        gain = 1.0 / (variance + noise)
        step = gain * (value - a * x - b * y - c * z)
        self.moments = x + px * step, y + py * step, z + pz * step
        self.spread = (
            xx - gain * px * px,
            xy - gain * px * py,
            xz - gain * px * pz,
            yy - gain * py * py,
            yz - gain * py * pz,
            zz - gain * pz * pz,
        )


def _quadratic(spread: Sequence[float], row: Row) -> float:
    xx, xy, xz, yy, yz, zz = spread
    a, b, c = row
    return a * a * xx + b * b * yy + c * c * zz + 2.0 * (a * b * xy + a * c * xz + b * c * yz)
