"""Wrenches on the platform that have a history: a cable's friction, a body's inertia."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from wrist_stiffness.mechanism.components import Array
from wrist_stiffness.mechanism.vectors import cross
from wrist_stiffness.simulation.block import Block
from wrist_stiffness.simulation.laws.law import Law

REACH = 1e-3
"""Change of a cable's length in which its friction comes 63 % nearer to its limit [m]."""


@dataclass
class Strands:
    """Inner friction of a cable, by Dahl's law dF/dL = sigma (1 - F/Fc sign(dL))."""

    most: float  # Fc [N]
    past: float | None = None  # length [m]
    friction: float = 0.0  # [N]

    def __call__(self, length: Array) -> Array:
        """Return the friction at the next lengths (n,) [m], (n,) [N]."""
        out = np.empty_like(length)
        past = float(length[0]) if self.past is None else self.past
        friction = self.friction
        for i, now in enumerate(length.tolist()):
            step = now - past
            limit = np.copysign(self.most, step)
            # Exact for a step in one direction: friction nears its limit over the reach.
            out[i] = friction = limit + (friction - limit) * np.exp(-abs(step) / REACH)
            past = now
        self.past, self.friction = past, friction
        return out


@dataclass
class Inertia(Law):
    """Newton's and Euler's forces of platform and tool in the motion that the motors make."""

    mass: float  # [kg]
    place: Array  # (3,), centre of gravity in U [m]
    gyration: float  # radius of gyration about it [m]
    # times [s] and three spots of the body (k, 3, 3) [m] at the last two samples
    past: tuple[Array, Array] = (np.zeros(0), np.zeros((0, 3, 3)))

    def wrench(self, block: Block) -> Array:
        """Differentiate three spots of the body twice, by the last 3 samples."""
        # Equal masses on a circle of the radius of gyration about the centre of gravity.
        angles = 2.0 * np.pi * np.arange(3) / 3.0
        circle = np.stack([np.cos(angles), np.sin(angles), np.zeros(3)], axis=-1)
        spots = self.place + np.sqrt(2.0) * self.gyration * circle
        at = np.einsum("nij,sj->nsi", block.configuration.platform, spots)
        time_s = np.append(self.past[0], block.time_s)[:, None, None]
        path = np.concatenate([self.past[1], at])
        self.past = time_s[-2:, 0, 0], path[-2:]
        speed = np.diff(path, axis=0) / np.diff(time_s, axis=0)
        force = np.zeros_like(at)
        # None at the first two samples of all.
        rate = 2.0 * np.diff(speed, axis=0) / (time_s[2:] - time_s[:-2])
        force[len(force) - len(rate) :] = -self.mass / 3.0 * rate
        return np.concatenate([force.sum(axis=1), cross(at, force).sum(axis=1)], axis=-1)
