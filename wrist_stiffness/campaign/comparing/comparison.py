"""How far a model is off from what was measured, and what of that could be known better."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from typing import Any

import numpy as np

from wrist_stiffness.campaign.comparing.sentences import Told
from wrist_stiffness.campaign.noise_floor import NoiseFloor, against_floor, over_floor
from wrist_stiffness.inference import Observations, Quantity
from wrist_stiffness.inference.blocks import time_blocks
from wrist_stiffness.mechanism.components import Array

JUDGES = 12
"""Blocks of units from which the uncertainty of an error is taken."""


@dataclass(frozen=True)
class Size:
    """Error of one quantity over all units, in the unit of its report.

    Parameters
    ----------
    mean, rms, maximum : float
        Of the vector's length.
    uncertainty : float
        One standard uncertainty of `rms`.
    """

    mean: float
    rms: float
    maximum: float
    uncertainty: float

    def as_values(self) -> dict[str, float]:
        """Return what programs read."""
        return {
            "mean": self.mean,
            "rms": self.rms,
            "rms_uncertainty": self.uncertainty,
            "max": self.maximum,
        }


def lengths(observations: Observations, quantity: Quantity) -> Array:
    """Length of a quantity of each unit over its measured components, (n,); NaN without any."""
    columns = observations.values[:, list(quantity.components)]
    measured = np.isfinite(columns)
    square = np.sum(np.where(measured, columns, 0.0) ** 2, axis=1)
    return np.where(measured.any(axis=1), np.sqrt(square) * quantity.per_si, np.nan)


def sizes(observations: Observations) -> dict[str, Size]:
    """Error of every quantity by its key."""
    return {q.key: _size(observations, lengths(observations, q)) for q in observations.reported}


def _size(observations: Observations, length: Array) -> Size:
    known = np.isfinite(length)
    length, sessions = length[known], observations.sessions[known]
    blocks = time_blocks(sessions, min(JUDGES, len(length)))
    means = np.array([np.mean(length[blocks == block] ** 2) for block in np.unique(blocks)])
    rms = float(np.sqrt(np.mean(length**2)))
    scatter = means.std(ddof=1) / np.sqrt(len(means)) if len(means) > 1 else np.inf
    slope = 1.0 / (2.0 * rms) if rms > 0.0 else 0.0
    return Size(float(length.mean()), rms, float(length.max()), float(scatter * slope))


@dataclass(frozen=True, eq=False)
class ComparedModel:
    """One model against the recordings.

    Parameters
    ----------
    name : str
        Of the model.
    raw : Observations
        Residual as it stands, with the registrations that the model has.
    refitted : Observations
        Residual after registrations, zeros and tare of every session were fitted again.
    absorbed : tuple of str
        What those took up.
    told : Told
        On what the refitted residual depends.
    """

    name: str
    raw: Observations
    refitted: Observations
    absorbed: tuple[str, ...]
    told: Told

    @cached_property
    def before(self) -> dict[str, Size]:
        """Errors before the registrations were fitted again."""
        return sizes(self.raw)

    @cached_property
    def after(self) -> dict[str, Size]:
        """Errors after it."""
        return sizes(self.refitted)


@dataclass(frozen=True, eq=False)
class Comparison:
    """Models side by side over the same units.

    Parameters
    ----------
    sessions : tuple of str
        Names, in the order of time.
    models : tuple of ComparedModel
        In the order in which they were named.
    noise : NoiseFloor
        Scatter of the units.
    repeated, repeated_by_side : dict of str to float
        Repeatability of the measured pose from any side, and from the same side; empty where no
        dwell was repeated.
    process : dict of str to float
        What a Gaussian process over the conditions leaves of the first model's error.
    mistake : str
        A sentence on a sign, unit or name that may be wrong in the recordings; empty for none.
    """

    sessions: tuple[str, ...]
    models: tuple[ComparedModel, ...]
    noise: NoiseFloor
    repeated: dict[str, float]
    repeated_by_side: dict[str, float]
    process: dict[str, float]
    mistake: str = ""

    @cached_property
    def floor(self) -> dict[str, float]:
        """What noise alone gives each quantity."""
        return self.noise.rms(self.models[0].refitted)

    @property
    def quantities(self) -> tuple[Quantity, ...]:
        """Quantities that were measured."""
        return self.models[0].refitted.reported

    def headroom(self, model: ComparedModel, key: str) -> float | None:
        """Share of what could be explained that a model explains; None where nothing could.

        (before - after) / (before - Gaussian process), before being the first model.
        """
        before = self.models[0].after[key]
        possible = before.rms - self.process[key]
        if possible <= 2.0 * before.uncertainty:
            return None
        return (before.rms - model.after[key].rms) / possible

    def over_floor(self, model: ComparedModel) -> float:
        """Error of a model over the noise floor, the larger of the quantities'."""
        return over_floor({q.key: model.after[q.key].rms for q in self.quantities}, self.floor)

    @property
    def verdict(self) -> tuple[str, ...]:
        """The answer in a few sentences."""
        lines = []
        for model in self.models:
            parts = [f"{model.after[q.key].rms:.3g} {q.unit} of {q.name}" for q in self.quantities]
            means = against_floor(self.over_floor(model), self.noise.source)
            lines.append(f"{model.name} is off by {' and '.join(parts)} (RMS): {means}.")
        if len(self.models) > 1:
            lines += [self._fall(q) for q in self.quantities]
        if self.mistake:
            lines.append(self.mistake)
        return tuple(lines)

    def _fall(self, quantity: Quantity) -> str:
        first, last = self.models[0], self.models[-1]
        before, after = first.after[quantity.key].rms, last.after[quantity.key].rms
        was, is_now = f"{before:.3g}", f"{after:.3g}"
        moves = f"{'falls' if after < before else 'rises'} from {was} to {is_now}"
        if was == is_now:
            moves = f"stays at {is_now}"
        text = f"From {first.name} to {last.name} {quantity.name} {moves} {quantity.unit}"
        share = self.headroom(last, quantity.key)
        if share is None:
            left = f"{self.process[quantity.key]:.3g} {quantity.unit}"
            return f"{text} (a curve over the conditions alone reaches {left})."
        if share >= 1.0:
            # A process over the conditions of a moment knows nothing of where the wrist came from.
            return f"{text}: all that the conditions could explain."
        return f"{text}: {100.0 * share:.0f} % of what the conditions could explain."

    def as_values(self) -> dict[str, Any]:
        """Return what programs read, with units in the names."""
        return {
            "schema": 1,
            "sessions": list(self.sessions),
            "verdict": list(self.verdict),
            "units": self.models[0].refitted.n_units,
            "noise_floor": {**self.floor, "source": self.noise.source},
            "repeatability": {
                "from_any_side": self.repeated,
                "from_the_same_side": self.repeated_by_side,
            },
            "gaussian_process": self.process,
            "models": [self._model_values(model) for model in self.models],
        }

    def _model_values(self, model: ComparedModel) -> dict[str, Any]:
        return {
            "model": model.name,
            "before_registration": {k: size.as_values() for k, size in model.before.items()},
            "after_registration": {k: size.as_values() for k, size in model.after.items()},
            "absorbed": list(model.absorbed),
            "explained_headroom": {q.key: self.headroom(model, q.key) for q in self.quantities},
            **model.told.as_values(),
        }
