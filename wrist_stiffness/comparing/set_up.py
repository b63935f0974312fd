"""What is set up anew in every session, fitted again: registrations, encoder zeros, load tare.

Without it every comparison with an instrument shows where that instrument stands and little else:
T_measured = X T_true Y has two unknown registrations.  All four are known in closed form, so the
fit costs little more than one prediction.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from wrist_stiffness.identification.taken_up import TakenUp
from wrist_stiffness.inference.observations import Mask, Observations
from wrist_stiffness.inference.outliers import robust_scale
from wrist_stiffness.mechanism.components import Array
from wrist_stiffness.mechanism.kinematics import Mechanism
from wrist_stiffness.mechanism.rigid_motion import exp_twist, log_motion, rotation_vector
from wrist_stiffness.model.block import Block
from wrist_stiffness.model.error_model import ErrorModel
from wrist_stiffness.model.parameters import si_factor
from wrist_stiffness.model.registry import effect_named
from wrist_stiffness.sessions.gauges import cleared
from wrist_stiffness.sessions.observing import Observed, tabulate, usual_wander
from wrist_stiffness.sessions.refitted import REGISTRATIONS, SET_UP, names_of
from wrist_stiffness.sessions.unit_session import UnitSession

GROUPS = {
    "measurement_frame": slice(0, 6),
    "target_mounting": slice(6, 12),
    "encoder_offset": slice(12, 14),
    "load_bias": slice(14, 20),
}
"""Effects that stand for what is set up anew, with their columns."""

PLAUSIBLE = np.concatenate(
    [np.repeat([1e-3, 3e-3, 1e-3, 3e-3], 3), np.full(2, 1e-3), np.repeat([0.05, 2e-3], 3)]
)
"""Standard deviations of the priors [m, rad, N, N m]: directions that the units hardly tell
apart stay small by them."""

ROUNDS = 4

REACH = 4.0
"""Robust standard deviations from which a unit no longer pulls the fit."""

INDEPENDENT = 50
"""So many units of a session count against the priors: a model that is wrong is wrong alike at
neighbours, and a tare must not stand in for it."""

Motion = tuple[Array, Array]
"""Rotation (3, 3) and shift (3,) [m]."""

LOAD_STEP = np.repeat([1e-2, 1e-3], 3)
"""Change of the load that shows what a tare does [N, N m]."""


@dataclass(frozen=True, eq=False)
class SetUp:
    """One session's set-up as a fit finds it, relative to what the model has."""

    session: str  # name
    # (20,), shift and turn of the instrument in F, of the target in U, encoder zeros, tare [m, rad,
    # rad, N, N m]
    values: Array
    residual: Array  # (u, 6), what it leaves of all units of the session [m, rad]
    columns: Array  # (u, 6, 20), change of that by one `PLAUSIBLE` of each; 0 for what stays
    # (u, 6), what the squares of that counted in the fit, where the priors count 1; 0 where not
    # measured
    weights: Array

    @property
    def moved(self) -> Array:
        """Where it stands, in standard deviations of the priors, (20,)."""
        return self.values / PLAUSIBLE

    def taken_up(self, table: Observations, columns: Array) -> list[TakenUp]:
        """Tell what each part took up of a table, (u, 6, 20) being the columns there."""
        found, place = [], 0
        for name in names_of(SET_UP):
            parameters = effect_named(name).parameters
            own = slice(place, place + len(parameters))
            place = own.stop
            if not self.values[own].any():
                continue
            sizes = table.rms((columns[:, :, own] @ self.moved[own]) ** 2)
            far = int(np.argmax(np.abs(self.moved[own])))
            key, value = parameters[far].key, self.values[own][far]
            found.append(
                TakenUp(
                    f"{name} in {self.session}",
                    {q.name: sizes[q.key] for q in table.reported},
                    key,
                    float(value / si_factor(key)),
                    float(abs(self.moved[own][far])),
                )
            )
        return found


