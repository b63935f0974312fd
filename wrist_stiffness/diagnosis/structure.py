"""How many independent chances structure has to look like something else.

Above the noise floor the residual is no noise but the shape of a law that is missing or not quite
right.  Such a shape has far fewer independent numbers than there are measurements, so evidence
against it is counted in those: a candidate that merely resembles the shape explains a share of
it, a right one explains it down to the floor.
"""

from dataclasses import dataclass

import numpy as np
from scipy.special import chdtrc, fdtrc

from wrist_stiffness.diagnosis.hypotheses import Hypothesis, addition
from wrist_stiffness.diagnosis.observations import Array
from wrist_stiffness.diagnosis.projection import Base
from wrist_stiffness.diagnosis.settings import CHANCE_OF_STRUCTURE


def effective_dimension(base: Base, hypotheses: list[Hypothesis]) -> float:
    """Effective rank of the shapes that the catalogue can take beyond the base.

    Exponential of the entropy of the eigenvalue shares of the Gram matrix of unit columns
    (Roy and Vetterli 2007).
    """
    directions = (addition(base, each).directions for each in hypotheses)
    columns = np.hstack([base.basis[:, :0], *directions])
    if columns.shape[1] == 0:
        return 1.0
    size = np.linalg.eigvalsh(columns.T @ columns)
    share = size[size > 0] / size[size > 0].sum()
    return float(np.exp(-np.sum(share * np.log(share))))


@dataclass(frozen=True)
class Excess:
    """Sum of squares above what noise leaves.

    Parameters
    ----------
    energy : float
        Excess over the expected sum of squares; zero unless significant.
    p_value : float
        Probability of at least so much from noise alone.
    """

    energy: float
    p_value: float


def lack_of_fit(energy: float, freedom: int, noise_dof: float) -> Excess:
    """Compare a residual sum of squares with the noise floor.

    Parameters
    ----------
    energy : float
        Whitened sum of squares.
    freedom : int
        Its degrees of freedom.
    noise_dof : float
        Degrees of freedom of the floor itself; infinite = known.
    """
    if np.isinf(noise_dof):
        p_value = float(chdtrc(freedom, energy))
    else:
        p_value = float(fdtrc(freedom, noise_dof, energy / freedom))
    significant = p_value < CHANCE_OF_STRUCTURE
    return Excess(max(0.0, energy - freedom) if significant else 0.0, p_value)


def background(remaining: Array | float, dimension: float) -> Array:
    """Variance against which a gain is judged: noise (1) plus remaining structure per dimension.

    Parameters
    ----------
    remaining : (...,) array
        Excess sum of squares that would be left with the candidate in the model.
    dimension : float
        From `effective_dimension`.
    """
    return 1 + np.maximum(remaining, 0.0) / dimension
