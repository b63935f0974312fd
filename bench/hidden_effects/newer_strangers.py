"""Newer strangers, as blind as those of `blind_strangers`, and what is true of each."""

from __future__ import annotations

from dataclasses import dataclass, field
from functools import partial

import numpy as np
from bench_wrist import Array
from blind_strangers import Late
from right_sentences import LOAD, LOAD_SENSOR, POSE, RATES, RIGHT, SEEN, Right

from wrist_stiffness.mechanism.vectors import block_diagonal, cross, dot, unit
from wrist_stiffness.simulation.block import Block, Rate
from wrist_stiffness.simulation.catalogue import ALL, STRANGERS
from wrist_stiffness.simulation.effect_entry import Draw, Entry
from wrist_stiffness.simulation.equilibrium import Equilibrium
from wrist_stiffness.simulation.laws.joint_friction import joint_turn
from wrist_stiffness.simulation.laws.law import (
    JOINED,
    MOTOR,
    Bending,
    Flowing,
    Law,
    PlatformForce,
    SensorMotion,
)


@dataclass(frozen=True)
class SlitBush(Bending):
    """A bushing is slit at one end; the slit turns with the outer body, the pin does not."""

    component: str  # passive joint
    slit: Array  # (6,), screw at O of a unit shift of that end across it, with the wrist at home
    softness: float  # displacement per little force across the slit [m/N]
    closing: float  # force that leaves 71 % of the softness, for the edges meet [N]

    def bend(self, block: Block, wrench: Array) -> tuple[Array, Array]:
        """Give way, less and less, to what of the force at that end points across the slit."""
        outer = block.configuration.rotations[JOINED[self.component][1]]
        column = block_diagonal(outer) @ self.slit
        share = np.sum(column * wrench, axis=-1) / self.closing
        shift = self.softness * self.closing * np.arcsinh(share)
        slope = self.softness / np.hypot(1.0, share)
        columns = column[:, :, None] * column[:, None, :]
        return shift[:, None] * column, slope[:, None, None] * columns


@dataclass
class LapJoint(Flowing):
    """Two halves of a link, held by one bolt: they slip about it beyond the grip, and stick."""

    component: str  # link
    bolt: Array  # (3,), axis of the bolt with the wrist at home, through O
    softness: float  # turn per moment beyond the grip [rad/(N m)]
    grip: float  # moment that friction holds [N m]
    slipped: float = 0.0  # moment beyond the grip that the slip so far stands for [N m]

    def flow(self, block: Block, wrench: Array, remember: bool) -> Array:
        """Drag the slip behind the moment about the bolt."""
        bolt = block.rotation(self.component) @ self.bolt
        slipped, out = self.slipped, np.zeros_like(wrench)
        for i, moment in enumerate(dot(wrench[:, 3:], bolt).tolist()):
            slipped = min(max(slipped, moment - self.grip), moment + self.grip)
            out[i, 3:] = self.softness * slipped * bolt[i]
        if remember:
            self.slipped = slipped
        return out


@dataclass
class HotPin(Flowing):
    """A joint's sleeve is warmed by its own rubbing and swells, more where its wall is thicker."""

    component: str  # passive joint
    axis: Array  # (3,), of the joint with the wrist at home
    swelling: Array  # (6,), screw at O per heat, with the wrist at home [m s/(N rad)]
    constant: float  # in which 63 % of the warmth go [s]
    past: tuple[float, float, float] | None = None  # time, turn and warmth

    def flow(self, block: Block, wrench: Array, remember: bool) -> Array:
        """Warm up by radial force times speed of the turn, and cool down at rest."""
        axis = block.rotation(self.component) @ self.axis
        radial = np.sqrt(np.sum(cross(axis, wrench[:, :3]) ** 2, axis=-1))
        turn = joint_turn(block, self.component, self.axis)
        before, angle, warmth = self.past or (float(block.time_s[0]), float(turn[0]), 0.0)
        out = np.empty_like(radial)
        for i, now in enumerate(block.time_s.tolist()):
            warmth *= np.exp(-(now - before) / self.constant)
            warmth += radial[i] * abs(turn[i] - angle) / self.constant
            before, angle, out[i] = now, turn[i], warmth
        if remember:
            self.past = before, angle, warmth
        return out[:, None] * (block_diagonal(block.rotation(self.component)) @ self.swelling)


