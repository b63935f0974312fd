"""A small made-up machine with a hidden error: three joints, a load, a temperature.

Serves the benchmark and the tests of the statistical core.  It has nothing to do with the wrist:
a serial arm whose tip twist (3 shifts, 3 turns) is measured at rest.  `hide` adds an effect whose
law may differ in shape from the one in the catalogue, and coloured noise.
"""

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from scipy.spatial.transform import Rotation

from wrist_stiffness.inference import (
    Candidate,
    Nuisance,
    Observations,
    Parameter,
    Quantity,
    ShapeParameter,
)

AXES = np.array([[0.0, 0.0, 1.0], [0.0, 1.0, 0.0], [0.0, 1.0, 0.0]])
LINKS = np.array([[0.0, 0.0, 0.10], [0.25, 0.0, 0.0], [0.20, 0.0, 0.05]])
NOISE = np.array([0.7e-6] * 3 + [3e-6] * 3)
"""Scatter of one dwell: metres, then radians."""

QUANTITIES = (
    Quantity("s", "um", (0, 1, 2), 1e6),
    Quantity("phi", "mdeg", (3, 4, 5), np.degrees(1e3)),
)
COLOUR_SHARE, COLOUR_TIME_S = 0.5, 60.0


@dataclass(frozen=True, eq=False)
class Pose:
    """Joint axes and positions at the angles of a table, with the load's torques."""

    axis: np.ndarray
    lever: np.ndarray
    link: np.ndarray
    before: np.ndarray
    turn: np.ndarray
    torque: np.ndarray
    force: np.ndarray


def pose_of(table: Observations) -> Pose:
    """Kinematics of every unit: (n, 3, 3) axes, levers from joint to tip and links."""
    q = np.column_stack([table.covariate(f"q{i}") for i in (1, 2, 3)])
    force = np.column_stack([table.covariate(f) for f in ("fx", "fy", "fz")])
    turn = Rotation.from_rotvec(np.zeros((len(q), 3)))
    axis, link = np.empty((len(q), 3, 3)), np.empty((len(q), 3, 3))
    before = np.empty((len(q), 3, 3, 3))
    for i in range(3):
        before[:, i] = turn.as_matrix()
        axis[:, i] = turn.apply(AXES[i])
        turn = turn * Rotation.from_rotvec(q[:, [i]] * AXES[i])
        link[:, i] = turn.apply(LINKS[i])
    lever = np.cumsum(link[:, ::-1], axis=1)[:, ::-1]
    torque = np.einsum("nij,nij->ni", axis, np.cross(lever, force[:, None]))
    return Pose(axis, lever, link, before, turn.as_matrix(), torque, force)


def joint_twist(pose: Pose, i: int, axis: np.ndarray | None = None) -> np.ndarray:
    """Tip twist (n, 6) for a unit turn at joint i, about its own or another axis."""
    axis = pose.axis[:, i] if axis is None else axis
    return np.concatenate([np.cross(axis, pose.lever[:, i]), axis], axis=1)


def tip_twist(shift: np.ndarray) -> np.ndarray:
    """Twist (n, 6) of a pure shift of the tip."""
    return np.concatenate([shift, np.zeros_like(shift)], axis=1)


Law = Callable[[Observations, Pose, tuple[float, ...]], list[np.ndarray]]


def candidate(
    effect: str,
    component: str,
    law: Law,
    plausible: tuple[float, ...],
    shape: tuple[ShapeParameter, ...] = (),
    lower: float = -np.inf,
) -> Candidate:
    """Wrap a law that returns a list of (n, 6) columns."""

    def columns(table: Observations, values: tuple[float, ...]) -> np.ndarray:
        return np.stack(law(table, pose_of(table), values), axis=2)

    parameters = tuple(
        Parameter(f"size_{k + 1}", lower, plausible=size) for k, size in enumerate(plausible)
    )
    return Candidate(effect, component, parameters, columns, shape)


