"""The temperature of a part: measured, or a first-order lag behind ambient."""

from __future__ import annotations

from typing import Any

import numpy as np

from wrist_stiffness.mechanism.components import Array
from wrist_stiffness.model.memory import lag
from wrist_stiffness.model.parameters import Parameter
from wrist_stiffness.model.situation import Situation

LAG = Parameter("lag_s", 0.0, 1e5, 600.0, mean=600.0, linear=False)
"""Time constant of a part without a thermometer behind the ambient temperature; 0 for none."""


def warmth(at: Situation, place: str, time_constant: float, state: Any) -> tuple[Array, Any]:
    """Return the temperature of a part above reference.

    Parameters
    ----------
    at : Situation
        n samples.
    place : str
        The part; its own thermometer is believed as it is.
    time_constant : float
        Of the lag behind ambient [s].
    state : object
        What the call before returned.

    Returns
    -------
    (n,) float
        [K]
    object
        State for the next block.

    Raises
    ------
    MissingSignalError
        If neither the part nor ambient has a thermometer.
    """
    if place in at.block.temperatures:
        return at.temperature(place), None
    ambient = at.temperature("ambient")[:, None]
    slow, state = lagged(at.block.time, ambient, time_constant, state)
    return slow[:, 0], state


def lagged(time: Array, values: Array, time_constant: float, state: Any) -> tuple[Array, Any]:
    """Return values (n, k) behind a first-order lag, settled at the first sample, and the state."""
    if time_constant <= 0.0:
        return values, None
    before_time, before, start = state if state else (time[0], values[0], values[0])
    interval = np.diff(time, prepend=before_time)
    slow = lag(values, interval, time_constant, before, start)
    return slow, (time[-1], values[-1], slow[-1])
