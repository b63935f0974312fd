"""Strangers by an author who has not seen how laws are proposed, and what is true of each."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from bench_wrist import Array
from right_sentences import LOAD, LOAD_SENSOR, POSE, RATES, RIGHT, SEEN, Right

from wrist_stiffness.mechanism.components import ELASTIC, LINKS, PASSIVE_JOINTS
from wrist_stiffness.mechanism.rigid_motion import exp_twist
from wrist_stiffness.mechanism.vectors import block_diagonal, unit
from wrist_stiffness.simulation.block import Block
from wrist_stiffness.simulation.catalogue import ALL, STRANGERS
from wrist_stiffness.simulation.effect_entry import Draw, Entry
from wrist_stiffness.simulation.equilibrium import Equilibrium
from wrist_stiffness.simulation.laws.joint_friction import joint_turn
from wrist_stiffness.simulation.laws.law import DRIVEN, MOTOR, Bending, Law, Rubbing, at_component
from wrist_stiffness.simulation.program import Program


@dataclass
class Late:
    """Numbers that follow others as time, or a path, goes on; both begin alike."""

    constant: float  # in which 63 % of a difference go
    past: tuple[float, Array] | None = None

    def __call__(self, clock: Array, leading: Array) -> Array:
        """Return what follows `leading` (n, d) at the next n times."""
        before, value = self.past or (float(clock[0]), leading[0])
        out = np.empty_like(leading)
        for i, now in enumerate(clock.tolist()):
            value = leading[i] + (value - leading[i]) * np.exp(-(now - before) / self.constant)
            before, out[i] = now, value
        self.past = before, value
        return out


@dataclass(frozen=True)
class AirTable(Law):
    """The cell stands on air springs: it tilts under a change of force, and its valves level it."""

    flexibility: Array  # (6, 6), with the valves shut, at O in F [m/N, rad/N, rad/(N m)]
    levelled: Late  # what the valves have made up for

    def twist(self, block: Block, state: Equilibrium) -> Array:
        """Tilt under load and weights; the pose sensor stands on the floor beside the table."""
        whole = np.asarray(sum(state.through[:, ELASTIC.index(j)] for j in DRIVEN.values()))
        return (whole - self.levelled(block.time_s, whole)) @ self.flexibility


@dataclass(frozen=True)
class Crack(Bending):
    """A torsion crack, at 45 deg to its link: a twist to one side opens it."""

    component: str  # link
    column: Array  # (6,), screw at O of a unit twist of the link, with the wrist at home
    softness: float  # turn per opening moment [rad/(N m)]
    rough: float  # moment over which its faces come apart [N m]

    def bend(self, block: Block, wrench: Array) -> tuple[Array, Array]:
        """Gape by the moment along the link."""
        column = block_diagonal(block.rotation(self.component)) @ self.column
        moment = np.sum(column * wrench, axis=-1)
        size = np.hypot(moment, self.rough)
        gape = 0.5 * self.softness * (moment + size)[:, None] * column
        slope = 0.5 * self.softness * (1.0 + moment / size)[:, None, None]
        return gape, slope * column[:, :, None] * column[:, None, :]


@dataclass
class PinClimb(Law):
    """A sprung pin climbs the wall of its bore by friction, to the side towards which it turns."""

    joint: str  # passive joint
    axis: Array  # (3,), of the joint with the wrist at home
    climb: Array  # (6,), screw at O to one side, across the axis, with the wrist at home [m, rad]
    side: Late  # from -1 to 1, by the path of the joint's turn [rad]
    past: tuple[float, float] | None = None  # path and turn so far [rad]

    def screws(self, block: Block) -> Array:
        """Roll towards the side of the turn; it stays there at rest."""
        turn = joint_turn(block, self.joint, self.axis)
        so_far, angle = self.past or (0.0, float(turn[0]))
        moved = np.diff(turn, prepend=angle)
        path = so_far + np.cumsum(np.abs(moved))
        self.past = float(path[-1]), float(turn[-1])
        screw = block_diagonal(block.rotation(self.joint)) @ self.climb
        return at_component(block, self.joint, self.side(path, np.sign(moved)[:, None]) * screw)


@dataclass(frozen=True)
class SealingBoot(Rubbing):
    """A rubber boot over a passive joint is twisted as the joint turns, and twists back."""

    component: str  # passive joint
    axis: Array  # (3,), of the joint with the wrist at home
    stiffness: float  # torque per turn [N m/rad]

    def rub(
        self, block: Block, give: Array, state: Equilibrium, acting: Array, remember: bool
    ) -> Array:
        """Return the boot's torque against the turn; the joint's parts give way to it a little."""
        j = PASSIVE_JOINTS.index(self.component)
        turn = joint_turn(block, self.component, self.axis) + state.slips[:, j, 1]
        free = turn - give[:, j, 1, 1] * acting[:, 1]
        torque = -free / (1.0 / self.stiffness + give[:, j, 1, 1])
        return np.column_stack([np.zeros_like(torque), torque])


@dataclass(frozen=True)
class BowedShaft(Law):
    """A motor's shaft bows as it warms, for it was straightened cold; the bow turns with it."""

    motor: str
    bow: Array  # (3,), shift of the shaft's end with the wrist at home [m/K]

    def screws(self, block: Block) -> Array:
        """Shift the link's bore, which turns with the shaft."""
        shift = block.rotation(LINKS[MOTOR[self.motor]]) @ self.bow
        shift *= block.temperature_of(self.motor)[:, None]
        return at_component(block, DRIVEN[self.motor], np.column_stack([shift, 0.0 * shift]))


