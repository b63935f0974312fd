"""On what the error of a wrist may depend: the questions asked of its discrepancy."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np

from wrist_stiffness.inference.discrepancy import Question, bell, centred, scaled, straight
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


def _at_rest(conditions: Conditions) -> Array:
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

QUESTIONS = (
    Question("the pose", lambda c: centred(pose_kernel(c)), 10),
    Question("the load", _load, 8),
    Question("the load and the pose together", _load_and_pose, 14),
    Question("the side of approach", _approach, 8),
    Question("the speed", _speed, 6),
    Question("the time at rest", _at_rest, 6),
    Question("the temperature", _temperature, 3),
)
"""Asked of every wrist, with the most columns of each (assumed)."""


def questions(conditions: Conditions) -> tuple[Question, ...]:
    """Return what is asked of a wrist: the same of each, and every signal recorded beside it."""

    def of(name: str) -> Question:
        return Question(name, lambda own: centred(bell(_columns(own, name))), 5)

    beside = [name for name in conditions if name not in KNOWN and not name.startswith("T_")]
    return (*QUESTIONS, *map(of, beside))


def alike(conditions: Conditions) -> Array:
    """Kernel (u, u) of units under like conditions, for which a law errs alike."""
    sense = np.stack([conditions[f"approach_{motor}"] for motor in (1, 2)], axis=1)
    pose, load = _columns(conditions, "theta_1", "theta_2"), _columns(conditions, *LOAD)
    return bell(np.concatenate([pose, 0.5 * sense, 0.4 * load], axis=1), 2.0)