def catalogue() -> tuple[Candidate, ...]:
    """Twenty-four candidates."""
    found = []
    for i in range(3):
        name = f"joint_{i + 1}"

        def scaled(i: int, factor: Callable[[Observations, Pose], np.ndarray]) -> Law:
            return lambda t, p, s: [joint_twist(p, i) * factor(t, p)[:, None]]

        def eccentric(t: Observations, p: Pose, s: tuple[float, ...], i: int = i) -> list:
            q = t.covariate(f"q{i + 1}")[:, None]
            return [joint_twist(p, i) * np.cos(q), joint_twist(p, i) * np.sin(q)]

        def hard(t: Observations, p: Pose, s: tuple[float, ...], i: int = i) -> list:
            return [joint_twist(p, i) * (p.torque[:, i] ** 3)[:, None]]

        def creep(t: Observations, p: Pose, s: tuple[float, ...], i: int = i) -> list:
            grown = 1 - np.exp(-t.covariate("hold_s") / s[0])
            return [joint_twist(p, i) * (p.torque[:, i] * grown)[:, None]]

        def tilt(t: Observations, p: Pose, s: tuple[float, ...], i: int = i) -> list:
            across = np.flatnonzero(AXES[i] == 0)
            return [joint_twist(p, i, p.before[:, i, :, k]) for k in across]

        found += [
            candidate("compliance", name, scaled(i, lambda t, p, i=i: p.torque[:, i]), (1e-5,)),
            candidate(
                "backlash", name, scaled(i, lambda t, p, i=i: t.covariate(f"a{i + 1}") / 2), (3e-5,)
            ),
            candidate("eccentricity", name, eccentric, (3e-5, 3e-5)),
            candidate("hardening", name, hard, (1e-6,)),
            candidate("axis_tilt", name, tilt, (3e-4, 3e-4)),
            candidate(
                "creep",
                name,
                creep,
                (1e-5,),
                (ShapeParameter("time_constant_s", (2.0, 5.0, 12.0, 30.0)),),
            ),
        ]
    for i in (1, 2):
        name = f"link_{i + 1}"

        def growth(t: Observations, p: Pose, s: tuple[float, ...], i: int = i) -> list:
            return [tip_twist(p.link[:, i] * t.covariate("temperature")[:, None])]

        def bending(t: Observations, p: Pose, s: tuple[float, ...], i: int = i) -> list:
            along = p.link[:, i] / np.linalg.norm(p.link[:, i], axis=1, keepdims=True)
            across = p.force - along * np.sum(along * p.force, axis=1, keepdims=True)
            return [np.concatenate([across * 0.1, np.cross(along, across)], axis=1)]

        found += [
            candidate("thermal_expansion", name, growth, (2e-5,)),
            candidate("bending", name, bending, (1e-5,)),
        ]

    def drift(t: Observations, p: Pose, s: tuple[float, ...]) -> list:
        time = t.times / 600
        return [np.outer(time, row) for row in np.eye(6)[:3]]

    def gravity(t: Observations, p: Pose, s: tuple[float, ...]) -> list:
        down = np.cross(p.lever, [0.0, 0.0, -1.0])
        torque = np.einsum("nij,nij->ni", p.axis, down)
        return [sum(joint_twist(p, i) * torque[:, [i]] for i in range(3))]

    found += [
        candidate("drift", "tracker", drift, (1e-5,) * 3),
        candidate("gravity", "tip", gravity, (1e-4,)),
    ]
    return tuple(found)


def base() -> tuple[Nuisance, ...]:
    """Registration of the tracker per session, target on the tip, encoder zeros."""

    def registration(t: Observations) -> np.ndarray:
        return np.broadcast_to(np.eye(6), (t.n_units, 6, 6))

    def target(t: Observations) -> np.ndarray:
        turn = pose_of(t).turn
        columns = np.zeros((t.n_units, 6, 6))
        columns[:, :3, :3], columns[:, 3:, 3:] = turn, turn
        return columns

    def zeros(t: Observations) -> np.ndarray:
        pose = pose_of(t)
        return np.stack([joint_twist(pose, i) for i in range(3)], axis=2)

    return (
        Nuisance("registration", registration, per_session=True),
        Nuisance("target", target),
        Nuisance("encoder zeros", zeros),
    )


def smooth_field(table: Observations, rng: np.random.Generator, n_out: int) -> np.ndarray:
    """Random smooth functions of pose and load with unit mean square, (n, n_out)."""
    names = ("q1", "q2", "q3", "fx", "fy", "fz")
    x = np.column_stack([table.covariate(name) for name in names])
    x = x / np.where(x.std(axis=0) > 0, x.std(axis=0), 1.0)
    waves = np.cos(x @ rng.normal(0, 0.7, (6, 12)) + rng.uniform(0, 2 * np.pi, 12))
    field = waves @ rng.normal(size=(12, n_out))
    return field / np.sqrt(np.mean(field**2, axis=0))


def outsiders() -> dict[str, Law]:
    """Effects that no candidate describes."""

    def ripple(t: Observations, p: Pose, s: tuple[float, ...]) -> list:
        return [joint_twist(p, 1) * np.cos(7 * t.covariate("q2"))[:, None]]

    def cable(t: Observations, p: Pose, s: tuple[float, ...]) -> list:
        return [tip_twist(smooth_field(t, np.random.default_rng(5), 3))]

    def waviness(t: Observations, p: Pose, s: tuple[float, ...]) -> list:
        return [tip_twist(np.sin(40 * p.lever[:, 0]))]

    def torsion(t: Observations, p: Pose, s: tuple[float, ...]) -> list:
        along = p.link[:, 2] / np.linalg.norm(p.link[:, 2], axis=1, keepdims=True)
        moment = np.sum(along * np.cross(p.link[:, 1], p.force), axis=1, keepdims=True)
        return [joint_twist(p, 2, along) * moment * np.abs(moment)]

    def humidity(t: Observations, p: Pose, s: tuple[float, ...]) -> list:
        return [tip_twist(p.turn[:, :, 2] * t.covariate("humidity")[:, None] ** 2)]

    return {
        "ripple": ripple,
        "cable": cable,
        "waviness": waviness,
        "torsion": torsion,
        "humidity": humidity,
    }


