"""What remains of the measured pose when the base has explained its part."""

from __future__ import annotations

import numpy as np

from wrist_stiffness.lookup.table import Table
from wrist_stiffness.mechanism.components import ELASTIC, Array
from wrist_stiffness.mechanism.rigid_motion import exp_twist, log_motion
from wrist_stiffness.simulation.cell import CellSample
from wrist_stiffness.simulation.equilibrium import Pose

CHUNK = 2000
"""Poses whose operators are in memory at a time."""


def residual(table: Table, sample: CellSample) -> Array:
    """Return log(T_measured T_base^-1) for the readings of angles and load.

    Parameters
    ----------
    table : Table
        The base.
    sample : CellSample
        n samples.

    Returns
    -------
    (n, 6) float
        Twist at O in F [m, rad].
    """
    parts = []
    for first in range(0, len(sample.encoder), CHUNK):
        rows = slice(first, first + CHUNK)
        configuration = table.mechanism.forward(sample.encoder[rows])
        pose = Pose(configuration, table.components, table.geometry.gravity)
        screws = np.zeros((len(configuration.theta), len(ELASTIC), 6))
        bent, moved = exp_twist(pose.solve(sample.wrench[rows], screws).twist)
        rotation = sample.measured_rotation[rows] @ np.swapaxes(
            bent @ configuration.platform, -1, -2
        )
        shift = sample.measured_shift[rows] - (rotation @ moved[..., None])[..., 0]
        parts.append(log_motion(rotation, shift))
    return np.concatenate(parts)
