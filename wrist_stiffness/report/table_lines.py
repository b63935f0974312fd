"""What a table holds, on a terminal."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from typing import TYPE_CHECKING, Any

import numpy as np

from wrist_stiffness.lookup.table import Table

if TYPE_CHECKING:
    from wrist_stiffness.commands.modes import ModeSummary


def fact_lines(table: Table) -> list[str]:
    """Return what a table was made from and how exact it is."""
    return [f"{name + ':':26} {text}" for name, text in facts(table)]


def load_lines(summary: Mapping[str, Mapping[str, Any]]) -> list[str]:
    """Return what the rated load does."""
    lines = ["rated load (1 N downward, own weight left out), operative workspace:"]
    lines += [
        f"  {name:12} mean {row['mean']:7.2f}   min {row['min']:7.2f}   max {row['max']:7.2f}"
        for name, row in summary["operative"].items()
    ]
    largest = summary["domain_max"]
    lines.append(
        f"whole map: s up to {largest['s_um']:.3g} um, phi up to {largest['phi_mdeg']:.3g} mdeg"
    )
    return lines


def mode_lines(summary: ModeSummary) -> list[str]:
    """Return natural frequencies, and for which loads static corrections hold."""
    lines = ["natural frequencies [Hz], motors locked, no damping, operative workspace:"]
    for state, values in summary.items():
        for number in range(3):
            lowest, mean, highest = (row[number] for row in values.values())
            label = f"flanges {state}, mode {number + 1}"
            lines.append(f"  {label:26} mean {mean:7.1f}   min {lowest:7.1f}   max {highest:7.1f}")
    slowest = summary["at rest"]["min"][0]
    return [
        *lines,
        f"static corrections are right to 1 % for loads that change below {slowest / 10:.0f} Hz, "
        "a tenth of the lowest frequency at rest",
    ]


def facts(table: Table) -> Iterable[tuple[str, str]]:
    """Return what a person wants to know of a table, as (name, text)."""
    header, limits = table.header, table.geometry.limits
    lower, upper = (np.degrees(edge) for edge in table.workspace.rectangle)
    errors = header.errors
    yield "geometry", f"{table.geometry.name} ({table.geometry.status})"
    yield (
        "angles",
        f"motor 1 {lower[0]:.1f} to {upper[0]:.1f}, motor 2 {lower[1]:.1f} to {upper[1]:.1f} deg",
    )
    yield "loads", f"up to {limits.force:g} N and {limits.moment:g} N m at O"
    yield (
        "parts",
        f"{sum(header.mesh['elements'].values())} elements, {header.interface} interfaces, "
        f"pins {'rigid' if table.geometry.pins is None else 'bend'}",
    )
    sectors, rings = len(table.components.sectors.gap), header.mesh["rings"]
    yield "contact", f"{sectors} flange sectors in {rings} rings"
    yield "grid", f"{len(table.nodes)} poses ({header.per_axis} per axis), kernel {header.kernel}"
    yield "evaluation", header.evaluation
    for part, what in (
        ("mesh", "extrapolated from a coarser one"),
        ("contact", "against eight rings over a flange's width"),
        ("walls", "walls that lift off against two-sided ones"),
        ("second_order", "finite rotations"),
    ):
        if bound := errors.get(part):
            s, phi = 100 * bound["s"], 100 * bound["phi"]
            yield f"{part.replace('_', ' ')} error", f"s {s:.2f} %, phi {phi:.2f} % ({what})"
    yield "stated error", f"{100 * errors['stated_relative']:.2f} %, in every covariance"
    for region in ("operative", "domain"):
        worst = errors["predicted"][region]
        yield (
            f"spline error, {region}",
            f"s {100 * worst['s']:.3f} %, phi {100 * worst['phi']:.3f} % at 99 of 100 unseen poses",
        )
