"""What a fit tells a technician, in lines of text."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from typing import TYPE_CHECKING

import numpy as np

from wrist_stiffness.identification.held_out import ANOTHER_SESSION, THIS_SESSION
from wrist_stiffness.identification.result import FittedParameter
from wrist_stiffness.identification.wrist_fit import WristFit
from wrist_stiffness.inference.noise import at_most
from wrist_stiffness.model.joint_uncertainty import JointUncertainty
from wrist_stiffness.numerals import number, plus_minus
from wrist_stiffness.report.page import Table, title
from wrist_stiffness.sessions.measured_session import MeasuredSession
from wrist_stiffness.topics import MICROMETRES, MILLIDEGREES

if TYPE_CHECKING:
    from wrist_stiffness.commands.calibrate import Calibrated
    from wrist_stiffness.commands.extend import Extended

MOST_MOVED = 8
"""Parameters of the base that are told of, those that moved farthest."""

NOT_AT_THE_FLOOR = (
    "an effect is missing ('wrist-stiffness diagnose' finds out which), or the fit was caught "
    "where other flanges touch than on the wrist; then more poses and loads help"
)

JUDGED_BY = {
    THIS_SESSION: "on the end of the session, by a fit that has not seen it; valid for this "
    "session only",
    ANOTHER_SESSION: "on the last session, by a fit that has not seen it",
}


def calibration_lines(found: Calibrated) -> list[str]:
    """Return what a technician reads of a calibration."""
    result, parameters = found.calibration, found.calibration.parameters
    rows = {"model as it stands": result.before, "calibrated": result.after}
    lines = _judged_lines(found.sessions, result.fit, result.judged_by, rows)
    # Of a wrist that was not fitted nothing is known.
    lines += [] if result.refused else [uncertainty_line(result.fit.joint)]
    lines += [f"WARNING: {warning}" for warning in result.warnings]
    lines += [found.mistake] if found.mistake else []
    parts = {
        f"set up in {session.name}:": told_lines(p for p in parameters if p.session == session.name)
        for session in found.sessions
    }
    if not result.refused:
        parts["of this wrist:"] = told_lines(each for each in parameters if each.session is None)
    for heading, part in parts.items():
        lines += ["", heading, *(part or ["  nothing identifiable"])]
    checks = {
        each.effect.name: each.effect.law.check.replace("{place}", each.effect.component)
        for each in result.fit.problem.free
    }
    if far := [each for each in parameters if each.far]:
        lines += ["", "farther off than typical, to be checked on the machine:"]
        lines += [f"  {p.effect} {p.key}: {tolerances(p)}; {checks[p.effect]}" for p in far]
    if untold := untold_lines(result.fit, parameters):
        lines += ["", "not identifiable from these recordings:", *untold]
    if result.calibrated:
        lines += ["", f"not fitted, calibrated as the notes say: {', '.join(result.calibrated)}"]
    return lines


def uncertainty_line(joint: JointUncertainty) -> str:
    """Tell how well a fit knows where the platform is, for whom."""
    as_measured, in_f = (
        " and ".join(
            f"{number(factor * float(np.linalg.norm(own)), 2)} {unit}"
            for own, factor, unit in (
                (sigma[:3], MICROMETRES, "um"),
                (sigma[3:], MILLIDEGREES, "mdeg"),
            )
            if own.any()  # what was not measured has none
        )
        for sigma in (joint.measured, joint.platform)
    )
    return (
        f"uncertainty of predictions: {as_measured} for the instrument as it is set up here, "
        f"{in_f} in the wrist's own frame; place parts by this instrument"
    )


def extension_lines(found: Extended) -> list[str]:
    """Return what a technician reads of an extension."""
    result = found.extension
    effect = result.effect
    sentence = effect.law.sentence.format(place=effect.component)
    rows = {"without the effect": found.before, f"with {effect.name}": found.after}
    lines = _judged_lines(found.sessions, result.fit, result.judged_by, rows)
    lines += ["", f"{effect.name}: {sentence}"]
    usual = all(np.isfinite(parameter.scale) for parameter in effect.parameters)
    lines += told_lines(result.own, all_of_them=True, usual=usual)
    lines += [f"WARNING: {warning}" for warning in result.warnings]
    moved = [
        f"  {before.effect:30} {before.key:24}{plus_minus(before.value, before.sigma):>20} -> "
        f"{plus_minus(after.value, after.sigma)}"
        for before, after in result.base_moved[:MOST_MOVED]
    ]
    if not moved:
        return [*lines, "", "no other parameter changed by more than its uncertainty"]
    return [*lines, "", "other parameters that changed:", *moved]


def _judged_lines(
    sessions: Sequence[MeasuredSession],
    fit: WristFit,
    judged_by: str,
    rows: Mapping[str, Mapping[str, float]],
) -> list[str]:
    """Tell what a fit saw, its errors as a table, how they were judged, and how much is left."""
    unknown = at_most(fit.table.background.noise_known)
    cells = [
        [name, *(f"{row[key]:.3f}" if key in row else "-" for key in fit.noise)]
        for name, row in {**rows, f"noise and drift alone{unknown}": fit.noise}.items()
    ]
    table = Table("", ["", *map(title, fit.noise)], cells)
    *_, after = rows.values()
    judged = f"judged {JUDGED_BY[judged_by]}"
    return [
        *used_lines(sessions, fit),
        "",
        *table.lines(),
        judged,
        left_line(fit, after, len(sessions)),
    ]


def left_line(fit: WristFit, after: Mapping[str, float], sessions: int) -> str:
    """Tell what a fit to so many sessions leaves; `after`: its error on data not seen, RMS."""
    where = f"in the fit to {'the whole session' if sessions == 1 else 'all sessions'}"
    if not fit.rough:
        return f"{where} no more than the noise remains"
    above = " and ".join(
        q.told(fit.discrepancy[q.key])
        for q in fit.problem.table.reported
        if fit.discrepancy[q.key] > 0.0
    )
    unseen_is_noise = all(after[key] <= size for key, size in fit.noise.items())
    why = "the unseen part shows none of it" if unseen_is_noise else NOT_AT_THE_FLOOR
    return f"{where} {above} remain above the noise: {why}"


def used_lines(sessions: Sequence[MeasuredSession], found: WristFit) -> list[str]:
    """Tell what the fit saw, and what of the recordings could not be used."""
    table = found.problem.table
    dwells = sum(int((each.cut.dwell & each.measured).sum()) for each in found.problem.sessions)
    lost = found.lost + sum(each.lost for each in found.problem.sessions)
    lines = [
        f"{', '.join(session.name for session in sessions)}: {dwells} dwells and "
        f"{table.n_units - dwells} half seconds in motion"
        + (f", {lost} lost beams left out" if lost else "")
    ]
    lines += [f"  {session.name}: {remark}" for session in sessions for remark in session.remarks]
    if not found.arrived:
        lines.append(
            f"the fit ended {found.off:.1f} standard uncertainties short of its best values: a "
            "contact opens or closes there"
        )
    return lines


def told_lines(
    parameters: Iterable[FittedParameter], all_of_them: bool = False, usual: bool = True
) -> list[str]:
    """Return the estimates that the data tell, or all of them, a line each.

    `all_of_them`: also those that the data do not tell; `usual`: whether they have a typical
    magnitude: those of a user's formula have none.
    """
    lines = []
    for each in parameters:
        if each.excited or all_of_them:
            notes = [tolerances(each)] if usual else []
            notes += ["on its bound"] if each.at_bound else []
            line = f"  {each.effect:30} {each.key:24}{plus_minus(each.value, each.sigma):>22}"
            lines.append(f"{line}   {', '.join(notes)}".rstrip())
    return lines


def untold_lines(found: WristFit, parameters: Iterable[FittedParameter]) -> list[str]:
    """Tell in short what the data do not say, or not all of, by what to record to see it."""
    needs = {each.effect.name: each.effect.law.excited_by for each in found.problem.free}
    # Several sessions, and several parameters of an effect, may say the same.
    untold = dict.fromkeys(each.effect for each in parameters if not each.excited)
    alike: dict[str, dict[str, list[str]]] = {}
    for effect in untold:
        law = effect.partition("@")[0]
        alike.setdefault(needs[effect], {}).setdefault(law, []).append(effect)
    lines = []
    for need, laws in alike.items():
        names = (
            effects[0] if len(effects) == 1 else f"{law} ({len(effects)} places)"
            for law, effects in laws.items()
        )
        lines.append(f"  {', '.join(names)}: record {need}")
    if lines:
        lines.append("  which parameters, and which only in combination: --json")
    return lines


def tolerances(parameter: FittedParameter) -> str:
    """Return how far a parameter went, in the words of a fitter."""
    text = f"{abs(parameter.moved):.1f} x the typical magnitude"
    # The usual gap is where shims follow the axes; 11.5 ppm/K is steel.
    return f"{text} from {parameter.prior:.3g}" if parameter.prior else text
