"""From measured sessions to the table that the statistics take: one residual twist a unit."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from scipy.linalg import block_diag

from wrist_stiffness.errors import InputError
from wrist_stiffness.inference import Observations, Quantity
from wrist_stiffness.lookup.table import Table
from wrist_stiffness.mechanism.components import Array
from wrist_stiffness.model.error_model import ErrorModel
from wrist_stiffness.sessions.gauges import cleared
from wrist_stiffness.sessions.unit_session import UnitSession
from wrist_stiffness.sessions.units import COUNTS, SPARSE_S, WINDOW_S, Cut, Labels

WANDER = {"um": 0.5e-6, "mdeg": 5e-6}
"""Slow scatter between units that no instrument states [m, rad]: it only sets weights."""

SAME_POSE_COUNTS, SAME_LOAD = 2.5, 0.02
"""Two dwells repeat one condition within so many encoder counts and this share of the load."""

HALF_OF_A_NEW_APPROACH = 1.0
"""Variance of the difference of two readings of a pose, in that of a hidden count: two new
approaches leave twice as much, motors at rest the noise alone."""


@dataclass(frozen=True, eq=False)
class Observed:
    """Sessions, what a model predicts of them, and the table of the difference."""

    sessions: tuple[UnitSession, ...]  # sessions as units
    # (u, 6), predicted pose error of the units of all sessions, what the sensor would say [m, rad]
    predicted: Array
    observations: Observations  # residuals and conditions of all units


def usual_wander(quantities: Sequence[Quantity]) -> Array:
    """Return that scatter of each component, (m,) [m, rad]."""
    out = np.zeros(1 + max(max(each.components) for each in quantities))
    for each in quantities:
        out[list(each.components)] = WANDER[each.unit]
    return out


def without_mounting(table: Observations, values: Array) -> Array:
    """Return values of a table, (u, m) or (u, m, k), without what a mounting of gauges does."""
    if table.common is None:
        return values
    return cleared(values, table.common, usual_wander(table.quantities))


def predict_units(model: ErrorModel, session: UnitSession) -> Array:
    """Return the predicted pose error of each unit as the sensor says it, (u, 6) [m, rad]."""
    return session.mean_twist(model.batch(session.block).measured)


def tabulate(
    model: ErrorModel, sessions: tuple[UnitSession, ...], predicted: Array | None = None
) -> Observed:
    """Return the table of residuals of units against a prediction of them.

    `model`: its kinematics and encoder step tell what the encoders hide; `sessions`: in the order
    of time, u units together; `predicted` (u, 6): pose error of the units, as the sensor would say
    it, by default the model's [m, rad].  Raises `InputError` if no unit was measured.
    """
    if predicted is None:
        predicted = np.concatenate([predict_units(model, each) for each in sessions])
    parts = np.split(predicted, np.cumsum([len(each) for each in sessions])[:-1])
    values = np.concatenate(
        [each.residual(part) for each, part in zip(sessions, parts, strict=True)]
    )
    used = np.isfinite(values).any(axis=1)
    if not used.any():
        raise InputError("no unit of the sessions was measured: every pose is blank")
    table = model.table
    counts = np.concatenate(
        [each.columns_seen(hidden_counts(table, each.cut, each.still.theta)) for each in sessions]
    )
    covariance = _covariance(sessions, counts)
    stand = stands_of(model, sessions)
    observations = Observations(
        values,
        _covariates(sessions),
        covariance,
        np.concatenate([each.still.time for each in sessions]),
        np.repeat(np.arange(len(sessions)), [len(each) for each in sessions]),
        _replicates(sessions, table.geometry.limits.encoder_step, stand),
        np.concatenate([each.samples for each in sessions]),
        sessions[0].quantities,
        stand=stand,
        shared=counts,
        common=side_by_side([s.common for s in sessions]) if sessions[0].gauges else None,
    )
    return Observed(sessions, predicted, replace(observations.take(used), row=None))


def side_by_side(columns: Sequence[Array]) -> Array:
    """Return what each session's columns do to its own units, as columns of all units (u, m, q)."""
    flat = block_diag(*(each.reshape(-1, each.shape[2]) for each in columns))
    return np.asarray(flat.reshape(-1, columns[0].shape[1], flat.shape[1]))


def _covariates(sessions: tuple[UnitSession, ...]) -> dict[str, Array]:
    """Return the conditions of each unit by name."""
    columns: list[dict[str, Array]] = []
    for each in sessions:
        still, cut = each.still, each.cut
        motors = {
            "theta": still.theta,
            "approach": each.mean(cut.sense[cut.kept]),
            "speed": np.zeros_like(still.theta) if still.theta_dot is None else still.theta_dot,
        }
        own = {
            **{f"{name}_{i + 1}": both[:, i] for name, both in motors.items() for i in range(2)},
            **dict(zip(("fx", "fy", "fz", "mx", "my", "mz"), still.load.T, strict=True)),
            "force": np.linalg.norm(still.load[:, :3], axis=1),
            "moment": np.linalg.norm(still.load[:, 3:], axis=1),
            "held_s": each.mean(cut.held_s[cut.kept]),
            "loaded_at_rest": np.rint(each.mean(cut.at_rest[cut.kept].astype(float))),
            "time_s": still.time,
            **{f"T_{name}": value for name, value in still.temperatures.items()},
            **still.covariates,
        }
        columns.append(own)
    common = [name for name in columns[0] if all(name in own for own in columns)]
    return {name: np.concatenate([own[name] for own in columns]) for name in common}


