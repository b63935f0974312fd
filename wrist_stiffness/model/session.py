"""A model with the memory of a stream of samples."""

from __future__ import annotations

from collections.abc import Callable
from functools import cache
from typing import TYPE_CHECKING

import numpy as np

from wrist_stiffness.errors import InputError
from wrist_stiffness.mechanism.components import Array
from wrist_stiffness.model.block import Sample
from wrist_stiffness.model.evaluation import Memory, evaluate, evaluate_beside
from wrist_stiffness.model.prediction import Prediction

if TYPE_CHECKING:
    from wrist_stiffness.model.error_model import ErrorModel

LARGEST_TURN = 1.0
"""Turn of the platform that no error makes, but a signal that is no temperature [rad]."""


class Session:
    """A model with the memory of a stream of samples.

    Each uncertain parameter has a memory of its own, moved by one standard uncertainty: so the
    covariance knows the history.  Models without uncertainties cost one evaluation a sample.
    """

    def __init__(self, model: ErrorModel) -> None:
        self.model = model
        self._memory: Memory | None = None
        self._others: list[Memory] | None = None

    def advance(self, sample: Sample) -> Prediction:
        """Predict one sample and remember it.

        `sample`: not earlier than the one before.  Raises `WristError` if the sample is out of
        range, not finite or earlier than the one before; it is not remembered.
        """
        prediction, self._memory, varied = self._predicted(sample)
        if self.model.variations:
            self._others = varied()[1]
        return prediction

    def preview(self, sample: Sample) -> Prediction:
        """Predict what `advance` would, and forget it: to try other angles.

        `sample`: not earlier than the last one remembered.  Raises `WristError` as in `advance`.
        """
        return self._predicted(sample)[0]

    def _predicted(
        self, sample: Sample
    ) -> tuple[Prediction, Memory, Callable[[], tuple[Array, list[Memory]]]]:
        model, memory = self.model, self._memory
        if not np.isfinite(sample.time):
            raise InputError(f"sample: time {sample.time} is not finite")
        if sample.theta_dot is not None and not np.isfinite(sample.theta_dot).all():
            raise InputError(f"sample: motor speeds {sample.theta_dot} are not finite")
        if memory is not None and sample.time < memory.time:
            raise InputError(
                f"sample: time {sample.time:.6f} s is before the last one, {memory.time:.6f} s"
            )
        if model.stateless:
            plain = model.predict(sample.theta, sample.load, memory.active if memory else None)
            later = Memory((), sample.time, sample.theta, plain.active)
            return plain, later, lambda: (plain.covariance, [])
        configuration = model.table.workspace.configuration(sample.theta)
        model.table.check_load(sample.load.wrench)
        pose = configuration if model.evaluation == "closed_form" else None
        result = evaluate(model, sample.block, memory, pose)
        twist, others = result.twist[0], self._others
        turn = float(np.abs(twist[3:]).max())
        if not turn < LARGEST_TURN:
            raise InputError(
                f"sample: the predicted error turns by {turn:.3g} rad, the limit is "
                f"{LARGEST_TURN:g} rad: is a temperature, a covariate or a speed wrong?"
            )

        @cache
        def varied() -> tuple[Array, list[Memory]]:
            before: list[Memory | None] = [*others] if others else [None] * len(model.variations)
            found = evaluate_beside(model.variations, before, result)
            covariance = model.parameter_covariance(twist, [moved.twist[0] for moved in found])
            return covariance, [moved.memory for moved in found]

        left, right = result.situation.sensor
        prediction = Prediction(
            twist,
            configuration,
            result.active[0],
            model.table_covariance,
            (_only(left), _only(right)),
            lambda: varied()[0],
            warnings=result.warnings,
        )
        return prediction, result.memory, varied


def _only(rows: Array | None) -> Array | None:
    """Return the only row of (1, 6), or what is (6,) already."""
    return None if rows is None else rows.reshape(6)
