"""The equilibrium of all bodies at once with hidden laws: it judges the fast path."""

from __future__ import annotations

from collections.abc import Sequence
from functools import partial

import numpy as np

from wrist_stiffness.lookup.table import Table
from wrist_stiffness.mechanism.components import ELASTIC, PASSIVE_JOINTS, Array
from wrist_stiffness.mechanism.statics import turned_flexibilities
from wrist_stiffness.simulation.block import Block
from wrist_stiffness.simulation.exact import (
    FAR,
    MICRO,
    NEAR,
    PAIRS_APART,
    SCREW,
    THROUGH,
    Equations,
    ExactState,
    carried,
)
from wrist_stiffness.simulation.laws.joint_friction import JointFriction
from wrist_stiffness.simulation.laws.law import Bending, Law


class ExactWrist:
    """A wrist with hidden laws, pose by pose; friction remembers the pose before.

    `laws`: hidden; sensor laws, motor laws and creep are not looked at.
    """

    def __init__(self, table: Table, laws: Sequence[Law]) -> None:
        self._mechanism, self._laws = table.mechanism, laws
        self._parts, self._gravity = table.components, table.geometry.gravity
        for law in laws:
            self._parts, self._gravity = law.parts(self._parts), law.gravity(self._gravity)
        self._drags = {law.component: Drag(law) for law in laws if isinstance(law, JointFriction)}

    def solve(self, theta: Array, load: Array, kelvin: Array) -> ExactState:
        """Find the equilibrium of the next pose.

        `theta` (2,): True motor angles [rad]; `load` (6,): wrench on the platform at O in F [N, N
        m]; `kelvin` (7,): temperatures of `HEATED` above the reference [K].
        """
        configuration = self._mechanism.forward(theta[None])
        flexibility = turned_flexibilities(configuration, self._parts)
        block = Block(np.zeros(1), configuration, load[None], flexibility, kelvin[None])
        whole = load + sum((law.wrench(block)[0] for law in self._laws), np.zeros(6))
        own = configuration, self._parts, self._gravity, whole
        return LawfulEquations(block, self._laws, self._drags, *own).solve()


class Drag:
    """Friction of one pair from pose to pose."""

    def __init__(self, law: JointFriction) -> None:
        self.law = law
        self.past: Array | None = None
        self.bristle = np.zeros(2)

    def force(self, path: Array, reaction: Array) -> tuple[Array, Array]:
        """Return friction (2,) on (slide, radius x turn) at `path` (2,), and minus its slope."""
        past = path if self.past is None else self.past
        stuck = -self.law.stiffness * (self.bristle + path - past)
        most, size = float(self.law.budget(reaction)), float(np.hypot(*stuck))
        if size <= most:
            return stuck, self.law.stiffness * np.eye(2)
        # Dragged along, the bristles only turn with the direction of slip.
        along = stuck / size
        return most * along, self.law.stiffness * most / size * (np.eye(2) - np.outer(along, along))

    def keep(self, path: Array, force: Array) -> None:
        """Remember the pose."""
        self.past, self.bristle = path, -force / self.law.stiffness


class LawfulEquations(Equations):
    """Residual and tangent of one pose with hidden laws."""

    def __init__(
        self, block: Block, laws: Sequence[Law], drags: dict[str, Drag], *of_the_rest: object
    ) -> None:
        super().__init__(*of_the_rest)
        self._block, self._drags = block, drags
        self._screws = sum((law.screws(block)[0] for law in laws), np.zeros((len(ELASTIC), 6)))
        self._bends = [
            (ELASTIC.index(law.component), partial(law.bend, block))
            for law in laws
            if isinstance(law, Bending)
        ]

    def residual(self, z: Array, force: Array) -> tuple[Array, Array, Array]:
        """Add what laws bend, and what friction drags along."""
        rest, tangent, gap = super().residual(z, force)
        through, given = z[THROUGH].reshape(-1, 6), self._screws.copy()
        for k, law in self._bends:
            extra, slope = law(through[None, k])
            given[k] += extra[0]
            rows = THROUGH.start + 6 * k + np.arange(6)
            tangent[np.ix_(rows, rows)] -= slope[0] / MICRO
        rest[THROUGH] -= given.ravel() / MICRO
        motion, _, slips = self.moved(z)
        for joint in self._drags:
            j = PASSIVE_JOINTS.index(joint)
            near, far = NEAR[len(ELASTIC) + j], FAR[len(ELASTIC) + j]
            _, friction, slope = self._friction(joint, slips[j], through)
            along = np.array([[1.0], [self._drags[joint].law.seat.radius]]) * self.along[j]
            to_path = along @ PAIRS_APART[j]
            tangent[SCREW, SCREW] -= MICRO * to_path.T @ slope @ to_path
            (drag,) = carried(motion, np.array([near]), (friction @ along)[None])
            rest[6 * far : 6 * far + 6] += drag
            rest[6 * near : 6 * near + 6] -= drag
        return rest, tangent, gap

    def _friction(self, joint: str, slip: Array, through: Array) -> tuple[Array, Array, Array]:
        """Return slide and radius times whole turn (2,) [m], friction on them, minus its slope."""
        drag = self._drags[joint]
        turn = drag.law.turn_of(self._block)[0] + slip[1]
        path = np.array([slip[0], drag.law.seat.radius * turn])
        reaction = drag.law.reaction(self._block, through[None, ELASTIC.index(joint)])[0]
        return path, *drag.force(path, reaction)

    def state(self, z: Array, force: Array) -> ExactState:
        """Let friction remember the pose."""
        found, through = super().state(z, force), z[THROUGH].reshape(-1, 6)
        for joint, drag in self._drags.items():
            path, friction, _ = self._friction(
                joint, found.slip[PASSIVE_JOINTS.index(joint)], through
            )
            drag.keep(path, friction)
        return found
