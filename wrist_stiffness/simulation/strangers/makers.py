"""Laws that nobody has thought of, and how each is drawn.

The comment says why a wrist with more than the largest magnitude would not work.
"""

from __future__ import annotations

from functools import partial

import numpy as np

from wrist_stiffness.mechanism.components import JOINTS, LINKS, MOTORS, PASSIVE_JOINTS, Array
from wrist_stiffness.mechanism.vectors import block_diagonal, cross, dot, screws_to_origin, unit
from wrist_stiffness.simulation.block import Block, Rate
from wrist_stiffness.simulation.effect_entry import Draw, effect
from wrist_stiffness.simulation.equilibrium import Equilibrium
from wrist_stiffness.simulation.laws.drive import Drive
from wrist_stiffness.simulation.laws.joint_friction import joint_turn
from wrist_stiffness.simulation.laws.law import (
    DRIVEN,
    JOINED,
    MOTOR,
    BodyScrew,
    Law,
    LoadReading,
    PlatformForce,
    PlatformMotion,
)
from wrist_stiffness.simulation.laws.pose_sensor import SensorMotion
from wrist_stiffness.simulation.makers import spring
from wrist_stiffness.simulation.strangers.histories import (
    LooseningScrew,
    PlasticSet,
    PrismIncidence,
    Resonance,
    SpinningTool,
    SqueezeFilm,
    Switch,
)


def bump(angle: Array, at: float, width: float) -> Array:
    """Return a bell of height 1 (n,) at a place of a width, both on the angle (n,) [rad]."""
    return np.asarray(np.exp(-0.5 * ((angle - at) / width) ** 2))


# A tool that rings more than it moves.
@effect(("platform",), "-", 0.1, 1.0, 50.0)
def resonance(d: Draw) -> Law:
    """Return a weakly damped tool."""
    return Resonance(d.magnitude, d.platform_spot, d.rng.uniform(5.0, 9.0), 0.03)


# Thicker than the clearance of any bearing of this size.
@effect(PASSIVE_JOINTS, "m", 3e-6, 5e-5, 1e-3)
def oil_film(d: Draw) -> Law:
    """Return a turning pin that floats up on its lubricant, away from the groove that feeds it.

    At 0.3 rad/s three quarters of the lift are there.
    """
    seat = d.seat
    lift = np.append(d.magnitude * unit(np.cross(seat.axis, d.direction())), np.zeros(3))
    inner, outer = JOINED[d.component]

    def share(rate: Rate, block: Block) -> Array:
        bodies = block.configuration.rotations
        trace = np.einsum("nij,nij->n", bodies[inner], bodies[outer])
        turn = np.arccos(np.clip((trace - 1.0) / 2.0, -1.0, 1.0))
        return np.tanh(np.abs(rate(block.time_s, turn)) / 0.3)

    return BodyScrew(d.component, screws_to_origin(seat.centre) @ lift, partial(share, Rate()))


# 0.1 mm of play rattles.
@effect(("platform",), "m", 5e-6, 1e-4, 1e-3)
def loose_seat(d: Draw) -> Law:
    """Return two seats of the tool; a moment beyond 4 mN m throws it into the other one."""
    jump, lever = d.twist(), d.direction()

    def thrown(switch: Switch, block: Block, state: Equilibrium) -> Array:
        platform = block.configuration.platform
        moment = np.einsum("nji,nj->ni", platform, block.load[:, 3:]) @ lever
        return switch(moment)[:, None] * (block_diagonal(platform) @ jump)

    return PlatformMotion(partial(thrown, Switch(0.004)))


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
    """Return two heads that do not quite agree, on both sides of a vertical plane.

    The second one takes over when the platform's normal leans to its side.
    """
    normal = d.table.mechanism.n0
    twist, side = d.twist(), unit(np.cross(d.direction(), normal))

    def second(switch: Switch, block: Block, rotation: Array) -> Array:
        return switch((rotation @ normal) @ side)

    return SensorMotion(twist, partial(second, Switch(0.05)))


# A wall.
@effect(("platform",), "N/m", 20.0, 1e4, 1e5)
def cable_stop(d: Draw) -> Law:
    """Return something soft that touches a random point of the rim beyond a tilt to its side."""
    azimuth = d.rng.uniform(0.0, 2.0 * np.pi)
    rim = 0.025 * np.array([np.cos(azimuth), np.sin(azimuth), 0.0])
    up = -unit(d.table.geometry.gravity)

    def pushed(block: Block, at: Array) -> Array:
        # More and more as the cable bunches.
        dip = np.maximum(-0.005 - at @ up, 0.0)
        return (d.magnitude * dip**1.5 / np.sqrt(1e-3))[:, None] * up

    return PlatformForce(rim, pushed)


