"""Readings of dial gauges and inclinometers, against the rigid wrist that they were held to."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace
from typing import Any

import numpy as np
from scipy.optimize import least_squares

from wrist_stiffness.errors import InputError
from wrist_stiffness.lookup.table import Table
from wrist_stiffness.mechanism.components import Array
from wrist_stiffness.recording.samples import GaugeSamples
from wrist_stiffness.sessions.gauges import Gauge, Gauges
from wrist_stiffness.sessions.reading.signals import Stamps, last_of_equal

GAUGES = "gauges"
"""Key of the notes: what stands where, a list in the order of the readings."""

ERROR_M, ERROR_RAD = 1e-5, 1e-4
"""What a wrist may be off in all readings alike: mountings are fitted no closer."""

FOLLOWS = 0.3
"""Readings follow the wrist where they are off by less than this share of its motion: points and
directions measured by hand leave a tenth."""

MISMOUNTED = 4.0
"""Standard deviations of its mounting that nobody overlooks: another point or direction."""

LENGTHS = (
    (1e3, "are they in mm where um belong, or in m where mm belong?"),
    (1e-3, "are they in um where mm belong?"),
    (25.4, "are they in inches where mm belong?"),
    (1.0 / 25.4, "are they in mm where inches belong?"),
)
ANGLES = (
    (180.0 / np.pi, "are they in rad where deg belong?"),
    (1e-3, "are they in mdeg where deg belong?"),
    (1e3, "are they in deg where mdeg belong?"),
)


def gauge_readings(
    samples: GaugeSamples, notes: Mapping[str, Any], table: Table
) -> tuple[Stamps, Gauges, Array]:
    """Return stamps in their order [ns], the K gauges, and their readings (n, K) [m] or [rad].

    Raises `InputError` if no note says of what they are.
    """
    try:
        gauges = tuple(Gauge.of_note(facts) for facts in notes[GAUGES])
    except (KeyError, TypeError, ValueError) as error:
        raise InputError(
            f"readings of gauges, but no list of their names, points and directions as the note "
            f"{GAUGES!r}"
        ) from error
    names = samples.names[0].tolist()
    if missing := [each.name for each in gauges if each.name not in names]:
        raise InputError(f"gauge {missing[0]} of the notes was never read: {', '.join(names)} were")
    rows, columns = last_of_equal(samples.time_ns), [names.index(each.name) for each in gauges]
    gravity = table.geometry.gravity
    length = float(np.linalg.norm(gravity))
    up = -gravity / length if length > 0.0 else np.array([0.0, 0.0, 1.0])
    own = Gauges(gauges, table.mechanism, up)
    return samples.time_ns[rows], own, samples.value[rows][:, columns]


def held_to(gauges: Gauges, values: Array, rotation: Array) -> tuple[Gauges, Array, list[str]]:
    """Return gauges with mountings that fit the rigid wrist, what it leaves of readings, remarks.

    `gauges`: as somebody measured where they stand; `values` (n, K): their readings [m] or [rad];
    `rotation` (n, 3, 3): of the rigid wrist.  Raises `InputError` if a reading has a wrong sign or
    unit, or nothing stands where it is said to.
    """
    up = gauges.up
    found, left, remarks = [], [], []
    for each, own in zip(gauges.members, values.T, strict=True):
        seen = np.isfinite(own)
        if seen.any():
            _require_right(each, own[seen], each.reading(np.zeros(3), rotation[seen], up))
            each, zero, said = _mounted(each, own[seen], rotation[seen], up)
            remarks += said
            own = own - zero - each.reading(np.zeros(3), rotation, up)
        found.append(each)
        left.append(own)
    return replace(gauges, members=tuple(found)), np.stack(left, axis=1), remarks


def _require_right(gauge: Gauge, values: Array, rigid: Array) -> None:
    """Refuse a sign or a unit that fits the motion of the rigid wrist far worse than another."""
    if not gauge.follows(rigid):
        return
    sign = f"does it {gauge.counts_up}?"
    tried = [(1.0, ""), (-1.0, sign)]
    for factor, why in ANGLES if gauge.point is None else LENGTHS:
        tried += [(factor, why), (-factor, f"{why} and {sign}")]
    off = [float(np.std(factor * values - rigid)) for factor, _ in tried]
    best = int(np.argmin(off))
    if best and off[best] < FOLLOWS * rigid.std():
        raise InputError(
            f"gauge {gauge.name}: times {tried[best][0]:.4g} its readings follow the motion of the "
            f"wrist, as they stand they do not; {tried[best][1]}"
        )


def _mounted(
    gauge: Gauge, values: Array, rotation: Array, up: Array
) -> tuple[Gauge, float, list[str]]:
    """Return a gauge as the motion of the rigid wrist shows that it stands, its zero, a remark."""
    scale = (ERROR_RAD if gauge.point is None else ERROR_M) * np.sqrt(len(values))
    start = np.zeros(gauge.mounting(rotation[:1], up).shape[1])
    first = gauge.mounting(rotation[:1], up)[0, 0]
    start[0] = np.median(values - gauge.reading(np.zeros(3), rotation, up)) / first

    def off(step: Array) -> Array:
        own, zero = gauge.mounted(step)
        left = values - zero - own.reading(np.zeros(3), rotation, up)
        return np.concatenate([left / scale, step])

    step = least_squares(off, start, loss="soft_l1", x_scale="jac").x
    own, zero = gauge.mounted(step)
    turned = float(np.degrees(np.arccos(np.clip(own.direction @ gauge.direction, -1.0, 1.0))))
    moved = 0.0
    if gauge.point is not None and own.point is not None:
        moved = 1e3 * float(np.linalg.norm(own.point - gauge.point))
    place = f"{moved:.1f} mm from its point and " if gauge.point is not None else ""
    said = f"gauge {gauge.name} reads as if {place}{turned:.1f} deg from its direction"
    far = float(np.abs(step[1:]).max())
    if far > MISMOUNTED:
        touch = "" if gauge.point is None else ", and that its tip touches the ball at every pose"
        check = "check its point and direction, which column is which"
        raise InputError(f"{said}: {check}{touch}")
    return own, zero, [f"{said}: taken so"] if far > 1.0 else []
