"""The report of `compare`."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from wrist_stiffness.comparing.comparison import ComparedModel, lengths
from wrist_stiffness.comparing.sentences import sentences
from wrist_stiffness.inference import Quantity
from wrist_stiffness.report.page import Bullets, Page, Part, Section, Table, Text, drawn
from wrist_stiffness.report.parts import number, provenance_section, typeset, unit_of
from wrist_stiffness.report.pictures.dependence import draw_against
from wrist_stiffness.report.pictures.errors import Bars, draw_bars, draw_map, draw_time_line

if TYPE_CHECKING:
    from wrist_stiffness.commands.compare import Compared

MOST_PICTURED = 4
"""Conditions that are drawn."""

MOST_MAPPED = 3
"""Models whose maps stand side by side."""

HOW = (
    "The error is measured minus predicted, as a shift s of the platform's point O and an angle "
    "phi, in wrist_base. One number counts for every dwell (its mean) and for every half second "
    "in motion.",
    "Without a refit every comparison shows where the instrument stands: so the place of "
    "instrument and target, the zeros of the encoders and the tare of the load sensor are fitted "
    "again in every session, unless the recording says that they were calibrated.",
    "What is left is asked as in diagnose: noise, drift of the instrument, and smooth laws of the "
    "conditions, each of which may be there or not. A law is told from a probability of 90 % on: "
    "the evidence of all sets of laws that hold it, against those without it.",
    "A size is the part of the error that goes with a condition, beyond what the refit could take "
    "up; +- is one standard uncertainty, a band two.",
    "Laws of the conditions, unseen part: what these laws leave of stretches that were not used to "
    "fit them. Laws with a memory can do better.",
)


def report_of_comparison(compared: Compared) -> Page:
    """Return the report of a comparison."""
    found = compared.comparison
    models = ", ".join(model.name for model in found.models)
    units = found.models[0].refitted.n_units
    sections = [
        Section("On what the error depends", _depends(compared)),
        Section("How far off", _how_far(compared)),
        Section("Where it fails", _where(compared)),
        Section("When it fails", _when(compared)),
        Section("How it was computed", (Bullets(tuple(typeset(line) for line in HOW)),)),
        provenance_section(compared.provenance),
    ]
    return Page(
        f"{models} compared with measurements",
        f"{', '.join(found.sessions)}: {units} dwells and half seconds in motion",
        tuple(typeset(line) for line in found.verdict),
        tuple(sections),
    )


def _label(quantity: Quantity) -> str:
    return f"{quantity.name} [{unit_of(quantity.unit)}]"


def _how_far(compared: Compared) -> tuple[Part, ...]:
    found = compared.comparison
    bars = [
        Bars(
            _label(q),
            [model.name for model in found.models],
            [model.after[q.key].rms for model in found.models],
            [model.after[q.key].uncertainty for model in found.models],
            {
                "instrument noise": found.noise[q.key],
                "laws of the conditions": found.reachable[q.key],
            },
        )
        for q in found.quantities
    ]
    caption = (
        "Error after registrations were refitted, with one standard uncertainty, against what "
        "noise alone makes and what laws of the conditions would leave of stretches unseen."
    )
    parts: list[Part] = [drawn(draw_bars(bars), caption), _sizes(compared), _levels(compared)]
    for model in found.models:
        parts.append(Text(f"What the refit took up for {model.name}:"))
        parts.append(Bullets(tuple(typeset(line) for line in model.absorbed)))
    if compared.notes:
        parts += [Text("To be kept in mind:"), Bullets(compared.notes)]
    return tuple(parts)


def _sizes(compared: Compared) -> Table:
    found = compared.comparison
    head = ["model", "registrations"]
    for q in found.quantities:
        head += [f"{_label(q)} mean", "RMS", "max"]
    rows = []
    for model in found.models:
        for stage, sizes in (("as they stand", model.before), ("refitted", model.after)):
            cells = [
                number(value)
                for q in found.quantities
                for value in (sizes[q.key].mean, sizes[q.key].rms, sizes[q.key].maximum)
            ]
            rows.append((model.name, stage, *cells))
    return Table(
        "Error of every dwell and half second in motion, before and after the refit.",
        tuple(head),
        tuple(rows),
    )


def _levels(compared: Compared) -> Table:
    found = compared.comparison
    head = ("to compare with", *(f"{_label(q)} RMS" for q in found.quantities))
    rows = [
        (name, *(number(level[q.key]) for q in found.quantities))
        for name, level in compared.levels()
    ]
    for model in found.models[1:]:
        shares = [found.headroom(model, q.key) for q in found.quantities]
        rows.append(
            (
                f"{model.name}: share of what could be explained",
                *(_share(share) for share in shares),
            )
        )
    return Table("What the error is to be judged by.", head, tuple(rows))


def _share(share: float | None) -> str:
    """Return a share of what the conditions could explain; a memory may explain more than they."""
    if share is None:
        return "-"
    return "all" if share >= 1.0 else f"{100.0 * share:.0f} %"


def _depends(compared: Compared) -> tuple[Part, ...]:
    found = compared.comparison
    parts: list[Part] = []
    for model in found.models:
        if len(found.models) > 1:
            parts.append(Text(f"{model.name}:"))
        parts.append(Bullets(tuple(typeset(line) for line in sentences(model.explained))))
    first, *others = found.models
    told = first.explained.told[:MOST_PICTURED]
    if told:
        shown = [(model.name, model.refitted) for model in others[1 - MOST_MAPPED :]]
        caption = (
            f"What {first.name} leaves against the conditions on which it depends most, everything "
            "else that was found taken out: every dwell and moment, and the fitted law with its "
            "95 % band. On a map the fields are the law and the dots what was measured. Squares "
            "are means of what the other models leave."
        )
        parts.append(drawn(draw_against(told, shown), caption))
    return tuple(parts)


def _side_by_side(compared: Compared) -> list[ComparedModel]:
    """Return the models to be drawn together: all, or the first and the last few."""
    models = list(compared.comparison.models)
    return models if len(models) <= MOST_MAPPED else [models[0], *models[1 - MOST_MAPPED :]]


def _where(compared: Compared) -> tuple[Part, ...]:
    found = compared.comparison
    models = _side_by_side(compared)
    units = models[0].refitted
    theta = np.stack([units.covariate(f"theta_{motor}") for motor in (1, 2)], axis=1)
    rows = [
        (_label(q), np.stack([lengths(model.refitted, q) for model in models]))
        for q in found.quantities
    ]
    picture = drawn(
        draw_map(compared.border, theta, rows, [model.name for model in models]),
        "Error over the joint space: cells without data are grey, white dots are dwells and "
        "moments, the black line borders the operative workspace.",
    )
    return (picture, _worst(compared, found.models[-1]))


def _worst(compared: Compared, model: ComparedModel) -> Table:
    quantities = compared.comparison.quantities
    head = ("session", "time [s]", "motor 1 [deg]", "motor 2 [deg]", "Fx [N]", "Fy [N]", "Fz [N]")
    rows = [
        (
            pose.session,
            f"{pose.time_s:.1f}",
            *(f"{angle:.2f}" for angle in pose.theta_deg),
            *(f"{value:.3f}" for value in np.round(pose.load[:3], 3) + 0.0),
            *(number(pose.errors[q.key]) for q in quantities),
        )
        for pose in compared.worst(model)
    ]
    return Table(
        f"Where {model.name} fails worst.", (*head, *(_label(q) for q in quantities)), tuple(rows)
    )


def _when(compared: Compared) -> tuple[Part, ...]:
    found = compared.comparison
    models = _side_by_side(compared)
    units = models[0].refitted
    rows = [
        (
            _label(q),
            np.stack([lengths(model.refitted, q) for model in models]),
            found.noise[q.key],
        )
        for q in found.quantities
    ]
    names = [model.name for model in models]
    return (
        drawn(
            draw_time_line(units.times, units.sessions, found.sessions, rows, names),
            "Error over the time of each session.",
        ),
    )
