"""The verdict of a diagnosis in words, the same on the terminal and on the page."""

from __future__ import annotations

from wrist_stiffness.diagnosis import Diagnosis, Finding


def verdict_lines(result: Diagnosis) -> list[str]:
    """Return the verdict in one or two sentences."""
    if result.verdict == "none":
        return ["Nothing is missing: what is left is noise."]
    found = "; ".join(class_of(each) for each in result.findings)
    if result.verdict == "effect":
        return [f"Missing in the model: {found}."]
    if found:
        return [
            f"Missing in the model: {found}.",
            "Something else that no known effect explains. As long as it is not understood, what "
            "is named may stand in for it: check it on the machine before you add it.",
        ]
    return ["Something is missing that no known effect explains."]


def class_of(finding: Finding) -> str:
    """Return the best effect of a class, and those that the data cannot tell from it."""
    names = finding.names
    return names[0] if len(names) == 1 else f"{names[0]} (or {', '.join(names[1:])})"
