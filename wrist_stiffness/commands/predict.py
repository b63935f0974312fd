"""Predict one pose."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np

from wrist_stiffness.lookup.table import Evaluation
from wrist_stiffness.mechanism.components import ELASTIC, Array
from wrist_stiffness.mechanism.rigid_motion import exp_twist, log_motion
from wrist_stiffness.model.error_model import Load, Prediction
from wrist_stiffness.model.evaluation import FIRST_ORDER_LIMIT
from wrist_stiffness.model.model_file import load_model
from wrist_stiffness.simulation.exact import exact_equilibrium


def predict(
    model: str | Path,
    angles: Sequence[float],
    load: Sequence[float],
    on_platform: bool,
    both: bool = False,
) -> dict[str, Any]:
    """Predict the pose error at one pose under one load, as people and programs read it.

    `angles`: motor angles [rad]; `load`: wrench on the platform at O [N, N m]; `on_platform`:
    whether it is given in `wrist_platform` instead of `wrist_base`; `both`: also evaluate the table
    in the way that the nodes do not use.  Raises `WristError` if the model cannot be read, or pose
    or load are out of range.
    """
    error_model = load_model(model)
    theta, wrench = np.array(angles, dtype=float), Load(np.array(load, dtype=float), on_platform)
    prediction = error_model.predict(theta, wrench)
    other = None
    if both:
        way: Evaluation = "spline" if error_model.evaluation == "closed_form" else "closed_form"
        other = _values(error_model.with_evaluation(way).predict(theta, wrench))
    table = error_model.table
    configuration = prediction.configuration
    past_first_order = prediction.phi > FIRST_ORDER_LIMIT
    exact = None
    if past_first_order and not error_model.effects:
        # With finite rotations; of effects only the first order is known.
        state = exact_equilibrium(table, theta, wrench.in_base(configuration))
        exact = _lengths(log_motion(state.rotation @ configuration.platform.T, state.shift))
    return {
        **_values(prediction),
        "evaluation": error_model.evaluation,
        "other_evaluation": other,
        "exact": exact,
        "past_first_order": past_first_order,
        "energy_share": _shares(table.shares(configuration), wrench.in_base(configuration)),
        "tilt_deg": float(np.degrees(table.mechanism.tilt(theta))),
        "singularity_D": float(configuration.singularity),
        "in_operative_workspace": bool(table.workspace.operative(theta)),
        "sectors_in_contact": int(np.count_nonzero(prediction.active)),
    }


def _lengths(twist: Array) -> dict[str, float]:
    _, shift = exp_twist(twist)
    return {
        "s_um": 1e6 * float(np.linalg.norm(shift)),
        "phi_mdeg": 1e3 * float(np.degrees(np.linalg.norm(twist[3:]))),
    }


def _shares(shares: Array, wrench: Array) -> dict[str, float]:
    """Return the part of the load's strain energy in each component, slides free; 0 for no load."""
    energy = np.einsum("i,kij,j->k", wrench, shares, wrench)
    total = energy.sum()
    return {
        name: float(part / total) if total else 0.0
        for name, part in zip(ELASTIC, energy, strict=True)
    }


def _values(prediction: Prediction) -> dict[str, Any]:
    shift = prediction.motion[1]
    return {
        "s_um": 1e6 * prediction.shift_norm,
        "phi_mdeg": 1e3 * float(np.degrees(prediction.phi)),
        "shift_um": (1e6 * shift).tolist(),
        "rotation_mdeg": (1e3 * np.degrees(prediction.twist[3:])).tolist(),
        "sigma_um": (1e6 * np.sqrt(np.diagonal(prediction.covariance)[:3])).tolist(),
        "sigma_mdeg": (1e3 * np.degrees(np.sqrt(np.diagonal(prediction.covariance)[3:]))).tolist(),
    }
