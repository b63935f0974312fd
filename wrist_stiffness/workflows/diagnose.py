"""Which physical effect is missing, from recordings to an answer."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from wrist_stiffness.campaign.comparing.compare import suspicion_in
from wrist_stiffness.campaign.comparing.wiring import WORTH_ASKING, told_mistake
from wrist_stiffness.campaign.comparing.wrong_load import wrong_load
from wrist_stiffness.campaign.fitting.free_effects import unfitted
from wrist_stiffness.campaign.measured_session import MeasuredSession
from wrist_stiffness.campaign.refitted import ANSWERS_LOAD
from wrist_stiffness.campaign.searching.contributions import Contribution, worth_hearing
from wrist_stiffness.campaign.searching.diagnose import WristDiagnosis, diagnose_sessions
from wrist_stiffness.campaign.searching.taken_up import TakenUp
from wrist_stiffness.diagnosis import Diagnosis, Finding
from wrist_stiffness.model.error_model import ErrorModel
from wrist_stiffness.model.model_file import file_sha256, load_model
from wrist_stiffness.progress import Progress, silent
from wrist_stiffness.workflows.compare import remarks_of
from wrist_stiffness.workflows.fit_report import TITLES, plus_minus
from wrist_stiffness.workflows.provenance import Provenance, Run
from wrist_stiffness.workflows.read_sessions import (
    Recordings,
    read_sessions,
    sha256_by_name,
    was_fitted_to,
)
from wrist_stiffness.workflows.verdict import (
    PROVEN,
    class_of,
    conditions_in_words,
    correction_of,
    unexplained_share,
    verdict_lines,
)

if TYPE_CHECKING:
    from wrist_stiffness.workflows.report.page import Page


SEED = 0
"""Of what chance gives: the same recordings give the same answer."""

USUAL = 1.0
"""Standard deviations of its prior within which a tolerance needs no line of its own."""

FAR_FROM_DRAWN = 3.0
"""Standard deviations of its prior at which a part is softer or stiffer than any is built."""


@dataclass(frozen=True, eq=False)
class Diagnosed:
    """A diagnosis and what it was made from.

    Parameters
    ----------
    answer : WristDiagnosis
        What was found.
    recordings : tuple of str
        Names of the sessions.
    mistake : str
        Of signs, units or names, where one explains most of the error; else empty.
    remarks : tuple of str
        What could not be used of the recordings.
    provenance : Provenance
        Files and versions.
    """

    answer: WristDiagnosis
    recordings: tuple[str, ...]
    mistake: str
    remarks: tuple[str, ...]
    provenance: Provenance

    @property
    def result(self) -> Diagnosis:
        """What the statistics say."""
        return self.answer.diagnosis

    def lines(self) -> list[str]:
        """Return the answer for a terminal, the verdict first."""
        result = self.result
        out = [*([self.mistake, ""] if self.mistake else []), *verdict_lines(result), ""]
        out += _table(result)
        for place, finding in enumerate(result.findings, 1):
            out += ["", *_finding_lines(place, finding)]
        unknown = result.verdict == "unknown"
        out += adding_lines(worth_hearing(self.answer.contributions, unknown, result.after))
        if result.unexplained.evidence:
            out += ["", f"not explained: {unexplained_share(result)}"]
            out.append(f"  {result.unexplained.evidence}")
            if result.unexplained.depends_on:
                out.append(f"  it depends on {conditions_in_words(result.unexplained.depends_on)}")
        if result.not_excited:
            out += ["", "these recordings cannot show:"]
            out += [f"  {names}: {needs}" for needs, names in _needs(result).items()]
        out += ["", "taken up first, by the refit of the set-up and the wrist's tolerances:"]
        out += taken_up_lines(self.answer.absorbed)
        out.append(f"held-out errors are valid for {result.scope}")
        if result.lost_units:
            out.append(f"note: units left out as lost beams: {result.lost_units}")
        return [*out, *(f"note: {remark}" for remark in self.remarks)]

    def as_values(self) -> dict[str, Any]:
        """Return what programs read, with units in the names."""
        return {
            **self.result.as_json(),
            "contributions": [
                {"effect": c.effect, "component": c.component, "kind": c.kind}
                | {key: list(size) for key, size in c.sizes.items()}
                for c in self.answer.contributions
            ],
            "set_up_mistake": self.mistake,
            "notes": list(self.remarks),
            "provenance": self.provenance.as_values(),
        }

    def report(self) -> Page:
        """Return the report with pictures."""
        from wrist_stiffness.workflows.report.diagnosis_report import (
            report_of_diagnosis,
            shown_by,
        )

        observed, result = self.answer.observed.observations, self.result
        explained = self.answer.base.residual if result.findings else None
        shown = shown_by(observed, np.random.default_rng(SEED), explained)
        return report_of_diagnosis(
            result,
            self.answer.contributions,
            shown,
            self.recordings,
            self.mistake,
            self.remarks,
            self.provenance,
        )


def diagnose_recordings(
    model: str | Path,
    recordings: Recordings,
    run: Run,
    progress: Callable[[str], Progress] = lambda label: silent,
    tell: Callable[[str], None] = lambda text: None,
) -> Diagnosed:
    """Find the effects that a model misses in recordings of one wrist.

    Parameters
    ----------
    model : path
        Model file.
    recordings : Recordings
        Each a session; the last one judges what the others show.
    run : Run
        For the report.
    progress : callable
        From a label to a function that is told steps done and in all.
    tell : callable
        Told what is being done.

    Returns
    -------
    Diagnosed
        Verdict, findings and what remains open.

    Raises
    ------
    WristError
        If the model or a recording cannot be used.
    """
    loaded = load_model(model)
    sessions = read_sessions(recordings, [loaded], progress("reading"))
    known = unfitted(loaded) if was_fitted_to(loaded, sessions) else loaded
    rng = np.random.default_rng(SEED)
    answer = diagnose_sessions(known, list(sessions.values()), rng, tell=tell)
    mistake = mistake_beside(known, answer, list(sessions.values()), rng, tell)
    hashes = sha256_by_name(sessions)
    return Diagnosed(
        answer,
        tuple(hashes),
        mistake,
        remarks_of(sessions.values()),
        Provenance(run.command, run.date, {Path(model).stem: file_sha256(model)}, hashes),
    )


def mistake_beside(
    known: ErrorModel,
    answer: WristDiagnosis,
    sessions: Sequence[MeasuredSession],
    rng: np.random.Generator,
    tell: Callable[[str], None] = lambda text: None,
) -> str:
    """Return the mistake of signs, units or names that an answer makes likely; empty for none.

    Parameters
    ----------
    known : ErrorModel
        What the diagnosis began with.
    answer : WristDiagnosis
        What was found.
    sessions : sequence of MeasuredSession
        In which.
    rng : numpy.random.Generator
        For the noise floor.
    tell : callable, optional
        Told what is being done.
    """
    mistake = ""
    if _leaves_much(answer.diagnosis):
        tell("asking for wrong signs, units and names")
        mistake = told_mistake(suspicion_in(known, sessions, rng))
    if not mistake and _doubts_load(answer):
        # Axes that are off their drawing hide a wrong load, and so do parts that it made as stiff
        # as they can be: so it is asked with the axes as fitted and the stiffness of before.
        tell("asking for a wrong load")
        fitted = known.with_effects(*answer.base.effects(0))
        mistake = wrong_load(known, fitted, sessions, rng)
    return mistake


def _leaves_much(result: Diagnosis) -> bool:
    """Tell whether so much is left that a mistake of the set-up is looked for."""
    floor = result.noise_floor
    return any(error > WORTH_ASKING * floor[key] for key, error in result.after.items())


def _doubts_load(answer: WristDiagnosis) -> bool:
    """Tell whether the wrist answers loads so unusually that these may be wrong."""
    named = {law for finding in answer.diagnosis.findings for law, _ in finding.members}
    far = {
        each.name.partition("@")[0] for each in answer.absorbed if each.deviations > FAR_FROM_DRAWN
    }
    return not ANSWERS_LOAD.isdisjoint(named | far)


def _table(result: Diagnosis) -> list[str]:
    rows = (
        ("set-up refitted", result.before),
        ("with the findings", result.after),
        ("noise floor", result.noise_floor),
    )
    out = [f"{'RMS on the part put aside':28}" + "".join(f"{TITLES[k]:>12}" for k in result.before)]
    return out + [f"  {name:26}" + "".join(f"{row[k]:12.3g}" for k in row) for name, row in rows]


def _finding_lines(place: int, finding: Finding) -> list[str]:
    out = [f"{place}. {class_of(finding)}", f"   {finding.evidence}"]
    out += [
        f"   {name} = {plus_minus(value, error)}"
        for name, (value, error) in finding.parameters.items()
    ]
    if finding.check:
        out.append(f"   to be sure: {finding.check}")
    out.append(f"   brings {_sizes(finding.buys)}; {correction_of(finding)}")
    out.append(
        f"   p = {finding.p_value:.2g}, {100.0 * finding.stability:.0f} % of resamples agree, "
        f"evidence (2 ln Bayes factor) {finding.delta_bic:.3g}"
    )
    return out


def adding_lines(parts: Sequence[Contribution]) -> list[str]:
    """Return how much parts of a wrist add to its error, a line each; nothing without any.

    Parameters
    ----------
    parts : sequence of Contribution
        Findings, suspects and what is possible, largest first.
    """
    if not parts:
        return []
    out = ["", "what adds most to the error, RMS beyond what a new set-up would take up:"]
    out += [f"  {each.name}: {_sizes(each.sizes)} ({PROVEN[each.kind]})" for each in parts]
    return out


def _sizes(sizes: Mapping[str, tuple[float, float]]) -> str:
    """Return sizes with their uncertainties, by keys such as `s_um`."""
    parts = []
    for key, (size, error) in sizes.items():
        name, _, unit = key.rpartition("_")
        parts.append(f"{name} {plus_minus(size, error)} {unit}")
    return ", ".join(parts)


def taken_up_lines(absorbed: Sequence[TakenUp]) -> list[str]:
    """Return set-up and what left its usual range a line each, all the rest in one."""
    within = [each for each in absorbed if each.parameter and each.deviations <= USUAL]
    out = [f"  {each.sentence}" for each in absorbed if each not in within]
    if within:
        names = ", ".join(each.name for each in within)
        out.append(f"  within {USUAL:g} standard deviation of their tolerances: {names}")
    return out


def _needs(result: Diagnosis) -> dict[str, str]:
    """Return what effects need to be recorded, by what it is."""
    needs: dict[str, list[str]] = {}
    for each in result.not_excited:
        needs.setdefault(each.needs, []).append(f"{each.effect}@{each.component}")
    return {need: ", ".join(names) for need, names in needs.items()}
