"""A diagnosis in words, the same on the terminal and on the page."""

from __future__ import annotations

from collections.abc import Iterable

from wrist_stiffness.campaign.noise_floor import WITH_WANDER, over_floor
from wrist_stiffness.diagnosis import Diagnosis, Finding
from wrist_stiffness.model.registry import find_law

PROVEN = {
    "finding": "found",
    "suspect": "suspect, not proven",
    "possible": "possible, a guess from usual sizes",
}
"""What is said of parts of a wrist that are no tolerances, by their kind."""

CONDITIONS = {
    "time_s": "time in the session",
    "held_s": "hold time",
    "loaded_at_rest": "load put on at rest or carried",
    "force": "size of the force",
    "moment": "size of the moment",
    **{f"theta_{motor}": f"angle of motor {motor}" for motor in (1, 2)},
    **{f"approach_{motor}": f"approach direction of motor {motor}" for motor in (1, 2)},
    **{f"speed_{motor}": f"speed of motor {motor}" for motor in (1, 2)},
    **{f"f{axis}": f"force along {axis}" for axis in "xyz"},
    **{f"m{axis}": f"moment about {axis}" for axis in "xyz"},
}
"""Conditions in words; temperatures and covariates are told by the names that they came with."""


def conditions_in_words(names: Iterable[str]) -> str:
    """Return on what something depends, as a list for a technician."""
    return ", ".join(CONDITIONS.get(name, name) for name in names)


def verdict_lines(result: Diagnosis) -> list[str]:
    """Return the verdict in one or two sentences."""
    if result.verdict == "none":
        ratio = over_floor(result.after, result.noise_floor)
        if ratio > WITH_WANDER:
            return [
                f"Nothing is missing that these recordings show: what is left is {ratio:.2g} times "
                "the noise and depends on nothing that was recorded; slow wander of the instrument "
                "looks like this."
            ]
        return ["Nothing is missing: what is left is noise."]
    found = "; ".join(class_of(each) for each in result.findings)
    if result.verdict == "effect":
        return [f"Missing in the model: {found}."]
    if result.unexplained.energy_share == 0.0:
        what = "Something else" if found else "Something"
        doubt = f"{what} may be missing, too little to be told from chance by these recordings."
        return [*([f"Missing in the model: {found}."] if found else []), doubt]
    if found:
        return [
            f"Missing in the model: {found}.",
            "Something else that no known effect explains. As long as it is not understood, what "
            "is named may stand in for it: check it on the machine before you add it.",
        ]
    return ["Something is missing that no known effect explains."]


def unexplained_share(result: Diagnosis) -> str:
    """Return how much no known effect explains, so that a small rest does not read as nothing."""
    share = 100.0 * result.unexplained.energy_share
    if share == 0.0:
        if result.verdict == "unknown":
            return "what was named at first and did not hold"
        return "nothing of the structure above the noise"
    amount = f"{share:.0f}" if share >= 1.0 else f"{share:.1g}"
    text = f"{amount} % of the structure above the noise"
    if result.verdict == "unknown":
        return text
    ratio = over_floor(result.after, result.noise_floor)
    if ratio > WITH_WANDER:
        return (
            f"{text}, and still {ratio:.2g} times the noise: no law is exact, and a smaller effect "
            "may hide in what these leave"
        )
    return f"{text}, too little to look for another effect"


def class_of(finding: Finding) -> str:
    """Return the best effect of a class, and those that the data cannot tell from it."""
    names = finding.names
    return names[0] if len(names) == 1 else f"{names[0]} (or {', '.join(names[1:])})"


def correction_of(finding: Finding) -> str:
    """Return what the nodes can do about a finding."""
    if finding.compensable == "yes":
        return "the nodes can correct it"
    if finding.compensable == "needs_signal":
        return "the nodes can correct it where they get its signal"
    law, place = finding.members[0]
    if find_law(law).of_measurement(place):
        return "it is in the instrument, so nothing is to be corrected"
    return "it shifts the platform and does not turn it, so only the manipulator can correct it"
