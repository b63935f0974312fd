"""A diagnosis in words, the same on the terminal and on the page."""

from __future__ import annotations

from wrist_stiffness.comparing.sentences import percent
from wrist_stiffness.inference import Diagnosis, Finding
from wrist_stiffness.model.registry import find_law


def verdict_lines(result: Diagnosis) -> list[str]:
    """Return the verdict in one or two sentences."""
    if result.verdict == "none":
        return [f"Nothing is missing: what is left is noise ({percent(result.probability)} sure)."]
    found = "; ".join(f"{class_of(e)}, {percent(e.probability)} sure" for e in result.findings)
    lines = [f"Missing in the model: {found}."] if found else []
    if result.verdict == "unknown":
        if result.depends_on:
            lines.append("The error is real, but no effect in the catalogue explains it.")
        else:
            lines.append("An effect is missing, but these recordings do not say which.")
    return [*lines, *rest_lines(result)]


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