def campaign(rng: np.random.Generator, n: int = 160, rich: bool = True) -> Observations:
    """Conditions of a recording, values still zero.

    Poses, loads, approaches and holds are random (rich), or the load is constant and every pose
    approached from one side (poor).  Every sixth unit returns to an earlier condition.
    """
    table = {f"q{i}": rng.uniform(-1.0, 1.0, n) for i in (1, 2, 3)}
    size = rng.choice([0.0, 10.0, 20.0], n) if rich else np.full(n, 20.0)
    direction = rng.normal(size=(n, 3)) if rich else np.tile([0.0, 0.0, -1.0], (n, 1))
    direction /= np.linalg.norm(direction, axis=1, keepdims=True)
    table |= {name: size * direction[:, k] for k, name in enumerate(("fx", "fy", "fz"))}
    for i in (1, 2, 3):
        table[f"a{i}"] = rng.choice([-1.0, 1.0], n) if rich else np.ones(n)
    table["hold_s"] = rng.choice([1.0, 4.0, 20.0], n) if rich else np.full(n, 4.0)
    table["humidity"] = np.cumsum(rng.normal(size=n)) / np.sqrt(n)
    replicate = np.full(n, -1)
    again = np.arange(12, n, 6)
    for number, row in enumerate(again):
        origin = int(rng.integers(0, row - 6))
        origin = int(again[again < row][-1]) if origin in again and (again < row).any() else origin
        if replicate[origin] < 0:
            replicate[origin] = number
        replicate[row] = replicate[origin]
        for column in table.values():
            column[row] = column[origin]
    session = np.repeat([0, 1], [n - n // 4, n // 4])
    replicate[session == 1] = np.where(
        replicate[session == 1] >= 0, replicate[session == 1] + 1000, -1
    )
    time = 5.0 * np.arange(n)
    table["temperature"] = 3 * (1 - np.exp(-time / 300)) + 0.5 * np.sin(time / 90)
    return Observations(
        np.zeros((n, 6)),
        table,
        np.diag(NOISE**2),
        time,
        session,
        replicate,
        np.full(n, 100.0),
        QUANTITIES,
    )


def coloured_noise(table: Observations, rng: np.random.Generator) -> np.ndarray:
    """White noise plus an Ornstein-Uhlenbeck wander, (n, 6), total as in `NOISE`."""
    n = table.n_units
    wander = np.empty((n, 6))
    wander[0] = rng.normal(size=6)
    keep = np.exp(-np.diff(table.times) / COLOUR_TIME_S)
    for k in range(1, n):
        step = np.sqrt(1 - keep[k - 1] ** 2)
        wander[k] = keep[k - 1] * wander[k - 1] + step * rng.normal(size=6)
    white = rng.normal(size=(n, 6))
    return NOISE * (np.sqrt(1 - COLOUR_SHARE) * white + np.sqrt(COLOUR_SHARE) * wander)


def hide(
    table: Observations,
    effects: list[tuple[Law | Candidate, float]],
    rng: np.random.Generator,
    law_error: float = 0.0,
) -> Observations:
    """Measurements of a machine with hidden effects.

    Parameters
    ----------
    table : Observations
        Conditions.
    effects : list of (law or candidate, size)
        Size = root mean square in units of the scatter, per component, mean removed.
    rng : numpy.random.Generator
        Noise, parameters, registration.
    law_error : float, optional
        Smooth random deviation of the true law from the catalogue's, as a share.
    """
    values = coloured_noise(table, rng)
    for effect, size in effects:
        if isinstance(effect, Candidate):
            shape = tuple(float(rng.uniform(p.grid[0], p.grid[-1])) for p in effect.shape)
            columns = effect.evaluate(table, shape)
        else:
            columns = np.stack(effect(table, pose_of(table), ()), axis=2)
        length = np.linalg.norm(columns, axis=(0, 1))
        plausible = np.where(length > 0, length, 1.0)
        change = (columns / plausible) @ (
            rng.choice([-1, 1], columns.shape[2]) * rng.uniform(0.5, 1.0, columns.shape[2])
        )
        change = change * (1 + law_error * smooth_field(table, rng, 6))
        white = (change - change.mean(axis=0)) / NOISE
        strength = np.sqrt(np.mean(white**2))
        values += change * (size / strength if strength > 0 else 1.0)
    for nuisance in base():
        columns = nuisance.columns(table)
        values += columns @ rng.normal(0, 1e-4, columns.shape[2])
    return table.with_values(values)
