"""What chance alone would give: the same questions asked of rearranged residuals.

Freedman and Lane (1983): residuals of the reduced model are rearranged, the model is refitted, the
largest statistic over all candidates is kept.  So a large catalogue pays for its size, whatever
its members share.  Short stretches of units move together, with a random sign, and never leave
their session, so that wander which the noise model missed stays in place.
"""

import numpy as np

from wrist_stiffness.diagnosis.observations import Array, Labels

STRETCH = 3
"""Units that move together."""


def rearrangements(
    sessions: Labels, repeats: int, rng: np.random.Generator
) -> tuple[Labels, Array]:
    """Random rearrangements of units.

    Parameters
    ----------
    sessions : (n,) array
        Session of each unit.
    repeats : int
        How many.
    rng : numpy.random.Generator
        Source of chance.

    Returns
    -------
    (repeats, n) array of int, (repeats, n) array
        Which unit comes to each place, and with which sign.
    """
    n = len(sessions)
    order, sign = np.empty((repeats, n), dtype=np.int64), np.empty((repeats, n))
    for session in np.unique(sessions):
        places = np.flatnonzero(sessions == session)
        count = len(places)
        rolled = (np.arange(count) + rng.integers(STRETCH, size=(repeats, 1))) % count
        piece = np.arange(count) // STRETCH
        key, flip = rng.random((2, repeats, piece[-1] + 1))
        moved = np.argsort(key[:, piece], axis=1, kind="stable")
        order[:, places] = places[np.take_along_axis(rolled, moved, axis=1)]
        sign[:, places] = np.where(
            np.take_along_axis(flip[:, piece], moved, axis=1) < 0.5, -1.0, 1.0
        )
    return order, sign


def rearranged(residual: Array, n_components: int, order: Labels, sign: Array) -> Array:
    """Rearranged residuals, (N, repeats); the rows of the priors stay.

    Parameters
    ----------
    residual : (N,) array
        Whitened residual, components of one unit next to each other.
    n_components : int
        Numbers per unit.
    order, sign : (repeats, n) arrays
        From `rearrangements`.
    """
    repeats, n = order.shape
    units = residual[: n * n_components].reshape(n, n_components)
    moved = (units[order] * sign[:, :, None]).reshape(repeats, -1)
    rest = np.broadcast_to(residual[n * n_components :], (repeats, residual.size - moved.shape[1]))
    return np.hstack([moved, rest]).T
