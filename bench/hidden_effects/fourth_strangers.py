"""Strangers by a fourth author, as blind as the others, and what is true of each."""

from __future__ import annotations

from dataclasses import dataclass
from functools import partial

import numpy as np
from bench_wrist import Array
from right_sentences import LOAD, LOAD_SENSOR, POSE, RATES, RIGHT, SEEN, Right

from wrist_stiffness.mechanism.rigid_motion import exp_twist
from wrist_stiffness.mechanism.vectors import (
    block_diagonal,
    both_halves,
    cross,
    dot,
    frame_about,
    screws_to_origin,
    unit,
)
from wrist_stiffness.simulation.block import Block, Rate
from wrist_stiffness.simulation.catalogue import ALL, STRANGERS
from wrist_stiffness.simulation.effect_entry import LEVER, Draw, Entry
from wrist_stiffness.simulation.equilibrium import Equilibrium
from wrist_stiffness.simulation.laws.joint_friction import joint_turn
from wrist_stiffness.simulation.laws.law import (
    DRIVEN,
    MOTOR,
    BodyScrew,
    Law,
    PlatformForce,
    at_component,
)
from wrist_stiffness.simulation.program import Program
from wrist_stiffness.simulation.seat import Seat


@dataclass(frozen=True)
class Shuttle:
    """A carriage that is moved from one end of its way to the other, rests, and is moved back."""

    move_s: float  # [s]
    rest_s: float  # at each end [s]
    phase: float  # share of a whole cycle that is over at the start [-]

    def __call__(self, time_s: Array) -> tuple[Array, Array]:
        """Return its place, from 0 to 1, and acceleration [1/s^2] at n times."""
        half_s = self.move_s + self.rest_s
        cycle_s = np.mod(time_s + 2.0 * half_s * self.phase, 2.0 * half_s)
        ways = np.clip((cycle_s - half_s * np.arange(2.0)[:, None]) / self.move_s, 0.0, 1.0)
        place = ways**3 * (10.0 - 15.0 * ways + 6.0 * ways**2)
        pushed = (60.0 * ways - 180.0 * ways**2 + 120.0 * ways**3) / self.move_s**2
        return place[0] - place[1], pushed[0] - pushed[1]


@dataclass
class Chill:
    """How much colder the wet side of a link is, from 0 to 1: wetted by a jet, it dries in air."""

    link: str
    spot: Array  # (3,), of the link, with the wrist at home [m]
    # (3,), a point of the jet in F [m] and its direction
    aim: Array
    along: Array
    radius: float  # of the jet [m]
    # in which 63 % of the chill come in the middle of the jet, and go in air [s]
    wet_s: float
    dry_s: float
    past: tuple[float, float] | None = None  # time [s] and chill

    def __call__(self, block: Block) -> Array:
        """Return the chill of the next samples; the link has stood at the first one for long."""
        off = cross(self.along, block.rotation(self.link) @ self.spot - self.aim)
        wetted = np.exp(-0.5 * dot(off, off) / self.radius**2) / self.wet_s
        rate = wetted + 1.0 / self.dry_s
        goal, out = wetted / rate, np.empty_like(rate)
        before, chill = self.past or (float(block.time_s[0]), float(goal[0]))
        for i, now in enumerate(block.time_s.tolist()):
            chill = goal[i] + (chill - goal[i]) * np.exp(-rate[i] * (now - before))
            before, out[i] = now, chill
        self.past = before, chill
        return out


@dataclass
class WalkingSleeve(Law):
    """A sleeve sits loose in its joint: the pin takes it along while it turns one way only.

    Its wall is thicker on one side, which goes round with it.
    """

    joint: str  # passive joint
    seat: Seat  # of its bushing
    thicker: Array  # (3,), shift across the axis at the start, with the wrist at home [m]
    share: float  # of the turn one way that it is taken along, with the sign of that way [-]
    past: tuple[float, float] | None = None  # turn of the joint, and of the sleeve so far [rad]

    def screws(self, block: Block) -> Array:
        """Turn the shift about the axis by all that the joint has turned that way."""
        turn = joint_turn(block, self.joint, self.seat.axis)
        before, walked = self.past or (float(turn[0]), 0.0)
        taken = np.maximum(self.share * np.diff(turn, prepend=before), 0.0)
        angle = walked + np.cumsum(taken)
        self.past = float(turn[-1]), float(angle[-1])
        other = np.cross(self.seat.axis, self.thicker)
        shift = np.cos(angle)[:, None] * self.thicker + np.sin(angle)[:, None] * other
        to_origin = self.seat.to_origin(block.rotation(self.joint))
        screw = to_origin @ np.column_stack([shift, np.zeros_like(shift)])[..., None]
        return at_component(block, self.joint, screw[..., 0])


