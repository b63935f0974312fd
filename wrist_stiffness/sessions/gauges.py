"""Dial gauges and inclinometers: what each reads of the platform's pose, and what of its error.

A gauge reads one number of a pose.  To first order an error twist (t, phi) at O changes it by one
row h of numbers, h @ (t, phi).  A tracker is the special case in which the rows are those of the
identity.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, replace
from functools import cached_property
from pathlib import Path
from typing import Any

import numpy as np

from wrist_stiffness.errors import InputError
from wrist_stiffness.inference import Quantity as Reported
from wrist_stiffness.inputs.document import Node, read_yaml
from wrist_stiffness.inputs.schema import Quantity, list_of, record, text, vector, version
from wrist_stiffness.mechanism.components import Array
from wrist_stiffness.mechanism.kinematics import Mechanism
from wrist_stiffness.mechanism.rigid_motion import exp_twist
from wrist_stiffness.sessions.in_pieces import in_pieces

GAUGES = Reported("gauges", "um", (), 1e6)
TILTS = Reported("tilts", "mdeg", (), 180e3 / np.pi)

MOVES_M, MOVES_RAD = 5e-5, 1e-3
"""Motion of the rigid wrist, RMS, from which a wrong sign or unit shows in it: far above what
elasticity and faults do."""

ZERO_M, ZERO_RAD = 0.02, 0.1
"""Standard deviation of a zero: of no account, since nobody knows where a dial was set to 0."""

POINT_M, DIRECTION_RAD = 1e-3, np.radians(2.0)
"""Standard deviations with which a ball's place and a direction are known, as a ruler and a square
tell them (assumed)."""

LENGTHS, ANGLES = ("mm", "um", "in"), ("deg", "mdeg")
"""Units of their columns."""

STEP = 1e-4
"""Of differences, in [m], [rad] and standard deviations of a mounting: curvature and rounding are
nothing beside it."""


@dataclass(frozen=True, eq=False)
class Gauge:
    """One instrument that reads one number of the platform's pose."""

    name: str  # column of the table without its unit
    # (3,), unit vector along which the reading grows.  Of a dial gauge in F: it stands on the base,
    # its flat tip on a ball.  Of an inclinometer in U: an arrow on the platform, whose angle above
    # the horizontal it reads
    direction: Array
    point: Array | None = None  # (3,), centre of the ball in U from O [m]; None for an inclinometer

    @classmethod
    def of_note(cls, facts: Mapping[str, Any]) -> Gauge:
        """Return the instrument that a recording's note describes (inverse of `note`)."""
        point = facts.get("point_m")
        along = np.array(facts["direction"], dtype=float)
        return cls(facts["name"], along, None if point is None else np.array(point, dtype=float))

    @property
    def note(self) -> dict[str, Any]:
        """As it stands in a recording's notes."""
        point = {} if self.point is None else {"point_m": self.point.tolist()}
        return {"name": self.name, "direction": self.direction.tolist(), **point}

    @property
    def counts_up(self) -> str:
        """When the reading grows, after "does it"."""
        what = "arrow" if self.point is None else "ball"
        return f"count up when the {what} moves along its direction"

    def follows(self, rigid: Array) -> bool:
        """Tell whether the rigid wrist moves so much that signs and units show in readings (n,)."""
        return bool(np.std(rigid) >= (MOVES_RAD if self.point is None else MOVES_M))

    def reading(self, shift: Array, rotation: Array, up: Array) -> Array:
        """Return what it reads of poses but for its zero, (..., n) [m] or [rad].

        `shift` (..., n, 3) or (3,): position of O in F [m]; `rotation` (..., n, 3, 3): U -> F; `up`
        (3,): unit vector against gravity in F.
        """
        if self.point is None:
            return np.asarray(np.arcsin(np.clip(rotation @ self.direction @ up, -1.0, 1.0)))
        return np.asarray((rotation @ self.point + shift) @ self.direction)

    def mounting(self, rotation: Array, up: Array) -> Array:
        """Return what a standard deviation of its zero, place and directions does, (n, q)."""

        def read(step: Array) -> Array:
            own, zero = self.mounted(step)
            return zero + own.reading(np.zeros(3), rotation, up)

        return _slopes(read, 3 if self.point is None else 6)

    def mounted(self, step: Array) -> tuple[Gauge, float]:
        """Return it with another mounting, (q,) standard deviations away, and its zero."""
        aside = np.linalg.svd(self.direction[None])[2][1:] * DIRECTION_RAD
        along = self.direction + step[-2:] @ aside
        along = along / np.linalg.norm(along)
        if self.point is None:
            return Gauge(self.name, along), ZERO_RAD * float(step[0])
        return Gauge(self.name, along, self.point + POINT_M * step[1:4]), ZERO_M * float(step[0])


def _slopes(function: Callable[[Array], Array], count: int) -> Array:
    """Return the central differences (..., count) at zero of a function of so many numbers."""
    steps = STEP * np.eye(count)
    return np.stack([(function(each) - function(-each)) / (2.0 * STEP) for each in steps], axis=-1)


