"""What a diagnosis decides by: thresholds that a caller may set, and those that steps share.

A threshold that one step alone uses stands with that step.  Without a source they are assumed, or
were kept because the benchmarks, where the answer is known, came out better with them.
"""

import math
from dataclasses import dataclass

from wrist_stiffness.errors import InputError

CHANCE_OF_STRUCTURE = 0.001
"""Probability with which noise is taken for structure, in each test that asks for it."""

FEWEST_UNITS = 12
"""From fewer units noise cannot be told from error, nor a lost beam from a good one."""


@dataclass(frozen=True)
class Settings:
    """Thresholds.

    Parameters
    ----------
    alpha : float
        Probability with which pure noise may let any one effect of the catalogue in.
    law_accuracy : float
        Share of an effect's size by which its law may be wrong.  What is left of a large effect
        within this share is no evidence for another one.
    unexplained_share : float
        Verdict ``unknown`` from this share of the initial excess over the noise.
    sealed_share : float
        Part of the units that is put aside before looking, where there is one session only.
    blocks : int
        Parts for cross-validation and resampling, cut along the time.
    permutations : int
        Random rearrangements of each permutation test.
    most_findings : int
        The search ends after so many effects.
    most_members : int
        A class of more effects than these names nothing: they are not told from each other, nor
        from what nobody thought of.
    least_stability : float
        Share of the resamples that must choose an effect again, or one of its class, before it is
        named (stability selection, Meinshausen and Buehlmann 2010, who take 0.6 to 0.9).
    outlier_limit : float
        Distance from the rich model, in robust standard deviations, of a lost beam.

    Raises
    ------
    InputError
        If the permutations are too few for any effect or structure ever to be significant.
    """

    alpha: float = 0.005
    law_accuracy: float = 0.1
    unexplained_share: float = 0.10
    sealed_share: float = 0.2
    blocks: int = 10
    permutations: int = 999
    most_findings: int = 8
    most_members: int = 8
    least_stability: float = 0.7
    outlier_limit: float = 7.0

    def __post_init__(self) -> None:
        """Refuse settings by which nothing can be found."""
        chance = min(self.alpha, CHANCE_OF_STRUCTURE)
        least = math.ceil(1.0 / chance) - 1
        if self.permutations < least:
            raise InputError(
                f"{self.permutations} permutations cannot tell a chance of {chance:g}; "
                f"at least {least} are needed"
            )
