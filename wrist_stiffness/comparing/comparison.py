"""How far a model is off from what was measured, where most, and what could be known better."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import Any

import numpy as np

from wrist_stiffness.comparing.curve import since_start_s
from wrist_stiffness.comparing.explained import Explained
from wrist_stiffness.comparing.sentences import as_values
from wrist_stiffness.identification.questions import LOAD
from wrist_stiffness.identification.taken_up import TakenUp
from wrist_stiffness.inference import Observations, Quantity
from wrist_stiffness.inference.held_out import time_blocks
from wrist_stiffness.mechanism.components import Array
from wrist_stiffness.numerals import number, percent

JUDGES = 12
"""Blocks of units from which the uncertainty of an error is taken."""

APART_S = 2.0
"""Moments closer than this in time are one event."""

SAME_DEG, SAME_N = 2.0, 0.1
"""So are repetitions of one pose under one force."""


@dataclass(frozen=True)
class Size:
    """Error of one quantity over all units, in the unit of its report, as programs read it."""

    # `mean`, `rms`, `max`: of the vector's length
    mean: float
    rms: float
    rms_uncertainty: float  # one standard uncertainty
    max: float


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
    return Size(float(length.mean()), rms, float(scatter * slope), float(length.max()))


@dataclass(frozen=True, eq=False)
class ComparedModel:
    """One model against the recordings."""

    name: str  # of the model
    raw: Observations  # residual as it stands, with the registrations that the model has
    # residual after registrations, zeros and tare of every session were fitted again, and on what
    # it depends
    explained: Explained
    absorbed: tuple[TakenUp, ...]  # what those took up

    @property
    def refitted(self) -> Observations:
        """Residual after registrations, zeros and tare were fitted again."""
        return self.explained.observations

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
    """Models side by side over the same units."""

    sessions: tuple[str, ...]  # names, in the order of time
    models: tuple[ComparedModel, ...]  # in the order in which they were named
    # `repeated`, `repeated_by_side`: repeatability of the measured pose from any side, and from the
    # same side; empty where no dwell was repeated
    repeated: dict[str, float]
    repeated_by_side: dict[str, float]
    # a sentence on a sign, unit or name that may be wrong in the recordings; empty for none
    mistake: str = ""
    lost: int = 0  # units that were left out as lost beams

    @property
    def noise(self) -> dict[str, float]:
        """Instrument noise of each quantity, as what the last model leaves tells it."""
        return self.models[-1].explained.noise

    @property
    def noise_known(self) -> bool:
        """Whether anything tells that noise; else it is at most so large."""
        return self.models[-1].explained.noise_known

    @property
    def reachable(self) -> dict[str, float]:
        """What the laws of the conditions leave of the first model's error, on unseen stretches."""
        return self.models[0].explained.reachable

    @property
    def quantities(self) -> tuple[Quantity, ...]:
        """Quantities that were measured."""
        return self.models[0].refitted.reported

    def headroom(self, model: ComparedModel, key: str) -> float | None:
        """Share of what could be explained that a model explains; None where nothing could.

        (before - after) / (before - reachable), before being the first model.
        """
        before = self.models[0].after[key]
        possible = before.rms - self.reachable[key]
        if possible <= 2.0 * before.rms_uncertainty:
            return None
        return (before.rms - model.after[key].rms) / possible

    def over_noise(self, model: ComparedModel) -> float:
        """Error of a model over the instrument's noise, the larger of the quantities'."""
        over = [model.after[key].rms / max(size, 1e-12) for key, size in self.noise.items()]
        return max(over)

    @property
    def verdict(self) -> tuple[str, ...]:
        """The answer in a few sentences."""
        lines = [
            f"{each.name} is off by {self._sizes(each.explained.error)} (RMS): "
            f"{self._means(each.explained)}."
            for each in self.models
        ]
        if len(self.models) > 1:
            lines += [self._fall(q) for q in self.quantities]
        if not self.noise_known:
            lines.append(
                "Nothing states the noise of the instrument: it is at most "
                f"{self._sizes(self.noise)}, as play and friction pass for noise here. Repeated "
                "readings would tell it."
            )
        if self.lost:
            units = self.models[0].refitted.n_units + self.lost
            lines.append(f"Lost beams, left out: {self.lost} of {units} dwells and moments.")
        if self.mistake:
            lines.append(self.mistake)
        return tuple(lines)

    def _sizes(self, rms: dict[str, float]) -> str:
        return " and ".join(q.told(rms[q.key]) for q in self.quantities)

    def _means(self, found: Explained) -> str:
        state = found.answer.state
        if not (state.discrepant.any() or state.misfit):
            sure = percent(found.answer.nothing)
            if not found.noise_known:
                return f"none of it depends on what was recorded ({sure} sure)"
            return f"noise and drift of the instrument, no more ({sure} sure)"
        return f"{self._sizes(found.above)} are surely above noise and drift of the instrument"

    def _fall(self, quantity: Quantity) -> str:
        first, last = self.models[0], self.models[-1]
        before, after = first.after[quantity.key].rms, last.after[quantity.key].rms
        was, is_now = number(before), number(after)
        moves = f"{'falls' if after < before else 'rises'} from {was} to {is_now}"
        if was == is_now:
            moves = f"stays at {is_now}"
        text = f"From {first.name} to {last.name} {quantity.name} {moves} {quantity.unit}"
        share = self.headroom(last, quantity.key)
        if share is None or share >= 1.0:
            # Laws of the conditions of a moment know nothing of where the wrist came from.
            left = f"{number(self.reachable[quantity.key])} {quantity.unit}"
            return f"{text} (laws of the conditions alone reach {left})."
        return f"{text}: {100.0 * share:.0f} % of what the conditions could explain."

    def as_values(self) -> dict[str, Any]:
        """Return what programs read, with units in the names."""
        return {
            "schema": 2,
            "sessions": list(self.sessions),
            "verdict": list(self.verdict),
            "units": self.models[0].refitted.n_units,
            "instrument_noise": self.noise,
            "noise_known": self.noise_known,
            "repeatability": {
                "from_any_side": self.repeated,
                "from_the_same_side": self.repeated_by_side,
            },
            "reachable": self.reachable,
            "models": [self._model_values(model) for model in self.models],
        }

    def _model_values(self, model: ComparedModel) -> dict[str, Any]:
        return {
            "model": model.name,
            "before_registration": {k: vars(size) for k, size in model.before.items()},
            "after_registration": {k: vars(size) for k, size in model.after.items()},
            "absorbed": [each.sentence for each in model.absorbed],
            "explained_headroom": {q.key: self.headroom(model, q.key) for q in self.quantities},
            **as_values(model.explained),
        }


