"""A model with the memory of one stream: backlash, creep and heat depend on what was before."""

from __future__ import annotations

from collections.abc import Callable
from copy import copy

import numpy as np

from wrist_stiffness.compensation.held_signals import HeldSignals
from wrist_stiffness.compensation.load_history import NANOSECONDS
from wrist_stiffness.errors import InputError, WristError
from wrist_stiffness.mechanism.compiled import CompiledWrist, Flags
from wrist_stiffness.mechanism.components import Array
from wrist_stiffness.model.block import Sample
from wrist_stiffness.model.error_model import ErrorModel, Load, Prediction
from wrist_stiffness.model.session import Session

JUMP_S = 1.0
"""A stamp this much before the last one says that the clock jumped back: the memory begins anew."""


class RunningModel:
    """One model and one stream of samples.

    Where effects are constant there is nothing to remember, and samples may come in any order.

    `temperatures`, `covariates`: what the stream has heard of them.
    """

    def __init__(
        self, model: ErrorModel, temperatures: HeldSignals, covariates: HeldSignals
    ) -> None:
        self.model = model
        self._temperatures = temperatures
        self._covariates = covariates
        self._session: Session | None = None if model.stateless else model.session()
        self._last_ns = 0
        # (m,), flange sectors in contact at the last sample, for a model without a memory
        self.contact: Flags = np.zeros(len(model.parts.sectors.gap), dtype=bool)

    def advance(
        self, stamp_ns: int, theta: Array, load: Load, theta_dot: Array | None = None
    ) -> Prediction:
        """Predict a sample and remember it.

        `stamp_ns` [ns].  `theta` (2,): motor angles [rad].  `theta_dot` (2,): motor speeds; where
        absent the difference to the sample before [rad/s].  Raises `WristError` if the sample is
        out of range or, with effects, before the last one.
        """
        session = self._session_at(stamp_ns)
        if session is None:
            return self._predict(theta, load)
        sample = self._sample(stamp_ns, theta, load, theta_dot)
        prediction = _told(lambda: session.advance(sample))
        self._last_ns = stamp_ns
        return prediction

    def snapshot(self) -> RunningModel:
        """Return the same with the memory as it is now; what comes later changes only this one."""
        taken = copy(self)
        taken._session = copy(self._session)
        return taken

    def rest(self, stamp_ns: int, load_at: Callable[[Array], Load]) -> None:
        """Let time pass up to a stamp [ns], at rest at the last motor angles, if there are any.

        `load_at`: the load on the platform that is turned by (3, 3), U -> F.  What is tried from
        there has moved in no time, so no speed and no acceleration is made of it.  Raises
        `WristError` as `advance`.
        """
        session = self._session_at(stamp_ns)
        if session is not None and session.theta is not None:
            there = self.model.table.workspace.configuration(session.theta)
            self.advance(stamp_ns, session.theta, load_at(there.platform), np.zeros(2))

    @property
    def compiled(self) -> CompiledWrist | None:
        """The compiled formulas, where they serve the model and nothing is to be remembered."""
        return None if self.remembers else self.model.compiled

    @property
    def remembers(self) -> bool:
        """Whether predictions depend on the samples before."""
        return self._session is not None

    def preview(
        self, stamp_ns: int, load: Load, theta_dot: Array | None = None
    ) -> Callable[[Array], Prediction]:
        """Return the prediction as a function of the motor angles, to be tried and forgotten."""
        session = self._session_at(stamp_ns)
        if session is None:
            return lambda theta: self._predict(theta, load)
        return lambda theta: _told(
            lambda: session.preview(self._sample(stamp_ns, theta, load, theta_dot))
        )

    def _predict(self, theta: Array, load: Load) -> Prediction:
        # The flanges that touched last are a good guess.  It saves time and leaves no trace: the
        # forces are solved for once more from the flanges that are found, whatever the guess was.
        prediction = _told(lambda: self.model.predict(theta, load, self.contact))
        self.contact[:] = prediction.active
        return prediction

    def _session_at(self, stamp_ns: int) -> Session | None:
        if self._session is not None and stamp_ns < self._last_ns - JUMP_S * NANOSECONDS:
            self._session = self.model.session()
        return self._session

    def _sample(self, stamp_ns: int, theta: Array, load: Load, theta_dot: Array | None) -> Sample:
        return Sample(
            stamp_ns / NANOSECONDS,
            theta,
            load,
            theta_dot,
            temperatures=self._temperatures.at(stamp_ns),
            covariates=self._covariates.at(stamp_ns),
        )


def _told(predict: Callable[[], Prediction]) -> Prediction:
    """Predict; whatever a user's own law raises becomes an error of the input."""
    try:
        return predict()
    except WristError:
        raise
    except Exception as error:
        raise InputError(f"the model fails: {type(error).__name__}: {error}") from error
