"""What chance alone would give: the same questions asked of rearranged residuals.

Freedman and Lane (1983): residuals of the reduced model are rearranged, the model is refitted, the
largest statistic over all candidates is kept.  So a large catalogue pays for its size, whatever
its members share.  Short stretches of units move together, with a random sign, and never leave
their session, so that wander which the noise model missed stays in place.  Units change places
only where the same components were measured: the zero that stands for a blank is no residual.  A
prior is no unit: how far it was strained is evidence, and by chance it is strained as it says
itself.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from wrist_stiffness.diagnosis.observations import Array, Labels
from wrist_stiffness.diagnosis.projection import Base

STRETCH = 3
"""Units that move together."""


@dataclass(frozen=True, eq=False)
class Rearrangements:
    """Random rearrangements of units, and random strains of priors.

    Parameters
    ----------
    order : (repeats, n) array of int
        Which unit comes to each place.
    sign : (repeats, n) array
        With which sign.
    strain : (repeats, p) array
        Of each prior, in its standard deviations.
    """

    order: Labels
    sign: Array
    strain: Array

    def residuals(self, base: Base) -> Array:
        """Return what a base leaves of a rearrangement of what it left, (N, repeats).

        Parameters
        ----------
        base : Base
            Refitted to each of them.
        """
        repeats, n = self.order.shape
        data = len(base.residual) - self.strain.shape[1]
        units = base.residual[:data].reshape(n, -1)
        moved = (units[self.order] * self.sign[:, :, None]).reshape(repeats, data)
        rows = np.hstack([moved, self.strain]).T
        return np.asarray(rows - base.basis @ (base.basis.T @ rows))


def rearrangements(
    base: Base, groups: Labels, repeats: int, rng: np.random.Generator
) -> Rearrangements:
    """Draw rearrangements.

    Parameters
    ----------
    base : Base
        Whose residual is rearranged.
    groups : (n,) array
        Units of one group may change places.
    repeats : int
        How many.
    rng : numpy.random.Generator
        Source of chance.
    """
    n = len(groups)
    order, sign = np.empty((repeats, n), dtype=np.int64), np.empty((repeats, n))
    for group in np.unique(groups):
        places = np.flatnonzero(groups == group)
        count = len(places)
        rolled = (np.arange(count) + rng.integers(STRETCH, size=(repeats, 1))) % count
        piece = np.arange(count) // STRETCH
        key, flip = rng.random((2, repeats, piece[-1] + 1))
        moved = np.argsort(key[:, piece], axis=1, kind="stable")
        order[:, places] = places[np.take_along_axis(rolled, moved, axis=1)]
        sign[:, places] = np.where(
            np.take_along_axis(flip[:, piece], moved, axis=1) < 0.5, -1.0, 1.0
        )
    return Rearrangements(order, sign, rng.standard_normal((repeats, base.n_priors)))
