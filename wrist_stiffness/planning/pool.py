"""Settings that a plan may choose from, and the order in which the chosen ones are performed."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from wrist_stiffness.errors import InputError, LoadRangeError
from wrist_stiffness.mechanism.components import Array
from wrist_stiffness.mechanism.geometry import Limits
from wrist_stiffness.mechanism.workspace import Workspace
from wrist_stiffness.planning.loads_file import NO_LOAD, AppliedLoad, Source
from wrist_stiffness.planning.timeline import (
    HOME,
    SPEEDS,
    Pace,
    Timeline,
    Visit,
    run_through,
    straight,
)

POOL = 100
"""Settings to choose from."""

TILT_SHARE = 0.9
"""Poses stay this far inside the operative workspace: approaches begin outside of them."""

REFERENCE_EVERY_S = 480.0
"""The reference pose is measured again at least so often, as far as single visits allow [s]."""

HOLD_S = 60.0
"""Of each of the two long holds [s]."""

WARM_UP_SHARE, WARM_UP_LEAST_S, WARM_UP_MOST_S = 0.1, 30.0, 300.0
"""Of the experiment's duration; moving without measuring [s]."""

DRAWS = 200
"""Tries to find a load within the table's range."""

OUTWARD_STEPS = 30
"""Radii that are tried for a setting that is moved outward."""


def draw_settings(
    workspace: Workspace, sources: Sequence[Source], gravity: Array, rng: np.random.Generator
) -> list[Visit]:
    """Draw the pool: random poses, without load or with one that the user can apply.

    `gravity` (3,): in F [m/s^2].  Gives about `POOL` visits, each from one side.  Raises
    `InputError` if home or the way to it from either side is out of the table's domain;
    `LoadRangeError` if a source has no load within the table's range at any pose.
    """
    if not _approachable(workspace, HOME, np.ones(2)):
        raise InputError("plan: the home pose is not inside the table's domain")
    # One in four settings is without load, as loads are what most effects need.
    count = POOL if sources else POOL // 2
    chosen = [
        None if i % 4 == 3 or not sources else sources[i % len(sources)] for i in range(count)
    ]
    rng.shuffle(chosen)
    poses = _poses(workspace, count, rng)
    settings = []
    for theta, source in zip(poses, chosen, strict=True):
        approach = rng.choice([-1.0, 1.0], 2)
        speed = float(rng.permutation(SPEEDS)[0])
        carried = bool(rng.uniform() < 0.5)
        load = NO_LOAD
        if source is not None:
            load = _draw_load(source, workspace, theta, approach, gravity, rng)
        carried = carried and load is not NO_LOAD
        settings.append(Visit(theta, approach, load, carried, speed))
    for source in sources:
        if not any(setting.load.name == source.name for setting in settings):
            raise LoadRangeError(
                f"load {source.name}: beyond the table's range of {workspace.limits.force:g} N and "
                f"{workspace.limits.moment:g} N m about O at every pose"
            )
    return settings


def moved_outward(setting: Visit, workspace: Workspace) -> Visit:
    """Return a setting as far from home as the workspace lets it be visited with its load.

    Most effects differ most where the motors have turned far, which random poses seldom have.
    """
    nearest = float(np.linalg.norm(setting.theta))
    farthest = float(np.linalg.norm(np.abs(workspace.rectangle).max(axis=0)))
    for radius in np.linspace(farthest, nearest, OUTWARD_STEPS, endpoint=False):
        theta = setting.theta * radius / nearest
        if _visitable(workspace, theta) and within(
            setting.load.wrench(_platforms(workspace, theta, setting.approach)), workspace.limits
        ):
            return replace(setting, theta=theta)
    return setting


def _poses(workspace: Workspace, count: int, rng: np.random.Generator) -> Array:
    """Return poses that can be visited, (n, 2)."""
    lower, upper = workspace.rectangle
    found: list[Array] = []
    while len(found) < count:
        theta = rng.uniform(lower, upper)
        if _visitable(workspace, theta):
            found.append(theta)
    return np.array(found)


def _visitable(workspace: Workspace, theta: Array) -> bool:
    """Tell whether a pose of the operative workspace can be approached from all sides."""
    tilt = TILT_SHARE * workspace.limits.operative_tilt
    if not workspace.operative(theta) or workspace.mechanism.tilt(theta) > tilt:
        return False
    sides = np.array([[1.0, 1.0], [1.0, -1.0]])
    return all(_approachable(workspace, theta, side) for side in sides)


