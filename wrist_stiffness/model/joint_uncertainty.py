"""How uncertain a fit leaves predictions, its parameters together."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from wrist_stiffness.mechanism.components import Array

KEYS = {
    **{f"{axis}_um": 1e-6 for axis in "xyz"},
    **{f"turn_{axis}_mdeg": float(np.radians(1e-3)) for axis in "xyz"},
}
"""Names in the model file and their SI sizes."""


@dataclass(frozen=True, eq=False)
class JointUncertainty:
    """What the uncertainties of fitted parameters make of a prediction together.

    One by one they tell too much: an axis and a registration may each be uncertain by 40 mdeg where
    only their sum shows, and that is known to one.
    """

    # effects that were fitted; their own uncertainties are not counted again
    effects: tuple[str, ...]
    # (6,), standard uncertainty of what the pose sensor would say, at O in F, root mean square over
    # the recordings of the fit [m, rad]
    sigma: Array

    @property
    def covariance(self) -> Array:
        """Of a predicted twist, (6, 6)."""
        return np.diag(self.sigma**2)

    def as_values(self) -> dict[str, float]:
        """Return the sigma as the model file holds it, with units in the names."""
        sizes = zip(KEYS.items(), self.sigma.tolist(), strict=True)
        return {key: value / size for (key, size), value in sizes}

    @classmethod
    def of_values(cls, effects: Sequence[str], **values: float) -> JointUncertainty:
        """Return what `as_values` told."""
        return cls(tuple(effects), np.array([values[key] * size for key, size in KEYS.items()]))
