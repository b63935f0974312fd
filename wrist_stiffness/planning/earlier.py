"""What was measured before, as an experiment whose information the next one adds to."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from wrist_stiffness.errors import InputError
from wrist_stiffness.model.error_model import ErrorModel
from wrist_stiffness.planning.timeline import Experiment
from wrist_stiffness.sessions.measured_session import MeasuredSession
from wrist_stiffness.sessions.unit_session import as_units
from wrist_stiffness.sessions.units import COUNTS


def as_experiment(model: ErrorModel, session: MeasuredSession) -> Experiment:
    """Return where and when a session measured.

    `model`: for the table's domain and load range; measurements outside are left out.  `session`:
    any.  Gives `Experiment`: one row for each dwell and each single moment in motion.  Dwells
    between which no motor moved belong to one visit.  Raises `InputError` if no measurement lies in
    the table's domain and load range, or gauges measured.
    """
    if session.readings is not None:
        raise InputError(f"{session.name}: readings of gauges; plans are made for measured poses")
    parts = as_units(model, session).cut
    in_unit = np.flatnonzero(parts.unit >= 0)
    # The heaviest moment of each unit stands for its mean.
    order = in_unit[np.lexsort((parts.weight[in_unit], parts.unit[in_unit]))]
    last = np.append(np.diff(parts.unit[order]) != 0, True)
    rows = order[last]
    moving = ~parts.dwell[parts.unit[rows]]
    limit = COUNTS * model.table.geometry.limits.encoder_step
    turned = np.any(np.abs(np.diff(parts.block.theta, axis=0)) > limit, axis=1)
    motions = np.append(0, np.cumsum(turned))[rows]
    visit = np.unique(motions, return_inverse=True)[1]
    return Experiment(replace(parts.block, theta_dot=parts.speed), rows, visit, moving)
