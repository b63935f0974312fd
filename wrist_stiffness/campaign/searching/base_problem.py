"""The fit of a base as numbers: columns that are kept, and weights by what each unit is worth."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np

from wrist_stiffness.campaign.fitting.problem import FitProblem
from wrist_stiffness.inference.shared import Apart, own_covariance
from wrist_stiffness.mechanism.components import Array
from wrist_stiffness.model.error_model import ErrorModel

MOST_POINTS = 4
"""So many points keep their columns."""

WANDER = np.repeat([0.5e-6, 5e-6], 3)
"""Slow scatter between units that no instrument states [m, rad]: it only sets weights."""

SILENT = 1e-6
"""Length, in standard deviations of the noise, of a column that is rounding: bases of columns are
blind to scales, and what rounding says differs from machine to machine."""


@dataclass(frozen=True, eq=False)
class BaseProblem(FitProblem):
    """The fit of a base.

    Parameters
    ----------
    whole : ErrorModel
        The model with all effects that it had.
    """

    whole: ErrorModel

    def columns_at(self, z: Array, places: tuple[int, ...] | None = None) -> Array:
        """Return `columns`, of the last few points without evaluating anew; not to be changed.

        A fit ends where its last step failed, and the next one begins where it ended.
        """
        key = (z.tobytes(), places)
        if key not in self._known:
            if len(self._known) == MOST_POINTS:
                self._known.pop(next(iter(self._known)))
            found = self.columns(z, places)
            found[..., np.linalg.norm(self.whiten(found), axis=0) < SILENT] = 0.0
            self._known[key] = found
        return self._known[key]

    @cached_property
    def _known(self) -> dict[tuple[bytes, tuple[int, ...] | None], Array]:
        return {}

    @cached_property
    def _apart(self) -> Apart:
        stated = self.table.covariance
        if stated is None:
            stated = np.diag(4.0 * WANDER**2)
        own = own_covariance(self.table, stated) + np.diag(WANDER**2)
        return Apart(self.table, np.linalg.inv(np.linalg.cholesky(own)))

    def whiten(self, values: Array) -> Array:
        """Bring (u, 6) or (u, 6, k) to about unit scatter, (6u,) or (6u, k); NaN become zero."""
        columns = values if values.ndim == 3 else values[:, :, None]
        measured = self.table.measured[:, :, None]
        filled = np.where(measured, np.nan_to_num(columns), 0.0)
        white = self._apart(filled)
        flat: Array = white.reshape(-1, columns.shape[2])
        return flat if values.ndim == 3 else flat[:, 0]
