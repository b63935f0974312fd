"""Fit a model to one wrist as it was set up, and write it."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

from wrist_stiffness.atomic_file import require_room
from wrist_stiffness.commands.provenance import Run
from wrist_stiffness.commands.read_sessions import Recordings, read_sessions, was_fitted_to
from wrist_stiffness.comparing.compare import doubts_load, suspicion_in, wrong_load
from wrist_stiffness.comparing.wiring import load_too_large, told_mistake
from wrist_stiffness.errors import InputError
from wrist_stiffness.identification.calibration import Calibration, calibrate
from wrist_stiffness.identification.free_effects import unfitted
from wrist_stiffness.identification.result import FittedParameter
from wrist_stiffness.identification.wrist_fit import WristFit
from wrist_stiffness.model.model_file import load_model, save_model
from wrist_stiffness.progress import Progress, silent
from wrist_stiffness.sessions.measured_session import MeasuredSession


@dataclass(frozen=True, eq=False)
class Calibrated:
    """A calibration and what it was made from."""

    calibration: Calibration
    sessions: tuple[MeasuredSession, ...]  # what was measured, in the order of time
    mistake: str  # of signs, units or names, where one explains most of what is left; else empty

    def as_values(self) -> dict[str, Any]:
        """Return what programs read, with units in the names."""
        found = self.calibration
        return {
            **fit_values(found.fit, found.before, found.after, found.judged_by, self.sessions),
            "set_up_mistake": self.mistake,
            "refused": {f"rmse_{key}": value for key, value in found.refused.items()},
            "warnings": list(found.warnings),
            "calibrated_otherwise": list(found.calibrated),
            "parameters": parameter_values(found.parameters),
        }


def calibrate_model(
    model: str | Path,
    recordings: Recordings,
    output: str | Path,
    run: Run,
    progress: Progress = silent,
    asking: Progress = silent,
) -> Calibrated:
    """Fit a model to recordings and write it as it holds for the newest one.

    `progress`: told steps done and steps at most; `asking`: the same of a second fit, where a
    mistake of the load is likely.  Raises `WristError` if a file cannot be read, used or written;
    then no model is written.
    """
    require_model_place(output)
    parent = load_model(model)
    sessions = read_sessions(recordings, [parent], progress)
    step = run.step(model, sessions)
    again = was_fitted_to(parent, sessions)
    measured = tuple(sessions.values())
    found = calibrate(parent, measured, progress, again)
    child = replace(found.model, lineage=(*parent.lineage, step))
    start = unfitted(parent) if again else parent
    mistake, much = load_too_large(start, measured), found.fit.rough
    # What is wrong with positions or angles shows in the model as it was; what is wrong with the
    # load hides there behind axes that are a little off their drawing.
    if not mistake and much:
        mistake = told_mistake(suspicion_in(start, measured))
    if not mistake and (much or doubts_load(found)):
        mistake = wrong_load(start, child, measured, found, asking)
    save_model(child, output)
    return Calibrated(found, measured, mistake)


def require_model_place(output: str | Path) -> None:
    """Refuse a path that takes no model, so that no fit ends in a typing error (InputError)."""
    if Path(output).suffix == ".mcap":
        raise InputError(f"{output}: a model is no recording; choose another name")
    require_room(output)


def fit_values(
    fit: WristFit,
    before: Mapping[str, float],
    after: Mapping[str, float],
    judged_by: str,
    sessions: Iterable[MeasuredSession],
) -> dict[str, Any]:
    """Return errors (RMS by the key of the quantity) and of what they are."""
    return {
        "schema": 2,
        "noise": dict(fit.noise),
        "noise_known": fit.table.background.noise_known,
        "discrepancy": dict(fit.discrepancy),
        "before": {f"rmse_{key}": value for key, value in before.items()},
        "after": {f"rmse_{key}": value for key, value in after.items()},
        "judged_by": judged_by,
        "sessions": [
            {"name": session.name, "remarks": list(session.remarks)} for session in sessions
        ],
        "lost": fit.lost,
        "settled": fit.arrived,
    }


def parameter_values(parameters: Iterable[FittedParameter]) -> list[dict[str, Any]]:
    """Return all parameters for programs."""
    values = []
    for each in parameters:
        effect, _, component = each.effect.partition("@")
        values.append(
            {
                "effect": effect,
                "component": component,
                "session": each.session,
                "parameter": each.key,
                "value": each.value,
                "sigma": each.sigma,
                "prior": each.prior,
                "prior_sigma": each.prior_sigma,
                "excited": each.excited,
                "at_bound": each.at_bound,
                "together_with": list(each.together),
            }
        )
    return values