@dataclass
class DeadPath(Law):
    """The beams of an interferometer grow with the warmth of the air that they pass on their way.

    Its settings leave out the air between where it was set to zero and its optics.
    """

    motion: Array  # (6,), of what is seen [m/K, rad/K]

    def told(self, program: Program) -> None:
        """Keep the program, which tells the warmth of the room."""
        self._program = program

    def read_pose(self, block: Block, rotation: Array, shift: Array) -> tuple[Array, Array]:
        """Move everything by the warmth: each beam has a way of its own."""
        kelvin = self._program.ambient(self._program.phase(block.time_s))
        turn, move = exp_twist(kelvin * self.motion)
        return turn @ rotation, (turn @ shift[..., None])[..., 0] + move


# 0.3 mm in each metre: the bed rocks.
@Entry(("frame",), "rad", 1e-5, 3e-4, 1e-2)
def neighbour_robot(d: Draw) -> Law:
    """Return a robot on the same bed: it carries a part to and fro, by weight and by its push."""
    azimuth = d.rng.uniform(0.0, 2.0 * np.pi)
    along, foot = np.array([np.cos(azimuth), np.sin(azimuth), 0.0]), [0.0, 0.0, -0.4]
    # To tilt towards a side is to turn about the level axis across it.
    axis = np.cross([0.0, 0.0, 1.0], along)
    tilt = d.magnitude * np.append(np.cross(foot, axis), axis)
    way = Shuttle(d.rng.uniform(0.8, 1.5), d.rng.uniform(1.5, 4.0), d.rng.uniform())
    # Height of the part above the foot over g: what speeds it up pushes the bed back.
    fall = d.rng.uniform(0.3, 0.6) / 9.81

    def tilted(block: Block, state: Equilibrium) -> Array:
        place, pushed = way(block.time_s)
        return (place - 0.5 - fall * pushed)[:, None] * tilt

    return Law(d.component, twist=tilted)


# 20 um at each edge of a bearing 20 mm wide: it is heard to grind.
@Entry(("motor_1",), "rad", 3e-5, 2e-3, 2e-2)
def dented_race(d: Draw) -> Law:
    """Return a bearing whose balls dented the inner race in a crash: the axis nods as it turns."""
    joint = DRIVEN[d.component]
    seat = Seat.of(d.table.geometry, joint)
    # The cage turns by some 0.42 of the shaft; each ball that a dent meets makes one wave.
    order, phase = 0.58 * d.rng.integers(12, 21), d.rng.uniform(0.0, 2.0 * np.pi)
    sizes = d.magnitude * d.rng.uniform(0.3, 1.0, 2)
    tilts = np.hstack([np.zeros((2, 3)), sizes[:, None] * frame_about(seat.axis).T[1:]])
    # The bearing is 20 mm behind the bushing; neither turns.
    screws = tilts @ screws_to_origin(seat.centre + 0.02 * seat.axis).T

    def nodding(block: Block) -> Array:
        at = order * block.configuration.theta[:, MOTOR[d.component]] + phase
        return at_component(block, joint, np.column_stack([np.cos(at), np.sin(at)]) @ screws)

    return Law(d.component, screws=nodding)


# 50 K across 8 mm of steel bend 50 mm by that much: the coolant would boil.
@Entry(("link_3",), "rad", 1e-4, 3e-3, 5e-2)
def coolant_jet(d: Draw) -> Law:
    """Return a jet that hits the outside of the link in some poses, and bows it by its cold."""
    near, far = d.table.geometry.link_ends(d.component)
    spot = d.table.geometry.links[d.component].arc_radius * unit(near + far)
    # From outside the wrist: the side away from O is wet.
    along = unit(0.5 * d.direction() - unit(spot))
    aim = spot + d.rng.uniform(0.0, 0.006) * d.direction()
    times_s = d.rng.uniform([1.5, 8.0], [5.0, 20.0])
    chill = Chill(d.component, spot, aim, along, d.rng.uniform(0.005, 0.009), *times_s)
    about = unit(np.cross(far - near, along))
    return BodyScrew(d.component, d.magnitude * np.append(np.cross(spot, about), about), chill)


# A wall of 0.75 mm that is 0.1 mm thicker on one side is scrap.
@Entry(("joint_2",), "m", 5e-6, 1e-4, 5e-3)
def walking_sleeve(d: Draw) -> Law:
    """Return a sleeve that is taken along by a third or more of the turn to one side."""
    thicker = d.magnitude * unit(np.cross(d.seat.axis, d.direction()))
    share = d.rng.choice((-1.0, 1.0)) * d.rng.uniform(0.3, 0.9)
    return WalkingSleeve(d.component, d.seat, thicker, share)