@dataclass
class HoldingBrake(Law):
    """A brake closes when its motor has rested for a moment, and turns the shaft as it grips."""

    motor: str
    kick: float  # to one side always: its lining hangs askew [rad]
    delay: float  # from rest to grip [s]
    rate: Rate = field(default_factory=Rate)
    moved: float = -np.inf  # when it moved last [s]

    STILL = 0.01
    """Below this speed the drive calls for the brake [rad/s]."""

    def turn(self, time_s: Array, shaft: Array) -> Array:
        """Turn the link while the brake is closed; it opens at once."""
        column, out = MOTOR[self.motor], np.zeros_like(shaft)
        moving = np.abs(self.rate(time_s, shaft)[:, column]) > self.STILL
        last = np.maximum.accumulate(np.where(moving, time_s, self.moved))
        self.moved = max(self.moved, float(last[-1]))
        out[:, column] = self.kick * (time_s - last >= self.delay)
        return out


def standing(rate: Rate, late: Late, stirring: float, block: Block, rotation: Array) -> Array:
    """Return warmth (n,) [K] of the first motor times what of its plume a moving wrist leaves."""
    speed = np.abs(rate(block.time_s, block.configuration.theta)).sum(axis=-1)
    still = late(block.time_s, np.exp(-speed / stirring)[:, None])
    return np.asarray(block.temperature_of("motor_1") * still[:, 0])


# 0.05 mm at 1 N is a broken bushing.
@Entry(("joint_4",), "m/N", 1e-6, 5e-5, 1e-3)
def slit_bush(d: Draw) -> Law:
    """Return a bushing whose slit looks up or down, within 20 deg: it gives way to the side."""
    seat = d.seat
    level = unit(np.cross(seat.axis, d.table.geometry.gravity))
    side = unit(level + d.rng.uniform(-0.36, 0.36) * np.cross(seat.axis, level))
    slit = seat.to_origin(np.eye(3)) @ (side @ seat.rings[0])
    return SlitBush(d.component, slit, d.magnitude, d.rng.uniform(0.3, 1.0))


# At 20 mN m, the moment of the largest load, half a degree: both halves are seen to hinge.
@Entry(("link_2",), "rad/(N m)", 1e-2, 0.5, 10.0)
def lap_joint(d: Draw) -> Law:
    """Return a bolt in the middle of the link, along its radius, that grips too little."""
    near, far = d.table.geometry.link_ends(d.component)
    return LapJoint(d.component, unit(near + far), d.magnitude, d.rng.uniform(5e-4, 2e-3))


# At 1 N and the usual 0.3 rad/s this is 0.15 mm: the pin seizes.
@Entry(("joint_2",), "m s/(N rad)", 5e-5, 5e-4, 2e-2)
def hot_pin(d: Draw) -> Law:
    """Return a thin sleeve, which warms up and cools down within some ten or twenty seconds."""
    seat, side = d.seat, d.magnitude * unit(np.cross(d.seat.axis, d.direction()))
    # At one end of the bore, where the wall is thicker on one side.
    swelling = seat.to_origin(np.eye(3)) @ (side @ seat.rings[0])
    return HotPin(d.component, seat.axis, swelling, d.rng.uniform(8.0, 20.0))


# 0.3 deg are seen as a jerk at every stop.
@Entry(("motor_1",), "rad", 1e-4, 5e-3, 0.02)
def holding_brake(d: Draw) -> Law:
    """Return a brake behind the encoder, which does not see what it does."""
    kick = d.rng.choice((-1.0, 1.0)) * d.magnitude
    return HoldingBrake(d.component, kick, d.rng.uniform(0.3, 0.8))


