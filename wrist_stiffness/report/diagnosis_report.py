"""What `diagnose` tells, on a terminal and as a page; the verdict is that of the workbench too."""

from __future__ import annotations

from collections import Counter
from collections.abc import Callable, Sequence
from math import nan
from typing import TYPE_CHECKING

from wrist_stiffness.comparing.explained import Explained
from wrist_stiffness.comparing.sentences import sentences
from wrist_stiffness.inference import Diagnosis, Finding
from wrist_stiffness.inference.answer import NotExcited, Standing
from wrist_stiffness.inference.noise import at_most
from wrist_stiffness.inference.search import TIME_OVER
from wrist_stiffness.model.registry import find_law
from wrist_stiffness.numerals import number, percent, plus_minus
from wrist_stiffness.report.absorbed import absorbed_lines, absorbed_table
from wrist_stiffness.report.page import (
    Bullets,
    Command,
    Page,
    Part,
    Picture,
    Sections,
    Table,
    drawn,
    lines_of,
    provenance_section,
    title,
)
from wrist_stiffness.report.pictures.errors import Bars, draw_against, draw_bars
from wrist_stiffness.sessions.observing import without_mounting

if TYPE_CHECKING:
    from wrist_stiffness.commands.diagnose import Diagnosed

MOST_PICTURED = 4
"""Conditions that are drawn."""

MOST_RANKED = 12
"""Candidates that are told."""

MOST_PROMISING = 3


HOW = (
    "Registrations, encoder zeros, load tare and the tolerances of the wrist were fitted first; an "
    "effect counts only for what it explains beyond them.",
    "Every set of effects was fitted whole and judged by its evidence: how probable the recordings "
    "are under it, with all values integrated over their priors. The probabilities follow from it.",
    "Beside the effects stands a discrepancy without a name, a smooth law of the conditions. What "
    "it explains is left above noise and drift.",
    "Held-out errors are those of another session where there is one, else of the end of the only "
    "one, by models whose values were fitted to the rest.",
    "Effects in one class cannot be told apart by these recordings.",
)


def diagnosis_lines(found: Diagnosed) -> list[str]:
    """Return the answer for a terminal, the verdict first."""
    result = found.result
    sections: Sections = {
        **_sections(result, _unseen_in_short),
        "Absorbed by calibration, largest first": [Bullets(absorbed_lines(found.answer.absorbed))],
        "To be kept in mind": [Bullets(found.remarks)] if found.remarks else [],
    }
    mistake = [found.mistake, ""] if found.mistake else []
    return [*mistake, *verdict_lines(result), *found.proposed(), *lines_of(sections)]


def report_of_diagnosis(found: Diagnosed) -> Page:
    """Return the report of a diagnosis."""
    result, left = found.result, found.depends()
    verdict = [*([found.mistake] if found.mistake else []), *verdict_lines(result)]
    if result.findings:
        falls = [
            f"{_name(key)} from {number(before)} to {number(result.after[key])} {_unit(key)} "
            f"({_noise(result)} {number(result.noise_of_judge[key])})"
            for key, before in result.before.items()
        ]
        verdict.append(f"Adding it changes the held-out error of {' and '.join(falls)}, RMS.")
    sections = _sections(result, _unseen)
    if result.findings:
        sections["How large the error is"].append(_fall(result))
    laws = [line.strip() for line in found.proposed()]
    remains: list[Part] = [*(rest_lines(result) or ["Nothing beyond the noise."])]
    remains += [Command(line) if line.startswith("wrist-stiffness ") else line for line in laws]
    taken = found.answer.absorbed
    absorbed: list[Part] = [absorbed_table(taken, result.noise)] if taken else []
    if found.remarks:
        absorbed += ["To be kept in mind:", Bullets(found.remarks)]
    whole: Sections = {
        **sections,
        "Where it shows": _depends(found, left),
        "What remains": remains,
        "Absorbed by calibration": absorbed,
        "How it was computed": [Bullets(HOW)],
        **provenance_section(found.provenance),
    }
    # Where nothing of the catalogue fits, what does comes first.
    first: Sections = {} if result.findings else {"What remains": remains}
    return Page(
        "Which physical effect is missing?",
        f"{', '.join(found.recordings)}: {left.observations.n_units} dwells and half seconds in "
        "motion",
        verdict,
        {**first, **whole},
    )