# A collar that runs out by half its thickness is on askew.
@Entry(("joint_4",), "m", 2e-6, 5e-4, 2e-2)
def flange_runout(d: Draw) -> Law:
    """Return a hub whose face runs out: as the joint turns, its flange is pressed or comes free."""
    # The gap was shimmed at home, about halfway between the face's high and its low side.
    axis = d.seat.axis
    high = d.rng.choice((-0.5, 0.5)) * np.pi + d.rng.uniform(-0.5, 0.5)

    def shifted(block: Block) -> Array:
        turn = joint_turn(block, d.component, axis)
        return np.asarray(np.cos(turn - high) - np.cos(high))

    return BodyScrew(d.component, d.magnitude * np.append(axis, np.zeros(3)), shifted)


# At 30 mm/s three times the rated load: the wrist stirs putty.
@Entry(("platform",), "N s/m", 1.0, 100.0, 5e3)
def glue_pot(d: Draw) -> Law:
    """Return a spatula below the platform that stirs a pot of glue, as deep as the pose dips it."""
    reach, height = d.rng.uniform(0.025, 0.045), d.rng.uniform(0.005, 0.01)
    side = np.append(d.rng.uniform(-0.015, 0.015, 2), 0.0)
    tip = d.table.geometry.platform.centre - reach * d.table.mechanism.n0 + side
    level = tip[2] + d.rng.uniform(0.4, 1.0) * height

    def dragged(rate: Rate, block: Block, at: Array) -> Array:
        dipped = np.clip((level - at[:, 2]) / height, 0.0, 1.0)
        return -d.magnitude * dipped[:, None] * rate(block.time_s, at)

    return PlatformForce(tip, partial(dragged, Rate()))


# Half of a push is read on another axis: the gauge has come off.
@Entry(("load_sensor",), "-", 0.03, 0.5, 50.0)
def peeling_gauge(d: Draw) -> Law:
    """Return a strain gauge that comes off its beam: a pull stretches it, under a push it buckles.

    The magnitude is what is read wrong per push; by the calibration matrix it shows on all axes.
    """
    strain = np.append(d.direction(), d.direction() / LEVER) / np.sqrt(2.0)
    wrong, rough = np.append(d.direction(), 0.02 * d.direction()), d.rng.uniform(0.01, 0.05)

    def lifted(block: Block, wrench: Array) -> Array:
        # Gauges turn with the platform.
        platform = block.configuration.platform
        push = -both_halves(np.swapaxes(platform, -1, -2), wrench) @ strain
        # It was set to zero without load; what glue is left holds the first of a push.
        lost = d.magnitude * 0.5 * (push + np.hypot(push, rough) - rough)
        return wrench + lost[:, None] * (block_diagonal(platform) @ wrong)

    return Law(d.component, read_load=lifted)


# One part in a million per kelvin: 30 m of air in front of a wrist of 0.1 m.
@Entry(("pose_sensor",), "m/K", 1e-6, 3e-5, 5e-3)
def dead_path(d: Draw) -> Law:
    """Return beams without a weather station."""
    return DeadPath(d.twist())


FOURTH = {name: each for name, each in list(globals().items()) if isinstance(each, Entry)}

FOURTH_RIGHT = {
    "neighbour_robot": Right(("time",)),  # to and fro in a few seconds
    # How far the shaft has turned.  It nods in the frame, and all of the limb with it.
    "dented_race": Right(("theta_1",), ("motor_1", "joint_1", "link_1")),
    # Whether the link is in the jet, late; no thermometer sees one side of it.
    "coolant_jet": Right((*POSE, "turn_4")),
    "walking_sleeve": Right(("time",)),  # all that the joint has turned one way: it only grows
    # The flange that is pressed strains its limb.
    "flange_runout": Right(("turn_4",), ("joint_4", "link_2", "link_3")),
    "glue_pot": Right((*RATES, "turn_dot_2", "turn_dot_3", "turn_dot_4"), (LOAD_SENSOR,)),
    "peeling_gauge": Right(LOAD, (LOAD_SENSOR,)),  # one sense of a mixture of all six
    "dead_path": Right(("T_ambient",), SEEN),
}


def register() -> None:
    """Add the strangers of this file, and what is true of them, to those of the benchmark."""
    for entries in (STRANGERS, ALL):
        entries.update(FOURTH)
    RIGHT.update(FOURTH_RIGHT)
