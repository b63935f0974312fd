"""What `predict`, `explain`, `table`, `replay` and `tolerances` tell on a terminal."""

from __future__ import annotations

from collections.abc import Mapping
from typing import TYPE_CHECKING, Any

import numpy as np

from wrist_stiffness.lookup.table import Table
from wrist_stiffness.numerals import number, plus_minus
from wrist_stiffness.report import page

if TYPE_CHECKING:
    from wrist_stiffness.commands.explain import Explanation
    from wrist_stiffness.commands.modes import ModeSummary
    from wrist_stiffness.commands.output_changes import TopicChanges
    from wrist_stiffness.commands.replay_block import ReplaySummary
    from wrist_stiffness.commands.tolerances import ToleranceStudy


def prediction_lines(values: dict[str, Any], loaded: bool) -> list[str]:
    """Return a predicted error, and whose share it is where a load acts."""
    lines = []
    for name, unit, parts in (("s", "um", "shift_um"), ("phi", "mdeg", "rotation_mdeg")):
        x, y, z = values[parts]
        size = values[f"{name}_{unit}"]
        lines.append(f"{name:4} {size:8.3f} {unit:5} ({x:.3f}, {y:.3f}, {z:.3f})")
    if other := values["other_evaluation"]:
        way = "spline" if values["evaluation"] == "closed_form" else "closed form"
        lines.append(f"by the table's {way}: {_sizes(other)}")
    if exact := values["exact"]:
        lines.append(f"past first order (2 mrad); with finite rotations: {_sizes(exact)}")
    elif values["past_first_order"]:
        lines.append("past first order (2 mrad), in which the model's effects are carried")
    inside = "inside" if values["in_operative_workspace"] else "outside"
    lines.append(
        f"tilt {values['tilt_deg']:.2f} deg, {inside} the operative workspace, "
        f"{values['sectors_in_contact']} flange sectors in contact"
    )
    if loaded:
        lines.append("share of the load's strain energy with free slides:")
        shares = sorted(values["energy_share"].items(), key=lambda item: -item[1])
        lines += [f"  {name}  {100 * share:5.1f} %" for name, share in shares]
    return lines


def _sizes(values: dict[str, Any]) -> str:
    return f"s {values['s_um']:.3f} um, phi {values['phi_mdeg']:.3f} mdeg"


def explanation_lines(found: Explanation) -> list[str]:
    """Return the parts of an error that add up, and the whole."""
    values = found.as_values()
    spread = [values["prediction_sigma_um"], values["prediction_sigma_mdeg"]]
    keys = ("s_um", "s_sigma_um", "phi_mdeg", "phi_sigma_mdeg")
    rows = [_part(*(row[key] for key in ("name", *keys, "meaning"))) for row in values["rows"]]
    name, sigma = ("measured", [0.0, 0.0]) if found.measured else ("predicted", spread)
    rows.append(_part(name, values["s_um"], sigma[0], values["phi_mdeg"], sigma[1], ""))
    lines = page.Table("", ("", "s [um]", "", "phi [mdeg]", "", ""), rows).lines()
    if found.measured:
        along = "uncertainty of the prediction along the measured error: {:.3f} um, {:.3f} mdeg"
        lines.append(along.format(*spread))
        lines.append(values["verdict"])
    return [*lines, *(f"note: {warning}" for warning in values["warnings"])]


def _part(
    name: str, s: float, s_sigma: float, phi: float, phi_sigma: float, meaning: str
) -> list[str]:
    spread = [f"+-{sigma:.3f}" if sigma else "" for sigma in (s_sigma, phi_sigma)]
    return [name, f"{s:.3f}", spread[0], f"{phi:.3f}", spread[1], meaning]


def fact_lines(table: Table) -> list[str]:
    """Return what a table was made from and how exact it is."""
    header, limits = table.header, table.geometry.limits
    (low_1, low_2), (high_1, high_2) = (np.degrees(edge) for edge in table.workspace.rectangle)
    errors, rings = header.errors, header.mesh["rings"]
    facts = {
        "geometry": f"{table.geometry.name} ({table.geometry.status})",
        "angles": f"motor 1 {low_1:.1f} to {high_1:.1f}, motor 2 {low_2:.1f} to {high_2:.1f} deg",
        "loads": f"up to {limits.force:g} N and {limits.moment:g} N m at O",
        "parts": f"{sum(header.mesh['elements'].values())} elements, {header.interface} "
        f"interfaces, pins {'rigid' if table.geometry.pins is None else 'bend'}",
        "contact": f"{len(table.components.sectors.gap)} flange sectors in {rings} rings",
        "grid": f"{len(table.nodes)} poses ({header.per_axis} per axis), kernel {header.kernel}",
        "evaluation": header.evaluation,
    }
    for part, what in (
        ("mesh", "extrapolated from a coarser one"),
        ("contact", "against eight rings over a flange's width"),
        ("walls", "walls that lift off against two-sided ones"),
        ("second_order", "finite rotations"),
    ):
        if bound := errors.get(part):
            sizes = f"s {100 * bound['s']:.2f} %, phi {100 * bound['phi']:.2f} %"
            facts[f"{part.replace('_', ' ')} error"] = f"{sizes} ({what})"
    facts["stated error"] = f"{100 * errors['stated_relative']:.2f} %, in every covariance"
    for region in ("operative", "domain"):
        worst = errors["predicted"][region]
        sizes = f"s {100 * worst['s']:.3f} %, phi {100 * worst['phi']:.3f} %"
        facts[f"spline error, {region}"] = f"{sizes} at 99 of 100 unseen poses"
    return [f"{name + ':':26} {text}" for name, text in facts.items()]


