"""On what the error of a wrist may depend: the questions asked of its discrepancy."""

from __future__ import annotations

from collections.abc import Callable, Mapping

import numpy as np

from wrist_stiffness.inference.discrepancy import (
    Question,
    bell,
    centred,
    leading,
    scaled,
    straight,
)
from wrist_stiffness.inference.noise import in_each_component
from wrist_stiffness.inference.observations import Labels, Observations
from wrist_stiffness.mechanism.components import Array

Conditions = Mapping[str, Array]

LOAD = ("fx", "fy", "fz", "mx", "my", "mz")


def _columns(conditions: Conditions, *names: str) -> Array:
    return scaled(np.stack([conditions[name] for name in names], axis=1))


def pose_kernel(conditions: Conditions) -> Array:
    """Kernel (u, u) of zones of poses, about a third of the workspace wide."""
    return bell(_columns(conditions, "theta_1", "theta_2"))


def _load(conditions: Conditions) -> Array:
    load = straight(_columns(conditions, *LOAD))
    return centred(load + 0.5 * load**2)


def _load_and_pose(conditions: Conditions) -> Array:
    return straight(_columns(conditions, *LOAD)) * pose_kernel(conditions)


def _approach(conditions: Conditions) -> Array:
    sense = np.stack([conditions[f"approach_{motor}"] for motor in (1, 2)], axis=1)
    return centred(straight(sense) * 0.5 * (1.0 + pose_kernel(conditions)))


def _speed(conditions: Conditions) -> Array:
    speed = straight(_columns(conditions, "speed_1", "speed_2"))
    return centred(speed * 0.5 * (1.0 + pose_kernel(conditions)))


def _at_rest(conditions: Conditions) -> Array | None:
    if np.ptp(conditions["held_s"]) == 0.0:  # poses measured one by one: the load alone is left
        return None
    held = bell(scaled(np.log1p(np.maximum(conditions["held_s"], 0.0))[:, None]))
    return centred(held * 0.5 * (1.0 + straight(_columns(conditions, *LOAD))))


def _temperature(conditions: Conditions) -> Array | None:
    warm = [name for name in conditions if name.startswith("T_")]
    return centred(straight(_columns(conditions, *warm))) if warm else None


KNOWN = frozenset(
    (
        *(f"{each}_{motor}" for each in ("theta", "approach", "speed") for motor in (1, 2)),
        *LOAD,
        *("force", "moment", "held_s", "loaded_at_rest", "time_s"),
    )
)
"""Conditions that every session of a wrist has."""

ANGLES, SIDES, SPEEDS = (
    tuple(f"{each}_{motor}" for motor in (1, 2)) for each in ("theta", "approach", "speed")
)

QUESTIONS = (
    Question("the pose", lambda c: centred(pose_kernel(c)), 10, ANGLES),
    Question("the load", _load, 8, LOAD),
    Question("the load and the pose together", _load_and_pose, 14, (*ANGLES, *LOAD)),
    Question("the side of approach", _approach, 8, SIDES),
    Question("the speed", _speed, 6, SPEEDS),
    Question("the time at rest", _at_rest, 6, ("held_s",)),
    Question("the temperature", _temperature, 3),
)
"""Asked of every wrist, with the most columns of each (assumed)."""

ZONE, RIPPLE = 0.35, 0.12
"""Widths of a zone of poses and of a ripple of one angle, in standard deviations of the angles
(assumed)."""

PASSING_S, PASSING_RANK = 10.0, 40
"""Correlation time of what passes [s], and its most columns in one session (assumed)."""


def _zone(conditions: Conditions) -> Array:
    return centred(bell(_columns(conditions, *ANGLES), ZONE))


def _difference(conditions: Conditions) -> Array:
    one, two = (conditions[name] for name in ANGLES)
    return centred(bell(scaled((one - two)[:, None]), RIPPLE))


def _with_pose(name: str) -> Callable[[Conditions], Array]:
    """Two signals together: neither of them alone shows it."""
    return lambda own: centred(straight(_columns(own, name)) * pose_kernel(own))


def _pushed(conditions: Conditions) -> Array:
    """Play follows the direction of a load and not its size."""
    sides = []
    for names in (LOAD[:3], LOAD[3:]):
        own = np.stack([conditions[name] for name in names], axis=1)
        size = np.linalg.norm(own, axis=1, keepdims=True)
        sides.append(np.divide(own, size, out=np.zeros_like(own), where=size > 0.0))
    side = straight(np.concatenate(sides, axis=1))
    return centred(side * 0.5 * (1.0 + pose_kernel(conditions)))


def questions(conditions: Conditions) -> tuple[Question, ...]:
    """Return what is asked of a wrist: the same of each, and every signal recorded beside it."""

    def of(name: str) -> Question:
        return Question(name, lambda own: centred(bell(_columns(own, name))), 5, (name,))

    beside = [name for name in conditions if name not in KNOWN and not name.startswith("T_")]
    return (*QUESTIONS, *map(of, beside))


def smooth_columns(table: Observations) -> Array:
    """Return what the usual questions ask, in each component of the units, (u, m, q)."""
    asked = [each.features(table.covariates) for each in questions(table.covariates)]
    return in_each_component(asked, table)


def finer_questions(conditions: Conditions) -> tuple[Question, ...]:
    """Return those and some that look closer."""

    def ripple(name: str) -> Question:
        kernel = lambda own: centred(bell(_columns(own, name), RIPPLE))  # noqa: E731
        return Question(f"the angle of motor {name[-1]}", kernel, 25, (name,))

    return (
        *questions(conditions),
        Question("the direction of the load", _pushed, 10, LOAD),
        Question("a zone of poses", _zone, 30, ANGLES),
        *map(ripple, ANGLES),
        Question("the difference of the motor angles", _difference, 25, ANGLES),
        *(
            Question(f"{name} and the pose together", _with_pose(name), 12, (name, *ANGLES))
            for name in conditions
            if name not in KNOWN and not name.startswith("T_")
        ),
    )


def passing(sessions: Labels, conditions: Conditions) -> Array:
    """Return columns (u, k) of what changes within seconds; sessions (u,) do so apart."""
    apart = np.abs(conditions["time_s"][:, None] - conditions["time_s"]) / PASSING_S
    apart[sessions[:, None] != sessions] = np.inf
    return leading(np.exp(-apart), PASSING_RANK * len(np.unique(sessions)))


def alike(conditions: Conditions) -> Array:
    """Kernel (u, u) of units under like conditions, for which a law errs alike."""
    sense = np.stack([conditions[f"approach_{motor}"] for motor in (1, 2)], axis=1)
    pose, load = _columns(conditions, "theta_1", "theta_2"), _columns(conditions, *LOAD)
    return bell(np.concatenate([pose, 0.5 * sense, 0.4 * load], axis=1), 2.0)
