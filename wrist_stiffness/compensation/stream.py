"""One path from the sample on: live nodes and replay call the very same methods.

A shell converts a message into numbers, calls one of these methods and converts the answer out.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field

import numpy as np

from wrist_stiffness.compensation.correction import Correction, correct
from wrist_stiffness.compensation.intake import (
    CORRECTED_FRAME,
    Frames,
    LoadHistory,
    MotorNames,
)
from wrist_stiffness.compensation.objective import Objective, ObjectiveName
from wrist_stiffness.errors import InputError, WristError
from wrist_stiffness.mechanism.components import Array
from wrist_stiffness.model.error_model import ErrorModel, Load, Prediction

TARE_WINDOW_S = 1.0


@dataclass(frozen=True)
class StreamSettings:
    """What nodes and replay can be told, the same for both.

    Parameters
    ----------
    motors : MotorNames
        Joint names of the motors.
    frames : Frames
        Frames in which loads arrive.
    load_age_limit_s : float
        Oldest load that is still used [s].
    objective : str
        What the correction makes right.
    correction_limit : float
        Largest correction of a motor angle [rad].
    """

    motors: MotorNames = field(default_factory=MotorNames)
    frames: Frames = field(default_factory=Frames)
    load_age_limit_s: float = 0.5
    objective: ObjectiveName = "pointing"
    correction_limit: float = float(np.radians(0.5))


class LoadIntake:
    """Loads as they arrive, moved to O, less the tare."""

    def __init__(self, settings: StreamSettings) -> None:
        self._frames = settings.frames
        self._history = LoadHistory(settings.load_age_limit_s)
        self._tare: Load | None = None

    def add(
        self, stamp_ns: int, frame_id: str, force: Sequence[float], moment: Sequence[float]
    ) -> None:
        """Take in a wrench message (see `Frames.load` for its errors)."""
        self._history.add(stamp_ns, self._frames.load(frame_id, force, moment))

    def tare(self) -> Load:
        """Make the mean of the last second the new zero and return it."""
        self._tare = self._history.mean_since(TARE_WINDOW_S)
        return self._tare

    def at(self, stamp_ns: int) -> tuple[int, Load]:
        """Return stamp [ns] and load that belong to a joint state (see `LoadHistory.at`)."""
        load_stamp_ns, load = self._history.at(stamp_ns)
        if self._tare is None:
            return load_stamp_ns, load
        if self._tare.on_platform != load.on_platform:
            raise InputError("load: the tare was taken in another frame than this load")
        return load_stamp_ns, Load(load.wrench - self._tare.wrench, load.on_platform)


@dataclass(frozen=True)
class PredictedSample:
    """Prediction for one joint state.

    Parameters
    ----------
    stamp_ns, load_stamp_ns : int
        Stamps of the joint state and of the load that belonged to it [ns].
    prediction : Prediction
        The pose error.
    """

    stamp_ns: int
    load_stamp_ns: int
    prediction: Prediction


class PredictionStream:
    """Pose error for every joint state.

    Parameters
    ----------
    model : ErrorModel
        May be replaced between samples.
    settings : StreamSettings
        Names, frames, limits.
    """

    def __init__(self, model: ErrorModel, settings: StreamSettings) -> None:
        self.model = model
        self.loads = LoadIntake(settings)
        self._settings = settings

    def on_joint_state(
        self, stamp_ns: int, names: Sequence[str], positions: Sequence[float]
    ) -> PredictedSample:
        """Predict for a joint state.

        Parameters
        ----------
        stamp_ns : int
            Its stamp [ns].
        names, positions : sequence
            As in sensor_msgs/JointState [rad].

        Returns
        -------
        PredictedSample
            To be published with the joint state's stamp.

        Raises
        ------
        WristError
            If the sample, the pose or the load cannot be used: nothing is to be published.
        """
        theta = self._settings.motors.angles(names, positions)
        load_stamp_ns, load = self.loads.at(stamp_ns)
        return PredictedSample(stamp_ns, load_stamp_ns, self.model.predict(theta, load))


@dataclass(frozen=True)
class CorrectedCommand:
    """What to send to the motors for one command.

    Parameters
    ----------
    positions : (n,) float
        All joints of the command, the motors corrected [rad].
    theta : (2,) float
        Corrected motor angles [rad].
    delta : (2,) float
        What was added [rad].
    correction : Correction or None
        None where the command passes unchanged.
    fault : WristError or None
        Why it passes unchanged although correction is on.
    """

    positions: Array
    theta: Array
    delta: Array
    correction: Correction | None
    fault: WristError | None


class CorrectionStream:
    """Corrected motor angles for every command; never worse than no correction.

    Parameters
    ----------
    model : ErrorModel
        May be replaced between samples.
    settings : StreamSettings
        Names, frames, objective, limits.
    enabled : bool
        Whether commands are corrected; else they pass unchanged.
    """

    def __init__(self, model: ErrorModel, settings: StreamSettings, enabled: bool) -> None:
        self.model = model
        self.loads = LoadIntake(settings)
        self.enabled = enabled
        self._settings = settings

    def on_command(
        self, stamp_ns: int, frame_id: str, names: Sequence[str], positions: Sequence[float]
    ) -> CorrectedCommand:
        """Correct a command.

        Parameters
        ----------
        stamp_ns : int
            Its stamp [ns].
        frame_id : str
            Its header's frame; `wrist_corrected` marks a command that was corrected already.
        names, positions : sequence
            As in sensor_msgs/JointState [rad].

        Returns
        -------
        CorrectedCommand
            Unchanged, with the fault, wherever a correction cannot be had safely.

        Raises
        ------
        InputError
            If a motor is missing or an angle is not finite: such a command is not to be forwarded.
        """
        theta = self._settings.motors.angles(names, positions)
        sent = np.array(positions, dtype=float)
        if not np.all(np.isfinite(sent)):
            raise InputError(f"command: position {sent.tolist()} is not finite")
        unchanged = CorrectedCommand(sent, theta, np.zeros(2), None, None)
        if not self.enabled:
            return unchanged
        try:
            correction = self._correction(stamp_ns, frame_id, theta)
        except WristError as error:
            return CorrectedCommand(sent, theta, np.zeros(2), None, error)
        corrected = sent.copy()
        corrected[list(self._settings.motors.places(names))] = theta + correction.delta
        return CorrectedCommand(
            corrected, theta + correction.delta, correction.delta, correction, None
        )

    def _correction(self, stamp_ns: int, frame_id: str, theta: Array) -> Correction:
        if frame_id == CORRECTED_FRAME:
            raise InputError("command is marked 'wrist_corrected': passed on unchanged, not twice")
        _, load = self.loads.at(stamp_ns)
        platform = self.model.table.geometry.platform
        objective = Objective(self._settings.objective, platform.normal, platform.tool_point)
        correction = correct(self.model, theta, load, objective)
        largest = float(np.max(np.abs(correction.delta)))
        if largest > self._settings.correction_limit:
            raise InputError(
                f"correction of {np.degrees(largest):.4f} deg is larger than the limit "
                f"{np.degrees(self._settings.correction_limit):g} deg"
            )
        return correction
