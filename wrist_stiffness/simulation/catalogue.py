"""The laws by their catalogue names: places, forms, sizes, and how to make one."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import numpy as np

from wrist_stiffness.errors import InputError
from wrist_stiffness.lookup.table import Table
from wrist_stiffness.mechanism.components import JOINTS, LINKS, MOTORS, PASSIVE_JOINTS
from wrist_stiffness.simulation import makers
from wrist_stiffness.simulation.laws.law import Law
from wrist_stiffness.simulation.makers import Draw


@dataclass(frozen=True)
class HiddenEffect:
    """One hidden effect: everything that is needed to make its law again.

    Parameters
    ----------
    effect, component, form : str
        Names of the catalogue.
    magnitude : float
        In the unit of the catalogue's entry (SI).
    shape_seed : int
        Draws directions, phases and time constants.
    """

    effect: str
    component: str
    form: str
    magnitude: float
    shape_seed: int


@dataclass(frozen=True)
class Entry:
    """One effect.

    Parameters
    ----------
    components, forms : tuple of str
        Places, and functional forms of the law.
    unit : str
        Of the magnitude.
    plausible : float
        Magnitude that an ordinary wrist may have.
    limit : float
        Largest magnitude that makes physical sense.
    make : callable
        Law of a draw.
    """

    components: tuple[str, ...]
    forms: tuple[str, ...]
    unit: str
    plausible: float
    limit: float
    make: Callable[[Draw], Law]


ONE: tuple[str, ...] = ("plain",)

CATALOGUE: dict[str, Entry] = {
    "link_stiffness": Entry(LINKS, ("uniform", "hinge"), "-", 0.2, 50.0, makers.link_stiffness),
    "bushing_stiffness": Entry(JOINTS, ONE, "-", 0.2, 50.0, makers.bushing_stiffness),
    "drive_compliance": Entry(
        MOTORS, ("linear", "stiffening"), "rad/(N m)", 2e-3, 5.0, makers.drive_compliance
    ),
    "mount_compliance": Entry(MOTORS, ONE, "m/N", 5e-7, 2e-4, makers.mount_compliance),
    "frame_compliance": Entry(("frame",), ONE, "m/N", 5e-7, 2e-4, makers.outer_spring(False)),
    "platform_compliance": Entry(("platform",), ONE, "m/N", 5e-7, 2e-4, makers.outer_spring(True)),
    "gravity": Entry(("platform", *LINKS), ("mass", "tilt"), "kg", 3e-3, 5.0, makers.gravity),
    "joint_clearance": Entry(
        JOINTS, ("algebraic", "exponential"), "m", 5e-6, 5e-4, makers.joint_clearance
    ),
    "flange_contact": Entry(
        PASSIVE_JOINTS, ("open", "pressed"), "m", 1e-6, 5e-4, makers.flange_contact
    ),
    "bushing_hardening": Entry(
        JOINTS, ("saturating", "power"), "-", 0.2, 0.5, makers.bushing_hardening
    ),
    "joint_friction": Entry(
        PASSIVE_JOINTS, ("coulomb", "stribeck"), "-", 0.1, 0.5, makers.joint_friction
    ),
    "backlash": Entry(MOTORS, ("single", "train"), "rad", 1e-4, 0.02, makers.backlash),
    "encoder_offset": Entry(MOTORS, ONE, "rad", 2e-4, 0.05, makers.encoder_offset),
    "encoder_eccentricity": Entry(
        MOTORS, ("once", "twice"), "-", 2e-4, 0.05, makers.encoder_eccentricity
    ),
    "transmission_error": Entry(
        MOTORS, ("single", "train"), "rad", 1e-4, 0.02, makers.transmission_error
    ),
    "axis_misalignment": Entry(JOINTS, ONE, "m", 2e-5, 2e-3, makers.axis_misalignment),
    "thermal_expansion": Entry(
        ("link_1", "link_2", "frame", "platform"),
        ("linear", "quadratic"),
        "1/K",
        1.2e-5,
        2e-2,
        makers.thermal_expansion,
    ),
    "thermal_softening": Entry(
        JOINTS,
        ("exponential", "glassy"),
        "1/K",
        0.01,
        1.0,
        makers.thermal_softening,
    ),
    "creep": Entry(JOINTS, ("standard_solid", "power_law"), "-", 0.2, 2.0, makers.creep),
    "cable_wrench": Entry(
        ("platform",), ("smooth", "rubbing"), "N/m", 2.0, 500.0, makers.cable_wrench
    ),
    "load_bias": Entry(("load_sensor",), ("constant", "warm_up"), "N", 0.02, 5.0, makers.load_bias),
    "load_scale": Entry(("load_sensor",), ("scale",), "-", 0.03, 20.0, makers.load_scale),
    "load_cross_talk": Entry(("load_sensor",), ONE, "-", 0.01, 5.0, makers.load_cross_talk),
    "load_misalignment": Entry(
        ("load_sensor",),
        ONE,
        "rad",
        0.03,
        3.0,
        makers.load_misalignment,
    ),
    "load_point": Entry(
        ("load_sensor",),
        ("frame", "platform"),
        "m",
        2e-3,
        0.5,
        makers.load_point,
    ),
    "measurement_frame": Entry(
        ("pose_sensor",), ONE, "m", 5e-5, 1e-2, makers.measured(makers.MeasurementFrame)
    ),
    "target_mounting": Entry(
        ("pose_sensor",), ONE, "m", 5e-5, 1e-2, makers.measured(makers.TargetMounting)
    ),
    "drift": Entry(
        ("pose_sensor",),
        ("linear", "settling", "daily"),
        "m",
        5e-6,
        1e-2,
        makers.drift,
    ),
    "time_delay": Entry(
        ("pose_sensor", "load_sensor", *MOTORS),
        ONE,
        "s",
        5e-3,
        0.5,
        makers.time_delay,
    ),
    "inertia": Entry(("platform",), ONE, "kg", 0.05, 50.0, makers.inertia),
}
"""Effects that a diagnosis knows by name."""

STRANGERS: dict[str, Entry] = {
    "resonance": Entry(
        ("platform",),
        ONE,
        "-",
        0.1,
        50.0,
        makers.resonance,
    ),
    "oil_film": Entry(
        PASSIVE_JOINTS,
        ONE,
        "m",
        3e-6,
        1e-3,
        makers.oil_film,
    ),
    "loose_seat": Entry(("platform",), ONE, "m", 5e-6, 1e-3, makers.loose_seat),
    "plastic_set": Entry(JOINTS, ONE, "m/N", 5e-6, 1e-3, makers.plastic_set),
    "head_change": Entry(
        ("pose_sensor",),
        ONE,
        "m",
        5e-6,
        1e-3,
        makers.head_change,
    ),
    "cable_stop": Entry(("platform",), ONE, "N/m", 20.0, 1e5, makers.cable_stop),
    "dent": Entry(PASSIVE_JOINTS, ONE, "m", 5e-6, 1e-3, makers.dent),
    "thermal_bow": Entry(("frame",), ONE, "m/K^2", 2e-5, 1e-2, makers.thermal_bow),
    "floor_tilt": Entry(("frame",), ONE, "rad", 0.02, 0.5, makers.floor_tilt),
    "swelling": Entry(JOINTS, ONE, "m", 5e-6, 1e-3, makers.swelling),
}
"""Effects that nobody has thought of."""

ALL = CATALOGUE | STRANGERS


def places(entries: dict[str, Entry]) -> list[tuple[str, str, str]]:
    """Return every (effect, component, form) that makes a law."""
    return [
        (effect, component, form)
        for effect, entry in entries.items()
        for component in entry.components
        for form in entry.forms
        if not (effect == "gravity" and form == "tilt" and component != "platform")
    ]


def build(hidden: HiddenEffect, table: Table) -> Law:
    """Make the law of a hidden effect.

    Parameters
    ----------
    hidden : HiddenEffect
        Name, place, form, magnitude, shape.
    table : Table
        Of the wrist.

    Returns
    -------
    Law
        With a history of its own: one law for one run.

    Raises
    ------
    InputError
        If effect, place or form is not in the catalogue, or the magnitude beyond its limit.
    """
    entry = _known("effect", hidden.effect, ALL)
    for what, value, allowed in (
        ("component", hidden.component, entry.components),
        ("form", hidden.form, entry.forms),
    ):
        if value not in allowed:
            raise InputError(
                f"{hidden.effect}: {what} {value!r} is not one of {', '.join(allowed)}"
            )
    if not abs(hidden.magnitude) <= entry.limit:
        raise InputError(
            f"{hidden.effect}: magnitude {hidden.magnitude:g} {entry.unit} is beyond the limit of "
            f"{entry.limit:g} {entry.unit}"
        )
    rng = np.random.default_rng(hidden.shape_seed)
    return entry.make(Draw(table, hidden.component, hidden.form, hidden.magnitude, rng))


def _known(what: str, name: str, entries: dict[str, Any]) -> Any:
    if name not in entries:
        raise InputError(f"{what} {name!r} is not one of {', '.join(entries)}")
    return entries[name]
