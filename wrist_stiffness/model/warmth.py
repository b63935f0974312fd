"""The temperature of a part: measured, or a first-order lag behind ambient and motor heat."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np

from wrist_stiffness.mechanism.components import Array
from wrist_stiffness.mechanism.influence import LIMB_1
from wrist_stiffness.model.memory import lag
from wrist_stiffness.model.parameters import Parameter
from wrist_stiffness.model.situation import Situation

LAG = Parameter("lag_s", 0.0, 1e5, 600.0, 600.0, linear=False, grid=(0.0, 200.0, 1200.0))
SHARE = Parameter("motor_share_percent", 0.0, 100.0, 30.0, linear=False, grid=(0.0, 100.0))
WARMTH = (LAG, SHARE)
"""Time constant of a part without a thermometer, 0 for none; and how far its limb's motor (for the
frame and the platform motor 1) rather than ambient decides where its temperature goes."""


def unused(place: str, signals: frozenset[str]) -> tuple[str, ...]:
    """Return those of `WARMTH` that do nothing: all where the part has its own thermometer."""
    return tuple(each.key for each in WARMTH) if place in signals else ()


def warmth(at: Situation, place: str, values: Mapping[str, float], state: Any) -> tuple[Array, Any]:
    """Return the temperature of a part above reference.

    `at`: n samples.  `place`: the part; its own thermometer is believed as it is.  `values`: with
    `WARMTH`, in SI units.  `state`: what the call before returned.  Gives (n,) [K].  Raises
    `MissingSignalError` if neither the part nor what it follows has a thermometer.
    """
    if place in at.block.temperatures:
        return at.temperature(place), None
    share = values[SHARE.key]
    source = np.zeros(len(at.block))
    if share < 1.0:
        source += (1.0 - share) * at.temperature("ambient")
    if share > 0.0:
        first = place in (*LIMB_1, "frame", "platform")
        source += share * at.temperature("motor_1" if first else "motor_2")
    slow, state = lagged(at.block.time, source[:, None], values[LAG.key], state)
    return slow[:, 0], state


def lagged(time: Array, values: Array, time_constant: float, state: Any) -> tuple[Array, Any]:
    """Return values (n, k) behind a first-order lag, settled at the first sample, and the state."""
    if time_constant <= 0.0:
        return values, None
    before_time, before, start = state if state else (time[0], values[0], values[0])
    interval = np.diff(time, prepend=before_time)
    slow = lag(values, interval, time_constant, before, start)
    return slow, (time[-1], values[-1], slow[-1])