def without_set_up(
    model: ErrorModel,
    sessions: tuple[UnitSession, ...],
    calibrated: Sequence[str] = (),
    predicted: Array | None = None,
) -> tuple[Observed, Observations, tuple[SetUp, ...]]:
    """Return what a model leaves of units, what a set-up fitted anew leaves of that, and the fit.

    `sessions`: in the order of time; `calibrated`: effects among `GROUPS` that the recordings say
    were calibrated: they stay; `predicted` (u, 6): what the model predicts of all units, where that
    is known already [m, rad].
    """
    observed = tabulate(model, sessions, predicted)
    free = np.ones(len(PLAUSIBLE), dtype=bool)
    gauges = sessions[0].gauges is not None
    for effect in (*calibrated, *(REGISTRATIONS if gauges else ())):
        free[GROUPS.get(effect, slice(0))] = False
    parts = np.split(observed.predicted, np.cumsum([len(each) for each in sessions])[:-1])
    set_ups = tuple(
        _refit(model, session, part, free) for session, part in zip(sessions, parts, strict=True)
    )
    left = np.concatenate([each.residual for each in set_ups])
    seen = np.concatenate([np.isfinite(each.values) for each in sessions])
    in_table = (seen & np.isfinite(left)).any(axis=1)
    return observed, observed.observations.with_values(left[in_table]), set_ups


def _refit(model: ErrorModel, session: UnitSession, predicted: Array, free: Mask) -> SetUp:
    theta = session.mean(session.block.theta)
    mechanism = model.table.mechanism
    home = mechanism.forward(theta)
    softness = _softness(model, session, theta)
    instrument, target = (np.eye(3), np.zeros(3)), (np.eye(3), np.zeros(3))
    zero, tare = np.zeros(2), np.zeros(6)
    taken = np.zeros(len(PLAUSIBLE))
    pointed = np.isfinite(session.values[:, 3:].sum(axis=1)) | (session.gauges is not None)
    wander = usual_wander(session.quantities)

    def said() -> tuple[Array, Array]:
        """Rotation and shift of the platform as the instrument should see it."""
        turn, shift = exp_twist(predicted + softness @ tare)
        turn = turn @ mechanism.platform_rotation(theta + zero)
        shift = shift + turn @ target[1]
        return instrument[0] @ turn @ target[0], shift @ instrument[0].T + instrument[1]

    def left() -> tuple[Array, Array, Array]:
        turn, shift = said()
        bow = _bow(mechanism, session, instrument, target, zero)
        error = exp_twist(np.hstack([np.zeros_like(shift), bow[:, 3:]]))[0] @ turn
        twist = log_motion(error @ np.swapaxes(home.platform, -1, -2), shift + bow[:, :3])
        return unmounted(session.residual(twist)), turn, shift

    def unmounted(values: Array) -> Array:
        return cleared(values, session.common, wander)

    def shown(columns: Array) -> Array:
        """Return what the instrument shows of columns and no mounting of gauges takes up."""
        return unmounted(session.columns_seen(columns))

    def slopes(turn: Array, shift: Array) -> Array:
        """Change of the prediction by each unknown, in its `PLAUSIBLE`; 0 for what stays."""
        columns = np.zeros((len(theta), 6, len(PLAUSIBLE)))
        columns[:, :, :6] = np.eye(6)
        columns[:, :3, 6:9] = columns[:, 3:, 9:12] = turn
        columns[:, :3, 9:12] = np.cross(shift[:, :, None], turn, axis=1)
        columns[:, 3:, 12:14] = mechanism.jacobian(home)
        columns[:, :, 14:] = softness
        # Where no rotation was measured, shifts are compared and no twists.
        lever = np.repeat(shift[:, :, None], len(PLAUSIBLE), axis=2)
        lever[:, :, 12:] -= instrument[1][:, None]
        carried = np.cross(columns[:, 3:], lever, axis=1)
        columns[:, :3] += np.where(pointed[:, None, None], 0.0, carried)
        return columns * np.where(free, PLAUSIBLE, 0.0)

    for _ in range(ROUNDS):
        residual, turn, shift = left()
        moved, weights = _solved(shown(slopes(turn, shift)), residual, taken / PLAUSIBLE)
        step = PLAUSIBLE * moved
        taken += step
        instrument = _composed(exp_twist(step[:6]), instrument)
        target = _composed(target, exp_twist(step[6:12]))
        zero, tare = zero + step[12:14], tare + step[14:]
    values = np.concatenate([log_motion(*instrument), log_motion(*target), zero, tare])
    residual, turn, shift = left()
    return SetUp(session.name, values, residual, -shown(slopes(turn, shift)), weights)