def load_lines(summary: Mapping[str, Mapping[str, Any]]) -> list[str]:
    """Return what the rated load does."""
    lines = ["rated load (1 N downward, own weight left out), operative workspace:"]
    lines += [
        f"  {name:12} mean {row['mean']:7.2f}   min {row['min']:7.2f}   max {row['max']:7.2f}"
        for name, row in summary["operative"].items()
    ]
    largest = summary["domain_max"]
    lines.append(
        f"whole map: s up to {number(largest['s_um'])} um, "
        f"phi up to {number(largest['phi_mdeg'])} mdeg"
    )
    return lines


def mode_lines(summary: ModeSummary) -> list[str]:
    """Return natural frequencies, and for which loads static corrections hold."""
    lines = ["natural frequencies [Hz], motors locked, no damping, operative workspace:"]
    for state, values in summary.items():
        for mode in range(3):
            lowest, mean, highest = (row[mode] for row in values.values())
            label = f"flanges {state}, mode {mode + 1}"
            lines.append(f"  {label:26} mean {mean:7.1f}   min {lowest:7.1f}   max {highest:7.1f}")
    slowest = summary["at rest"]["min"][0]
    return [
        *lines,
        f"static corrections are right to 1 % for loads that change below {slowest / 10:.0f} Hz, "
        "a tenth of the lowest frequency at rest",
    ]


def replay_lines(summary: ReplaySummary) -> list[str]:
    """Return what a replay did."""
    lines = [
        *summary.remarks,
        f"{summary.predictions} predictions for {summary.joint_states} joint states, "
        f"{summary.corrections} of {summary.commands} commands corrected",
    ]
    if summary.trajectories:
        corrected = summary.corrected_trajectories
        lines.append(f"{corrected} of {summary.trajectories} trajectories corrected")
    if summary.predictions:
        for name, sizes in (("s [um]", summary.shift_um), ("phi [mdeg]", summary.phi_mdeg)):
            means = f"mean {sizes.mean:8.3f}   max {sizes.most:8.3f}"
            lines.append(f"  predicted {name:10} {means}")
    if summary.damage:
        lines.append(f"input is damaged: {summary.damage}")
    if summary.replaced:
        lines.append(f"{summary.replaced} outputs of an earlier run in the input left out")
    for warning, count in summary.warnings.most_common():
        lines.append(f"{count} predictions, the first: {warning}")
    for reason, count in summary.refused.most_common():
        lines.append(f"{count} refused, the first: {reason}")
    return lines


def tolerance_lines(study: ToleranceStudy) -> list[str]:
    """Return what each tolerance costs."""
    rows = [
        [
            cost.name,
            number(cost.sigma),
            *(plus_minus(*size) if size[1] else number(size[0]) for size in cost.size.values()),
        ]
        for cost in (*study.costs, study.others, study.whole)
    ]
    load = " ".join(f"{value:g}" for value in study.load)
    head = (
        "RMS beside the nominal model",
        "sigma",
        *map(page.title, study.whole.size),
    )
    return [
        f"{study.model}: {study.wrists} virtual wrists at {study.poses} poses, load {load}",
        *page.Table("", head, rows).lines(),
    ]


def change_line(topic: TopicChanges) -> str:
    """Return what changed on a topic, as one line."""
    text = f"{topic.topic:26} {topic.common} in both, {topic.changed or 'none'} changed"
    if topic.first_ns is not None:
        text += f", first at {1e-9 * topic.first_ns:.6f} s"
    for largest in topic.largest:
        text += f"; {largest.quantity} by {largest.size:.3g} at {1e-9 * largest.stamp_ns:.6f} s"
    for count, where in ((topic.only_old, "old"), (topic.only_new, "new")):
        text += f"; {count} only in the {where} one" if count else ""
    return text
