"""Lost beams: poses that neither a registration nor a late stamp explains."""

from __future__ import annotations

import numpy as np
from numpy.lib.stride_tricks import sliding_window_view
from numpy.typing import NDArray

from wrist_stiffness.campaign.reading.registration import place_left, turn_left
from wrist_stiffness.campaign.reading.spikes import WINDOW, spikes
from wrist_stiffness.mechanism.components import Array
from wrist_stiffness.mechanism.rigid_motion import log_motion

DENSE_S = 0.2
"""Median time between poses below which single ones are compared with their neighbours [s]."""

LEAST_SPIKE_M = 30e-6

LEAST_SPIKE_STEPS = 4.0
"""In encoder steps: in motion the measured rotation leaves the encoders' by counts."""

LATE_S = 0.1
"""So late a stamp may be: what turns meanwhile is no spike."""

MOVING_RAD = float(np.radians(1.0))
"""Turn in that time from which on a pose tells what the stamps do in motion [rad]."""


def lost_beams(
    time: Array, shift: Array, rotation: Array, rigid: Array, step: float
) -> NDArray[np.bool_]:
    """Tell which poses stand out from their neighbours.

    Parameters
    ----------
    time : (n,) float
        Rising [s].
    shift : (n, 3) float
        Measured positions [m]; NaN = not measured.  Of a target that is not at O they swing with
        the rotation.
    rotation, rigid : (n, 3, 3) float
        Measured rotations, and those of the rigid wrist when they were measured.
    step : float
        Of the encoders [rad].

    Returns
    -------
    (n,) bool
        True = lost; none where poses are far apart.
    """
    if len(time) < 2 or np.median(np.diff(time)) > DENSE_S:
        return np.zeros(len(time), dtype=bool)
    swing = _swing(time, rigid)
    moving = swing > MOVING_RAD
    turn = turn_left(rotation, rigid)
    place, lever = place_left(shift, rigid)
    turned = spikes(turn, LEAST_SPIKE_STEPS * step, swing, moving)
    return turned | spikes(place, LEAST_SPIKE_M, lever * swing, moving)


def _swing(time: Array, rigid: Array) -> Array:
    """Return how far the wrist turns beside each pose while a stamp may be late, (n,) [rad]."""
    interval = np.diff(time)
    turned = log_motion(np.swapaxes(rigid[:-1], 1, 2) @ rigid[1:], np.zeros((len(interval), 3)))
    # Neighbours differ by half a window's turn at most: a count that flickers at 1 kHz is no speed.
    share = LATE_S / np.maximum(interval, LATE_S / (WINDOW // 2))
    swing = share * np.linalg.norm(turned[:, 3:], axis=1)
    near = sliding_window_view(np.pad(swing, WINDOW // 2), WINDOW - 1)
    return np.asarray(np.max(near, axis=1))