@dataclass(frozen=True, eq=False)
class WorstPose:
    """One dwell or moment."""

    session: str  # name
    time_s: float  # since the first unit of its session [s]
    theta_deg: Array  # (2,), motor angles [deg]
    load: Array  # (6,), at O [N, N m]
    errors: dict[str, float]  # by the key of the quantity; NaN where not measured

    def as_values(self) -> dict[str, Any]:
        """Return what programs read."""
        return {
            "session": self.session,
            "time_s": self.time_s,
            "motor_deg": self.theta_deg.tolist(),
            "load": self.load.tolist(),
            **{k: None if np.isnan(value) else value for k, value in self.errors.items()},
        }


def worst_poses(
    observations: Observations, noise: dict[str, float], sessions: Sequence[str], most: int = 8
) -> tuple[WorstPose, ...]:
    """Return the units with the largest errors against the noise, worst first.

    `observations`: residuals with the covariates of `observing.tabulate`; `noise`: by quantity.
    """
    errors = {q.key: lengths(observations, q) for q in observations.reported}
    relative = [np.nan_to_num(error) / (noise[key] or np.inf) for key, error in errors.items()]
    size = np.sqrt(np.sum(np.square(relative), axis=0))
    theta = np.stack([observations.covariate(f"theta_{motor}") for motor in (1, 2)], axis=1)
    load = np.stack([observations.covariate(name) for name in LOAD], axis=1)
    chosen: list[int] = []
    for unit in np.argsort(-size).tolist():
        moment = np.abs(observations.times[chosen] - observations.times[unit]) < APART_S
        moment &= observations.sessions[chosen] == observations.sessions[unit]
        pose = (np.abs(np.degrees(theta[chosen] - theta[unit])) < SAME_DEG).all(axis=1)
        pose &= np.linalg.norm(load[chosen, :3] - load[unit, :3], axis=1) < SAME_N
        if not (moment | pose).any():
            chosen.append(unit)
        if len(chosen) == most:
            break
    since_s = since_start_s(observations)
    return tuple(
        WorstPose(
            sessions[observations.sessions[unit]],
            float(since_s[unit]),
            np.degrees(theta[unit]),
            load[unit],
            {key: float(error[unit]) for key, error in errors.items()},
        )
        for unit in chosen
    )
