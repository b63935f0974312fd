"""Laws outside the catalogue of effects: a diagnosis should say that it does not know them.

First those with a history of their own, then how each is drawn; the comment says why a wrist with
more than the largest magnitude would not work.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import partial

import numpy as np
from scipy.linalg import expm

from wrist_stiffness.mechanism.components import JOINTS, LINKS, MOTORS, PASSIVE_JOINTS, Array
from wrist_stiffness.mechanism.vectors import block_diagonal, cross, dot, screws_to_origin, unit
from wrist_stiffness.simulation.block import Block, Rate
from wrist_stiffness.simulation.effect_entry import Draw, Entry
from wrist_stiffness.simulation.equilibrium import Equilibrium
from wrist_stiffness.simulation.laws.drive import winding
from wrist_stiffness.simulation.laws.joint_friction import joint_turn
from wrist_stiffness.simulation.laws.law import (
    DRIVEN,
    JOINED,
    MOTOR,
    Bending,
    BodyScrew,
    Flowing,
    Law,
    PlatformForce,
    SensorMotion,
    no_screws,
)
from wrist_stiffness.simulation.makers import spring
from wrist_stiffness.simulation.seat import Seat


class Resonance(Law):
    """The tool lags behind fast moves and rings after them, as a weakly damped oscillator does.

    `share`: how much of the oscillator's motion reaches the target [-]; `place` (3,): centre of
    gravity of what swings, in U [m]; `frequency_hz`, `damping`: natural frequency and damping
    ratio.
    """

    def __init__(self, share: float, place: Array, frequency_hz: float, damping: float) -> None:
        self._share, self._place = share, place
        w = 2.0 * np.pi * frequency_hz
        # State: lag and its rate; driven by where the body is, with a linear input in each step.
        self._system = np.array([[0.0, 1.0], [-w * w, -2.0 * damping * w]])
        self._force = np.array([0.0, w * w])
        self._state: tuple[float, Array, Array] | None = None
        self._steps: dict[float, tuple[Array, Array, Array]] = {}

    def twist(self, block: Block, state: Equilibrium) -> Array:
        """Shift and tilt the platform by the lag of its centre of gravity."""
        at = block.configuration.platform @ self._place
        before, past, z = (block.time_s[0], at[0], np.stack([at[0], np.zeros(3)]))
        if self._state is not None:
            before, past, z = self._state
        lag = np.empty_like(at)
        for i, now in enumerate(block.time_s):
            if now > before:
                free, old, new = self._step(round(float(now - before), 9))
                z = free @ z + np.outer(old, past) + np.outer(new, at[i])
            lag[i] = z[0] - at[i]
            before, past = now, at[i]
        self._state = before, past, z
        shift = self._share * lag
        lever = cross(at, shift) / dot(at, at)[:, None]
        return np.concatenate([shift, lever], axis=-1)

    def _step(self, dt: float) -> tuple[Array, Array, Array]:
        if dt not in self._steps:
            # The augmented exponential gives the integrals of constant and linear inputs.
            system = np.zeros((4, 4))
            system[:2, :2], system[:2, 2], system[2, 3] = self._system, self._force, 1.0
            grown = expm(system * dt)
            constant, linear = grown[:2, 2], grown[:2, 3] / dt
            self._steps = {dt: (grown[:2, :2], constant - linear, linear)}
        return self._steps[dt]


@dataclass
class LooseningScrew(Bending):
    """A link's clamp screw works loose: its end gets softer with all that the motors have moved.

    The gears shake it, and it never tightens again.
    """

    component: str  # link
    flexibility: Array  # (6, 6), of the open clamp, at O, wrist at home [m/N, rad/N, rad/(N m)]
    path: float  # sum of both motors' motion after which 63 % of it are there [rad]
    past: tuple[float, Array] | None = None  # motion so far, and angles (2,) [rad]
    # times (n,) [s], and how much of the clamp is open (n,) [-]
    loose: tuple[Array, Array] = (np.zeros(0), np.zeros(0))

    def screws(self, block: Block) -> Array:
        """Count what the motors move."""
        theta = block.configuration.theta
        so_far, past = self.past or (0.0, theta[0])
        moved = so_far + np.cumsum(np.abs(np.diff(theta, axis=0, prepend=past[None])).sum(axis=1))
        self.past = float(moved[-1]), theta[-1]
        self.loose = block.time_s, -np.expm1(-moved / self.path)
        return no_screws(block)

    def bend(self, block: Block, wrench: Array) -> tuple[Array, Array]:
        """Give way to the wrench, as loose as the screw is by now."""
        turn = block_diagonal(block.rotation(self.component))
        loose = np.interp(block.time_s, *self.loose)[:, None, None]
        soft = loose * (turn @ self.flexibility @ np.swapaxes(turn, -1, -2))
        return (soft @ wrench[..., None])[..., 0], soft


@dataclass
class SqueezeFilm(Flowing):
    """A passive joint's pin sinks along its radial force while at rest; turning centres it again.

    The force squeezes the lubricant out of the gap, the faster the larger it is.
    """

    component: str  # passive joint
    seat: Seat  # of its bushing
    gap: float  # radial, the farthest that the pin sinks [m]
    time_s: float  # time constant of sinking under 1 N [s]
    refill: float  # turn of the joint which draws 63 % of the lubricant in again [rad]
    past: tuple[float, float, Array] | None = None  # time [s], turn [rad] and place (3,) [m]

    def flow(self, block: Block, wrench: Array, remember: bool) -> Array:
        """Sink by time and force, rise by turn."""
        to_origin = self.seat.to_origin(block.rotation(self.component))
        across = np.eye(3) - np.outer(self.seat.axis, self.seat.axis)
        force = np.einsum("nji,nj->ni", to_origin, wrench)[:, :3] @ across
        size = np.sqrt(np.sum(force * force, axis=-1))
        wall = self.gap * force / np.maximum(size, 1e-12)[:, None]
        turn = joint_turn(block, self.component, self.seat.axis)
        # It was turned before the start.
        before, angle, sunk = self.past or (block.time_s[0], turn[0], np.zeros(3))
        out = np.zeros_like(wrench)
        for i, now in enumerate(block.time_s):
            sunk = sunk * np.exp(-abs(turn[i] - angle) / self.refill)
            sunk = wall[i] + (sunk - wall[i]) * np.exp(-size[i] * (now - before) / self.time_s)
            before, angle = now, turn[i]
            out[i, :3] = sunk
        if remember:
            self.past = float(before), float(angle), sunk
        return np.einsum("nij,nj->ni", to_origin, out)


@dataclass
class Switch:
    """Two states; it changes where a signal leaves a band, and remembers."""

    band: float
    on: bool = False

    def __call__(self, signal: Array) -> Array:
        """Return the state (n,) as 0 or 1 for a signal (n,)."""
        out = np.empty(len(signal))
        for i, value in enumerate(signal):
            if abs(value) > self.band:
                self.on = bool(value > 0.0)
            out[i] = self.on
        return out


@dataclass
class PlasticSet(Flowing):
    """A part yields a little whenever a load is larger than all before, and stays bent."""

    component: str
    direction: Array  # (6,), of screw and wrench at O with the wrist at home; unit in force
    per_newton: float  # set per force beyond the yield point [m/N]
    yielding: float  # yield point [N]
    worst: Array | float = 0.0  # (2,), largest load to each side so far [N]

    def flow(self, block: Block, wrench: Array, remember: bool) -> Array:
        """Set grows with the largest load so far, to each side on its own."""
        turn = block_diagonal(block.rotation(self.component))
        load = np.einsum("nji,nj->ni", turn, wrench) @ self.direction
        both = np.stack([load, -load], axis=-1)
        worst = np.maximum.accumulate(np.maximum(both, np.maximum(self.worst, self.yielding)))
        bent = self.per_newton * ((worst - self.yielding) @ np.array([1.0, -1.0]))
        if remember:
            self.worst = worst[-1]
        return bent[:, None] * (turn @ self.direction)


def bump(angle: Array, at: float, width: float) -> Array:
    """Return a bell of height 1 (n,) at a place of a width, both on the angle (n,) [rad]."""
    return np.asarray(np.exp(-0.5 * ((angle - at) / width) ** 2))


# A tool that rings more than it moves.
@Entry(("platform",), "-", 0.1, 1.0, 50.0)
def resonance(d: Draw) -> Law:
    """Return a weakly damped tool."""
    return Resonance(d.magnitude, d.platform_spot, d.rng.uniform(5.0, 9.0), 0.03)


# Thicker than the clearance of any bearing of this size.
@Entry(PASSIVE_JOINTS, "m", 3e-6, 5e-5, 1e-3)
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
@Entry(("platform",), "m", 5e-6, 1e-4, 1e-3)
def loose_seat(d: Draw) -> Law:
    """Return two seats of the tool; a moment beyond 4 mN m throws it into the other one."""
    jump, lever = d.twist(), d.direction()

    def thrown(switch: Switch, block: Block, state: Equilibrium) -> Array:
        platform = block.configuration.platform
        moment = np.einsum("nji,nj->ni", platform, block.load[:, 3:]) @ lever
        return switch(moment)[:, None] * (block_diagonal(platform) @ jump)

    return Law(d.component, twist=partial(thrown, Switch(0.004)))


# 0.1 mm at 1 N is a broken bushing.
@Entry(JOINTS, "m/N", 5e-6, 1e-4, 1e-3)
def plastic_set(d: Draw) -> Law:
    """Return yielding beyond 0.1 N."""
    seat = d.seat
    local = np.concatenate([unit(np.cross(seat.axis, d.direction())), np.zeros(3)])
    direction = seat.to_origin(np.eye(3)) @ local
    return PlasticSet(d.component, direction, d.magnitude, 0.1)


# Two heads that disagree by 0.2 mm were never calibrated.
@Entry(("pose_sensor",), "m", 5e-6, 2e-4, 1e-3)
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
@Entry(("platform",), "N/m", 20.0, 1e4, 1e5)
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
@Entry(PASSIVE_JOINTS, "m", 5e-6, 1e-4, 1e-3)
def dent(d: Draw) -> Law:
    """Return a dent or a chip that lifts the pin over a few degrees of the joint's turn."""
    seat, lift = d.seat, d.magnitude * d.direction()
    at, width = d.rng.uniform(-0.4, 0.4), d.rng.uniform(0.06, 0.12)

    def share(block: Block) -> Array:
        return bump(joint_turn(block, d.component, seat.axis), at, width)

    # Radial and tilting motion, as a translation at the outer ring.
    return BodyScrew(d.component, screws_to_origin(seat.centre) @ (lift @ seat.rings[0]), share)