def _bow(
    mechanism: Mechanism, session: UnitSession, instrument: Motion, target: Motion, zero: Array
) -> Array:
    """Return by how much the mean of registered poses is off the pose at the mean angles, (u, 6).

    In motion a target that is a millimetre off goes along a bow, and a unit is half a second of it.
    """

    def registered(theta: Array) -> Array:
        moved = mechanism.platform_rotation(theta + zero)
        nominal = np.swapaxes(mechanism.platform_rotation(theta), -1, -2)
        turn = rotation_vector(instrument[0] @ moved @ target[0] @ nominal)
        return np.hstack([(moved @ target[1]) @ instrument[0].T + instrument[1], turn])

    theta = session.block.theta
    return session.mean(registered(theta)) - registered(session.mean(theta))


def _composed(first: Motion, second: Motion) -> Motion:
    """Return the motion `second`, followed by `first`."""
    return first[0] @ second[0], first[0] @ second[1] + first[1]


def _softness(model: ErrorModel, session: UnitSession, theta: Array) -> Array:
    """Return how the units' elastic twist changes with the load, (u, 6, 6) [m/N, ...]."""
    block, mean = session.block, session.mean
    still = Block(
        mean(block.time), theta, mean(block.load), load_on_platform=block.load_on_platform
    )
    # Towards zero, so that no load leaves the table's range.
    step = np.where(still.load > 0.0, -LOAD_STEP, LOAD_STEP)
    load = still.load[:, None] + step[:, None] * np.vstack([np.zeros(6), np.eye(6)])
    beside = still.take(np.repeat(np.arange(len(still)), load.shape[1]))
    twist = model.with_effects().batch(replace(beside, load=load.reshape(-1, 6))).twist
    twist = np.swapaxes(twist.reshape(load.shape), 1, 2)
    return np.nan_to_num((twist[:, :, 1:] - twist[:, :, :1]) / step[:, None])


def _solved(columns: Array, residual: Array, taken: Array) -> tuple[Array, Array]:
    """Least squares that lost beams do not pull, with a prior of unit scatter: (p,), and weights.

    `columns` (u, 6, p): per standard deviation of the prior; `residual` (u, 6): NaN = not measured;
    `taken` (p,): how far the parameters are from their prior means already.
    """
    known = np.isfinite(residual)
    rows = np.where(known[:, :, None], columns, 0.0)
    values = np.where(known, residual, 0.0)
    parameters = np.zeros(columns.shape[2])
    share = min(1.0, INDEPENDENT / len(values))
    for _ in range(ROUNDS):
        miss = np.where(known, values - rows @ parameters, np.nan)
        scale = robust_scale(miss)
        square = np.sum(np.nan_to_num(miss / scale) ** 2, axis=1)
        distance = np.sqrt(square / np.maximum(known.sum(axis=1), 1))
        weight = share * np.minimum(1.0, REACH / np.maximum(distance, REACH))
        factor = np.sqrt(weight)[:, None] / scale
        white = (factor[:, :, None] * rows).reshape(-1, columns.shape[2])
        moment = white.T @ (factor * values).reshape(-1) - taken
        parameters = np.linalg.solve(white.T @ white + np.eye(len(moment)), moment)
    return np.asarray(parameters), np.where(known, factor**2, 0.0)
