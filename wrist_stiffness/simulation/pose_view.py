"""How much of the platform's pose a sensor sees, and when its beam is lost."""

from __future__ import annotations

import numpy as np
from scipy.special import ndtr

from wrist_stiffness.errors import InputError
from wrist_stiffness.mechanism.components import Array
from wrist_stiffness.mechanism.rigid_motion import exp_twist

VIEWS = ("pose", "points", "pointing")
"""Position of O and rotation; the position alone; the rotation alone."""

WILD_SHIFT, WILD_TURN = 2e-4, float(np.radians(0.1))
"""Standard deviation of a reading through a beam that is half lost [m], [rad]."""

MOST_LOST = 0.5


class PoseView:
    """What is left of a pose sensor's readings: parts that it does not see become NaN.

    Of the lost beams one half leave no reading and the other half a wild one.

    `sees`: one of `VIEWS`; `lost_beams`: share of the samples; `rng`: belongs to this view alone.
    Raises `InputError` if there is no such view, or the share is not in 0 to `MOST_LOST`.
    """

    def __init__(self, sees: str, lost_beams: float, rng: np.random.Generator) -> None:
        if sees not in VIEWS:
            raise InputError(f"pose sensor sees {sees!r}, which is not one of {', '.join(VIEWS)}")
        if not 0.0 <= lost_beams <= MOST_LOST:
            raise InputError(f"share of lost beams {lost_beams:g} is not in 0 to {MOST_LOST:g}")
        self._sees, self._lost, self._rng = sees, lost_beams, rng

    def __call__(self, rotation: Array, shift: Array) -> tuple[Array, Array]:
        """Return the next n rotations (n, 3, 3) and positions (n, 3) [m] as they are seen."""
        if self._lost > 0.0:
            drawn = self._rng.standard_normal((len(shift), 7))
            chance = ndtr(drawn[:, 6])
            wild = drawn[:, :6] * np.repeat([WILD_SHIFT, WILD_TURN], 3)
            wild[chance >= self._lost / 2.0] = 0.0
            rotation, shift = exp_twist(wild)[0] @ rotation, shift + wild[:, :3]
            gone = (chance >= self._lost / 2.0) & (chance < self._lost)
            rotation[gone], shift[gone] = np.nan, np.nan
        if self._sees == "points":
            rotation = np.full_like(rotation, np.nan)
        if self._sees == "pointing":
            shift = np.full_like(shift, np.nan)
        return rotation, shift
