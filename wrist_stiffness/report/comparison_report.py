"""What `compare` tells, on a terminal and as a page."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING

import numpy as np

from wrist_stiffness.comparing.comparison import ComparedModel
from wrist_stiffness.comparing.sentences import sentences
from wrist_stiffness.inference.noise import at_most
from wrist_stiffness.numerals import number
from wrist_stiffness.report.absorbed import absorbed_table
from wrist_stiffness.report.page import (
    Bullets,
    Page,
    Part,
    Picture,
    Table,
    drawn,
    lines_of,
    provenance_section,
    title,
)
from wrist_stiffness.report.pictures.errors import (
    Bars,
    draw_against,
    draw_bars,
    draw_map,
    draw_time_line,
)

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
    "Surely above noise and drift is what these laws explain, not the root of the difference of "
    "the squares of error and noise.",
    "The noise is as stated, or as readings that repeat tell it; else all that no smooth law "
    "explains counts as noise, play and friction too, and 'at most' says so.",
    "A size is the part of the error that goes with a condition, beyond what the refit could take "
    "up; +- is one standard uncertainty, a band two.",
    "Laws of the conditions, unseen part: what these laws leave of stretches that were not used to "
    "fit them. Laws with a memory can do better.",
)


def comparison_lines(compared: Compared) -> list[str]:
    """Return the answer for a terminal, of what depends and of the worst that of the last model."""
    found = compared.comparison
    return [*found.verdict, *compared.damage, *lines_of(_sections(compared, found.models[-1:]))]


def report_of_comparison(compared: Compared) -> Page:
    """Return the report of a comparison."""
    found = compared.comparison
    names = [model.name for model in found.models]
    units = found.models[0].refitted.n_units
    sections = _sections(compared, found.models)
    sections["On what the error depends"] += _dependence(found.models)
    keys = [q.key for q in found.quantities]
    absorbed: list[Part] = []
    for model in found.models:
        taken = absorbed_table(model.absorbed, keys)
        absorbed += [f"What the refit took up for {model.name}:", taken]
    sections["How far off"] = [_bars(compared), *sections["How far off"], *absorbed]
    # All models are drawn together, or the first and the last few.
    most = MOST_MAPPED
    models = found.models if len(names) <= most else (*found.models[:1], *found.models[1 - most :])
    where = drawn(
        draw_map(compared.border, models),
        "Error over the joint space: cells without data are grey, white dots are dwells and "
        "moments, the black line borders the operative workspace.",
    )
    when = drawn(draw_time_line(found, models), "Error over the time of each session.")
    return Page(
        f"{', '.join(names)} compared with measurements",
        f"{', '.join(found.sessions)}: {units} dwells and half seconds in motion",
        [*found.verdict, *compared.damage],
        {
            **sections,
            "Where it fails": [where, *sections["Where it fails"]],
            "When it fails": [when],
            "How it was computed": [Bullets(HOW)],
            **provenance_section(compared.provenance),
        },
    )


def _sections(compared: Compared, models: Sequence[ComparedModel]) -> dict[str, list[Part]]:
    """Return what both tell: all sizes, and on what the errors of some models depend."""
    depends: list[Part] = []
    for model in models:
        depends += [f"{model.name}:", Bullets(sentences(model.explained))]
    notes = [each for each in compared.notes if each not in compared.damage]
    return {
        "How far off": [_sizes(compared), _levels(compared)],
        "On what the error depends": depends,
        "Where it fails": [_worst(compared, models[-1])],
        "To be kept in mind": [Bullets(notes)] if notes else [],
    }


def _bars(compared: Compared) -> Picture:
    found = compared.comparison
    bars = [
        Bars(
            title(q.key),
            [model.name for model in found.models],
            [model.after[q.key].rms for model in found.models],
            [model.after[q.key].rms_uncertainty for model in found.models],
            {
                f"instrument noise{at_most(found.noise_known)}": found.noise[q.key],
                "laws of the conditions": found.reachable[q.key],
            },
        )
        for q in found.quantities
    ]
    caption = (
        "Error after registrations were refitted, with one standard uncertainty, against what "
        "noise alone makes and what laws of the conditions would leave of stretches unseen."
    )
    return drawn(draw_bars(bars), caption)


def _sizes(compared: Compared) -> Table:
    found = compared.comparison
    head = ["model", "registrations"]
    for q in found.quantities:
        head += [f"{title(q.key)} mean", "RMS", "max"]
    rows = []
    for model in found.models:
        for stage, sizes in (("as it stands", model.before), ("refitted", model.after)):
            row = [model.name, stage]
            for size in (sizes[q.key] for q in found.quantities):
                row += map(number, (size.mean, size.rms, size.max))
            rows.append(row)
    caption = "Error of every dwell and half second in motion, before and after the refit."
    return Table(caption, head, rows)


def _levels(compared: Compared) -> Table:
    found = compared.comparison
    head = ["to compare with", *(f"{title(q.key)} RMS" for q in found.quantities)]
    rows = [
        [name, *(number(level[q.key]) for q in found.quantities)]
        for name, level in compared.levels()
    ]
    for model in found.models[1:]:
        shares = [_share(found.headroom(model, q.key)) for q in found.quantities]
        rows.append([f"{model.name}: share of what these laws explain", *shares])
    return Table("What the error is to be judged by.", head, rows)


def _share(share: float | None) -> str:
    """Return a share of what the conditions could explain; a memory may explain more than they."""
    return "-" if share is None else f"{100.0 * min(share, 1.0):.0f} %"


def _dependence(models: Sequence[ComparedModel]) -> list[Part]:
    first, *others = models
    told = first.explained.told[:MOST_PICTURED]
    if not told:
        return []
    shown = [(model.name, model.refitted) for model in others[1 - MOST_MAPPED :]]
    caption = (
        f"What {first.name} leaves against the conditions on which it depends most, everything "
        "else that was found taken out: every dwell and moment, and the fitted law with its "
        "95 % band. On a map the fields are the law and the dots what was measured. Squares "
        "are means of what the other models leave."
    )
    return [drawn(draw_against(told, shown), caption)]


def _worst(compared: Compared, model: ComparedModel) -> Table:
    quantities = compared.comparison.quantities
    head = ["session", "time [s]", "motor 1 [deg]", "motor 2 [deg]", "Fx [N]", "Fy [N]", "Fz [N]"]
    rows = [
        [
            pose.session,
            f"{pose.time_s:.1f}",
            *(f"{angle:.2f}" for angle in pose.theta_deg),
            *(f"{value:.3f}" for value in np.round(pose.load[:3], 3) + 0.0),
            *(number(pose.errors[q.key]) for q in quantities),
        ]
        for pose in compared.worst(model)
    ]
    caption = f"Where {model.name} fails worst, the largest error over the noise first."
    return Table(caption, [*head, *(title(q.key) for q in quantities)], rows)
