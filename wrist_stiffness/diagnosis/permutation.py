"""What chance alone would give: the same questions asked of rearranged residuals.

Freedman and Lane (1983): residuals of the reduced model are rearranged, the model is refitted, the
largest statistic over all candidates is kept.  So a large catalogue pays for its size, whatever
its members share.  Short stretches of units move together, with a random sign, and never leave
their session, so that wander which the noise model missed stays in place.
"""

import numpy as np

from wrist_stiffness.diagnosis.observations import Array

STRETCH = 3
"""Units that move together."""


def rearrangements(sessions: Array, repeats: int, rng: np.random.Generator) -> tuple[Array, Array]:
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
        for repeat in range(repeats):
            rolled = np.roll(places, -rng.integers(STRETCH))
            pieces = np.array_split(rolled, max(1, len(places) // STRETCH))
            signs = rng.choice([-1.0, 1.0], len(pieces))
            shuffled = rng.permutation(len(pieces))
            order[repeat, places] = np.concatenate([pieces[i] for i in shuffled])
            sign[repeat, places] = np.concatenate(
                [np.full(len(pieces[i]), signs[i]) for i in shuffled]
            )
    return order, sign


def rearranged(residual: Array, n_components: int, order: Array, sign: Array) -> Array:
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
