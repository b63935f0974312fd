"""A model with the memory of a stream of samples."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from functools import cache
from typing import TYPE_CHECKING

import numpy as np

from wrist_stiffness.errors import InputError
from wrist_stiffness.mechanism.components import Array
from wrist_stiffness.model.block import Sample
from wrist_stiffness.model.evaluation import Evaluated, Memory, evaluate, evaluate_beside
from wrist_stiffness.model.prediction import Prediction

if TYPE_CHECKING:
    from wrist_stiffness.model.error_model import ErrorModel

LARGEST_TURN = 1.0
"""Turn of the platform that no error makes, but a signal that is no temperature [rad]."""


class Session:
    """A model with the memory of a stream of samples.

    Each of the model's `variations` has a memory of its own: so the covariance knows the history.
    Models without uncertainties cost one evaluation a sample.
    """

    def __init__(self, model: ErrorModel) -> None:
        self.model = model
        # of the model itself, and of each of its `variations`
        self._memories: Sequence[Memory | None] = [None] * (1 + len(model.variations))

    @property
    def theta(self) -> Array | None:
        """Motor angles of the last sample that is remembered (2,) [rad]; None where none is."""
        first = self._memories[0]
        return None if first is None else first.theta

    def advance(self, sample: Sample) -> Prediction:
        """Predict one sample and remember it.

        `sample`: not earlier than the one before.  Raises `WristError` if the sample is out of
        range, not finite or earlier than the one before; it is not remembered.
        """
        prediction, memories = self._predicted(sample)
        self._memories = memories()
        return prediction

    def preview(self, sample: Sample) -> Prediction:
        """Predict what `advance` would, and forget it: to try other angles.

        `sample`: not earlier than the last one remembered.  Raises `WristError` as in `advance`.
        """
        return self._predicted(sample)[0]

    def _predicted(self, sample: Sample) -> tuple[Prediction, Callable[[], list[Memory]]]:
        """Return the prediction, and what returns the memories after it."""
        model, (memory, *others) = self.model, self._memories
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
            return plain, lambda: [Memory((), sample.time, sample.theta, plain.active)]
        configuration = model.table.workspace.configuration(sample.theta)
        model.table.check_load(sample.load.wrench)
        pose = configuration if model.evaluation == "closed_form" else None
        result = evaluate(model, sample.block, memory, pose)
        twist = result.twist[0]
        turn = float(np.abs(twist[3:]).max())
        if not turn < LARGEST_TURN:
            raise InputError(
                f"sample: the predicted error turns by {turn:.3g} rad, the limit is "
                f"{LARGEST_TURN:g} rad: is a temperature, a covariate or a speed wrong?"
            )

        @cache
        def varied() -> list[Evaluated]:
            return evaluate_beside(model.variations, others, result)

        def of_parameters() -> Array:
            return model.parameter_covariance(twist, [each.twist[0] for each in varied()])

        left, right = result.situation.sensor
        prediction = Prediction(
            twist,
            configuration,
            result.active[0],
            model.table_covariance,
            (_only(left), _only(right)),
            None if model.certain else of_parameters,
            warnings=result.warnings,
        )
        return prediction, lambda: [each.memory for each in (result, *varied())]


def _only(rows: Array | None) -> Array | None:
    """Return the only row of (1, 6), or what is (6,) already."""
    return None if rows is None else rows.reshape(6)
