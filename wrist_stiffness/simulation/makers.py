"""How the laws are drawn: each maker gives a law of the drawn place, form, magnitude and shape."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from wrist_stiffness.lookup.table import Table
from wrist_stiffness.mechanism.components import ELASTIC, Array
from wrist_stiffness.mechanism.vectors import block_diagonal, skew, unit
from wrist_stiffness.simulation.laws.added_spring import (
    MountSpring,
    OuterSpring,
    StiffeningDrive,
    drive_flexibility,
)
from wrist_stiffness.simulation.laws.axis_misalignment import AxisMisalignment
from wrist_stiffness.simulation.laws.bushing_polymer import (
    JOINED,
    BushingHardening,
    ThermalSoftening,
)
from wrist_stiffness.simulation.laws.cable_wrench import CableWrench
from wrist_stiffness.simulation.laws.creep import Creep
from wrist_stiffness.simulation.laws.flange_contact import FlangeGap
from wrist_stiffness.simulation.laws.gravity import AddedMass, MountingTilt
from wrist_stiffness.simulation.laws.inertia import Inertia
from wrist_stiffness.simulation.laws.joint_clearance import JointClearance
from wrist_stiffness.simulation.laws.joint_friction import JointFriction
from wrist_stiffness.simulation.laws.law import DRIVEN, Law
from wrist_stiffness.simulation.laws.load_sensor import (
    LoadBias,
    LoadMatrix,
    LoadPoint,
    turned_sensor,
)
from wrist_stiffness.simulation.laws.motor_turn import (
    Backlash,
    EccentricEncoder,
    EncoderOffset,
    TransmissionError,
)
from wrist_stiffness.simulation.laws.part_stiffness import EndHinge, UniformSoftness
from wrist_stiffness.simulation.laws.pose_sensor import Drift, MeasurementFrame, TargetMounting
from wrist_stiffness.simulation.laws.thermal_expansion import ThermalExpansion, growing_spots
from wrist_stiffness.simulation.laws.time_delay import TimeDelay
from wrist_stiffness.simulation.seat import Seat
from wrist_stiffness.simulation.strangers.motion import OilFilm, Resonance
from wrist_stiffness.simulation.strangers.places import CableStop, Dent
from wrist_stiffness.simulation.strangers.slow import FloorTilt, Swelling, ThermalBow
from wrist_stiffness.simulation.strangers.steps import HeadChange, LooseSeat, PlasticSet

LEVER = 0.03
"""Arm at which a turn counts like a shift where both are drawn together [m]."""


@dataclass(frozen=True)
class Draw:
    """What a law is made from."""

    table: Table
    component: str
    form: str
    magnitude: float
    rng: np.random.Generator

    @property
    def seat(self) -> Seat:
        """Bushing of the component, which is a joint."""
        return Seat.of(self.table.geometry, self.component)

    @property
    def platform_spot(self) -> Array:
        """A place near the platform's plate, in U (3,) [m]."""
        return self.table.geometry.platform.centre + self.rng.uniform(-0.015, 0.015, 3)

    def direction(self) -> Array:
        """Return a random unit vector (3,)."""
        return unit(self.rng.normal(size=3))

    def twist(self) -> Array:
        """Return a random small twist (6,) of the drawn magnitude: a shift and a turn as large."""
        return self.magnitude * np.concatenate([self.direction(), self.direction() / LEVER])


def link_stiffness(d: Draw) -> Law:
    """Return softer steel, or one bore that gives way."""
    if d.form == "uniform":
        return UniformSoftness(d.component, d.magnitude)
    end = d.table.geometry.link_ends(d.component)[d.rng.integers(2)]
    return EndHinge(d.component, d.magnitude, d.table.geometry.links[d.component].arc_radius * end)


def drive_compliance(d: Draw) -> Law:
    """Return a linear or a stiffening drive."""
    axis = d.table.geometry.axes[DRIVEN[d.component]]
    if d.form == "stiffening":
        return StiffeningDrive(DRIVEN[d.component], axis, d.magnitude, 0.01)
    axes = d.table.mechanism.a1, d.table.mechanism.a2
    return MountSpring(d.component, drive_flexibility(d.component, axes, d.magnitude))


def mount_compliance(d: Draw) -> Law:
    """Return a bracket 20 mm behind the bushing."""
    seat = Seat.of(d.table.geometry, DRIVEN[d.component])
    place = seat.centre + 0.02 * seat.axis
    return MountSpring(d.component, d.magnitude * spring(d, place))


def spring(d: Draw, place: Array) -> Array:
    """Flexibility (6, 6) at O of a bracket at a place, of 1 in translation, in a random frame."""
    frame = np.linalg.qr(d.rng.normal(size=(3, 3)))[0]
    sizes = np.concatenate([d.rng.uniform(0.3, 1.0, 3), d.rng.uniform(0.3, 1.0, 3) / LEVER**2])
    turn = block_diagonal(frame)
    move = np.eye(6)
    move[:3, 3:] = skew(place)
    return move @ turn @ np.diag(sizes) @ turn.T @ move.T