def _platforms(workspace: Workspace, theta: Array, approach: Array) -> Array:
    """Return the platform's rotations on both approaches, (n, 3, 3)."""
    way = theta + np.linspace(-1.0, 1.0, 9)[:, None] * (theta - Visit(theta, approach).before)
    return workspace.mechanism.platform_rotation(way)


def _approachable(workspace: Workspace, theta: Array, side: Array) -> bool:
    starts = [Visit(theta, sign * side).before for sign in (1.0, -1.0)]
    return all(
        straight(workspace, start, end)
        for before in starts
        for start, end in ((HOME, before), (before, theta), (theta, HOME))
    )


def _draw_load(
    source: Source,
    workspace: Workspace,
    theta: Array,
    approach: Array,
    gravity: Array,
    rng: np.random.Generator,
) -> AppliedLoad:
    """Return a load that stays in the table's range on both approaches, no load if none does."""
    platform = _platforms(workspace, theta, approach)
    for _ in range(DRAWS):
        load = source.draw(gravity, rng)
        if within(load.wrench(platform), workspace.limits):
            return load
    return NO_LOAD


def within(wrench: Array, limits: Limits) -> bool:
    """Tell whether wrenches (..., 6) at O lie in the table's load range."""
    sizes = np.linalg.norm(wrench.reshape(-1, 2, 3), axis=2)
    return bool(np.all(sizes <= limits.most_load))


def fixed_visits(settings: Sequence[Visit], pace: Pace) -> list[Visit]:
    """Return what every plan has: one visit of the reference pose, and the two long holds.

    The holds are under the largest loads of different poses, one put on at rest and one carried
    along; without any load they watch the pose itself.
    """
    reference = Visit(HOME, np.ones(2), hold_s=pace.dwell_s, purpose="reference pose")
    by_size = sorted(settings, key=lambda s: -float(np.linalg.norm(s.load.force)))
    holds = [
        replace(
            setting,
            hold_s=max(HOLD_S, pace.dwell_s),
            carried=setting.load is not NO_LOAD and carried,
            purpose="long hold",
        )
        for setting, carried in zip(by_size, (False, True), strict=False)
    ]
    return [reference, *holds]


def arrange(
    chosen: Sequence[Visit],
    fixed: Sequence[Visit],
    workspace: Workspace,
    pace: Pace,
    rng: np.random.Generator,
) -> Timeline:
    """Put chosen visits into a random order, with everything that an experiment needs besides.

    Both sides of a pose, where both are chosen, come at different times.  Gives warm-up, visits,
    and returns to the reference pose at the beginning, in between and at the end.
    """
    reference, *holds = fixed
    visits = [chosen[i] for i in rng.permutation(len(chosen))]
    for number, hold in enumerate(holds, start=1):
        visits.insert(number * len(visits) // (len(holds) + 1), hold)
    ordered = _with_returns(visits, reference, workspace, pace)
    share = WARM_UP_SHARE * run_through(ordered, workspace, pace).duration_s
    seconds = float(np.clip(share, WARM_UP_LEAST_S, WARM_UP_MOST_S))
    return run_through(ordered, workspace, pace, _warm_up(seconds, workspace, pace, rng))


def _with_returns(
    visits: Sequence[Visit], reference: Visit, workspace: Workspace, pace: Pace
) -> list[Visit]:
    """Return the visits with the reference at both ends and as often as needed in between."""
    ordered = [reference]
    since_s = 0.0
    ends = run_through([reference, *visits], workspace, pace).ends
    for visit, lasts_s in zip(visits, np.diff(ends), strict=True):
        if since_s > 0.0 and since_s + lasts_s > REFERENCE_EVERY_S:
            ordered.append(reference)
            since_s = 0.0
        ordered.append(visit)
        since_s += float(lasts_s)
    return [*ordered, reference]


def _warm_up(
    seconds: float, workspace: Workspace, pace: Pace, rng: np.random.Generator
) -> list[Array]:
    """Return poses (2,) to move through for a time [rad]."""
    poses = _poses(workspace, 8, rng)
    way, spent = [HOME], 0.0
    while spent < seconds:
        target = poses[len(way) % len(poses)]
        spent += pace.move_s(way[-1], target)
        way.append(target)
    return way[1:]
