"""The laws that a diagnosis knows by name, and how each is drawn.

The comment says why a wrist with more than the largest magnitude would not work.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from functools import partial

import numpy as np
from scipy.spatial.transform import Rotation

from wrist_stiffness.mechanism.components import (
    ELASTIC,
    JOINTS,
    LINKS,
    MOTORS,
    PASSIVE_JOINTS,
    Array,
    ElasticComponents,
)
from wrist_stiffness.mechanism.vectors import (
    block_diagonal,
    both_halves,
    cross,
    screws_to_origin,
    skew,
    unit,
)
from wrist_stiffness.simulation.block import Block
from wrist_stiffness.simulation.effect_entry import LEVER, Draw, Entry
from wrist_stiffness.simulation.equilibrium import Equilibrium
from wrist_stiffness.simulation.laws.bushing import Creep, hardening, play, softening
from wrist_stiffness.simulation.laws.drive import Backlash, ahead_of_encoder, winding
from wrist_stiffness.simulation.laws.joint_friction import JointFriction
from wrist_stiffness.simulation.laws.law import (
    DRIVEN,
    BodyScrew,
    Law,
    PlatformForce,
    SensorMotion,
    UniformSoftness,
    flange_gap,
    in_series,
    no_screws,
    target_motion,
)
from wrist_stiffness.simulation.laws.platform import Inertia, Strands
from wrist_stiffness.simulation.laws.time_delay import TimeDelay
from wrist_stiffness.simulation.seat import Seat


def spring(d: Draw, place: Array) -> Array:
    """Flexibility (6, 6) at O of a bracket at a place, of 1 in translation, in a random frame."""
    frame = np.linalg.qr(d.rng.normal(size=(3, 3)))[0]
    sizes = np.concatenate([d.rng.uniform(0.3, 1.0, 3), d.rng.uniform(0.3, 1.0, 3) / LEVER**2])
    turn = block_diagonal(frame)
    move = screws_to_origin(place)
    return move @ turn @ np.diag(sizes) @ turn.T @ move.T


# Aluminium where steel was drawn bends three times as much.
@Entry(LINKS, "-", 0.2, 2.0, 50.0, ("uniform", "hinge"))
def link_stiffness(d: Draw) -> Law:
    """Return softer steel, or a cracked bore: it bends about all axes there.

    By a share of the bar's own mean flexibility in rotation.
    """
    if d.form == "uniform":
        return UniformSoftness(d.component, d.magnitude)
    end = d.table.geometry.link_ends(d.component)[d.rng.integers(2)]
    place = d.table.geometry.links[d.component].arc_radius * end
    turn = np.vstack([skew(place), np.eye(3)])
    return in_series(
        d.component, lambda own: d.magnitude * np.trace(own[3:, 3:]) / 3.0 * turn @ turn.T
    )


# The softest grade of the polymer has a quarter of the modulus.
@Entry(JOINTS, "-", 0.2, 3.0, 50.0)
def bushing_stiffness(d: Draw) -> Law:
    """Return softer polymer."""
    return UniformSoftness(d.component, d.magnitude)


STIFFER = 0.01
"""Torque at which a stiffening drive has half of its softness left [N m]."""


# A belt that gives 3 deg at 1 N m is off its wheel.
@Entry(MOTORS, "rad/(N m)", 2e-3, 0.05, 5.0, ("linear", "stiffening", "one_sided"))
def drive_compliance(d: Draw) -> Law:
    """Return a linear drive, a stiffening one, or one of which a flank is worn.

    A saturating logarithm stiffens: teeth touch more fully under torque.
    """
    joint = DRIVEN[d.component]
    axis = d.table.geometry.axes[joint]
    if d.form == "stiffening":

        def stiffening(block: Block, torque: Array) -> tuple[Array, Array]:
            turn = d.magnitude * STIFFER * np.arcsinh(torque / STIFFER)
            return turn, d.magnitude / np.sqrt(1.0 + (torque / STIFFER) ** 2)

        return winding(joint, axis, stiffening)
    if d.form == "one_sided":
        lean = d.rng.choice((-1.0, 1.0)) * d.rng.uniform(0.2, 0.5)
        above, below = d.magnitude * (1.0 + lean), d.magnitude * (1.0 - lean)

        def one_sided(block: Block, torque: Array) -> tuple[Array, Array]:
            own = np.where(torque > 0.0, above, below)
            return own * torque, own

        return winding(joint, axis, one_sided)
    about = np.concatenate([np.zeros(3), axis])
    return in_series(joint, lambda own: d.magnitude * np.outer(about, about))


# A bracket that gives 10 um at 1 N is seen to move by hand.
@Entry(MOTORS, "m/N", 5e-7, 1e-5, 2e-4)
def mount_compliance(d: Draw) -> Law:
    """Return a bracket 20 mm behind the bushing, which sits in the frame as the bracket does."""
    seat = Seat.of(d.table.geometry, DRIVEN[d.component])
    place = seat.centre + 0.02 * seat.axis
    bracket = d.magnitude * spring(d, place)
    return in_series(DRIVEN[d.component], lambda own: bracket)


# As a bracket.
@Entry(("frame",), "m/N", 5e-7, 1e-5, 2e-4)
def frame_compliance(d: Draw) -> Law:
    """Return a spring under the limbs."""
    place = d.rng.uniform(-0.05, 0.05, 3)
    flexibility = d.magnitude * spring(d, place)

    def moved(block: Block, state: Equilibrium) -> Array:
        # All weights hang on it as well.
        whole = sum(state.through[:, ELASTIC.index(joint)] for joint in DRIVEN.values())
        return np.asarray(whole) @ flexibility

    return Law(d.component, twist=moved)


# As a bracket.
@Entry(("platform",), "m/N", 5e-7, 1e-5, 2e-4)
def platform_compliance(d: Draw) -> Law:
    """Return a spring behind the limbs."""
    flexibility = d.magnitude * spring(d, d.platform_spot)

    def moved(block: Block, state: Equilibrium) -> Array:
        turn = block_diagonal(block.configuration.platform)
        local = np.einsum("nji,nj->ni", turn, block.load)
        return np.einsum("nij,nj->ni", turn, local @ flexibility)

    return Law(d.component, twist=moved)


# 200 g are several times the platform, and a tilt of 4 m/s2 is 24 deg.
@Entry(("platform", *LINKS), "kg", 3e-3, 0.2, 5.0, ("mass", "tilt"))
def gravity(d: Draw) -> Law:
    """Return a mass, or a tilt with the weight of the magnitude at 50 g."""
    if d.form == "tilt":
        across = np.cross(d.direction(), unit(d.table.geometry.gravity))
        # Gravity turns the other way.
        lean = Rotation.from_rotvec(-d.magnitude / 0.05 * unit(across))
        return Law(d.component, gravity=lean.apply)
    if d.component == "platform":
        place = d.platform_spot
    else:
        ends = d.table.geometry.link_ends(d.component)
        place = unit(ends[0] + ends[1]) * d.table.geometry.links[d.component].arc_radius
        place = place + d.rng.uniform(-0.01, 0.01, 3)
    weight = d.magnitude * np.vstack([np.eye(3), skew(place)])

    def heavier(parts: ElasticComponents) -> ElasticComponents:
        if d.component == "platform":
            return replace(parts, platform_weight=parts.platform_weight + weight)
        # The bore on the platform's side holds it.
        carried = parts.weight_platform_side.copy()
        carried[ELASTIC.index(d.component)] += weight
        return replace(parts, weight_platform_side=carried)

    return Law(d.component, parts=heavier)


# A pin with 0.1 mm of play rattles.
@Entry(JOINTS, "m", 5e-6, 1e-4, 5e-4, ("algebraic", "exponential"))
def joint_clearance(d: Draw) -> Law:
    """Return play with a random roughness."""
    return play(d.component, d.seat, d.magnitude, d.rng.uniform(0.005, 0.03), d.form)


# Shims are graded in tenths of a millimetre.
@Entry(PASSIVE_JOINTS, "m", 1e-6, 1e-4, 5e-4, ("open", "pressed"))
def flange_contact(d: Draw) -> Law:
    """Return a flange that was opened or pressed on."""
    sign = 1.0 if d.form == "open" else -1.0
    return flange_gap(d.component, sign * d.magnitude)


# Half of the flexibility is gone under load.
@Entry(JOINTS, "-", 0.2, 0.5, 0.5, ("saturating", "power"))
def bushing_hardening(d: Draw) -> Law:
    """Return hardening that sets in below 1 N."""
    flexibility = d.table.components.flexibility[ELASTIC.index(d.component)]
    to_centre = d.seat.to_origin(np.eye(3)).T
    local = to_centre @ flexibility @ to_centre.T
    energy = 0.5 * np.trace(local[:3, :3]) / 3.0 * d.rng.uniform(0.3, 1.0)
    return hardening(d.component, d.magnitude, energy, d.form)


# Dry polymer on rough steel.
@Entry(PASSIVE_JOINTS, "-", 0.1, 0.5, 0.5, ("coulomb", "stribeck"))
def joint_friction(d: Draw) -> Law:
    """Return friction with a few micrometres of pre-sliding."""
    stribeck = 0.5 if d.form == "stribeck" else 0.0
    stiffness = (0.2 + d.magnitude) / d.rng.uniform(2e-6, 6e-6) * 0.3
    return JointFriction(d.component, d.seat, d.magnitude, 0.2 * d.magnitude, stiffness, stribeck)


# 0.3 deg of lost motion is felt by hand.
@Entry(MOTORS, "rad", 1e-4, 5e-3, 0.02, ("single", "train"))
def backlash(d: Draw) -> Law:
    """Return one pair of teeth or a train of them."""
    widths = [1.0] if d.form == "single" else [0.4, 0.8, 1.2, 1.6]
    return Backlash(d.component, d.magnitude * np.array(widths))


# 1 deg is seen at the home mark.
@Entry(MOTORS, "rad", 2e-4, 0.02, 0.05)
def encoder_offset(d: Draw) -> Law:
    """Return a wrong zero."""
    return ahead_of_encoder(d.component, lambda angle: np.full_like(angle, d.magnitude))


# A disc of 20 mm that is 0.1 mm off its centre.
@Entry(MOTORS, "-", 2e-4, 5e-3, 0.05, ("once", "twice"))
def encoder_eccentricity(d: Draw) -> Law:
    """Return a disc off its centre, or pressed oval, read by one head.

    By exact geometry, not by its first harmonic; the magnitude is the offset of the disc's centre
    over its radius.
    """
    lobes, phase = {"once": 1, "twice": 2}[d.form], d.rng.uniform(0.0, 2.0 * np.pi)

    def ahead(angle: Array) -> Array:
        at = lobes * angle + phase
        return np.asarray(np.arctan2(d.magnitude * np.sin(at), 1.0 + d.magnitude * np.cos(at)))

    return ahead_of_encoder(d.component, ahead)


# Teeth of the worst grade.
@Entry(MOTORS, "rad", 1e-4, 2e-3, 0.02, ("single", "train"))
def transmission_error(d: Draw) -> Law:
    """Return one order, or harmonics of which each is half as high as the one before.

    These are modulated once a turn by the gear's own run-out.
    """
    count = 1 if d.form == "single" else 3
    orders = d.rng.integers(5, 25) * np.arange(1.0, count + 1.0)
    phases = d.rng.uniform(0.0, 2.0 * np.pi, count)
    height = d.magnitude * 0.5 ** np.arange(count)

    def ahead(angle: Array) -> Array:
        waves = (height * np.sin(orders * angle[:, None] + phases)).sum(axis=-1)
        return np.asarray(waves * (1.0 + 0.3 * (count > 1) * np.cos(angle)))

    return ahead_of_encoder(d.component, ahead)


# A bore that is 0.2 mm and 0.4 deg off is not assembled.
@Entry(JOINTS, "m", 2e-5, 2e-4, 2e-3)
def axis_misalignment(d: Draw) -> Law:
    """Return shift and tilt across the axis; along it the joint is free."""
    axis = d.table.geometry.axes[d.component]
    across = np.eye(3) - np.outer(axis, axis)
    shift, tilt = unit(across @ d.direction()), unit(across @ d.direction())
    local = d.magnitude * np.concatenate([shift, tilt / LEVER])
    return BodyScrew(d.component, d.seat.to_origin(np.eye(3)) @ local)


# The polymer with the largest growth.
@Entry(
    ("link_1", "link_2", "frame", "platform"), "1/K", 1.2e-5, 1e-4, 2e-2, ("linear", "quadratic")
)
def thermal_expansion(d: Draw) -> Law:
    """Return linear growth, or quadratic as of polymers and composites.

    The frame carries the bearings of both motors away from O; a link's bores move apart; on the
    platform the two bearings move away from the plate's centre, which is what the tool keeps.
    """
    geometry, body, quadratic = d.table.geometry, d.component, 0.05 * (d.form == "quadratic")
    at = {joint: b.radius * geometry.axes[joint] for joint, b in geometry.bushings.items()}
    # How far the platform side of a component moves per unit strain, at home in F [m].
    if body == "frame":
        spots = {joint: at[joint] for joint in ("joint_1", "joint_5")}
    elif body == "platform":
        centre = np.asarray(geometry.platform.centre)
        spots = {joint: centre - at[joint] for joint in ("joint_2", "joint_3")}
    else:
        near, far = geometry.link_ends(body)
        spots = {body: geometry.links[body].arc_radius * (far - near)}

    def grown(block: Block) -> Array:
        kelvin = block.temperature_of(body)
        strain = d.magnitude * kelvin * (1.0 + quadratic * kelvin)
        out = no_screws(block)
        turn = block.configuration.rotations[body]
        for component, lever in spots.items():
            out[:, ELASTIC.index(component), :3] += strain[:, None] * (turn @ lever)
        return out

    return Law(body, screws=grown)


# A polymer at its glass transition loses 5 % in each kelvin.
@Entry(JOINTS, "1/K", 0.01, 0.05, 1.0, ("exponential", "glassy"))
def thermal_softening(d: Draw) -> Law:
    """Return softening at the mean temperature of the joined bodies."""
    return softening(d.component, d.magnitude, d.form)


# As much creep as elastic strain.
@Entry(JOINTS, "-", 0.2, 1.0, 2.0, ("standard_solid", "power_law"))
def creep(d: Draw) -> Law:
    """Return one time constant or a row of three."""
    time_s = d.rng.uniform(5.0, 40.0)
    if d.form == "standard_solid":
        return Creep(d.component, np.array([d.magnitude]), np.array([time_s]))
    return Creep(
        d.component, d.magnitude * np.array([0.4, 0.3, 0.3]), time_s * np.array([0.1, 1.0, 10.0])
    )


# A hose, not a cable.
@Entry(("platform",), "N/m", 2.0, 50.0, 500.0, ("smooth", "rubbing"))
def cable_wrench(d: Draw) -> Law:
    """Return a cable from a random side: a spring of its length, and its strands' friction."""
    azimuth = d.rng.uniform(0.0, 2.0 * np.pi)
    frame = np.array([0.09 * np.cos(azimuth), 0.09 * np.sin(azimuth), d.rng.uniform(-0.08, -0.03)])
    spot, slack = d.platform_spot, d.rng.uniform(0.02, 0.06)
    # Friction over the pull of 1 cm.
    rub = 0.5 if d.form == "rubbing" else 0.1

    def pulled(strands: Strands, block: Block, at: Array) -> Array:
        line = frame - at
        length = np.sqrt(np.sum(line * line, axis=-1))
        pull = d.magnitude * np.maximum(length - slack, 0.0) + strands(length)
        return (pull / length)[:, None] * line

    return PlatformForce(spot, partial(pulled, Strands(rub * d.magnitude * 0.01)))