def outer_spring(on_platform: bool) -> Callable[[Draw], Law]:
    """Return the maker of a spring under the limbs or behind them."""

    def make(d: Draw) -> Law:
        place = d.platform_spot if on_platform else d.rng.uniform(-0.05, 0.05, 3)
        return OuterSpring(d.magnitude * spring(d, place), on_platform)

    return make


def gravity(d: Draw) -> Law:
    """Return a mass, or a tilt with the weight of the magnitude at 50 g."""
    if d.component == "platform":
        if d.form == "tilt":
            across = np.cross(d.direction(), unit(d.table.geometry.gravity))
            return MountingTilt(d.magnitude / 0.05 * unit(across))
        return AddedMass("platform", d.magnitude, d.platform_spot)
    ends = d.table.geometry.link_ends(d.component)
    place = unit(ends[0] + ends[1]) * d.table.geometry.links[d.component].arc_radius
    return AddedMass(d.component, d.magnitude, place + d.rng.uniform(-0.01, 0.01, 3))


def joint_clearance(d: Draw) -> Law:
    """Return play with a random roughness."""
    return JointClearance(d.component, d.seat, d.magnitude, d.rng.uniform(0.005, 0.03), d.form)


def flange_contact(d: Draw) -> Law:
    """Return a flange that was opened or pressed on."""
    sign = 1.0 if d.form == "open" else -1.0
    return FlangeGap(d.component, sign * d.magnitude)


def bushing_hardening(d: Draw) -> Law:
    """Return hardening that sets in below 1 N."""
    flexibility = d.table.components.flexibility[ELASTIC.index(d.component)]
    to_centre = d.seat.to_origin(np.eye(3)).T
    local = to_centre @ flexibility @ to_centre.T
    energy = 0.5 * np.trace(local[:3, :3]) / 3.0 * d.rng.uniform(0.3, 1.0)
    return BushingHardening(d.component, d.magnitude, energy, d.form)


def joint_friction(d: Draw) -> Law:
    """Return friction with a few micrometres of pre-sliding."""
    stribeck = 0.5 if d.form == "stribeck" else 0.0
    stiffness = (0.2 + d.magnitude) / d.rng.uniform(2e-6, 6e-6) * 0.3
    return JointFriction(d.component, d.seat, d.magnitude, 0.2 * d.magnitude, stiffness, stribeck)


def backlash(d: Draw) -> Law:
    """Return one pair of teeth or a train of them."""
    widths = [1.0] if d.form == "single" else [0.4, 0.8, 1.2, 1.6]
    return Backlash(d.component, d.magnitude * np.array(widths))


def encoder_eccentricity(d: Draw) -> Law:
    """Return a disc off its centre, or oval."""
    lobes = {"once": 1, "twice": 2}[d.form]
    return EccentricEncoder(d.component, d.magnitude, d.rng.uniform(0.0, 2.0 * np.pi), lobes)


def transmission_error(d: Draw) -> Law:
    """Return one order or a row of harmonics."""
    count = 1 if d.form == "single" else 3
    orders = d.rng.integers(5, 25) * np.arange(1.0, count + 1.0)
    phases = d.rng.uniform(0.0, 2.0 * np.pi, count)
    return TransmissionError(d.component, d.magnitude, orders, phases, 0.3 * (count > 1))


def axis_misalignment(d: Draw) -> Law:
    """Return shift and tilt across the axis; along it the joint is free."""
    axis = d.table.geometry.axes[d.component]
    across = np.eye(3) - np.outer(axis, axis)
    shift, tilt = unit(across @ d.direction()), unit(across @ d.direction())
    local = d.magnitude * np.concatenate([shift, tilt / LEVER])
    return AxisMisalignment(d.component, d.seat.to_origin(np.eye(3)) @ local)


def thermal_expansion(d: Draw) -> Law:
    """Return linear or quadratic growth."""
    quadratic = 0.0 if d.form == "linear" else 0.05
    spots = growing_spots(d.table.geometry, d.component)
    return ThermalExpansion(d.component, d.magnitude, spots, quadratic)


def creep(d: Draw) -> Law:
    """Return one time constant or a row of three."""
    time_s = d.rng.uniform(5.0, 40.0)
    if d.form == "standard_solid":
        return Creep(d.component, np.array([d.magnitude]), np.array([time_s]))
    return Creep(
        d.component, d.magnitude * np.array([0.4, 0.3, 0.3]), time_s * np.array([0.1, 1.0, 10.0])
    )


def cable_wrench(d: Draw) -> Law:
    """Return a cable from a random side."""
    azimuth = d.rng.uniform(0.0, 2.0 * np.pi)
    frame = np.array([0.09 * np.cos(azimuth), 0.09 * np.sin(azimuth), d.rng.uniform(-0.08, -0.03)])
    rub = 0.5 if d.form == "rubbing" else 0.1
    return CableWrench(frame, d.platform_spot, d.magnitude, d.rng.uniform(0.02, 0.06), rub)