@dataclass(frozen=True)
class PasteCup(Law):
    """Paste in an open cup on the platform creeps to its low side: the tool's weight shifts."""

    weight: Array  # (3,), times its shift for a slope of one, in F [N m]
    normal: Array  # (3,), of the cup, in U
    crept: Late  # how far it has come

    def wrench(self, block: Block) -> Array:
        """Return the moment of the shifted weight."""
        platform = block.configuration.platform
        down = unit(self.weight) @ platform
        slope = down - np.outer(down @ self.normal, self.normal)
        shifted = (platform @ self.crept(block.time_s, slope)[..., None])[..., 0]
        return np.column_stack([np.zeros_like(shifted), np.cross(shifted, self.weight)])


@dataclass
class Pickup(Law):
    """The load sensor's cable picks up the current of a motor's, which goes with its speed."""

    motor: str
    wrench_per_speed: Array  # (6,), read too much, in U at O [N s/rad, N m s/rad]

    def told(self, program: Program) -> None:
        """Keep the program, which tells the speeds."""
        self._program = program

    def read_load(self, block: Block, wrench: Array) -> Array:
        """Add it."""
        speed = self._program.speed(block.time_s)[:, MOTOR[self.motor]]
        turned = block_diagonal(block.configuration.platform) @ self.wrench_per_speed
        return wrench + speed[:, None] * turned


@dataclass(frozen=True)
class AirConditioner(Law):
    """Cold air falls through the tracker's beams now and then and bends them."""

    motion: Array  # (6,), of what is seen while it blows [m, rad]
    period_s: float  # of the thermostat that switches it [s]
    phase: float  # share of a period that is over at the start [-]

    def read_pose(self, block: Block, rotation: Array, shift: Array) -> tuple[Array, Array]:
        """Move everything while it blows; it comes and goes within seconds."""
        wave = np.sin(2.0 * np.pi * (block.time_s / self.period_s + self.phase))
        turn, move = exp_twist(0.5 * (1.0 + np.tanh(4.0 * wave))[:, None] * self.motion)
        return turn @ rotation, (turn @ shift[..., None])[..., 0] + move


# 1 N at the platform, 0.3 m above the table's middle, moves it by 0.3 mm: it is felt to float.
@Entry(("frame",), "rad/(N m)", 1e-4, 3e-3, 0.1)
def air_table(d: Draw) -> Law:
    """Return a table that tilts about two level axes some way below the wrist."""
    below = np.append(d.rng.uniform(-0.1, 0.1, 2), d.rng.uniform(-0.4, -0.2))
    tilts = np.column_stack([np.cross(below, np.eye(3)[:2]), np.eye(3)[:2]])
    return AirTable(d.magnitude * tilts.T @ tilts, Late(d.rng.uniform(3.0, 10.0)))