# 0.1 mm is seen by eye.
@effect(PASSIVE_JOINTS, "m", 5e-6, 1e-4, 1e-3)
def dent(d: Draw) -> Law:
    """Return a dent or a chip that lifts the pin over a few degrees of the joint's turn."""
    seat, lift = d.seat, d.magnitude * d.direction()
    at, width = d.rng.uniform(-0.4, 0.4), d.rng.uniform(0.06, 0.12)

    def share(block: Block) -> Array:
        return bump(joint_turn(block, d.component, seat.axis), at, width)

    # Radial and tilting motion, as a translation at the outer ring.
    return BodyScrew(d.component, screws_to_origin(seat.centre) @ (lift @ seat.rings[0]), share)


# 0.2 mm for one kelvin.
@effect(("frame",), "m/K^2", 2e-5, 2e-4, 1e-2)
def thermal_bow(d: Draw) -> Law:
    """Return a bow by the square of the difference in temperature between the two motors."""
    per_kelvin = d.twist()

    def bowed(block: Block, state: Equilibrium) -> Array:
        kelvin = block.temperature_of("motor_1") - block.temperature_of("motor_2")
        return (kelvin * np.abs(kelvin))[:, None] * per_kelvin

    return PlatformMotion(bowed)


# 11 deg: the wrist falls over.
@effect(("frame",), "rad", 0.02, 0.2, 0.5)
def floor_tilt(d: Draw) -> Law:
    """Return two waves of sway of the carrier: a weight of 1 N has a direction that wanders."""
    sway = d.magnitude * np.stack([d.direction(), 0.6 * d.direction()])
    place, periods_s = d.platform_spot, d.rng.uniform([15.0, 40.0], [30.0, 90.0])

    def turned(block: Block, at: Array) -> Array:
        waves = np.sin(2.0 * np.pi * block.time_s[:, None] / periods_s)
        return cross(waves @ sway, np.broadcast_to([0.0, 0.0, -1.0], at.shape))

    return PlatformForce(place, turned)


# 0.1 mm seizes the joint.
@effect(JOINTS, "m", 5e-6, 1e-4, 1e-3)
def swelling(d: Draw) -> Law:
    """Return a bushing that swells with a humidity that nobody records: three waves."""
    periods_s = d.rng.uniform([40.0, 100.0, 250.0], [80.0, 200.0, 500.0])
    screw, phases = d.twist(), d.rng.uniform(0.0, 6.0, 3)

    def wet(block: Block) -> Array:
        angle = 2.0 * np.pi * block.time_s[:, None] / periods_s + phases
        return np.asarray(np.sin(angle).mean(axis=-1))

    return BodyScrew(d.component, screw, wet)


# 0.3 deg at the torque of the largest load are felt by hand.
@effect(MOTORS, "rad/(N m)", 0.01, 0.1, 5.0)
def worn_sector(d: Draw) -> Law:
    """Return a gear that is worn where the cell works most: there its thinner teeth bend more."""
    joint = DRIVEN[d.component]
    axis = d.table.geometry.axes[joint]
    at, width = d.rng.uniform(-0.3, 0.3), d.rng.uniform(0.1, 0.2)

    def wound(block: Block, torque: Array) -> tuple[Array, Array]:
        theta = block.configuration.theta[:, MOTOR[d.component]]
        soft = d.magnitude * bump(theta, at, width)
        return soft * torque, soft

    return Drive(joint, axis, wound)


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
    """Return a ring about the plate that touches far below the rated side force.

    Chips fill most of its gap; what then goes through the ring goes past the strain gauges: the
    magnitude is the share of what is beyond the limit.
    """
    normal, centre = d.table.mechanism.n0, d.table.geometry.platform.centre
    limit = d.rng.uniform(0.05, 0.15)

    def without_ring(block: Block, wrench: Array) -> Array:
        platform, force = block.configuration.platform, wrench[:, :3]
        across, at = platform @ normal, platform @ centre
        side = force - dot(force, across)[:, None] * across
        size = np.maximum(np.sqrt(dot(side, side)), limit)
        past = (d.magnitude * (1.0 - limit / size))[:, None] * side
        return wrench - np.concatenate([past, cross(at, past)], axis=-1)

    return LoadReading(without_ring)


# The glass of the common half-inch prism is 9 mm deep.
@effect(("pose_sensor",), "m", 2e-4, 1e-2, 5e-2)
def prism_incidence(d: Draw) -> Law:
    """Return a prism that faces the sensor within some 30 deg with the wrist at home."""
    beam = d.direction()
    return PrismIncidence(d.magnitude, beam, unit(beam + 0.5 * d.direction()))
