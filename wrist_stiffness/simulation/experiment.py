"""The experiments that a user might run, as programs of the virtual cell."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from wrist_stiffness.errors import InputError
from wrist_stiffness.mechanism.components import Array
from wrist_stiffness.mechanism.vectors import unit
from wrist_stiffness.mechanism.workspace import Workspace
from wrist_stiffness.simulation.program import Program, Schedule

TILT_SHARE = 0.85
"""Poses stay this far inside the operative workspace, so that straight moves do as well."""

SPEED = float(np.radians(30.0))
"""Mean speed of the faster motor in a move [rad/s]."""

FORCE, LEVER = 1.0, 0.02
"""Largest force of a load [N] and its lever arm about O [m]."""

LOADING_S, DWELL_S = 0.6, 1.4


def random_pose(workspace: Workspace, rng: np.random.Generator) -> Array:
    """Return motor angles (2,) [rad] whose tilt is evenly spread over the workspace's area."""
    lower, upper = workspace.rectangle
    limit = TILT_SHARE * workspace.limits.operative_tilt
    while True:
        theta = rng.uniform(lower, upper)
        if workspace.domain(theta) and workspace.mechanism.tilt(theta) <= limit:
            return theta


def random_load(rng: np.random.Generator) -> Array:
    """Return a wrench (6,) at O in F of at most 1 N, from a random point of the platform."""
    force = FORCE * rng.uniform() ** (1.0 / 3.0) * unit(rng.normal(size=3))
    return np.concatenate([force, np.cross(LEVER * rng.uniform(-1.0, 1.0, 3), force)])


def move(schedule: Schedule, theta: Array, load: Array | None = None) -> None:
    """Move the motors to `theta` (2,) [rad] at the usual speed, with the load or to another one."""
    farthest = float(np.max(np.abs(theta - schedule.theta)))
    schedule.go_on(0.3 + farthest / SPEED, theta, load)


def rich(workspace: Workspace, rng: np.random.Generator, seconds: float) -> Program:
    """Return random poses, loads and approach sides; loads put on at rest or carried along.

    Every fifth dwell returns to a reference pose without load, every fourth re-approaches and
    re-loads the dwell before (a replicate), every eleventh is a hold of 15 s; the room drifts.

    `seconds`: about how long the program takes [s].  Gives `Program`: closed: it ends where it
    begins.
    """
    reference = random_pose(workspace, rng)
    schedule = Schedule(reference)
    schedule.go_on(DWELL_S)
    theta, load = reference, np.zeros(6)
    count = 0
    while schedule.time_s < seconds:
        count += 1
        replicate = count % 4 == 0
        if not replicate:
            to_reference = count % 5 == 0
            theta = reference if to_reference else random_pose(workspace, rng)
            load = np.zeros(6) if to_reference else random_load(rng)
        _approach(schedule, workspace, theta, load, rng)
        schedule.go_on(15.0 if count % 11 == 0 else DWELL_S)
        schedule.ambient(float(rng.uniform(-3.0, 3.0)))
    return schedule.program(LOADING_S)


def _approach(
    schedule: Schedule, workspace: Workspace, theta: Array, load: Array, rng: np.random.Generator
) -> None:
    """Go to a pose from a random side, with the load carried along or put on after arrival."""
    carried = rng.uniform() < 0.5
    schedule.go_on(LOADING_S, load=load if carried else np.zeros(6))
    before = theta + np.radians(4.0) * rng.choice([-1.0, 1.0], 2) * rng.uniform(0.5, 1.0, 2)
    if not workspace.domain(before):
        before = theta
    for target in (before, theta):
        if not np.array_equal(target, schedule.theta):
            move(schedule, target)
    if not carried:
        schedule.go_on(LOADING_S, load=load)