# A link that twists by half a degree under the largest moment through it is about to break.
@Entry(("link_1",), "rad/(N m)", 3e-3, 0.3, 5.0)
def crack(d: Draw) -> Law:
    """Return a crack in the middle of the link that gapes for one of both senses."""
    near, far = d.table.geometry.link_ends(d.component)
    root = d.table.geometry.links[d.component].arc_radius * unit(near + far)
    about = d.rng.choice((-1.0, 1.0)) * unit(far - near)
    return Crack(d.component, np.append(np.cross(root, about), about), d.magnitude, 1e-3)


# A pin that is 0.1 mm to either side rattles.
@Entry(("joint_3",), "m", 3e-6, 1e-4, 1e-3)
def pin_climb(d: Draw) -> Law:
    """Return a pin that is sprung to a random side."""
    across = np.append(unit(np.cross(d.seat.axis, d.direction())), np.zeros(3))
    climb = d.magnitude * (d.seat.to_origin(np.eye(3)) @ across)
    return PinClimb(d.component, d.seat.axis, climb, Late(d.rng.uniform(0.02, 0.06)))


# At the end of the joint's way several times the torque of the largest load: the motors stall.
@Entry(("joint_4",), "N m/rad", 5e-3, 0.3, 3.0)
def sealing_boot(d: Draw) -> Law:
    """Return a boot that was clipped on with the wrist at home."""
    return SealingBoot(d.component, d.seat.axis, d.magnitude)


# 0.1 mm at one kelvin: it strikes its housing.
@Entry(("motor_2",), "m/K", 5e-6, 1e-4, 1e-3)
def bowed_shaft(d: Draw) -> Law:
    """Return a shaft that bows to a random side."""
    axis = d.table.geometry.axes[DRIVEN[d.component]]
    return BowedShaft(d.component, d.magnitude * unit(np.cross(axis, d.direction())))


# Half a kilogram of paste in a cup of 0.1 m: wider than the wrist.
@Entry(("platform",), "kg m", 5e-4, 5e-2, 0.2)
def paste_cup(d: Draw) -> Law:
    """Return a cup that stands upright on the platform at home."""
    weight = d.magnitude * d.table.geometry.gravity
    return PasteCup(weight, d.table.mechanism.n0, Late(d.rng.uniform(2.0, 8.0)))


# At full speed several times the rated force.
@Entry(("load_sensor",), "N s/rad", 0.05, 10.0, 20.0)
def pickup(d: Draw) -> Law:
    """Return a cable along that of the first motor."""
    return Pickup("motor_1", d.magnitude * np.append(d.direction(), 0.02 * d.direction()))


# Beams that are bent by 0.1 mm over a few metres are seen to shimmer.
@Entry(("pose_sensor",), "m", 3e-6, 1e-4, 1e-2)
def air_conditioner(d: Draw) -> Law:
    """Return a thermostat that switches every half minute or so."""
    return AirConditioner(d.twist(), d.rng.uniform(25.0, 70.0), d.rng.uniform())


BLIND = {name: each for name, each in list(globals().items()) if isinstance(each, Entry)}

BLIND_RIGHT = {
    "air_table": Right((*LOAD, *RATES)),  # under a new load, or when weights move; it dies away
    "crack": Right(LOAD),  # the moment along the link, which the load on the platform makes
    "pin_climb": Right((*RATES, "turn_dot_3", *map("hysteresis of {}".format, ("turn_3", *POSE)))),
    "sealing_boot": Right(("turn_4",), ("joint_4", "link_2", "link_3")),  # a torque between both
    "bowed_shaft": Right(("T_motor_2",)),  # who says the motor's angle alone sees no heat
    "paste_cup": Right(POSE, (LOAD_SENSOR,)),  # down the platform's slope, late
    "pickup": Right(("theta_dot_1",), (LOAD_SENSOR,)),
    "air_conditioner": Right(("time",), SEEN),
}


def register() -> None:
    """Add the strangers of this file, and what is true of them, to those of the benchmark."""
    for entries in (STRANGERS, ALL):
        entries.update(BLIND)
    RIGHT.update(BLIND_RIGHT)