def _covariance(sessions: tuple[UnitSession, ...], counts: Array) -> Array | None:
    """Return the covariance of each unit on its own: white noise and the hidden encoder count.

    No measurement is better than what it is compared with.
    """
    white = np.stack([each.white for each in sessions])
    seen = np.concatenate([each.values for each in sessions])
    if np.isnan(white[:, np.isfinite(seen).any(axis=0)]).any():
        return None
    own = np.concatenate(
        [
            np.maximum(
                np.nan_to_num(each.white, nan=1.0) ** 2 / each.samples[:, None] + each.wander**2,
                each.table_error**2,
            )
            for each in sessions
        ]
    )
    return np.asarray(counts @ np.swapaxes(counts, -1, -2) + own[:, :, None] * np.eye(own.shape[1]))


def _replicates(sessions: tuple[UnitSession, ...], step: float, stand: Labels) -> Labels:
    """Return the number of the condition that each dwell repeats after a new approach, -1 else.

    `stand` (u,): what was read again without a new approach is no repeat.
    """
    labels, number, begun = [], 0, 0
    for each in sessions:
        pose, load, dwell = each.still.theta, each.still.load, each.cut.dwell
        here = stand[begun : begun + len(each)]
        begun += len(each)
        range_ = np.repeat([np.linalg.norm(load[:, i : i + 3], axis=1).max() for i in (0, 3)], 3)
        own = np.full(len(each), -1)
        for i in np.flatnonzero(dwell):
            if own[i] >= 0:
                continue
            alike = dwell & (own < 0)
            alike &= (np.abs(pose - pose[i]) <= SAME_POSE_COUNTS * step).all(axis=1)
            alike &= (np.abs(load - load[i]) <= SAME_LOAD * range_ + 1e-12).all(axis=1)
            rows = np.flatnonzero(alike)
            first = np.unique(here[rows], return_index=True)[1]
            alike[rows] = (here[rows] < 0) | np.isin(np.arange(len(rows)), first)
            if alike.sum() > 1:
                own[alike] = number
                number += 1
        labels.append(own)
    return np.concatenate(labels)


def hidden_counts(table: Table, cut: Cut, theta: Array) -> Array:
    """Return what a standard deviation of each motor's hidden part does to units, (u, 6, 2).

    Between two counts an encoder shows nothing.  In motion every moment hides a part of its own; a
    motor at rest hides the same part all the time, before and after a load is put on.
    `theta` (u, 2): mean angles of the units [rad].
    """
    mechanism, step = table.mechanism, table.geometry.limits.encoder_step
    jacobian = np.zeros((len(theta), 6, 2))
    jacobian[:, 3:] = mechanism.jacobian(mechanism.forward(theta))
    known = counts_known(cut, step)
    return np.asarray(jacobian * (step / np.sqrt(12.0 * known))[:, None, :])


def counts_known(cut: Cut, step: float) -> Array:
    """Return how many counts of their own the mean angles of units rest on, (u, 2)."""
    low, high = cut.extremes(cut.block.theta)
    moments = np.bincount(cut.unit[cut.unit >= 0], minlength=len(low))[:, None]
    return np.clip((high - low) / step, 1.0, np.where(cut.dwell[:, None], 1.0, moments))


def stands_of(model: ErrorModel, sessions: Sequence[UnitSession]) -> Labels:
    """Return the stand of the motors that each unit shares with others, -1 for none, (u,)."""
    found, first = [], 0
    for each in sessions:
        own = _stands(each.cut, model.table.geometry.limits.encoder_step, np.inf)
        if _moved_unseen(model, each, own):
            own = _stands(each.cut, model.table.geometry.limits.encoder_step, SPARSE_S)
        alike = np.bincount(own[own >= 0], minlength=1)
        alone = (own < 0) | (alike[np.maximum(own, 0)] < 2)
        found.append(np.where(alone, -1, own + first))
        first += len(alike)
    return np.concatenate(found)


def _moved_unseen(model: ErrorModel, session: UnitSession, stand: Labels) -> bool:
    """Tell whether motors moved between readings of one pose that are further apart than a second.

    A new approach hides another part of the counts, so what such readings differ by tells.

    `stand` (u,): in which each unit lies if they did not.
    """
    begin, end = session.span.T
    far = (stand[1:] == stand[:-1]) & (stand[1:] >= 0) & (begin[1:] - end[:-1] > SPARSE_S)
    if not far.any():
        return False
    left = session.residual(model.batch(session.still).measured)
    hidden = session.columns_seen(hidden_counts(model.table, session.cut, session.still.theta))
    apart = np.nan_to_num(left[1:] - left[:-1])[far]
    parts = (np.linalg.pinv(hidden[1:][far]) @ apart[..., None])[..., 0]
    return bool(np.mean(parts**2) > HALF_OF_A_NEW_APPROACH)


def _stands(cut: Cut, step: float, longest_s: float) -> Labels:
    """Return the number of the stand in which each unit lies, -1 in motion, (u,).

    A motor that comes to rest shows the count of its rest already, and is not there yet.

    `longest_s`: time without any sample in which it may have moved and come back [s].
    """
    theta, number = cut.block.theta, np.zeros(len(cut.kept), dtype=np.intp)
    begun, late = theta[0], np.diff(cut.block.time, prepend=cut.block.time[0]) > longest_s
    for moment in range(1, len(theta)):
        moved = bool(late[moment] or (np.abs(theta[moment] - begun) > COUNTS * step).any())
        begun = theta[moment] if moved else begun
        number[moment] = number[moment - 1] + moved
    first, last = cut.extremes(number)
    # A count that flickers at rest is as fast at its moment as a slow motion.
    fastest = cut.extremes(np.abs(cut.mean_speed))[1].max(axis=1)
    still = cut.dwell | (fastest <= COUNTS * step / WINDOW_S)
    return np.where((first == last) & still, first, -1.0).astype(np.intp)
