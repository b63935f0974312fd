"""The report of `diagnose`."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING

from wrist_stiffness.comparing.explained import Explained
from wrist_stiffness.comparing.sentences import percent, sentences
from wrist_stiffness.inference import Diagnosis, Finding, Quantity
from wrist_stiffness.report.diagnosis_lines import (
    class_of,
    correction_of,
    needs_of,
    rest_lines,
    verdict_lines,
)
from wrist_stiffness.report.page import Bullets, Page, Part, Section, Table, Text, drawn
from wrist_stiffness.report.parts import number, plus_minus, provenance_section, typeset, unit_of
from wrist_stiffness.report.pictures.dependence import draw_against
from wrist_stiffness.report.pictures.errors import Bars, draw_bars

if TYPE_CHECKING:
    from wrist_stiffness.commands.diagnose import Diagnosed

MOST_PICTURED = 4
"""Conditions that are drawn."""

MOST_RANKED = 12
"""Candidates that are told."""


HOW = (
    "Registrations, encoder zeros, load tare and the tolerances of the wrist were fitted first; an "
    "effect counts only for what it explains beyond them.",
    "Every set of effects was fitted whole and judged by its evidence: how probable the recordings "
    "are under it, with all values integrated over their priors. The probabilities follow from it.",
    "Beside the effects stands a discrepancy without a name, a smooth law of the conditions. What "
    "it explains is left above the noise.",
    "Held-out errors are those of another session where there is one, else of the end of the only "
    "one, by models whose values were fitted to the rest.",
    "Effects in one class cannot be told apart by these recordings.",
)


def report_of_diagnosis(found: Diagnosed) -> Page:
    """Return the report of a diagnosis."""
    result, left = found.result, found.depends()
    quantities, units = left.observations.reported, left.observations.n_units
    sections = [
        Section("Findings", tuple(_findings(result, quantities))),
        Section("How much it brings", _fall(result, quantities)),
        Section("Every candidate", _ranking(result)),
        Section("Where it shows", _depends(found, left)),
        Section("What remains", _remains(result, found.proposed())),
        Section("What these recordings cannot show", _not_excited(result)),
        Section("Absorbed by calibration", _absorbed(result, found.remarks)),
        Section("How it was computed", (Bullets(HOW),)),
        provenance_section(found.provenance),
    ]
    return Page(
        "Which physical effect is missing?",
        f"{', '.join(found.recordings)}: {units} dwells and half seconds in motion",
        (*([found.mistake] if found.mistake else []), *_verdict(result, quantities)),
        tuple(sections),
    )


def _verdict(result: Diagnosis, quantities: tuple[Quantity, ...]) -> tuple[str, ...]:
    """Return the answer in a few sentences."""
    lines = verdict_lines(result)
    if result.findings:
        falls = [
            f"{q.name} from {number(result.before[q.key])} to {number(result.after[q.key])} "
            f"{unit_of(q.unit)} (instrument noise {number(result.noise[q.key])})"
            for q in quantities
        ]
        lines.append(f"Adding it changes the held-out error of {' and '.join(falls)}, RMS.")
    return tuple(typeset(line) for line in lines)


def _findings(result: Diagnosis, quantities: tuple[Quantity, ...]) -> list[Part]:
    if not result.findings:
        return [Text("No effect of the catalogue was found.")]
    parts: list[Part] = []
    for place, finding in enumerate(result.findings, 1):
        parts.append(Text(f"{place}. {class_of(finding)}. {typeset(finding.evidence)}"))
        if finding.check:
            parts.append(Text(f"To be sure: {finding.check}."))
        parts.append(_numbers(finding, quantities))
    return parts


def _numbers(finding: Finding, quantities: tuple[Quantity, ...]) -> Table:
    rows = [
        (name, typeset(plus_minus(value, error)))
        for name, (value, error) in finding.parameters.items()
    ]
    for q in quantities:
        if q.key in finding.buys:
            gain, error = finding.buys[q.key]
            rows.append(
                (
                    f"held-out error of {q.name} falls by",
                    typeset(f"{plus_minus(gain, error)} {unit_of(q.unit)}"),
                )
            )
    rows += [
        ("probability", percent(finding.probability)),
        ("log evidence against the model without it", f"{finding.log_gain:+.0f}"),
        ("correction", correction_of(finding)),
    ]
    return Table(f"Numbers of {finding.name}.", ("", "value"), tuple(rows))


def _fall(result: Diagnosis, quantities: tuple[Quantity, ...]) -> tuple[Part, ...]:
    bars = [
        Bars(
            f"{q.name} [{unit_of(q.unit)}]",
            ["before", "with the findings"],
            [result.before[q.key], result.after[q.key]],
            [0.0, 0.0],
            {"instrument noise": result.noise[q.key]},
        )
        for q in quantities
    ]
    caption = (
        f"Error on the held-out part ({result.scope}), before and with the findings in the model."
    )
    return (drawn(draw_bars(bars), caption),)


def _ranking(result: Diagnosis) -> tuple[Part, ...]:
    """Return how the leading candidates stand."""
    rows = tuple(
        (each.name, percent(each.probability), f"{each.log_gain:+.0f}", each.why_not or "named")
        for each in result.standings[:MOST_RANKED]
    )
    caption = "How the leading candidates stand; log evidence against the calibrated model."
    return (Table(caption, ("effect", "probability", "log evidence", ""), rows),)


def _depends(found: Diagnosed, left: Explained) -> tuple[Part, ...]:
    parts: list[Part] = [Bullets(tuple(typeset(line) for line in sentences(left)))]
    if not left.told:
        return tuple(parts)
    series = []
    if found.result.findings:
        after = left.observations.with_values(found.answer.fitted.residual)
        series.append(("with the findings", after))
    parts.append(
        drawn(
            draw_against(left.told[:MOST_PICTURED], series),
            "What the refitted base leaves against the conditions that show it best, everything "
            "else that was found taken out: every dwell and half second in motion, and the fitted "
            "law with its 95 % band.",
        )
    )
    return tuple(parts)


def _remains(result: Diagnosis, proposed: Sequence[str]) -> tuple[Part, ...]:
    lines = [*(rest_lines(result) or ["Nothing beyond the noise."]), *proposed]
    return tuple(Text(typeset(line)) for line in lines)


def _not_excited(result: Diagnosis) -> tuple[Part, ...]:
    if not result.not_excited:
        return (Text("Every effect of the catalogue would have shown."),)
    rows = tuple((", ".join(names), need) for need, names in needs_of(result).items())
    return (Table("To be recorded if one of these is suspected.", ("effects", "needs"), rows),)


def _absorbed(result: Diagnosis, notes: Sequence[str]) -> tuple[Part, ...]:
    parts: list[Part] = [Bullets(tuple(typeset(line) for line in result.absorbed))]
    if notes:
        parts += [Text("To be kept in mind:"), Bullets(tuple(notes))]
    return tuple(parts)
