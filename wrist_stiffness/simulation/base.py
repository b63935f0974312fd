"""The base on which an effect hides: as the table says, or wrong as every real wrist is."""

from __future__ import annotations

import numpy as np

from wrist_stiffness.errors import InputError
from wrist_stiffness.lookup.table import Table
from wrist_stiffness.mechanism.components import ELASTIC, JOINTS, PASSIVE_JOINTS
from wrist_stiffness.mechanism.influence import influence
from wrist_stiffness.simulation.laws.law import (
    BodyScrew,
    Law,
    SensorMotion,
    UniformSoftness,
    flange_gap,
    target_motion,
)
from wrist_stiffness.simulation.seat import Seat

BASES = ("exact", "wrong")

STIFFNESS = 0.3
AXIS_SHIFT, AXIS_TILT = 30e-6, float(np.radians(0.05))
REGISTRATION_SHIFT, REGISTRATION_TURN = 1e-3, float(np.radians(0.2))
LOAD_SCALE = 0.03
"""How wrong a wrong base is, to each side and evenly spread [-], [m, rad], [m, rad], [-]."""


def base_laws(name: str, table: Table, seed: int, session: int) -> list[Law]:
    """Return the laws by which the true wrist departs from its table before any effect.

    `name`: `exact` (none) or `wrong`: stiffness of every part, every joint axis, both registrations
    of the pose sensor and the scale of the load sensor; `seed`: draws how wrong it is; `session`:
    sessions of one wrist differ in the registrations of the pose sensor.  Raises `InputError` if
    there is no such base.
    """
    if name not in BASES:
        raise InputError(f"base {name!r} is not one of {', '.join(BASES)}")
    if name == "exact":
        return []
    rng, day = np.random.default_rng(seed), np.random.default_rng([seed, session])
    softer = [UniformSoftness(part, rng.uniform(-STIFFNESS, STIFFNESS)) for part in ELASTIC]
    axes = [_misaligned(joint, table, rng) for joint in JOINTS]
    turn = np.repeat([REGISTRATION_SHIFT, REGISTRATION_TURN], 3)
    scale = 1.0 + rng.uniform(-LOAD_SCALE, LOAD_SCALE)
    return [
        *softer,
        *axes,
        *_shims(table, axes),
        Law("load_sensor", read_load=lambda block, wrench: scale * wrench),
        target_motion(turn * day.uniform(-1.0, 1.0, 6)),
        SensorMotion(turn * day.uniform(-1.0, 1.0, 6)),
    ]


def _misaligned(joint: str, table: Table, rng: np.random.Generator) -> BodyScrew:
    seat = Seat.of(table.geometry, joint)
    size = np.repeat([AXIS_SHIFT, AXIS_TILT], 3)
    local = size * rng.uniform(-1.0, 1.0, 6)
    return BodyScrew(joint, seat.to_origin(np.eye(3)) @ local)


def _shims(table: Table, axes: list[BodyScrew]) -> list[Law]:
    """Return what the fitter does: at home the flanges stand as designed again."""
    rows = influence(table.mechanism.forward(np.zeros(2))).slides()
    slides = sum(rows[ELASTIC.index(law.component)] @ law.screw[:3] for law in axes)
    return [
        flange_gap(joint, float(-table.components.contact[joint].sign[0] * slide))
        for joint, slide in zip(PASSIVE_JOINTS, np.asarray(slides), strict=True)
        if joint in table.components.contact
    ]
