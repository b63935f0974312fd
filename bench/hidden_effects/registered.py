"""Where the pose sensor stands and where its target sits: found before any search, by all alike."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from bench_wrist import Array

from wrist_stiffness.mechanism.rigid_motion import exp_twist
from wrist_stiffness.mechanism.vectors import skew
from wrist_stiffness.simulation.size import BasePose, departure

PASSES = 5
"""Of Gauss and Newton; 1 mm and 0.2 deg need three."""

SCALE = np.repeat([1e-6, 3e-5], 3)
"""Sizes by which shifts and turns are weighed [m], [rad]."""

COLUMN = np.tile(SCALE, 2)


@dataclass(frozen=True)
class Registration:
    """T_seen = X T Y.

    Parameters
    ----------
    rotation, shift : ((3, 3), (3, 3)), ((3,), (3,))
        Of X in F and of Y in U [m].
    """

    rotation: tuple[Array, Array]
    shift: tuple[Array, Array]

    def seen(self, base: BasePose) -> BasePose:
        """Return what the sensor sees of poses in F."""
        (x, y), (x_shift, y_shift) = self.rotation, self.shift
        shift = base.shift + base.rotation @ y_shift
        return BasePose(x @ base.rotation @ y, shift @ x.T + x_shift)


def difference(rotation: Array, shift: Array, base: BasePose) -> Array:
    """Return measured less predicted poses as residual twists (n, 6); NaN where not measured.

    Where no rotation was measured the predicted one stands in.
    """
    turned = np.isfinite(rotation).all(axis=(1, 2))
    moved = np.isfinite(shift).all(axis=1)
    whole = np.where(turned[:, None, None], rotation, base.rotation)
    out = departure(whole, np.where(moved[:, None], shift, base.shift), base)
    out[~moved, :3] = np.nan
    out[~turned, 3:] = np.nan
    return out


def register(rotation: Array, shift: Array, base: BasePose) -> Registration:
    """Find the registration of measured poses (n, 3, 3) and (n, 3) against predicted ones.

    Lost beams must be NaN.
    """
    x, y, x_shift, y_shift = np.eye(3), np.eye(3), np.zeros(3), np.zeros(3)
    turned = np.isfinite(rotation).all(axis=(1, 2))
    for _ in range(PASSES):
        seen = Registration((x, y), (x_shift, y_shift)).seen(base)
        left = difference(rotation, shift, seen) / SCALE
        columns = np.zeros((len(left), 6, 12))
        columns[:, :, :6] = np.eye(6)
        columns[:, :3, 6:9] = columns[:, 3:, 9:] = seen.rotation
        # A twist at O against the shift of a point: what a turn about O or U does to it.
        columns[turned, :3, 9:] = (skew(seen.shift) @ seen.rotation)[turned]
        columns[~turned, :3, 3:6] = -skew(seen.shift)[~turned]
        columns *= COLUMN / SCALE[:, None]
        rows = np.isfinite(left)
        step = np.linalg.lstsq(columns[rows], left[rows], rcond=1e-9)[0] * COLUMN
        turn, move = exp_twist(step[:6])
        own_turn, own_move = exp_twist(step[6:])
        x, x_shift = turn @ x, turn @ x_shift + move
        y, y_shift = y @ own_turn, y_shift + y @ own_move
    return Registration((x, y), (x_shift, y_shift))
