"""Motors with their gears and couplings: what winds up, turns less or stands ahead."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from wrist_stiffness.mechanism.components import Array
from wrist_stiffness.simulation.block import Block
from wrist_stiffness.simulation.laws.law import MOTOR, Bending, Law


def winding(
    joint: str, axis: Array, wound: Callable[[Block, Array], tuple[Array, Array]]
) -> Bending:
    """Let gears and coupling of a driven joint wind up about its axis (3,) by a law of their own.

    `wound`: torque (n,) [N m] to turn (n,) [rad] and its slope (n,).
    """
    about = np.concatenate([np.zeros(3), axis])

    def bend(block: Block, wrench: Array) -> tuple[Array, Array]:
        turn, slope = wound(block, wrench @ about)
        return turn[:, None] * about, slope[:, None, None] * np.outer(about, about)

    return Bending(joint, bend=bend)


def ahead_of_encoder(motor: str, ahead: Callable[[Array], Array]) -> Law:
    """Let a link stand ahead of its motor's encoder, (n,) [rad] at encoder angles (n,) [rad]."""

    def turn(time_s: Array, shaft: Array) -> Array:
        out, column = np.zeros_like(shaft), MOTOR[motor]
        out[:, column] = ahead(shaft[:, column])
        return out

    return Law(motor, turn=turn)


@dataclass
class Backlash(Law):
    """Lost motion: the link is dragged by the flanks of its gear or coupling.

    One play operator is a single pair of teeth, several in parallel (Prandtl-Ishlinskii) a train
    whose teeth take hold one after the other.
    """

    component: str  # motor
    widths: Array  # (k,), full widths of the operators [rad]
    link: Array | None = None  # (k,), where they stand [rad]

    def turn(self, time_s: Array, shaft: Array) -> Array:
        """Drag the link within the play."""
        column, half = MOTOR[self.component], self.widths / 2.0
        x = shaft[:, column]
        link = np.full(len(half), x[0]) if self.link is None else self.link
        out = np.zeros_like(shaft)
        for i, angle in enumerate(x):
            link = np.clip(link, angle - half, angle + half)
            out[i, column] = link.mean() - angle
        self.link = link
        return out
