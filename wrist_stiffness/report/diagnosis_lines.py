"""A diagnosis in words; the verdict is the same on the terminal and on the page."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING

from wrist_stiffness.comparing.sentences import percent
from wrist_stiffness.identification.taken_up import TakenUp
from wrist_stiffness.inference import Diagnosis, Finding
from wrist_stiffness.inference.answer import AS_MUCH
from wrist_stiffness.model.registry import find_law
from wrist_stiffness.report.parts import TITLES, plus_minus

if TYPE_CHECKING:
    from wrist_stiffness.commands.diagnose import Diagnosed

USUAL = 1.0
"""Standard deviations of its prior within which a tolerance needs no line of its own."""

MOST_PROMISING = 3


def diagnosis_lines(found: Diagnosed) -> list[str]:
    """Return the answer for a terminal, the verdict first."""
    result = found.result
    out = [*([found.mistake, ""] if found.mistake else []), *verdict_lines(result)]
    out += [*found.proposed(), "", *_table(result)]
    for place, finding in enumerate(result.findings, 1):
        out += ["", *_finding_lines(f"{place}. ", finding)]
    if alike := [each.name for each in result.standings if each.why_not == AS_MUCH]:
        out += ["", f"would explain as much, with less usual values: {', '.join(alike)}"]
    if result.suspects:
        why = {each.name: each.why_not for each in result.standings}
        out += ["", "not named:"]
        out += [
            f"  {class_of(e)}, {percent(e.probability)} sure: {why[e.name]}"
            for e in result.suspects
        ]
    if result.not_excited:
        out += ["", "these recordings cannot show:"]
        out += [f"  {', '.join(names)}: {needs}" for needs, names in needs_of(result).items()]
    out += ["", "absorbed by calibration, largest first:", *absorbed_lines(found.answer.absorbed)]
    out.append(f"held out was {result.scope}")
    return [*out, *(f"note: {remark}" for remark in found.remarks)]


def verdict_lines(result: Diagnosis) -> list[str]:
    """Return the verdict in one or two sentences."""
    if result.verdict == "none":
        return [f"Nothing is missing: what is left is noise ({percent(result.probability)} sure)."]
    found = "; ".join(f"{class_of(e)}, {percent(e.probability)} sure" for e in result.findings)
    lines = [f"Missing in the model: {found}."] if found else []
    if not result.complete:
        lines.append(_unfinished(result))
    elif result.verdict == "unknown":
        if result.depends_on:
            lines.append("The error is real, but no effect in the catalogue explains it.")
        else:
            lines.append("An effect is missing, but these recordings do not say which.")
    return [*lines, *rest_lines(result)]


def _unfinished(result: Diagnosis) -> str:
    text = "The time was over before every candidate was fitted"
    if result.promising:
        text += f"; most promising: {', '.join(e.name for e in result.promising[:MOST_PROMISING])}"
    return f"{text}. Allow more --seconds."


def rest_lines(result: Diagnosis) -> list[str]:
    """Return how much is left, and on what it depends; nothing where it is noise."""
    if not result.depends_on:
        return []
    left = ", ".join(
        f"{key.rpartition('_')[0]} {size:.2g} {key.rpartition('_')[2]}"
        for key, size in result.discrepancy.items()
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


def _table(result: Diagnosis) -> list[str]:
    rows = (
        ("calibrated model", result.before),
        ("with the findings", result.after),
        ("instrument noise", result.noise),
        ("left above the noise", result.discrepancy),
    )
    out = [
        f"{'RMS, the first two held out':28}" + "".join(f"{TITLES[k]:>12}" for k in result.before)
    ]
    return out + [f"  {name:26}" + "".join(f"{row[k]:12.3g}" for k in row) for name, row in rows]


def _finding_lines(place: str, finding: Finding) -> list[str]:
    out = [f"{place}{class_of(finding)}", f"   {finding.evidence}"]
    out += [
        f"   {name} = {plus_minus(value, error)}"
        for name, (value, error) in finding.parameters.items()
    ]
    if finding.check:
        out.append(f"   to be sure: {finding.check}")
    out.append(f"   reduces the held-out error by {_sizes(finding.buys)}; {correction_of(finding)}")
    out.append(
        f"   {percent(finding.probability)} sure; log evidence {finding.log_gain:+.0f} "
        "against the model without it"
    )
    return out


def _sizes(sizes: Mapping[str, tuple[float, float]]) -> str:
    """Return sizes with their uncertainties, by keys such as `s_um`."""
    parts = []
    for key, (size, error) in sizes.items():
        name, _, unit = key.rpartition("_")
        parts.append(f"{name} {plus_minus(size, error)} {unit}")
    return ", ".join(parts)


def absorbed_lines(absorbed: Sequence[TakenUp]) -> list[str]:
    """Return set-up and what left its usual range a line each, all the rest in one."""
    within = [each for each in absorbed if each.parameter and each.deviations <= USUAL]
    out = [f"  {each.sentence}" for each in absorbed if each not in within]
    if within:
        names = ", ".join(each.name for each in within)
        out.append(f"  within {USUAL:g} standard deviation of their tolerances: {names}")
    return out


def needs_of(result: Diagnosis) -> dict[str, list[str]]:
    """Return the effects that the recordings could not show, by what they need to be recorded."""
    needs: dict[str, list[str]] = {}
    for each in result.not_excited:
        needs.setdefault(each.needs, []).append(f"{each.effect}@{each.component}")
    return needs