@dataclass(frozen=True, eq=False)
class Gauges:
    """All gauges of a session."""

    members: tuple[Gauge, ...]  # K of them, as they stand
    mechanism: Mechanism
    up: Array  # (3,), unit vector against gravity in F

    @cached_property
    def quantities(self) -> tuple[Reported, ...]:
        """What is reported as one length: dial gauges together, and inclinometers."""
        tilts = tuple(n for n, each in enumerate(self.members) if each.point is None)
        lengths = tuple(n for n in range(len(self.members)) if n not in tilts)
        return tuple(
            replace(quantity, components=own, called=tuple(self.members[n].name for n in own))
            for quantity, own in ((GAUGES, lengths), (TILTS, tilts))
            if own
        )

    def rigid(self, theta: Array) -> Array:
        """Return the rotation U -> F of the rigid wrist at angles (n, 2) [rad], (n, 3, 3)."""
        return in_pieces(self.mechanism.platform_rotation, theta)

    def predicted(self, twist: Array, theta: Array) -> Array:
        """Return by how much twists (..., n, 6) at O change them at angles (n, 2), (..., n, K)."""
        rigid = self.rigid(theta)
        rotation, shift = exp_twist(twist)
        rotation = rotation @ rigid
        changes = [
            each.reading(shift, rotation, self.up) - each.reading(np.zeros(3), rigid, self.up)
            for each in self.members
        ]
        return np.stack(changes, axis=-1)

    def rows(self, theta: Array) -> Array:
        """Return by how much a twist at O in F changes the readings, (n, K, 6)."""
        return _slopes(lambda twist: self.predicted(np.tile(twist, (len(theta), 1)), theta), 6)

    def common(self, theta: Array) -> Array:
        """Return what standard deviations of all mountings do to the readings, (n, K, q)."""
        rotation = self.rigid(theta)
        own = [each.mounting(rotation, self.up) for each in self.members]
        ends = np.cumsum([each.shape[1] for each in own])
        out = np.zeros((len(theta), len(own), ends[-1]))
        for number, (each, end) in enumerate(zip(own, ends, strict=True)):
            out[:, number, end - each.shape[1] : end] = each
        return out


def cleared(values: Array, common: Array, sigma: Array) -> Array:
    """Return values (n, m) or (n, m, k) without what they have in common, NaN where they have it.

    `values` (n, m) or (n, m, k): left by a model; `common` (n, m, q): what a standard deviation of
    each unknown does to them; `sigma` (m,): their scatter: what is less than that is not taken out.
    """
    if not common.shape[2]:
        return values
    columns = values if values.ndim == 3 else values[:, :, None]
    known = np.isfinite(columns)
    white = np.where(known[:, :, :1], common, 0.0) / sigma[:, None]
    flat = white.reshape(-1, common.shape[2])
    target = (np.where(known, columns, 0.0) / sigma[:, None]).reshape(len(flat), -1)
    taken = np.linalg.solve(flat.T @ flat + np.eye(flat.shape[1]), flat.T @ target)
    return np.asarray((columns - common @ taken).reshape(values.shape))


def _direction(node: Node) -> Array:
    """Read a direction of any length (3,), and return its unit vector."""
    along = vector()(node)
    length = float(np.linalg.norm(along))
    if length == 0.0:
        raise node.refuse("is no direction: all three numbers are 0")
    return np.asarray(along / length)


GAUGE = record({"column": text(), "direction": _direction}, {"point_mm": Quantity(vector())})
FILE = record({"schema": version(1), "gauges": list_of(lambda node: node, at_least=1)})


def gauge_of(column: str) -> str:
    """Return the name of a column without its unit."""
    return column.rpartition("_")[0]


def read_gauges(path: str | Path) -> dict[str, Gauge]:
    """Read which gauge reads which column, in the file's order (InputError if it is wrong)."""
    found: dict[str, Gauge] = {}
    for node in FILE(read_yaml(path, InputError))["gauges"]:
        column, gauge = _gauge(node)
        if gauge.name in (known.name for known in found.values()):
            raise node["column"].refuse(f"{gauge.name!r} is there twice")
        found[column] = gauge
    return found


def _gauge(node: Node) -> tuple[str, Gauge]:
    own = GAUGE(node)
    name, _, unit = own["column"].rpartition("_")
    if not name or unit not in (*LENGTHS, *ANGLES):
        ends = ", ".join(f"_{each}" for each in (*LENGTHS, *ANGLES))
        raise node["column"].refuse(f"{own['column']!r} is no name with its unit ({ends})")
    if (unit in LENGTHS) != ("point" in own):
        what = "a dial gauge needs a" if unit in LENGTHS else "an inclinometer has no"
        raise node.refuse(f"{own['column']}: {what} point_mm")
    return own["column"], Gauge(name, own["direction"], own.get("point"))