# Half of the rated force is seen at rest.
@Entry(("load_sensor",), "N", 0.02, 0.5, 5.0, ("constant", "warm_up"))
def load_bias(d: Draw) -> Law:
    """Return a bias in a random direction, there from the start or as the sensor warms up."""
    bias = d.magnitude * np.concatenate([d.direction(), 0.01 * d.direction()])
    if d.form == "constant":
        return Law(d.component, read_load=lambda block, wrench: wrench + bias)
    warm_up_s = d.rng.uniform(60.0, 200.0)
    return Law(
        d.component,
        read_load=lambda block, wrench: (
            wrench + np.outer(-np.expm1(-block.time_s / warm_up_s), bias)
        ),
    )


# Another sensor's calibration sheet.
@Entry(("load_sensor",), "-", 0.03, 0.3, 20.0, ("scale",))
def load_scale(d: Draw) -> Law:
    """Return one gain for all axes."""
    return Law(d.component, read_load=lambda block, wrench: (1.0 + d.magnitude) * wrench)


# A tenth of full scale on the wrong axis: the cable is torn.
@Entry(("load_sensor",), "-", 0.01, 0.1, 5.0)
def load_cross_talk(d: Draw) -> Law:
    """Return a calibration matrix that is off by the magnitude at random, relative to full scale.

    Moments are a hundredth of forces in size.
    """
    scale = np.repeat([1.0, 0.01], 3)
    talk = d.rng.normal(size=(6, 6)) * d.magnitude * scale[:, None] / scale
    return Law(d.component, read_load=lambda block, wrench: wrench + wrench @ talk.T)