def _sections(
    result: Diagnosis, unseen: Callable[[Sequence[NotExcited]], Part]
) -> dict[str, list[Part]]:
    """Return what both tell; `unseen`: of effects that could hide."""
    findings: list[Part] = []
    for place, finding in enumerate(result.findings, 1):
        findings.append(f"{place}. {class_of(finding)}. {finding.evidence}")
        findings += [f"To be sure: {finding.check}."] if finding.check else []
        findings.append(_numbers(finding))
    findings_in = [("with the findings (held out)", result.after)] if result.findings else []
    rows = (
        ("calibrated model (held out)", result.before),
        *findings_in,
        (f"{_noise(result)}, without drift", result.noise_of_judge),
        ("left above noise and drift (all data)", result.discrepancy),
    )
    keys = {**result.noise, **result.before}
    table = Table(
        f"RMS. Held out: {result.scope}; these rows hold the instrument's drift too.",
        ["", *map(title, keys)],
        [[name, *(number(row.get(key, nan)) for key in keys)] for name, row in rows],
    )
    return {
        "Findings": findings or ["No effect of the catalogue was found."],
        "How large the error is": [table],
        "Every candidate": [_ranking(result)],
        "What these recordings cannot show": [
            unseen(result.not_excited)
            if result.not_excited
            else "Every effect of the catalogue would have shown."
        ],
    }


def _unseen(effects: Sequence[NotExcited]) -> Bullets:
    needs: dict[str, list[str]] = {}
    for each in effects:
        needs.setdefault(each.needs, []).append(f"{each.effect}@{each.component}")
    return Bullets([f"{', '.join(names)}: {need}" for need, names in needs.items()])


def _unseen_in_short(effects: Sequence[NotExcited]) -> str:
    laws = Counter(each.effect for each in effects)
    names = ", ".join(f"{law} ({n} places)" if n > 1 else law for law, n in laws.items())
    return f"{names}. What to record for each: --report or --json."


def _noise(result: Diagnosis) -> str:
    return f"instrument noise{at_most(result.noise_known)}"


def _name(key: str) -> str:
    return key.rpartition("_")[0]


def _unit(key: str) -> str:
    return key.rpartition("_")[2]


def _numbers(finding: Finding) -> Table:
    rows = [(name, plus_minus(*each)) for name, each in finding.parameters.items()]
    rows += [
        (f"held-out error of {_name(key)} falls by", f"{plus_minus(*gain)} {_unit(key)}")
        for key, gain in finding.buys.items()
    ]
    rows += [
        ("probability", percent(finding.probability)),
        ("log evidence against the model without it", f"{finding.log_gain:+.0f}"),
        ("correction", correction_of(finding)),
    ]
    return Table(f"Numbers of {finding.name}.", ("", "value"), rows)


def _fall(result: Diagnosis) -> Picture:
    bars = [
        Bars(
            title(key),
            ["before", "with the findings"],
            [before, result.after[key]],
            [0.0, 0.0],
            {_noise(result): result.noise_of_judge[key]},
        )
        for key, before in result.before.items()
    ]
    caption = (
        f"Error on the held-out part ({result.scope}), before and with the findings in the model."
    )
    return drawn(draw_bars(bars), caption)


def _ranking(result: Diagnosis) -> Table:
    """Return how the leading candidates stand."""
    rows = [
        (each.name, chance_of(each), f"{each.log_gain:+.0f}", each.why_not or "named")
        for each in result.standings[:MOST_RANKED]
    ]
    caption = "How the leading candidates stand; log evidence against the calibrated model."
    return Table(caption, ("effect", "probability", "log evidence", ""), rows)


