"""What programs read of any fit, with units in the names."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from typing import Any

from wrist_stiffness.identification.result import Fit, FittedParameter
from wrist_stiffness.sessions.measured_session import MeasuredSession


def fit_values(
    fit: Fit,
    before: Mapping[str, float],
    after: Mapping[str, float],
    judged_by: str,
    sessions: Iterable[MeasuredSession],
) -> dict[str, Any]:
    """Return errors (RMS by the key of the quantity) and of what they are."""
    return {
        "schema": 2,
        "noise": dict(fit.noise),
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
