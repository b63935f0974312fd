"""`cable_wrench`: a cable or hose pulls at the platform."""

from __future__ import annotations

import numpy as np

from wrist_stiffness.mechanism.components import Array
from wrist_stiffness.mechanism.vectors import cross
from wrist_stiffness.simulation.block import Block
from wrist_stiffness.simulation.laws.law import Law


class CableWrench(Law):
    """A cable from an anchor in the frame to one on the platform, with inner friction.

    Its pull is a spring force of its length and the friction of its strands, which follows the
    length by Dahl's law dF/dL = sigma (1 - F/Fc sign(dL)).

    `frame_anchor`, `platform_anchor` (3,): in F, and in U [m]; `stiffness` [N/m]; `slack`: length
    at which the pull ends [m]; `rub`: friction force over the pull of 1 cm [-].
    """

    def __init__(
        self,
        frame_anchor: Array,
        platform_anchor: Array,
        stiffness: float,
        slack: float,
        rub: float,
    ) -> None:
        self._frame, self._platform = frame_anchor, platform_anchor
        self._stiffness, self._slack = stiffness, slack
        self._most = rub * stiffness * 0.01
        self._past: float | None = None
        self._friction = 0.0

    def wrench(self, block: Block) -> Array:
        """Pull along the cable."""
        at = block.configuration.platform @ self._platform
        line = self._frame - at
        length = np.sqrt(np.sum(line * line, axis=-1))
        pull = self._stiffness * np.maximum(length - self._slack, 0.0) + self._rubbing(length)
        force = (pull / length)[:, None] * line
        return np.concatenate([force, cross(at, force)], axis=-1)

    def _rubbing(self, length: Array) -> Array:
        out = np.empty_like(length)
        past = float(length[0]) if self._past is None else self._past
        friction, most, reach = self._friction, max(self._most, 1e-300), 1e-3
        for i, now in enumerate(length):
            step = float(now) - past
            limit = np.copysign(most, step)
            # Exact for a step in one direction: friction nears its limit over the reach.
            friction = limit + (friction - limit) * np.exp(-abs(step) / reach)
            past = float(now)
            out[i] = friction
        self._past, self._friction = past, friction
        return out
