"""A corrector that knows the true laws and no more of the future than any other.

What it leaves is the floor of a perfect model: the same hysteresis, slew and noise of the load, the
same ignorance of what comes.
"""

from __future__ import annotations

from collections.abc import Callable
from copy import copy, deepcopy

import numpy as np
from numpy.typing import NDArray

from wrist_stiffness.compensation.correction_stream import CorrectionStream
from wrist_stiffness.compensation.settings import StreamSettings
from wrist_stiffness.mechanism.rigid_motion import log_motion
from wrist_stiffness.model.error_model import ErrorModel, Load, Prediction
from wrist_stiffness.simulation.cell import CellSettings, true_laws
from wrist_stiffness.simulation.wrist import TrueState, TrueWrist

Array = NDArray[np.float64]


class TrueRunningModel:
    """The true wrist in the place of a running model (`compensation/running_model.py`).

    Parameters
    ----------
    model : ErrorModel
        For the table.
    settings : CellSettings
        What is hidden.
    time_s : callable
        Stamp [ns] -> time since the start [s].
    room : callable
        Time since the start [s] -> temperature of the room above the reference [K].
    """

    remembers = True

    def __init__(
        self,
        model: ErrorModel,
        settings: CellSettings,
        time_s: Callable[[int], float],
        room: Callable[[float], float],
    ) -> None:
        self.model = model
        self._time_s, self._room = time_s, room
        self._wrist = TrueWrist(model.table, true_laws(model.table, settings))

    def advance(
        self, stamp_ns: int, theta: Array, load: Load, theta_dot: Array | None = None
    ) -> Prediction:
        """Let the wrist go on."""
        return self._prediction(theta, self._run(self._wrist, stamp_ns, theta, load))

    def preview(
        self, stamp_ns: int, load: Load, theta_dot: Array | None = None
    ) -> Callable[[Array], Prediction]:
        """Return the truth as a function of the angles, to be tried and forgotten."""

        def at(theta: Array) -> Prediction:
            trial = copy(self._wrist)
            # Its parts are large and never change; laws and heat have histories.
            for name in ("_laws", "_heat"):
                setattr(trial, name, deepcopy(getattr(self._wrist, name)))
            return self._prediction(theta, self._run(trial, stamp_ns, theta, load))

        return at

    def _run(self, wrist: TrueWrist, stamp_ns: int, theta: Array, load: Load) -> TrueState:
        now = self._time_s(stamp_ns)
        room = np.array([self._room(now)])
        return wrist.run(np.array([now]), theta[None], load.wrench[None], room)

    def _prediction(self, theta: Array, state: TrueState) -> Prediction:
        configuration = self.model.table.workspace.configuration(theta)
        turned = state.rotation[0] @ configuration.platform.T
        twist = log_motion(turned[None], state.shift)[0]
        return Prediction(
            twist, configuration, np.zeros(0, dtype=bool), self.model.table_covariance
        )


class PerfectStream(CorrectionStream):
    """The corrector of the nodes with the true laws.

    Parameters
    ----------
    model : ErrorModel
        For the table.
    settings : StreamSettings
        As of any corrector.
    truth : TrueRunningModel
        Stands in for the model.
    """

    def __init__(
        self, model: ErrorModel, settings: StreamSettings, truth: TrueRunningModel
    ) -> None:
        super().__init__(model, settings, enabled=True)
        self._running = truth  # type: ignore[assignment]
