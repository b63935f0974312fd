"""Parts that several reports share."""

from __future__ import annotations

from collections.abc import Sequence
from math import isnan

from wrist_stiffness.campaign.comparing.sentences import Change, Statement
from wrist_stiffness.inference import Observations
from wrist_stiffness.mechanism.components import Array
from wrist_stiffness.workflows.pictures.dependence import Against
from wrist_stiffness.workflows.provenance import Provenance
from wrist_stiffness.workflows.report.page import Section, Table, Text

SIGNS = {" um": " µm", "+-": "±", "degC": "°C", " deg/s": " °/s"}
"""What a terminal writes in ASCII."""


def typeset(text: str) -> str:
    """Return a sentence for people with the signs that a page has."""
    for plain, sign in SIGNS.items():
        text = text.replace(plain, sign)
    return text


def unit_of(unit: str) -> str:
    """Return the name of a unit as a page writes it."""
    return typeset(f" {unit}").strip()


def number(value: float) -> str:
    """Return three significant digits, without an exponent where a person writes none; NaN is -."""
    if isnan(value):
        return "-"
    return f"{value:.0f}" if 1e3 <= abs(value) < 1e6 else f"{value:.3g}"


def against(statement: Statement, models: Sequence[tuple[str, Observations]]) -> Against:
    """Return what a picture needs of one statement: residuals along its direction.

    Parameters
    ----------
    statement : Statement
        Of one of the models.
    models : sequence of (str, Observations)
        Name and residuals of each model to be shown, over the same units.
    """
    change = max(statement.changes, key=lambda each: each.size / each.uncertainty)
    condition = statement.condition
    values = condition.columns[:, 0] if condition.along is None else condition.along
    return Against(
        condition.name,
        typeset(condition.axis),
        f"{change.quantity} {'along' if change.quantity == 's' else 'about'} {change.where} "
        f"[{unit_of(change.unit)}]",
        values,
        [(name, _along(observations, change)) for name, observations in models],
    )


def _along(observations: Observations, change: Change) -> Array:
    """Part of the residual along the direction of a change, (n,) in the unit of its report."""
    (quantity,) = (q for q in observations.quantities if q.name == change.quantity)
    columns = observations.values[:, list(quantity.components)]
    # A component that was never measured has no part in the direction.
    used = change.direction != 0.0
    return columns[:, used] @ change.direction[used] * quantity.per_si


def provenance_section(provenance: Provenance) -> Section:
    """Return where the result comes from."""
    files = [("model", *each) for each in provenance.models.items()]
    files += [("recording", *each) for each in provenance.recordings.items()]
    return Section(
        "Files and versions",
        (
            Text(f"Made on {provenance.date} by: {provenance.command}"),
            Table(
                "Files, with the first digits of their checksums.",
                ("kind", "file", "SHA-256"),
                tuple((kind, name, sha[:16]) for kind, name, sha in files),
            ),
            Table("Versions", ("package", "version"), tuple(provenance.versions.items())),
        ),
    )
