"""What a comparison says of one model, in sentences that a technician reads once."""

from __future__ import annotations

from typing import Any

from wrist_stiffness.comparing.explained import LEAST, Explained, Told
from wrist_stiffness.inference.discrepancy import PASSING_DRIFT
from wrist_stiffness.numerals import number, percent


def sentences(found: Explained) -> tuple[str, ...]:
    """Return on what the error depends, the largest part first."""
    lines = [sentence(each, found) for each in found.told]
    if not found.every:
        lines.append(
            "What is left depends on nothing that was recorded, beyond chance "
            f"({percent(found.answer.nothing)} sure)."
        )
    if found.minor:
        names = ", ".join(each.name for each in found.minor)
        lines.append(
            f"It also depends on {names} (each less than {100.0 * LEAST:g} % of the squared error)."
        )
    if found.perhaps:
        more = ", ".join(f"{name} ({percent(p)})" for name, p in found.perhaps.items())
        lines.append(f"Perhaps it depends on {more}.")
    if found.not_varied:
        lines.append(f"Not varied here, so nothing can be said of: {', '.join(found.not_varied)}.")
    return tuple(lines)


def sentence(told: Told, found: Explained) -> str:
    """Return one dependence with its size and what it does."""
    quantities = {q.key: q for q in found.observations.reported}
    parts = " and ".join(
        f"{number(size, 2)} of {number(found.error[key], 2)} {quantities[key].unit}"
        for key, size in told.sizes.items()
    )
    sure = f"({percent(told.probability)} sure)"
    if told.name == PASSING_DRIFT:
        key = told.curve.quantity.key
        usual = f"{number(found.usual_drift[key], 2)} {quantities[key].unit}"
        return (
            f"The error changes with time, as no recorded condition does {sure}: {parts}; "
            f"an instrument like this drifts by about {usual}."
        )
    names = " or ".join(told.members)
    text = f"The error depends on {names} {sure}: {parts}. {told.curve.sentence}"
    if len(told.members) > 1:
        shares = ", ".join(f"{name} {percent(p)}" for name, p in told.members.items())
        text += f" These recordings cannot tell which: {shares}."
    return text


def as_values(found: Explained) -> dict[str, Any]:
    """Return what programs read, with units in the names."""
    return {
        "instrument_noise": found.noise,
        "noise_known": found.noise_known,
        "instrument_drift": found.drift,
        "above_noise": found.above,
        "reachable": found.reachable,
        "depends_on": [
            {
                "condition": each.name,
                "class": each.members,
                "probability": each.probability,
                "sentence": sentence(each, found),
                **each.sizes,
                "curve": {
                    "quantity": each.curve.quantity.key,
                    "direction": each.curve.direction.tolist(),
                    "against": list(each.curve.labels),
                    "at": each.curve.places.tolist(),
                    "mean": each.curve.mean.tolist(),
                    "sigma": each.curve.sigma.tolist(),
                },
            }
            for each in found.every
        ],
        "perhaps": found.perhaps,
        "depends_on_nothing": found.answer.nothing,
        "not_varied": list(found.not_varied),
    }
