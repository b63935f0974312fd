"""Laws that nobody has thought of, and how each is drawn.

The comment says why a wrist with more than the largest magnitude would not work.
"""

from __future__ import annotations

import numpy as np

from wrist_stiffness.mechanism.components import JOINTS, LINKS, MOTORS, PASSIVE_JOINTS
from wrist_stiffness.mechanism.vectors import unit
from wrist_stiffness.simulation.effect_entry import Draw, effect
from wrist_stiffness.simulation.laws.law import DRIVEN, MOTOR, Law
from wrist_stiffness.simulation.makers import spring
from wrist_stiffness.simulation.strangers.motion import (
    FloorTilt,
    LooseningScrew,
    OilFilm,
    Resonance,
    SpinningTool,
    SqueezeFilm,
    Swelling,
    ThermalBow,
)
from wrist_stiffness.simulation.strangers.places import (
    CableStop,
    Dent,
    HeadChange,
    LooseSeat,
    OverloadRing,
    PlasticSet,
    PrismIncidence,
    WornSector,
)


# A tool that rings more than it moves.
@effect(("platform",), "-", 0.1, 1.0, 50.0)
def resonance(d: Draw) -> Law:
    """Return a weakly damped tool."""
    return Resonance(d.magnitude, d.platform_spot, d.rng.uniform(5.0, 9.0), 0.03)


# Thicker than the clearance of any bearing of this size.
@effect(PASSIVE_JOINTS, "m", 3e-6, 5e-5, 1e-3)
def oil_film(d: Draw) -> Law:
    """Return a floating pin."""
    lift = d.magnitude * unit(np.cross(d.seat.axis, d.direction()))
    return OilFilm(d.component, d.seat, lift, 0.3)


# 0.1 mm of play rattles.
@effect(("platform",), "m", 5e-6, 1e-4, 1e-3)
def loose_seat(d: Draw) -> Law:
    """Return two seats."""
    return LooseSeat(d.twist(), d.direction(), 0.004)


# 0.1 mm at 1 N is a broken bushing.
@effect(JOINTS, "m/N", 5e-6, 1e-4, 1e-3)
def plastic_set(d: Draw) -> Law:
    """Return yielding beyond 0.1 N."""
    seat = d.seat
    local = np.concatenate([unit(np.cross(seat.axis, d.direction())), np.zeros(3)])
    direction = seat.to_origin(np.eye(3)) @ local
    return PlasticSet(d.component, direction, d.magnitude, 0.1)


# Two heads that disagree by 0.2 mm were never calibrated.
@effect(("pose_sensor",), "m", 5e-6, 2e-4, 1e-3)
def head_change(d: Draw) -> Law:
    """Return two heads, on both sides of a vertical plane."""
    normal = d.table.mechanism.n0
    return HeadChange(d.twist(), unit(np.cross(d.direction(), normal)), normal)


# A wall.
@effect(("platform",), "N/m", 20.0, 1e4, 1e5)
def cable_stop(d: Draw) -> Law:
    """Return a stop for a random point of the rim."""
    azimuth = d.rng.uniform(0.0, 2.0 * np.pi)
    rim = 0.025 * np.array([np.cos(azimuth), np.sin(azimuth), 0.0])
    up = -unit(d.table.geometry.gravity)
    return CableStop(d.magnitude, rim, up, -0.005)


# 0.1 mm is seen by eye.
@effect(PASSIVE_JOINTS, "m", 5e-6, 1e-4, 1e-3)
def dent(d: Draw) -> Law:
    """Return a dent at a random turn."""
    lift = d.magnitude * d.direction()
    return Dent(d.component, d.seat, lift, d.rng.uniform(-0.4, 0.4), d.rng.uniform(0.06, 0.12))


# 0.2 mm for one kelvin.
@effect(("frame",), "m/K^2", 2e-5, 2e-4, 1e-2)
def thermal_bow(d: Draw) -> Law:
    """Return a bow in a random direction."""
    return ThermalBow(d.twist())


# 11 deg: the wrist falls over.
@effect(("frame",), "rad", 0.02, 0.2, 0.5)
def floor_tilt(d: Draw) -> Law:
    """Return two waves of sway."""
    sway = d.magnitude * np.stack([d.direction(), 0.6 * d.direction()])
    return FloorTilt(1.0, d.platform_spot, sway, d.rng.uniform([15.0, 40.0], [30.0, 90.0]))


# 0.1 mm seizes the joint.
@effect(JOINTS, "m", 5e-6, 1e-4, 1e-3)
def swelling(d: Draw) -> Law:
    """Return three waves of humidity."""
    periods = d.rng.uniform([40.0, 100.0, 250.0], [80.0, 200.0, 500.0])
    return Swelling(d.component, d.twist(), periods, d.rng.uniform(0.0, 6.0, 3))


# 0.3 deg at the torque of the largest load are felt by hand.
@effect(MOTORS, "rad/(N m)", 0.01, 0.1, 5.0)
def worn_sector(d: Draw) -> Law:
    """Return a gear that is worn where the cell works most."""
    joint = DRIVEN[d.component]
    axis = d.table.geometry.axes[joint]
    at, width = d.rng.uniform(-0.3, 0.3), d.rng.uniform(0.1, 0.2)
    return WornSector(joint, axis, MOTOR[d.component], d.magnitude, at, width)


# A rotor of half a kilogram, at 20 000 turns a minute.
@effect(("platform",), "kg m^2/s", 5e-3, 0.1, 5.0)
def spinning_tool(d: Draw) -> Law:
    """Return a spindle that leans a little from the platform's normal."""
    axis = unit(d.table.mechanism.n0 + 0.3 * d.direction())
    return SpinningTool(d.rng.choice((-1.0, 1.0)) * d.magnitude * axis)


# A clamp that gives 0.1 mm at 1 N has lost its screw.
@effect(LINKS, "m/N", 5e-6, 1e-4, 1e-3)
def loosening_screw(d: Draw) -> Law:
    """Return a clamp at one end of the link."""
    end = d.table.geometry.link_ends(d.component)[d.rng.integers(2)]
    place = d.table.geometry.links[d.component].arc_radius * end
    return LooseningScrew(d.component, d.magnitude * spring(d, place), d.rng.uniform(10.0, 40.0))


# 50 um: no lubricant holds in such a gap.
@effect(PASSIVE_JOINTS, "m", 3e-6, 5e-5, 1e-3)
def squeeze_film(d: Draw) -> Law:
    """Return a grease that yields within seconds."""
    time_s, turn = d.rng.uniform(1.0, 4.0), d.rng.uniform(0.05, 0.15)
    return SqueezeFilm(d.component, d.seat, d.magnitude, time_s, turn)


# Of nine tenths hardly anything is left to measure, and more than all cannot go past.
@effect(("load_sensor",), "-", 0.3, 0.9, 1.0)
def overload_ring(d: Draw) -> Law:
    """Return a ring about the plate that touches far below the rated force."""
    plate = d.table.geometry.platform.centre
    return OverloadRing(d.magnitude, d.table.mechanism.n0, plate, d.rng.uniform(0.05, 0.15))


# The glass of the common half-inch prism is 9 mm deep.
@effect(("pose_sensor",), "m", 2e-4, 1e-2, 5e-2)
def prism_incidence(d: Draw) -> Law:
    """Return a prism that faces the sensor within some 30 deg with the wrist at home."""
    beam = d.direction()
    return PrismIncidence(d.magnitude, beam, unit(beam + 0.5 * d.direction()))