# 0.2 mm for one kelvin.
@Entry(("frame",), "m/K^2", 2e-5, 2e-4, 1e-2)
def thermal_bow(d: Draw) -> Law:
    """Return a bow by the square of the difference in temperature between the two motors."""
    per_kelvin = d.twist()

    def bowed(block: Block, state: Equilibrium) -> Array:
        kelvin = block.temperature_of("motor_1") - block.temperature_of("motor_2")
        return (kelvin * np.abs(kelvin))[:, None] * per_kelvin

    return Law(d.component, twist=bowed)


# 11 deg: the wrist falls over.
@Entry(("frame",), "rad", 0.02, 0.2, 0.5)
def floor_tilt(d: Draw) -> Law:
    """Return two waves of sway of the carrier: a weight of 1 N has a direction that wanders."""
    sway = d.magnitude * np.stack([d.direction(), 0.6 * d.direction()])
    place, periods_s = d.platform_spot, d.rng.uniform([15.0, 40.0], [30.0, 90.0])

    def turned(block: Block, at: Array) -> Array:
        waves = np.sin(2.0 * np.pi * block.time_s[:, None] / periods_s)
        return cross(waves @ sway, np.broadcast_to([0.0, 0.0, -1.0], at.shape))

    return PlatformForce(place, turned)


