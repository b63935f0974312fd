"""What a fit tells: a technician in lines of text, a program in values."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from wrist_stiffness.identification.held_out import ANOTHER_SESSION, THIS_SESSION
from wrist_stiffness.identification.result import Fit, FittedParameter
from wrist_stiffness.sessions.measured_session import MeasuredSession

TITLES = {"s_um": "s [um]", "phi_mdeg": "phi [mdeg]"}

NOT_AT_THE_FLOOR = (
    "an effect is missing ('wrist-stiffness diagnose' finds out which), or the fit was caught "
    "where other flanges touch than on the wrist; then more poses and loads help"
)

JUDGED_BY = {
    THIS_SESSION: "on the end of the session, by a fit that has not seen it; valid for this "
    "session only",
    ANOTHER_SESSION: "on the last session, by a fit that has not seen it",
}


@dataclass(frozen=True)
class Errors:
    """Root mean squares by the key of the quantity, in the order in which they are told.

    Parameters
    ----------
    rows : dict of str to dict
        Errors by what they are of.
    fit : Fit
        What noise alone gives, and what a model leaves above it.
    """

    rows: Mapping[str, Mapping[str, float]]
    fit: Fit

    def lines(self) -> list[str]:
        """Return a table for people."""
        keys = list(self.fit.noise)
        out = [" " * 28 + "".join(f"{TITLES.get(key, key):>12}" for key in keys)]
        for name, row in {**self.rows, "noise and drift alone": self.fit.noise}.items():
            out.append(f"{name:28}" + "".join(f"{row[key]:12.3f}" for key in keys))
        return out

    def as_values(self, names: Sequence[str]) -> dict[str, dict[str, float]]:
        """Return the errors for programs, under names of theirs in the order of the rows."""
        rows = {
            name: {f"rmse_{key}": value for key, value in row.items()}
            for name, row in zip(names, self.rows.values(), strict=True)
        }
        return {"noise": dict(self.fit.noise), "discrepancy": dict(self.fit.discrepancy), **rows}


def used_lines(sessions: Sequence[MeasuredSession], found: Fit) -> list[str]:
    """Tell what the fit saw, and what of the recordings could not be used."""
    table = found.problem.table
    dwells = sum(int((each.cut.dwell & each.measured).sum()) for each in found.problem.sessions)
    lost = found.lost + sum(each.lost for each in found.problem.sessions)
    lines = [
        f"{', '.join(session.name for session in sessions)}: {dwells} rests and "
        f"{table.n_units - dwells} half seconds in motion"
        + (f", {lost} lost beams left out" if lost else "")
    ]
    lines += [f"  {session.name}: {remark}" for session in sessions for remark in session.remarks]
    if not found.arrived:
        lines.append("the fit did not settle: read its numbers with doubt")
    return lines


def left_lines(found: Fit, judged_by: str) -> list[str]:
    """Tell how an error was judged, and how much more than noise is left."""
    lines = [f"judged {JUDGED_BY[judged_by]}"]
    if not found.rough:
        return [*lines, "what is left is no more than the noise"]
    above = " and ".join(
        f"{found.discrepancy[q.key]:.3g} {q.unit} of {q.name}"
        for q in found.problem.table.reported
        if found.discrepancy[q.key] > 0.0
    )
    return [*lines, f"left above the noise: {above}: {NOT_AT_THE_FLOOR}"]


def told_lines(
    parameters: Iterable[FittedParameter], all_of_them: bool = False, usual: bool = True
) -> list[str]:
    """Return the estimates that the data tell, or all of them, a line each.

    Parameters
    ----------
    parameters : iterable of FittedParameter
        Of a fit.
    all_of_them : bool
        Also those that the data do not tell.
    usual : bool
        Whether they have a usual size: those of a user's formula have none.
    """
    lines = []
    for each in parameters:
        if each.excited or all_of_them:
            notes = [tolerances(each)] if usual else []
            notes += ["on its bound"] if each.at_bound else []
            line = f"  {each.effect:30} {each.key:24}{plus_minus(each.value, each.sigma):>22}"
            lines.append(f"{line}   {', '.join(notes)}".rstrip())
    return lines


def far_lines(found: Fit, parameters: Iterable[FittedParameter]) -> list[str]:
    """Tell what went farther than usual, and what to look at on the machine."""
    checks = {
        each.effect.name: each.effect.law.check.replace("{place}", each.effect.component)
        for each in found.problem.free
    }
    return [
        f"  {each.effect} {each.key}: {tolerances(each)}; {checks[each.effect]}"
        for each in parameters
        if each.far
    ]


def untold_lines(found: Fit, parameters: Iterable[FittedParameter]) -> list[str]:
    """Tell what the data do not say, by what to record to see it."""
    needs = {each.effect.name: each.effect.law.excited_by for each in found.problem.free}
    # Several sessions may say the same of one parameter.
    untold: dict[str, dict[str, None]] = {}
    for each in parameters:
        if not each.excited:
            twin = f" (only together with {each.together[0]})" if each.together else ""
            untold.setdefault(each.effect, {})[f"{each.key}{twin}"] = None
    alike: dict[str, dict[tuple[str, str], list[str]]] = {}
    for effect, keys in untold.items():
        law, _, place = effect.partition("@")
        same = alike.setdefault(needs[effect], {})
        same.setdefault((law, ", ".join(keys)), []).append(place)
    lines = []
    for need, effects in alike.items():
        lines.append(f"  for these record {need}:")
        lines += [
            f"    {law}@{', '.join(places)}: {keys}" for (law, keys), places in effects.items()
        ]
    return lines


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


def fit_values(
    errors: Errors, judged_by: str, sessions: Iterable[MeasuredSession], found: Fit
) -> dict[str, Any]:
    """Return what programs read of any fit, with units in the names."""
    return {
        "schema": 2,
        **errors.as_values(("before", "after")),
        "judged_by": judged_by,
        "sessions": [
            {"name": session.name, "remarks": list(session.remarks)} for session in sessions
        ],
        "lost": found.lost,
        "settled": found.arrived,
    }


def plus_minus(value: float, sigma: float) -> str:
    """Return a value and its uncertainty with two digits of the latter."""
    digits = 3
    if np.isfinite(sigma) and sigma > 0.0:
        digits = min(max(1 - int(np.floor(np.log10(sigma))), 0), 9)
    return f"{round(value, digits) + 0.0:.{digits}f} +- {sigma:.{digits}f}"


def tolerances(parameter: FittedParameter) -> str:
    """Return how far a parameter went, in the words of a fitter."""
    text = f"{abs(parameter.moved):.1f} x its usual size"
    # The usual gap is where shims follow the axes; 11.5 ppm/K is steel.
    return f"{text} from {parameter.prior:.3g}" if parameter.prior else text
