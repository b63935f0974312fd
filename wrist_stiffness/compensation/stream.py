"""One path from the sample on: live nodes and replay call the very same methods.

A shell converts a message into numbers, calls one of these methods and converts the answer out.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Sequence
from dataclasses import dataclass, field, replace

import numpy as np
from numpy.typing import NDArray

from wrist_stiffness.compensation.held_signals import HeldSignals
from wrist_stiffness.compensation.intake import Frames, StaticTransform, sensor_frames
from wrist_stiffness.compensation.load_history import LoadHistory, Zero
from wrist_stiffness.compensation.running_model import RunningModel
from wrist_stiffness.compensation.settings import StreamSettings
from wrist_stiffness.errors import InputError, WristError
from wrist_stiffness.mechanism.compiled import Flags
from wrist_stiffness.mechanism.components import Array
from wrist_stiffness.mechanism.configuration import Configuration
from wrist_stiffness.mechanism.statics import contact_operators
from wrist_stiffness.mechanism.vectors import block_diagonal
from wrist_stiffness.model.error_model import ErrorModel, Load, Prediction


class Stream:
    """What all streams share: a model, the signals it needs and the settings.

    `model`: may be replaced between samples; `settings`: names, frames, limits.
    """

    def __init__(self, model: ErrorModel | None, settings: StreamSettings) -> None:
        self.loads = LoadHistory(
            settings.load_age_limit_s, settings.frames
        )  # loads by stamp, tared
        # by component or `ambient` [degC]
        self.temperatures = HeldSignals(settings.signal_age_limit_s)
        self.covariates = HeldSignals(settings.signal_age_limit_s)  # by name, in their own units
        self._settings = settings
        self._transforms: dict[str, StaticTransform] = {}
        self.model = model

    @property
    def model(self) -> ErrorModel | None:
        """The model; one that is put in its place remembers nothing yet."""
        return self._model

    @model.setter
    def model(self, model: ErrorModel | None) -> None:
        self._model = model
        self._running = (
            None
            if model is None
            else RunningModel(self._used(model), self.temperatures, self.covariates)
        )

    def _used(self, model: ErrorModel) -> ErrorModel:
        """Return what of a model counts for this stream: not what a tare has taken away already."""
        if self.loads.zero is None:
            return model
        return model.with_effects(*(each for each in model.effects if not each.law.tared))

    @property
    def settings(self) -> StreamSettings:
        """Names, frames, limits; may be replaced between samples."""
        return self._settings

    @settings.setter
    def settings(self, settings: StreamSettings) -> None:
        self._settings = settings
        self._use_frames()
        self.loads.age_limit_s = settings.load_age_limit_s
        self.temperatures.age_limit_s = settings.signal_age_limit_s
        self.covariates.age_limit_s = settings.signal_age_limit_s

    def on_static_transforms(self, transforms: Sequence[StaticTransform]) -> None:
        """Learn frames that sensors may speak in; those of the settings go first."""
        own = self._settings.frames.own_name
        for each in transforms:
            named = replace(each, parent=own(each.parent), child=own(each.child))
            self._transforms[named.child] = named
        self._use_frames()

    def _use_frames(self) -> None:
        heard = sensor_frames(self._transforms.values())
        own = self._settings.frames
        self.loads.frames = Frames({**heard, **own.sensors}, own.prefix)

    @property
    def dropped_signals(self) -> tuple[str, ...]:
        """Which temperatures and covariates were too old for the last sample, one text each."""
        limit_s = self.settings.signal_age_limit_s
        names = (*self.temperatures.stale, *self.covariates.stale)
        return tuple(f"{name}: older than {limit_s:g} s, not used" for name in names)

    def use_zero(self, zero: Zero | None) -> None:
        """Tare: take a zero off every load (see `LoadHistory.measured_zero`).

        A model that knows the sensor's zero goes on without it, and remembers nothing yet.
        """
        changed = (zero is None) != (self.loads.zero is None)
        self.loads.zero = zero
        if changed and self._model and any(each.law.tared for each in self._model.effects):
            self.model = self._model

    def running_model(self) -> RunningModel:
        """Return the model with its memory, or raise InputError where there is none."""
        if self._running is None:
            raise InputError("no model is loaded")
        return self._running


@dataclass(frozen=True)
class PredictedBlock:
    """Predictions for n joint states."""

    known: Flags  # (n,), which of them could be predicted; the rest of the others is undefined
    twist: Array  # (n, 6), at O in F [m, rad]
    covariance: Array  # (n, 6, 6), of the twist
    configuration: Array  # (n, 66), the rigid wrist, as `Configuration.of_row` takes it
    faults: dict[int, WristError] = field(default_factory=dict)  # why one could not, by its place
    # effects and signals that were left out
    warnings: Counter[str] = field(default_factory=Counter)


class PredictionStream(Stream):
    """Pose error for every joint state.

    `model`: may be replaced between samples; without one nothing is predicted.
    """

    def on_joint_state(
        self,
        stamp_ns: int,
        names: Sequence[str],
        positions: Sequence[float],
        velocities: Sequence[float] = (),
    ) -> Prediction:
        """Predict for a joint state.

        `stamp_ns`: its stamp [ns]; `names`, `positions`, `velocities`: as in
        sensor_msgs/JointState [rad, rad/s]; speeds that are absent or not finite are taken as
        differences of the angles.  Gives the pose error, to be published with the joint state's
        stamp.  Raises `WristError` if the sample, the pose or the load cannot be used: nothing is
        to be published.
        """
        motors = self.settings.motors
        theta, theta_dot = motors.angles(names, positions), motors.speeds(names, velocities)
        _, load = self.loads.at(stamp_ns)
        running = self.running_model()
        prediction = running.advance(stamp_ns, theta, load, theta_dot)
        if self.settings.load_noise is not None:
            added = load_covariance(running.model, prediction, load, self.settings.load_noise)
            if prediction.added_covariance is not None:
                added = added + prediction.added_covariance
            prediction = replace(prediction, added_covariance=added)
        return prediction

    @property
    def in_blocks(self) -> bool:
        """Whether `on_joint_states` is one compiled loop: each sample stands for itself."""
        running = self._running
        if running is None or running.compiled is None or self.settings.load_noise is not None:
            return False
        return running.model.certain and not running.model.constants.warnings

    def on_joint_states(
        self, stamps: NDArray[np.int64], theta: Array, theta_dot: Array | None = None
    ) -> PredictedBlock:
        """Predict for many joint states, to the bit as `on_joint_state` would one by one.

        Where not `in_blocks` it is asked one by one.

        `stamps` (n,): not falling [ns]; `theta` (n, 2): motor angles [rad]; `theta_dot` (n, 2):
        their speeds [rad/s].
        """
        running, compiled = self.running_model(), None
        if self.in_blocks:
            compiled = running.compiled
        if compiled is None:
            n = len(stamps)
            rows = np.empty((n, 6)), np.empty((n, 6, 6)), np.empty((n, 66))
            found = PredictedBlock(np.zeros(n, dtype=bool), *rows)
        else:
            wrench, on_platform, known = self.loads.block_at(stamps)
            served = compiled.predict(theta, wrench, on_platform, running.contact, known)
            known &= served.status == 0
            at = Configuration.of_row(served.configuration)
            covariance = running.model.table_covariance(at, served.twist)
            found = PredictedBlock(known, served.twist, covariance, served.configuration)
        names = self.settings.motors.motor_1, self.settings.motors.motor_2
        for place in np.flatnonzero(~found.known).tolist():
            speeds = () if theta_dot is None else theta_dot[place].tolist()
            angles = theta[place].tolist()
            try:
                one = self.on_joint_state(int(stamps[place]), names, angles, speeds)
            except WristError as error:
                found.faults[place] = error
                continue
            found.known[place], found.twist[place] = True, one.twist
            found.covariance[place] = one.covariance
            found.configuration[place] = one.configuration.row
            found.warnings.update((*one.warnings, *self.dropped_signals))
        return found


def load_covariance(model: ErrorModel, prediction: Prediction, load: Load, noise: Array) -> Array:
    """Return the covariance of the twist that comes from the load.

    `model`: made the prediction.  `prediction`: at the pose and under the load; its flange sectors
    in contact stay so.  `load`: says in which axes the noise is.  `noise` (6,): standard deviation
    of force and moment at O [N, N m].  Gives (6, 6): of the twist at O in F [m, rad].
    """
    sensitivity = tangent_compliance(model, prediction)
    if load.on_platform:
        sensitivity = sensitivity @ block_diagonal(prediction.configuration.platform)
    spread = sensitivity * noise
    return spread @ spread.T


def tangent_compliance(model: ErrorModel, prediction: Prediction) -> Array:
    """Return the change of the twist with the load, contacts held: C - B A^-1 B', (6, 6)."""
    geometry = model.table.geometry
    operators = contact_operators(prediction.configuration, model.parts, geometry.gravity)
    active = prediction.active
    force_twist = operators.force_twist[:, active]
    approach = operators.approach[np.ix_(active, active)]
    return operators.compliance - force_twist @ np.linalg.solve(approach, force_twist.T)
