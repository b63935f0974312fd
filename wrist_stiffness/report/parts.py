"""Parts that several reports share."""

from __future__ import annotations

from math import isnan
from typing import TYPE_CHECKING

import numpy as np

from wrist_stiffness.report.page import Section, Table, Text

if TYPE_CHECKING:
    from wrist_stiffness.commands.provenance import Provenance

SIGNS = {" um": " µm", "+-": "±", "degC": "°C", " deg/s": " °/s"}
"""What a terminal writes in ASCII."""


TITLES = {
    "s_um": "s [um]",
    "phi_mdeg": "phi [mdeg]",
    "gauges_um": "gauges [um]",
    "tilts_mdeg": "tilts [mdeg]",
}
"""Of columns, by the key of the quantity."""


def typeset(text: str) -> str:
    """Return a sentence for people with the signs that a page has."""
    for plain, sign in SIGNS.items():
        text = text.replace(plain, sign)
    return text


def unit_of(unit: str) -> str:
    """Return the name of a unit as a page writes it."""
    return typeset(f" {unit}").strip()


def number(value: float, digits: int = 3) -> str:
    """Return significant digits, without an exponent where a person writes none; NaN is -."""
    if isnan(value):
        return "-"
    return f"{value:.0f}" if 1e3 <= abs(value) < 1e6 else f"{value:.{digits}g}"


def plus_minus(value: float, sigma: float) -> str:
    """Return a value and its uncertainty with two digits of the latter."""
    digits = 3
    if np.isfinite(sigma) and sigma > 0.0:
        digits = min(max(1 - int(np.floor(np.log10(sigma))), 0), 9)
    return f"{round(value, digits) + 0.0:.{digits}f} +- {sigma:.{digits}f}"


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