def paper(workspace: Workspace, rng: np.random.Generator, seconds: float) -> Program:
    """Return the paper's 25 poses in rows, 1 N downward all the time, approached from one side.

    Repeated until `seconds` are over; see `rich` for the parameters.
    """
    lower, upper = workspace.rectangle
    inside = TILT_SHARE / workspace.limits.map_margin
    middle, half = (lower + upper) / 2.0, (upper - lower) / 2.0
    axis = np.linspace(-1.0, 1.0, 5)
    # The corners of the square lie outside of the round workspace: it is drawn in.
    poses = [middle + 0.7 * inside * half * np.array([x, y]) for x in axis for y in axis]
    load = np.array([0.0, 0.0, -FORCE, 0.0, 0.0, 0.0])
    schedule = Schedule(poses[0])
    schedule.go_on(LOADING_S, load=load)
    while schedule.time_s < seconds:
        for pose in poses:
            before = pose - np.radians(3.0)
            for target in (before, pose):
                move(schedule, target)
            schedule.go_on(DWELL_S)
    return schedule.program(LOADING_S)


def dead_weights(workspace: Workspace, rng: np.random.Generator, seconds: float) -> Program:
    """Return what weights on the platform allow: straight down, at four points, put on at rest.

    See `rich` for the parameters.
    """
    schedule = Schedule(random_pose(workspace, rng))
    down = np.array([0.0, 0.0, -1.0])
    while schedule.time_s < seconds:
        theta = random_pose(workspace, rng)
        schedule.go_on(LOADING_S, load=np.zeros(6))
        _approach(schedule, workspace, theta, np.zeros(6), rng)
        schedule.go_on(DWELL_S)
        platform = workspace.mechanism.forward(theta).platform
        point = LEVER * np.array(
            [(1.0, 0.0, 0.0), (-1.0, 0.0, 0.0), (0.0, 1.0, 0.0), (0.0, 0.0, 0.0)]
        )
        for mass in rng.permutation([0.02, 0.05, 0.1])[:2]:
            force = 9.81 * mass * down
            at = platform @ point[rng.integers(4)]
            schedule.go_on(LOADING_S, load=np.concatenate([force, np.cross(at, force)]))
            schedule.go_on(DWELL_S)
        schedule.ambient(float(rng.uniform(-3.0, 3.0)))
    return schedule.program(LOADING_S)


def production(workspace: Workspace, rng: np.random.Generator, seconds: float) -> Program:
    """Return pick-and-assemble cycles between four poses: weight carried, a push at the end.

    See `rich` for the parameters.
    """
    pick, lift, above, place = (random_pose(workspace, rng) for _ in range(4))
    schedule = Schedule(lift)
    weight = np.array([0.0, 0.0, -0.3, 0.0, 0.0, 0.0])
    push = weight + random_load(rng) * 0.6
    while schedule.time_s < seconds:
        for target, load in ((pick, weight), (lift, None), (above, None), (place, push)):
            move(schedule, target)
            schedule.go_on(0.3)
            if load is not None:
                schedule.go_on(0.4, load=load)
                schedule.go_on(0.5)
        schedule.go_on(0.4, load=np.zeros(6))
        move(schedule, above)
        schedule.ambient(2.0 * float(np.sin(schedule.time_s / 100.0)))
    return schedule.program(LOADING_S)


def heavy(workspace: Workspace, rng: np.random.Generator, seconds: float) -> Program:
    """Return random poses, at each another direction of a force at O three times the rated one.

    See `rich` for the parameters.
    """
    schedule = Schedule(random_pose(workspace, rng))
    while schedule.time_s < seconds:
        theta = random_pose(workspace, rng)
        load = np.append(3.0 * FORCE * unit(rng.normal(size=3)), np.zeros(3))
        move(schedule, theta, load)
        schedule.go_on(DWELL_S)
    return schedule.program(LOADING_S)


EXPERIMENTS: dict[str, Callable[[Workspace, np.random.Generator, float], Program]] = {
    each.__name__: each for each in (rich, paper, dead_weights, production, heavy)
}


def experiment(
    name: str, workspace: Workspace, rng: np.random.Generator, seconds: float
) -> Program:
    """Return the program of an experiment by its name.

    Raises `InputError` if there is none of that name.
    """
    if name not in EXPERIMENTS:
        raise InputError(f"experiment {name!r} is not one of {', '.join(EXPERIMENTS)}")
    return EXPERIMENTS[name](workspace, rng, seconds)
