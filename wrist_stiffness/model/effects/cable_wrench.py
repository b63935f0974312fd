"""A cable or hose that pulls at the platform."""

from __future__ import annotations

from typing import Any

import numpy as np

from wrist_stiffness.model.law import Contribution, Law, Outcome, Situation, SIValues
from wrist_stiffness.model.memory import play
from wrist_stiffness.model.parameters import Parameter, axis_keys, symmetric, vector

PATTERNS = (
    *("f{}_N", "m{}_Nmm"),
    *("f{}_1_N_per_rad", "m{}_1_Nmm_per_rad"),
    *("f{}_2_N_per_rad", "m{}_2_Nmm_per_rad"),
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
    own = (
        *(
            symmetric(key, *((50.0, 0.2) if key[0] == "f" else (2000.0, 5.0)))
            for pattern in PATTERNS
            for key in axis_keys(pattern)
        ),
        Parameter("hysteresis_deg", 0.0, 60.0, 3.0, linear=False, grid=(0.0, 5.0)),
    )

    def advance(self, at: Situation, place: str, values: SIValues, state: Any) -> Outcome:
        """Return the wrench."""
        followed = play(at.block.theta, 0.5 * values["hysteresis_deg"], state)
        constant, *slopes = vector(values, *PATTERNS).reshape(3, 6)
        return Contribution(wrench=constant + followed @ np.array(slopes)), followed[-1]
