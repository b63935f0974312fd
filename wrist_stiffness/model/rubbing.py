"""A joint that rubs: bristles between its surfaces, which bend before they slip."""

from __future__ import annotations

import math
from dataclasses import dataclass
from itertools import repeat

import numpy as np

from wrist_stiffness.mechanism.compiled import native
from wrist_stiffness.mechanism.components import PASSIVE_JOINTS, Array
from wrist_stiffness.mechanism.geometry import Geometry
from wrist_stiffness.model.contribution import Contribution
from wrist_stiffness.model.places import end_screws
from wrist_stiffness.model.situation import Situation, lengths

LEAST_BUDGET = 1e-9
"""[N]; keeps the stiffness of a joint without bearing force finite."""

MAX_STEPS, NEARLY = 30, 1e-8
"""Of the search for a slip; from so near its force, relative to the budget, one step is the last:
the next one would change nothing beyond rounding."""


@dataclass(frozen=True, eq=False)
class Bristles:
    """The bristles of a joint at n samples; two directions: round the axis, along it."""

    moved: Array  # (n, 2), where the surface would go without friction [m]
    compliance: Array  # (n, 2), of bristle and limb in series [m/N]
    budget: Array  # (n,), largest force [N]


@dataclass(frozen=True, eq=False)
class Rubbing:
    """Friction of a joint."""

    joint: str  # passive joint
    coefficient: float  # budget over pressing forces [-]
    preload: float  # further pressing force [N]
    presliding: float  # distance by which the bristle bends under the budget [m]
    bristle: float  # by which it bends besides for a unit force [m/N]
    # (n, 2) or 0, with which it drags the bristles along in the situation that it is asked about,
    # round the axis and along it [N]
    force: Array | float = 0.0

    def bristles(self, at: Situation) -> Bristles:
        """Return the bristles in a situation."""
        geometry, joint = at.table.geometry, self.joint
        radius = self.radius(geometry)
        pressed = pressing(geometry, joint, at.at_home(joint, at.through_place(joint)))
        budget = self.coefficient * (pressed + self.preload) + LEAST_BUDGET
        bristle = self.presliding / budget + self.bristle
        place = PASSIVE_JOINTS.index(joint)
        slide, turn = (each[:, place] for each in at.statics.slide_flexibility)
        own = np.broadcast_to(self.force, (len(at.block), 2))[:, 1]
        slid = at.slides[:, place] + slide * own
        return Bristles(
            np.stack([radius * at.turn(joint), slid], axis=1),
            np.stack([bristle + radius**2 * turn, bristle + slide], axis=1),
            budget,
        )

    def radius(self, geometry: Geometry) -> float:
        """Return the radius of the joint's pin [m]."""
        return 0.5 * geometry.bushings[self.joint].pin_diameter

    def push(self, at: Situation, force: Array) -> Contribution:
        """Return what a force (n, 2) that drags the bristles does to the wrist."""
        radius = self.radius(at.table.geometry)
        return at.joint_push(self.joint, -force[:, 1], -radius * force[:, 0])


def pressing(geometry: Geometry, joint: str, wrench: Array) -> Array:
    """Return the sum of the radial forces at both ends of a sleeve; a moment presses both.

    `wrench` (n, 6): carried by the joint, at O in its home frame [N, N m].  Gives (n,) [N].
    """
    ends = wrench @ end_screws(geometry, joint).T
    return np.asarray(lengths(ends[:, :2]) + lengths(ends[:, 2:]))


def slip(bristles: Bristles, foot: Array, give: Array | None = None) -> tuple[Array, Array]:
    """Follow bristles that slip where their force would exceed the budget.

    A bristle that is dragged lies in the direction of its slip.

    `bristles`: at n samples; `foot` (2,): where they stand at first [m]; `give` (n, 2, 2): by which
    the surface gives way to a unit force, besides the compliance [m/N].  Gives `force` (n, 2): with
    which they are dragged along [N], and `feet` (n + 1, 2): where they stand before each sample,
    and after the last one [m].
    """
    n = len(bristles.moved)
    force, feet = np.empty((n, 2)), np.empty((n + 1, 2))
    x, y = float(foot[0]), float(foot[1])
    feet[0] = x, y
    compliance, axes = bristles.compliance, None
    if give is not None:
        # Along the principal axes a slip adds the same to both compliances.
        compliance, axes = np.linalg.eigh(compliance[:, :, None] * np.eye(2) + give)
    if native is not None:
        given = (bristles.moved, compliance, axes, bristles.budget)
        native.slip(*(e if e is None else np.ascontiguousarray(e) for e in given), force, feet)
        return force, feet
    # Plain numbers: the history goes sample by sample, and arrays of two are slow.
    rows = zip(
        bristles.moved.tolist(),
        compliance.tolist(),
        repeat(((1.0, 0.0), (0.0, 1.0)), n) if axes is None else axes.tolist(),
        bristles.budget.tolist(),
        strict=True,
    )
    for row, ((u, v), (ca, cb), ((ua, ub), (va, vb)), limit) in enumerate(rows):
        a, b = ua * (u - x) + va * (v - y), ub * (u - x) + vb * (v - y)
        fa, fb = a / ca, b / cb
        size = math.hypot(fa, fb)
        if size > limit:
            more = 0.0
            for _ in range(MAX_STEPS):
                # Newton's step for 1 / size, which is nearly straight in `more`.
                slope = fa * fa / (ca + more) + fb * fb / (cb + more)
                off = size / limit - 1.0
                more += off * size * size / slope
                fa, fb = a / (ca + more), b / (cb + more)
                if abs(off) <= NEARLY:
                    break
                size = math.hypot(fa, fb)
            a, b = more * fa, more * fb
            x, y = x + ua * a + ub * b, y + va * a + vb * b
        force[row] = ua * fa + ub * fb, va * fa + vb * fb
        feet[row + 1] = x, y
    return force, feet


def dragged(bent: Array, compliance: Array, budget: Array) -> tuple[Array, Array, Array]:
    """Return the energy of bristles whose surface has gone away from their feet, and its slopes.

    Slip included it is convex: the least over all places where the feet may go.

    `bent` (..., 2): from the foot to the surface [m]; `compliance` (..., 2) [m/N]; `budget` (...):
    largest force [N].  Gives `energy` (...) [J], and `force` (..., 2): its gradient [N], and
    `stiffness` (..., 2, 2): its second derivative [N/m].
    """
    force = bent / compliance
    size, more = lengths(force), np.zeros_like(budget)
    slips = size > budget
    limit = np.where(slips, budget, 1.0)
    for _ in range(MAX_STEPS):
        slope = (force**2 / (compliance + more[..., None])).sum(axis=-1)
        off = np.where(slips, size / limit - 1.0, 0.0)
        more = more + np.divide(off * size**2, slope, out=np.zeros_like(off), where=slips)
        force = bent / (compliance + more[..., None])
        if (np.abs(off) <= NEARLY).all():
            break
        size = lengths(force)
    energy = 0.5 * (compliance * force**2).sum(axis=-1) + more * np.where(slips, budget**2, 0.0)
    soft = 1.0 / (compliance + more[..., None])
    along = soft * force
    down = np.divide(1.0, (force * along).sum(axis=-1), out=np.zeros_like(size), where=slips)
    stiffness = soft[..., None] * np.eye(2) - down[..., None, None] * (
        along[..., :, None] * along[..., None, :]
    )
    return energy, force, stiffness
