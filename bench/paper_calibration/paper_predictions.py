"""What a calibrated wrist predicts beyond the published figures: where equal fits part."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
from paper_figures import TO_UNITS, PaperExperiment

from wrist_stiffness.lookup.response import rated_wrench, respond
from wrist_stiffness.mechanism.components import ELASTIC, Array
from wrist_stiffness.mechanism.configuration import Configuration
from wrist_stiffness.mechanism.geometry_file import mechanism_of
from wrist_stiffness.mechanism.statics import component_shares, contact_operators

GRID = 25
"""Poses along each motor angle; the means run over those in the operative workspace."""

LOADS = {
    "1 N along x at O": (1.0, 0.0, 0.0, 0.0, 0.0, 0.0),
    "1 N along y at O": (0.0, 1.0, 0.0, 0.0, 0.0, 0.0),
    "1 N upward at O": (0.0, 0.0, 1.0, 0.0, 0.0, 0.0),
    "20 N mm about x": (0.0, 0.0, 0.0, 0.02, 0.0, 0.0),
    "20 N mm about z": (0.0, 0.0, 0.0, 0.0, 0.0, 0.02),
}
"""Wrenches at O in F [N, N m] that the paper did not apply."""


def predictions(experiment: PaperExperiment) -> dict[str, tuple[float, float]]:
    """Predict what the paper did not publish.

    Parameters
    ----------
    experiment : PaperExperiment
        A wrist.

    Returns
    -------
    dict of str to (float, float)
        Mean s [um] and phi [mdeg] in the operative workspace, by load.
    """
    configuration = _operative(experiment)
    geometry, components = experiment.geometry, experiment.components
    weightless = contact_operators(configuration, components, np.zeros(3))
    rated = rated_wrench(configuration, geometry)
    found = {}
    for name, point in (("O", np.zeros(3)), ("P0", geometry.platform.centre)):
        load = rated_wrench(configuration, replace(geometry, load_point=point))
        found[f"1 N downward at {name}"] = _mean(respond(weightless, load).twist)
    found["the calibrated load, flanges open"] = _mean(
        np.einsum("nij,nj->ni", weightless.compliance, rated)
    )
    for name, wrench in LOADS.items():
        load = np.broadcast_to(np.array(wrench), rated.shape)
        found[name] = _mean(respond(weightless, load).twist)
    heavy = contact_operators(configuration, components, geometry.gravity)
    found["own weight alone"] = _mean(respond(heavy, np.zeros_like(rated)).twist)
    return found


def energy_budget(experiment: PaperExperiment) -> dict[str, float]:
    """Split the strain energy of the calibrated load by component, with free slides.

    Parameters
    ----------
    experiment : PaperExperiment
        A wrist.

    Returns
    -------
    dict of str to float
        Mean share in the operative workspace [-]; the shares add up to 1.
    """
    configuration = _operative(experiment)
    rated = rated_wrench(configuration, experiment.geometry)
    energy = np.einsum(
        "ni,nkij,nj->nk", rated, component_shares(configuration, experiment.components), rated
    )
    share = (energy / energy.sum(axis=1, keepdims=True)).mean(axis=0)
    return dict(zip(ELASTIC, share.tolist(), strict=True))


def _operative(experiment: PaperExperiment) -> Configuration:
    workspace = experiment.workspace
    poses = workspace.grid(GRID)
    return mechanism_of(experiment.geometry).forward(poses[workspace.operative(poses)])


def _mean(twist: Array) -> tuple[float, float]:
    shift, turn = (np.linalg.norm(twist[:, half], axis=1) for half in (slice(3), slice(3, 6)))
    return float(shift.mean() * TO_UNITS[3]), float(turn.mean() * TO_UNITS[4])