# Five times the rated load: the wrist is caught.
@Entry(("platform",), "N", 0.1, 5.0, 100.0)
def steel_post(d: Draw) -> Law:
    """Return a magnet in the gripper that passes a post of steel; the pull is that at 12 mm."""
    magnet, gap = d.platform_spot, 0.012
    beside = unit(magnet) + 0.6 * unit(np.cross(magnet, d.direction()))
    post = (np.sqrt(magnet @ magnet) + 0.5 * gap) * unit(beside)

    def pulled(block: Block, at: Array) -> Array:
        line = post - at
        distance = np.sqrt(dot(line, line))[:, None]
        # Between a dipole and the one that it makes in the steel the pull falls steeply.
        return d.magnitude * (gap / distance) ** 4 * line / distance

    return PlatformForce(magnet, pulled)


# The motor is to be some ten kelvins warmer than the room: 1 mm is seen to shimmer.
@Entry(("pose_sensor",), "m/K", 3e-6, 1e-4, 5e-3)
def heat_plume(d: Draw) -> Law:
    """Return beams bent by air over a motor; the plume stands again a second or so after a move."""
    stirring, late = d.rng.uniform(0.1, 0.3), Late(d.rng.uniform(0.5, 2.0))
    return SensorMotion(d.twist(), partial(standing, Rate(), late, stirring))


# Within a second as much as the rated load.
@Entry(("load_sensor",), "N/s", 5e-3, 1.0, 10.0)
def charge_amplifier(d: Draw) -> Law:
    """Return a piezoelectric sensor; it drifts, in its own axes, until its amplifier is reset."""
    said = d.magnitude * np.append(d.direction(), 0.02 * d.direction())
    period_s, phase = d.rng.uniform(20.0, 45.0), d.rng.uniform()

    def drifted(block: Block, wrench: Array) -> Array:
        since_s = period_s * np.mod(block.time_s / period_s + phase, 1.0)
        return wrench + since_s[:, None] * (block_diagonal(block.configuration.platform) @ said)

    return Law(d.component, read_load=drifted)


# 0.3 mm in each metre: cups on the table are heard to rattle.
@Entry(("frame",), "rad", 1e-5, 3e-4, 1e-2)
def fork_lift(d: Draw) -> Law:
    """Return a floor that dips under a fork lift, which comes past every half minute or so.

    The stand tilts towards it, first to one side and then to the other; the sensor's does not.
    """
    along = unit(np.append(d.rng.normal(size=2), 0.0))
    towards, foot = np.cross([0.0, 0.0, 1.0], along), [0.0, 0.0, d.rng.uniform(-1.0, -0.3)]
    # To tilt towards a side is to turn about the level axis across it.
    axes = np.stack([towards, -along])
    tilts = d.magnitude * np.column_stack([np.cross(foot, axes), axes])
    period_s, phase = d.rng.uniform(25.0, 45.0), d.rng.uniform()
    pass_s = d.rng.uniform(2.0, 4.0)

    def tilted(block: Block, state: Equilibrium) -> Array:
        # Its place along the aisle over how far away that is.
        place = (np.mod(block.time_s / period_s + phase, 1.0) - 0.5) * period_s / pass_s
        dip = 1.0 / (1.0 + place**2) ** 2
        return np.column_stack([place * dip, dip]) @ tilts

    return Law(d.component, twist=tilted)


NEWER = {name: each for name, each in list(globals().items()) if isinstance(each, Entry)}

NEWER_RIGHT = {
    "slit_bush": Right((*LOAD, "turn_4")),  # the force across the slit, as the joint turns that
    "lap_joint": Right(LOAD),  # the moment about the bolt, from which side it came as well
    "hot_pin": Right((*RATES, "turn_dot_2")),  # late; a load on a joint at rest does not warm it
    # Whether it rests.  A turn about the motor's axis is the same in frame, joint and link.
    "holding_brake": Right(("theta_dot_1",), ("motor_1", "joint_1", "link_1")),
    "steel_post": Right(POSE, (LOAD_SENSOR,)),  # the distance from the post
    "heat_plume": Right(("T_motor_1", *RATES), SEEN),  # warmth at rest, nothing in motion
    "charge_amplifier": Right(("time",), (LOAD_SENSOR,)),  # a ramp, again and again
    "fork_lift": Right(("time",)),
}


def register() -> None:
    """Add the strangers of this file, and what is true of them, to those of the benchmark."""
    for entries in (STRANGERS, ALL):
        entries.update(NEWER)
    RIGHT.update(NEWER_RIGHT)