def chance_of(standing: Standing) -> str:
    """Return the probability of a candidate; a dash where the search ended before its fit."""
    return "-" if standing.probability is None else percent(standing.probability)


def _depends(found: Diagnosed, left: Explained) -> list[Part]:
    told = Bullets(sentences(left))
    if not left.told:
        return [told]
    series = []
    if found.result.findings:
        table = left.observations
        after = without_mounting(table, found.answer.fitted.residual)
        series.append(("with the findings", table.with_values(after)))
    caption = (
        "What the refitted base leaves against the conditions that show it best, everything else "
        "that was found taken out: every dwell and half second in motion, and the fitted law with "
        "its 95 % band."
    )
    return [told, drawn(draw_against(left.told[:MOST_PICTURED], series), caption)]


def verdict_lines(result: Diagnosis) -> list[str]:
    """Return the verdict in one or two sentences."""
    unforeseen = [_unforeseen(result)] if result.unforeseen else []
    if result.verdict in ("none", "undecided"):
        sure = percent(result.probability)
        decided = f"Nothing is missing: what is left is noise ({sure} sure)."
        if result.verdict == "undecided":
            decided = f"Not decided: what is left may be noise ({sure}) or an effect listed below."
        return [decided, *unforeseen, *([] if result.complete else [_unfinished(result)])]
    found = "; ".join(f"{class_of(e)}, {percent(e.probability)} sure" for e in result.findings)
    lines = [f"Missing in the model: {found}."] if found else []
    if not result.complete:
        lines.append(_unfinished(result))
    elif result.verdict == "unknown" and not result.contradicted:
        if result.depends_on:
            lines.append("The error is real, but no effect in the catalogue explains it.")
        else:
            lines.append("An effect is missing, but these recordings do not say which.")
    return [*lines, *unforeseen, *rest_lines(result)]


def _unfinished(result: Diagnosis) -> str:
    text = f"{result.ended.capitalize()} before every candidate was fitted"
    if result.promising:
        text += f"; most promising: {', '.join(e.name for e in result.promising[:MOST_PROMISING])}"
    return f"{text}. Allow more --seconds." if result.ended == TIME_OVER else f"{text}."


def _unforeseen(result: Diagnosis) -> str:
    errors = " and ".join(
        f"{_name(key)} is off by {number(result.after[key])} {_unit(key)} ({over:.1f} times noise "
        "and drift)"
        for key, over in result.unforeseen.items()
    )
    why = (
        "No fit to all of them explains it: it may not be the same wrist, or not in the same state"
        if result.contradicted
        else "A fit to all of them does: the others show too little of the wrist. Calibrate with "
        "all of them"
    )
    return f"In {result.scope} {errors}, though the others are explained. {why}."


def rest_lines(result: Diagnosis) -> list[str]:
    """Return how much is left, and on what it depends; nothing where it is noise."""
    if not result.depends_on:
        return []
    left = ", ".join(
        f"{_name(key)} {number(size, 2)} {_unit(key)}" for key, size in result.discrepancy.items()
    )
    causes = ", ".join(f"{name} ({percent(part)})" for name, part in result.depends_on.items())
    return [f"Left above the noise: {left}. It depends on {causes}."]


def class_of(finding: Finding) -> str:
    """Return the best effect of a class, and those that the data cannot tell from it."""
    first, *others = finding.members
    if not others:
        return finding.name
    told = ", ".join(f"{effect}@{place} {percent(share)}" for effect, place, share in others)
    return f"{finding.name} ({percent(first[2])}; or {told})"


def correction_of(finding: Finding) -> str:
    """Return what the nodes can do about a finding."""
    if finding.compensable == "yes":
        return "the nodes can correct it"
    if finding.compensable == "needs_signal":
        return "the nodes can correct it where they get its signal"
    law, place, _ = finding.members[0]
    if find_law(law).of_measurement(place):
        return "it is in the instrument, so nothing is to be corrected"
    return "it shifts the platform and does not turn it, so only the manipulator can correct it"
