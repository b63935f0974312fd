"""A cable or hose that pulls at the platform."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np

from wrist_stiffness.model.law import Contribution, Law
from wrist_stiffness.model.memory import play
from wrist_stiffness.model.parameters import Parameter, symmetric
from wrist_stiffness.model.situation import Situation
from wrist_stiffness.model.vector_keys import axis_keys

PATTERNS = (
    ("f{}_N", "m{}_Nmm"),
    *((f"f{{}}_{motor}_N_per_rad", f"m{{}}_{motor}_Nmm_per_rad") for motor in (1, 2)),
)
"""Force and moment at zero angles, and by each motor's angle."""


class CableWrench(Law):
    """Wrench in F at O, linear in both motor angles, which it follows with lost motion."""

    id = "cable_wrench"
    stage = "load"
    places = ("platform",)
    sentence = "a cable or hose pulls at the platform, differently from pose to pose"
    check = "unplug the cable or hold it up by hand and repeat a pose"
    excited_by = "unloaded poses all over the workspace, approached from both sides"
    smooth = False

    def parameters(self, place: str) -> tuple[Parameter, ...]:
        """Return the wrench at zero angles, twelve slopes and the width of the hysteresis."""
        linear = (
            symmetric(key, 50.0 if key.startswith("f") else 2000.0, 0.2 if key[0] == "f" else 5.0)
            for key in _keys()
        )
        return (*linear, Parameter("hysteresis_deg", 0.0, 60.0, 3.0, linear=False, grid=(0.0, 5.0)))

    def advance(
        self, at: Situation, place: str, values: Mapping[str, float], state: Any
    ) -> tuple[Contribution, Any]:
        """Return the wrench."""
        angles = at.block.theta
        followed = play(
            angles, 0.5 * values["hysteresis_deg"], angles[0] if state is None else state
        )
        constant, *slopes = np.array([values[key] for key in _keys()]).reshape(3, 6)
        return Contribution(wrench=constant + followed @ np.array(slopes)), followed[-1]


def _keys() -> list[str]:
    """Keys at zero angles, of motor 1 and of motor 2: force, moment."""
    return [key for pair in PATTERNS for pattern in pair for key in axis_keys(pattern)]
