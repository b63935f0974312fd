"""How uncertain a fit leaves predictions, its parameters together."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from wrist_stiffness.mechanism.components import Array

KEYS = {
    **{f"{axis}_um": 1e-6 for axis in "xyz"},
    **{f"turn_{axis}_mdeg": float(np.radians(1e-3)) for axis in "xyz"},
}
"""Names in the model file and their SI sizes."""

PLATFORM = "platform_"
"""Before those names: of the platform itself."""


@dataclass(frozen=True, eq=False)
class JointUncertainty:
    """What the uncertainties of fitted parameters make of a prediction together.

    One by one they tell too much: an axis and a registration may each be uncertain by 40 mdeg where
    only their sum shows, and that is known to one.  So what an instrument would say is known far
    better than where the platform stands in the wrist's own frame.
    """

    # effects that were fitted; their own uncertainties are not counted again
    effects: tuple[str, ...]
    # standard uncertainty at O in F, root mean square over the recordings of the fit, (6,) [m, rad]
    measured: Array  # of what the pose sensor would say
    platform: Array  # of the platform's own twist, whatever the pose sensor says

    @property
    def covariance(self) -> Array:
        """Of a predicted twist of the platform, (6, 6)."""
        return np.diag(self.platform**2)

    @property
    def as_measured(self) -> JointUncertainty:
        """The same where the pose sensor of the fit is what counts."""
        return replace(self, platform=self.measured)

    def as_values(self) -> dict[str, float]:
        """Return the sizes as the model file holds them, with units in the names."""
        found = {}
        for before, sigma in (("", self.measured), (PLATFORM, self.platform)):
            own = zip(KEYS.items(), sigma.tolist(), strict=True)
            found.update({before + key: value / size for (key, size), value in own})
        return found

    @classmethod
    def of_values(cls, effects: Sequence[str], **values: float) -> JointUncertainty:
        """Return what `as_values` told; older files do not tell of the platform itself."""
        measured, platform = (
            np.array([values.get(before + key, values[key]) * size for key, size in KEYS.items()])
            for before in ("", PLATFORM)
        )
        return cls(tuple(effects), measured, platform)