# 0.1 mm seizes the joint.
@Entry(JOINTS, "m", 5e-6, 1e-4, 1e-3)
def swelling(d: Draw) -> Law:
    """Return a bushing that swells with a humidity that nobody records: three waves."""
    periods_s = d.rng.uniform([40.0, 100.0, 250.0], [80.0, 200.0, 500.0])
    screw, phases = d.twist(), d.rng.uniform(0.0, 6.0, 3)

    def wet(block: Block) -> Array:
        angle = 2.0 * np.pi * block.time_s[:, None] / periods_s + phases
        return np.asarray(np.sin(angle).mean(axis=-1))

    return BodyScrew(d.component, screw, wet)


# 0.3 deg at the torque of the largest load are felt by hand.
@Entry(MOTORS, "rad/(N m)", 0.01, 0.1, 5.0)
def worn_sector(d: Draw) -> Law:
    """Return a gear that is worn where the cell works most: there its thinner teeth bend more."""
    joint = DRIVEN[d.component]
    axis = d.table.geometry.axes[joint]
    at, width = d.rng.uniform(-0.3, 0.3), d.rng.uniform(0.1, 0.2)

    def wound(block: Block, torque: Array) -> tuple[Array, Array]:
        theta = block.configuration.theta[:, MOTOR[d.component]]
        soft = d.magnitude * bump(theta, at, width)
        return soft * torque, soft

    return winding(joint, axis, wound)


