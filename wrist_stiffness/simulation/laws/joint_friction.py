"""`joint_friction`: a passive joint sticks and slips, in turn and slide together."""

from __future__ import annotations

from dataclasses import dataclass
from math import exp, hypot

import numpy as np
from scipy.optimize import brentq

from wrist_stiffness.mechanism.components import ELASTIC, PASSIVE_JOINTS, Array
from wrist_stiffness.mechanism.vectors import dot
from wrist_stiffness.simulation.block import Block
from wrist_stiffness.simulation.equilibrium import Equilibrium
from wrist_stiffness.simulation.laws.law import JOINED, Rubbing
from wrist_stiffness.simulation.seat import Seat

STRIBECK_SPEED = 5e-5
"""Slip at which the budget has fallen to that of motion [m/s]."""

BUDGET_TOLERANCE = 1e-12
"""Error of the friction of a joint that slips, relative to its budget."""

Pair = tuple[float, float]
"""Along the slide and round it [m] or [N]."""


@dataclass
class JointFriction(Rubbing):
    """Elasto-plastic friction of a cylindrical joint with one budget for slide and turn.

    Bristles of the stiffness sigma carry the friction force p = -sigma z on (slide, radius x turn)
    until its length reaches the budget mu N + p0, N being the sum of the radial reactions at both
    ends of the bushing; from then on they are dragged along.  A joint that turns therefore has
    little friction left along its axis; one at rest locks its slide.
    """

    component: str  # passive joint
    seat: Seat  # of its bushing
    mu: float  # coefficient of friction [-]
    preload: float  # p0, the budget of the unloaded joint [N]
    stiffness: float  # sigma, of the bristles [N/m]
    stribeck: float  # how much more the budget is at rest than in motion [-]
    past: tuple[float, Pair, Pair] | None = None  # time [s], slip [m] and bristles [m]

    def rub(
        self, block: Block, give: Array, state: Equilibrium, acting: Array, remember: bool
    ) -> Array:
        """Return the friction of each sample by an implicit step from the one before."""
        joint = self.component
        j, arm = PASSIVE_JOINTS.index(joint), self.seat.radius
        to_slip = np.array([1.0, arm])
        path = state.slips[:, j] * to_slip
        path[:, 1] += arm * self.turn_of(block)
        give = give[:, j] * to_slip[:, None] * to_slip
        free = path - (give @ (acting / to_slip)[..., None])[..., 0]
        budget = self.budget(self.reaction(block, state.through[:, ELASTIC.index(joint)]))
        start = float(block.time_s[0]), (path[0, 0], path[0, 1]), (0.0, 0.0)
        before, past, bristle = self.past or start
        out = np.empty_like(path)
        # Plain numbers: the history goes sample by sample, and arrays of two are slow.
        for i, (now, to, soft, slow) in enumerate(
            zip(block.time_s.tolist(), free.tolist(), give.tolist(), budget.tolist(), strict=True)
        ):
            pull = bristle[0] + to[0] - past[0], bristle[1] + to[1] - past[1]
            force = _implicit(self.stiffness, soft, pull)
            at = _given(soft, force, to)
            speed = hypot(at[0] - past[0], at[1] - past[1]) / max(now - before, 1e-9)
            most = slow * (1.0 + self.stribeck * exp(-speed / STRIBECK_SPEED))
            if hypot(*force) > most:
                force = _dragged(most, self.stiffness, soft, pull)
            out[i] = force
            bristle = -force[0] / self.stiffness, -force[1] / self.stiffness
            before, past = now, _given(soft, force, to)
        if remember:
            self.past = before, past, bristle
        return out * to_slip

    def turn_of(self, block: Block) -> Array:
        """Turn of the joint from home, (n,) [rad]."""
        return joint_turn(block, self.component, self.seat.axis)

    def budget(self, reaction: Array) -> Array:
        """Friction in motion for a reaction (...) [N]."""
        return self.preload + self.mu * reaction

    def reaction(self, block: Block, through: Array) -> Array:
        """Sum of the radial forces at both ends of the bushing, (n,) [N], for its wrench (n, 6)."""
        to_origin = self.seat.to_origin(block.rotation(self.component))
        local = np.einsum("nji,nj->ni", to_origin, through)
        push = np.einsum("rij,nj->nri", self.seat.rings, local)
        return np.asarray(np.sqrt(dot(push, push)).sum(axis=-1))


def joint_turn(block: Block, joint: str, axis: Array) -> Array:
    """Return the turn of a passive joint from home about its axis there (3,), (n,) [rad]."""
    inner, outer = JOINED[joint]
    bodies = block.configuration.rotations
    relative = np.swapaxes(bodies[inner], -1, -2) @ bodies[outer]
    across = np.linalg.svd(axis[None])[2][1]
    turned = relative @ across
    return np.arctan2(turned @ np.cross(axis, across), turned @ across)


def _implicit(stiffness: float, give: list[list[float]], pull: Pair) -> Pair:
    """Return the force of bristles on joint surfaces that themselves give way (2, 2)."""
    (a, b), (c, d) = give
    a, b, c, d = 1.0 + stiffness * a, stiffness * b, stiffness * c, 1.0 + stiffness * d
    share = -stiffness / (a * d - b * c)
    return share * (d * pull[0] - b * pull[1]), share * (a * pull[1] - c * pull[0])


def _dragged(most: float, stiffness: float, give: list[list[float]], pull: Pair) -> Pair:
    """Return the force of the size `most` against a slip that depends on the force itself.

    Dragged along, the bristles lie in the direction of slip.  The stiffness that would give the
    same force is found between none and their own: the force grows with it.
    """

    def excess(secant: float) -> float:
        return hypot(*_implicit(secant, give, pull)) / most - 1.0

    secant = brentq(excess, 0.0, stiffness, xtol=1e-12 * stiffness, rtol=BUDGET_TOLERANCE)
    return _implicit(secant, give, pull)


def _given(give: list[list[float]], force: Pair, start: Pair) -> Pair:
    """Return `start` plus what a force moves surfaces that give way (2, 2)."""
    (a, b), (c, d) = give
    return start[0] + a * force[0] + b * force[1], start[1] + c * force[0] + d * force[1]
