"""What chance alone would give: the same questions asked of rearranged residuals.

Freedman and Lane (1983): residuals of the reduced model are rearranged, the model is refitted, the
largest statistic over all candidates is kept.  So a large catalogue pays for its size, whatever
its members share.  Short stretches of units move together, with a random sign, and never leave
their session, so that wander which the noise model missed stays in place.  Units change places
only where the same components were measured: the zero that stands for a blank is no residual.  A
prior is no unit: how far it was strained is evidence, and by chance it is strained as it says
itself.
"""

import numpy as np

from wrist_stiffness.diagnosis.observations import Array, Labels
from wrist_stiffness.diagnosis.projection import Base

STRETCH = 3
"""Units that move together."""


def rearranged_residuals(
    base: Base, groups: Labels, repeats: int, rng: np.random.Generator
) -> Array:
    """Return what a base leaves of random rearrangements of what it left, (N, repeats).

    Parameters
    ----------
    base : Base
        Refitted to each of them.
    groups : (n,) array
        Units of one group may change places.
    repeats : int
        How many.
    rng : numpy.random.Generator
        Source of chance.
    """
    n, data = len(groups), len(base.residual) - base.n_priors
    order, sign = np.empty((repeats, n), dtype=np.int64), np.empty((repeats, n, 1))
    for group in np.unique(groups):
        places = np.flatnonzero(groups == group)
        count = len(places)
        rolled = (np.arange(count) + rng.integers(STRETCH, size=(repeats, 1))) % count
        piece = np.arange(count) // STRETCH
        key, flip = rng.random((2, repeats, piece[-1] + 1))
        moved = np.argsort(key[:, piece], axis=1, kind="stable")
        order[:, places] = places[np.take_along_axis(rolled, moved, axis=1)]
        sign[:, places, 0] = np.where(
            np.take_along_axis(flip[:, piece], moved, axis=1) < 0.5, -1.0, 1.0
        )
    units = base.residual[:data].reshape(n, -1)
    strain = rng.standard_normal((repeats, base.n_priors))
    rows = np.hstack([(units[order] * sign).reshape(repeats, data), strain]).T
    return np.asarray(base.beyond(rows))