# A rotor of half a kilogram, at 20 000 turns a minute.
@Entry(("platform",), "kg m^2/s", 5e-3, 0.1, 5.0)
def spinning_tool(d: Draw) -> Law:
    """Return a spindle that leans a little from the platform's normal and runs steadily.

    Turning its angular momentum (the magnitude) takes a moment, by the speed of the platform's
    tilting and across it.
    """
    axis = unit(d.table.mechanism.n0 + 0.3 * d.direction())
    momentum = d.rng.choice((-1.0, 1.0)) * d.magnitude * axis

    def wrench(rate: Rate, block: Block) -> Array:
        moment = -rate(block.time_s, block.configuration.platform @ momentum)
        return np.concatenate([np.zeros_like(moment), moment], axis=-1)

    return Law(d.component, wrench=partial(wrench, Rate()))


# A clamp that gives 0.1 mm at 1 N has lost its screw.
@Entry(LINKS, "m/N", 5e-6, 1e-4, 1e-3)
def loosening_screw(d: Draw) -> Law:
    """Return a clamp at one end of the link."""
    end = d.table.geometry.link_ends(d.component)[d.rng.integers(2)]
    place = d.table.geometry.links[d.component].arc_radius * end
    return LooseningScrew(d.component, d.magnitude * spring(d, place), d.rng.uniform(10.0, 40.0))


# 50 um: no lubricant holds in such a gap.
@Entry(PASSIVE_JOINTS, "m", 3e-6, 5e-5, 1e-3)
def squeeze_film(d: Draw) -> Law:
    """Return a grease that yields within seconds."""
    time_s, turn = d.rng.uniform(1.0, 4.0), d.rng.uniform(0.05, 0.15)
    return SqueezeFilm(d.component, d.seat, d.magnitude, time_s, turn)


# Of nine tenths hardly anything is left to measure, and more than all cannot go past.
@Entry(("load_sensor",), "-", 0.3, 0.9, 1.0)
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

    return Law(d.component, read_load=without_ring)


# The glass of the common half-inch prism is 9 mm deep.
@Entry(("pose_sensor",), "m", 2e-4, 1e-2, 5e-2)
def prism_incidence(d: Draw) -> Law:
    """Return a prism that faces the sensor within some 30 deg with the wrist at home.

    Light that enters its glass at an angle takes another way than its distance constant says:
    depth * (n - sqrt(n^2 - sin^2 angle)) too short along the beam, as the prism turns with the
    platform; the magnitude is the depth that the sensor's settings leave out.
    """
    beam, glass = d.direction(), 1.52
    face = unit(beam + 0.5 * d.direction())

    def seen(block: Block, rotation: Array, shift: Array) -> tuple[Array, Array]:
        sine_2 = 1.0 - ((rotation @ face) @ beam) ** 2
        short = d.magnitude * (glass - np.sqrt(glass**2 - sine_2))
        return rotation, shift + short[:, None] * beam

    return Law(d.component, read_pose=seen)
