"""What remains of the measured pose when the base has explained its part."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from wrist_stiffness.lookup.table import Table
from wrist_stiffness.mechanism.components import ELASTIC, Array
from wrist_stiffness.mechanism.rigid_motion import exp_twist, log_motion
from wrist_stiffness.simulation.cell import CellSample
from wrist_stiffness.simulation.equilibrium import Pose

CHUNK = 2000
"""Poses whose operators are in memory at a time."""


@dataclass(frozen=True)
class BasePose:
    """Poses (n) that the base predicts: rotation (n, 3, 3) U -> F, and place (n, 3) of O [m]."""

    rotation: Array
    shift: Array


def base_pose(table: Table, encoder: Array, wrench: Array) -> BasePose:
    """Return where the platform would be by the base alone.

    `encoder` (n, 2): motor angles [rad]; `wrench` (n, 6): load on the platform at O in F [N, N m].
    Gives `BasePose`: of n samples.
    """
    rotations, shifts = [], []
    for first in range(0, len(encoder), CHUNK):
        rows = slice(first, first + CHUNK)
        configuration = table.mechanism.forward(encoder[rows])
        pose = Pose(configuration, table.components, table.geometry.gravity)
        screws = np.zeros((len(configuration.theta), len(ELASTIC), 6))
        bent, moved = exp_twist(pose.solve(wrench[rows], screws).twist)
        rotations.append(bent @ configuration.platform)
        shifts.append(moved)
    return BasePose(np.concatenate(rotations), np.concatenate(shifts))


def departure(rotation: Array, shift: Array, base: BasePose) -> Array:
    """Return log(T T_base^-1) at O in F for poses T, (n, 6) [m, rad]."""
    turn = rotation @ np.swapaxes(base.rotation, -1, -2)
    return log_motion(turn, shift - (turn @ base.shift[..., None])[..., 0])


def residual(table: Table, sample: CellSample) -> Array:
    """Return log(T_measured T_base^-1) for the readings of angles and load.

    `sample`: n samples with whole poses.  Gives (n, 6): twist at O in F [m, rad].
    """
    base = base_pose(table, sample.encoder, sample.wrench)
    return departure(sample.measured_rotation, sample.measured_shift, base)
