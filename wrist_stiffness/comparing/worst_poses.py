"""Where a model fails worst."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from wrist_stiffness.comparing.comparison import lengths
from wrist_stiffness.identification.questions import LOAD
from wrist_stiffness.inference import Observations
from wrist_stiffness.mechanism.components import Array

APART_S = 2.0
"""Moments closer than this in time are one event."""

SAME_DEG, SAME_N = 2.0, 0.1
"""So are repetitions of one pose under one force."""


@dataclass(frozen=True, eq=False)
class WorstPose:
    """One dwell or moment."""

    session: str  # name
    time_s: float  # since the first unit of its session [s]
    theta_deg: Array  # (2,), motor angles [deg]
    load: Array  # (6,), at O [N, N m]
    errors: dict[str, float]  # by the key of the quantity; NaN where not measured

    def as_values(self) -> dict[str, Any]:
        """Return what programs read."""
        return {
            "session": self.session,
            "time_s": self.time_s,
            "motor_deg": self.theta_deg.tolist(),
            "load": self.load.tolist(),
            **{k: None if np.isnan(value) else value for k, value in self.errors.items()},
        }


def worst_poses(
    observations: Observations, noise: dict[str, float], sessions: Sequence[str], most: int = 8
) -> tuple[WorstPose, ...]:
    """Return the units with the largest errors against the noise, worst first.

    `observations`: residuals with the covariates of `observing.observe`; `noise`: by quantity.
    """
    errors = {q.key: lengths(observations, q) for q in observations.reported}
    relative = [np.nan_to_num(error) / (noise[key] or np.inf) for key, error in errors.items()]
    size = np.sqrt(np.sum(np.square(relative), axis=0))
    theta = np.stack([observations.covariate(f"theta_{motor}") for motor in (1, 2)], axis=1)
    load = np.stack([observations.covariate(name) for name in LOAD], axis=1)
    chosen: list[int] = []
    for unit in np.argsort(-size).tolist():
        moment = np.abs(observations.times[chosen] - observations.times[unit]) < APART_S
        moment &= observations.sessions[chosen] == observations.sessions[unit]
        pose = (np.abs(np.degrees(theta[chosen] - theta[unit])) < SAME_DEG).all(axis=1)
        pose &= np.linalg.norm(load[chosen, :3] - load[unit, :3], axis=1) < SAME_N
        if not (moment | pose).any():
            chosen.append(unit)
        if len(chosen) == most:
            break
    start = {
        int(number): float(observations.times[observations.sessions == number].min())
        for number in np.unique(observations.sessions)
    }
    return tuple(
        WorstPose(
            sessions[observations.sessions[unit]],
            float(observations.times[unit]) - start[int(observations.sessions[unit])],
            np.degrees(theta[unit]),
            load[unit],
            {key: float(error[unit]) for key, error in errors.items()},
        )
        for unit in chosen
    )