# 11 deg are seen by eye.
@Entry(("load_sensor",), "rad", 0.03, 0.2, 3.0)
def load_misalignment(d: Draw) -> Law:
    """Return a sensor turned about a random axis."""
    mounted = Rotation.from_rotvec(d.magnitude * d.direction()).as_matrix()
    return Law(d.component, read_load=lambda block, wrench: both_halves(mounted.T, wrench))


# As far off as the sensor is long.
@Entry(("load_sensor",), "m", 2e-3, 0.03, 0.5, ("frame", "platform"))
def load_point(d: Draw) -> Law:
    """Return a lever-arm error in F or in U."""
    point = d.magnitude * d.direction()

    def about(block: Block, wrench: Array) -> Array:
        at = block.configuration.platform @ point if d.form == "platform" else point
        force = wrench[:, :3]
        moment = wrench[:, 3:] - cross(np.broadcast_to(at, force.shape), force)
        return np.concatenate([force, moment], axis=1)

    return Law(d.component, read_load=about)


# Seen by eye.
@Entry(("pose_sensor",), "m", 5e-5, 1e-2, 1e-2)
def measurement_frame(d: Draw) -> Law:
    """Return a registration error of the sensor."""
    return SensorMotion(d.twist())


# Seen by eye.
@Entry(("pose_sensor",), "m", 5e-5, 1e-2, 1e-2)
def target_mounting(d: Draw) -> Law:
    """Return a registration error of the target."""
    return target_motion(d.twist())


# 0.1 mm in five minutes: the tripod is not fixed.
@Entry(("pose_sensor",), "m", 5e-6, 1e-4, 1e-2, ("linear", "settling", "daily"))
def drift(d: Draw) -> Law:
    """Return a drift that has its magnitude after 5 minutes, or a wave of four times that."""
    shape: Callable[[Array], Array] = {
        "linear": lambda x: x,
        "settling": lambda x: np.expm1(-3.0 * x) / np.expm1(-3.0),
        "daily": lambda x: np.sin(0.5 * np.pi * x),
    }[d.form]
    return SensorMotion(d.twist(), lambda block, rotation: shape(block.time_s / 300.0))


# A tenth of a second is a dropped message.
@Entry(("pose_sensor", "load_sensor", *MOTORS), "s", 5e-3, 0.1, 0.5)
def time_delay(d: Draw) -> Law:
    """Return a late stamp."""
    return TimeDelay(d.component, d.magnitude, d.table.mechanism)


# More than twenty times the platform.
@Entry(("platform",), "kg", 0.05, 0.5, 50.0)
def inertia(d: Draw) -> Law:
    """Return a tool in motion."""
    return Inertia(d.magnitude, d.platform_spot, d.rng.uniform(0.01, 0.025))
