"""Predict the platform's pose error at a pose under a load."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from wrist_stiffness.lookup.response import respond
from wrist_stiffness.lookup.table import Evaluation, Table
from wrist_stiffness.mechanism.components import Array
from wrist_stiffness.mechanism.kinematics import Configuration
from wrist_stiffness.mechanism.rigid_motion import exp_twist
from wrist_stiffness.mechanism.vectors import block_diagonal


@dataclass(frozen=True)
class Load:
    """Wrench on the platform at O, fixed in F or turning with the platform.

    Parameters
    ----------
    wrench : (6,) float
        Force and moment at O [N, N m].
    on_platform : bool
        True if the components are in U (`wrist_platform`), else in F (`wrist_base`).
    """

    wrench: Array
    on_platform: bool = False

    def in_base(self, configuration: Configuration) -> Array:
        """Return the wrench in F at a configuration, (6,) [N, N m]."""
        if not self.on_platform:
            return self.wrench
        return block_diagonal(configuration.platform) @ self.wrench


@dataclass(frozen=True)
class Prediction:
    """Predicted pose error of the platform, T_err = exp(twist).

    Parameters
    ----------
    twist : (6,) float
        At O in F, own weight included [m, rad].
    covariance : (6, 6) float
        Of the twist, from the table's stated error and the encoder step.
    configuration : Configuration
        The rigid wrist.
    active : (m,) bool
        Flange sectors in contact.
    """

    twist: Array
    covariance: Array
    configuration: Configuration
    active: NDArray[np.bool_]

    @property
    def motion(self) -> tuple[Array, Array]:
        """Rotation R_err (3, 3) and shift s (3,) [m]."""
        return exp_twist(self.twist)

    @property
    def shift_norm(self) -> float:
        """Length of s [m]."""
        return float(np.linalg.norm(self.motion[1]))

    @property
    def phi(self) -> float:
        """Angle of R_err [rad]."""
        return float(np.linalg.norm(self.twist[3:]))


@dataclass(frozen=True)
class ErrorModel:
    """A table and the effects that were added to it.

    Parameters
    ----------
    name : str
        What people call it.
    table : Table
        Elastic lookup of the wrist.
    evaluation : str
        `closed_form` or `spline`.
    """

    name: str
    table: Table
    evaluation: Evaluation

    def with_evaluation(self, evaluation: Evaluation) -> ErrorModel:
        """Return the same model with the other evaluation of its table."""
        return replace(self, evaluation=evaluation)

    def predict(
        self, theta: Array, load: Load, active: NDArray[np.bool_] | None = None
    ) -> Prediction:
        """Predict the pose error of one sample.

        Parameters
        ----------
        theta : (2,) float
            Motor angles [rad].
        load : Load
            What acts on the platform, own weight aside.
        active : (m,) bool, optional
            First guess of the flange sectors in contact; changes the cost, not the result beyond
            rounding.

        Returns
        -------
        Prediction
            Twist, covariance and contact state.

        Raises
        ------
        UnreachablePoseError, SingularPoseError
            If the pose is outside the table's domain.
        LoadRangeError
            If the load is outside the table's range.
        """
        configuration = self.table.workspace.configuration(theta)
        wrench = load.in_base(configuration)
        self.table.check_load(wrench)
        operators = self.table.operators_at(configuration, self.evaluation)
        response = respond(operators, wrench, active=active)
        covariance = self._covariance(configuration, response.twist)
        return Prediction(response.twist, covariance, configuration, response.active)

    def _covariance(self, configuration: Configuration, twist: Array) -> Array:
        """Variance of the table's stated error and of an encoder count spread over its step."""
        jacobian = np.zeros((6, 2))
        jacobian[3:] = self.table.mechanism.jacobian(configuration)
        step = self.table.geometry.limits.encoder_step
        relative = self.table.header.errors["stated_relative"]
        scale = np.repeat([np.linalg.norm(twist[:3]), np.linalg.norm(twist[3:])], 3)
        return jacobian @ jacobian.T * step**2 / 12.0 + np.diag((relative * scale) ** 2 / 3.0)
