"""What the noise of the load adds to the covariance of a prediction."""

from __future__ import annotations

import numpy as np

from wrist_stiffness.mechanism.components import Array
from wrist_stiffness.mechanism.statics import contact_operators
from wrist_stiffness.mechanism.vectors import block_diagonal
from wrist_stiffness.model.error_model import ErrorModel, Load, Prediction


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