def load_bias(d: Draw) -> Law:
    """Return a bias in a random direction."""
    bias = d.magnitude * np.concatenate([d.direction(), 0.01 * d.direction()])
    return LoadBias(bias, 0.0 if d.form == "constant" else d.rng.uniform(60.0, 200.0))


def load_scale(d: Draw) -> Law:
    """Return one gain for all axes."""
    return LoadMatrix((1.0 + d.magnitude) * np.eye(6))


def load_cross_talk(d: Draw) -> Law:
    """Return a calibration matrix that is off by the magnitude at random, relative to full scale.

    Moments are a hundredth of forces in size.
    """
    scale = np.repeat([1.0, 0.01], 3)
    talk = d.rng.normal(size=(6, 6)) * d.magnitude * scale[:, None] / scale
    return LoadMatrix(np.eye(6) + talk)


def measured(law: type[MeasurementFrame] | type[TargetMounting]) -> Callable[[Draw], Law]:
    """Return the maker of a registration error."""

    def make(d: Draw) -> Law:
        return law(d.twist())

    return make


def inertia(d: Draw) -> Law:
    """Return a tool in motion."""
    return Inertia(d.magnitude, d.platform_spot, d.rng.uniform(0.01, 0.025))


def cable_stop(d: Draw) -> Law:
    """Return a stop for a random point of the rim."""
    azimuth = d.rng.uniform(0.0, 2.0 * np.pi)
    rim = 0.025 * np.array([np.cos(azimuth), np.sin(azimuth), 0.0])
    up = -unit(d.table.geometry.gravity)
    return CableStop(d.magnitude, rim, up, -0.005)


def dent(d: Draw) -> Law:
    """Return a dent at a random turn."""
    lift = d.magnitude * d.direction()
    return Dent(d.component, d.seat, lift, d.rng.uniform(-0.4, 0.4), d.rng.uniform(0.06, 0.12))


def floor_tilt(d: Draw) -> Law:
    """Return two waves of sway."""
    sway = d.magnitude * np.stack([d.direction(), 0.6 * d.direction()])
    return FloorTilt(1.0, d.platform_spot, sway, d.rng.uniform([15.0, 40.0], [30.0, 90.0]))


def swelling(d: Draw) -> Law:
    """Return three waves of humidity."""
    periods = d.rng.uniform([40.0, 100.0, 250.0], [80.0, 200.0, 500.0])
    return Swelling(d.component, d.twist(), periods, d.rng.uniform(0.0, 6.0, 3))


def plastic_set(d: Draw) -> Law:
    """Return yielding beyond 0.1 N."""
    seat = d.seat
    local = np.concatenate([unit(np.cross(seat.axis, d.direction())), np.zeros(3)])
    direction = seat.to_origin(np.eye(3)) @ local
    return PlasticSet(d.component, direction, d.magnitude, 0.1)


def loose_seat(d: Draw) -> Law:
    """Return two seats."""
    return LooseSeat(d.twist(), d.direction(), 0.004)


def bushing_stiffness(d: Draw) -> Law:
    """Return softer polymer."""
    return UniformSoftness(d.component, d.magnitude)


def encoder_offset(d: Draw) -> Law:
    """Return a wrong zero."""
    return EncoderOffset(d.component, d.magnitude)


def thermal_softening(d: Draw) -> Law:
    """Return softening at the mean temperature of the joined bodies."""
    return ThermalSoftening(d.component, JOINED[d.component], d.magnitude, d.form)


def load_misalignment(d: Draw) -> Law:
    """Return a sensor turned about a random axis."""
    return LoadMatrix(turned_sensor(d.magnitude * d.direction()))


def load_point(d: Draw) -> Law:
    """Return a lever-arm error in F or in U."""
    return LoadPoint(d.magnitude * d.direction(), d.form == "platform")


def drift(d: Draw) -> Law:
    """Return a drift that has its magnitude after 5 minutes."""
    return Drift(d.twist(), 300.0, d.form)


def time_delay(d: Draw) -> Law:
    """Return a late stamp."""
    return TimeDelay(d.component, d.magnitude, d.table.mechanism)


def resonance(d: Draw) -> Law:
    """Return a weakly damped tool."""
    return Resonance(d.magnitude, d.platform_spot, d.rng.uniform(5.0, 9.0), 0.03)


def oil_film(d: Draw) -> Law:
    """Return a floating pin."""
    lift = d.magnitude * unit(np.cross(d.seat.axis, d.direction()))
    return OilFilm(d.component, d.seat, lift, 0.3)


def head_change(d: Draw) -> Law:
    """Return two heads, on both sides of a vertical plane."""
    normal = d.table.mechanism.n0
    return HeadChange(d.twist(), unit(np.cross(d.direction(), normal)), normal)


def thermal_bow(d: Draw) -> Law:
    """Return a bow in a random direction."""
    return ThermalBow(d.twist())
