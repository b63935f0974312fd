"""Whether measured and rigid rotations belong to one wrist, wherever the instrument stands."""

from __future__ import annotations

import numpy as np
from scipy.spatial.transform import Rotation

from wrist_stiffness.mechanism.components import Array

POSES_USED = 1000

ROUNDS = 20


def median_misfit(measured: Array, rigid: Array) -> float:
    """Return the median angle between rotations that is left after the best registration.

    The registration is a turn of the instrument in F and one of the target on the platform; either
    is the mean of what the other leaves.

    Parameters
    ----------
    measured, rigid : (n, 3, 3) float
        U -> F, finite.

    Returns
    -------
    float
        [rad].
    """
    used = np.unique(np.linspace(0, len(measured) - 1, POSES_USED).astype(int))
    seen, said = Rotation.from_matrix(measured[used]), Rotation.from_matrix(rigid[used])
    instrument = target = Rotation.identity()
    for _ in range(ROUNDS):
        instrument = (seen * (said * target).inv()).mean()
        target = ((instrument * said).inv() * seen).mean()
    return float(np.median((seen * (instrument * said * target).inv()).magnitude()))
