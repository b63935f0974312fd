"""A plain table made ready for the search: whitened, with the size of its noise."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from wrist_stiffness.inference.discrepancy import DRIFT, background, unresolved
from wrist_stiffness.inference.noise import KNOWN, in_each_component, unstated
from wrist_stiffness.inference.observations import Array, Observations
from wrist_stiffness.inference.point import Background
from wrist_stiffness.inference.projection import orthonormal
from wrist_stiffness.inference.shared import LAW_RANK, Whitened, own_covariance, with_shared
from wrist_stiffness.inference.smooth import alike, by_session, questions, wander

BEYOND = 0.03
"""Least part of a question that no name must be able to answer, or it is not asked."""


class Table(Whitened):
    """Units of a table as whitened rows.

    `observations`: n units of m components; `base` (n, m, p): columns of what is refitted; `named`
    (n, m, k): columns of all candidates; `ordered`: whether the rows follow each other in time, so
    that an instrument drifts over them.
    """

    def __init__(
        self, observations: Observations, base: Array, named: Array, ordered: bool
    ) -> None:
        self.ordered = ordered and observations.time_s is not None
        self.questions = questions(observations)
        self._wander = by_session(observations, wander) if self.ordered else None
        if observations.covariance is None:
            asked = [each.features(observations.covariates) for each in self.questions]
            smooth = in_each_component([*asked, self._wander], observations)
            structure = np.concatenate([named, smooth], axis=2)
            observations, self.variance, self.noise_width = unstated(observations, base, structure)
            stated = with_shared(observations, np.diag(self.variance))
        else:
            stated, self.noise_width = observations.covariance, KNOWN
            variances = np.atleast_2d(np.diagonal(stated, axis1=-2, axis2=-1))
            self.variance = np.median(variances, axis=0)
        own = own_covariance(observations, stated)
        self.scatter: Array = np.sqrt(np.median(np.diagonal(own, axis1=1, axis2=2), axis=0))
        if self._wander is not None:
            # What the columns of the drift cannot follow is scatter of each row by itself.
            beyond = unresolved(self._wander)[:, None] * (DRIFT * self.scatter) ** 2
            own = own + beyond[:, :, None] * np.eye(observations.n_components)
        super().__init__(observations, own, alike(observations, LAW_RANK))

    def background(self, named: Array) -> Background:
        """Return what has no name.

        The discrepancy is what the columns that have one, (N, q), cannot do (Plumlee 2017): what a
        candidate explains is never called unknown for being smooth.
        """
        drift, width = DRIFT * self.scatter, self.noise_width
        whole = background(self, self.questions, self.scatter, width, drift, self._wander)
        own = orthonormal(named)
        groups = []
        for each in whole.groups:
            left = each.columns
            if each.expected == 0.0:
                left = left - own @ (own.T @ left)
            if np.linalg.norm(left) > BEYOND * np.linalg.norm(each.columns):
                groups.append(replace(each, columns=left))
        return Background(tuple(groups), self.noise_width)
