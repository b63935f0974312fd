"""A wrist of plausible size for tests: made from springs, not from finite elements."""

import importlib
import sys
from functools import cache
from pathlib import Path

import numpy as np
import pytest
import yaml

from wrist_stiffness.lookup.operators import pack
from wrist_stiffness.lookup.table import Table, TableHeader
from wrist_stiffness.mechanism.components import (
    ELASTIC,
    PASSIVE_JOINTS,
    ElasticComponents,
    FlangeContact,
)
from wrist_stiffness.mechanism.geometry_file import geometry_from_values, mechanism_of
from wrist_stiffness.mechanism.statics import contact_operators
from wrist_stiffness.mechanism.vectors import skew
from wrist_stiffness.mechanism.workspace import Workspace

BENCH = Path(__file__).parents[2] / "bench" / "hidden_effects"
GEOMETRY = Path(__file__).parent / "orthogonal_wrist.yaml"
SECTORS = 8
BUSHING_RADIAL, BUSHING_TILT = 3e-7, 5e-3  # m/N and rad/(N m)
LINK_BEND, LINK_TURN = 2e-7, 2e-4
MASS = 0.02
"""Of each elastic part [kg]; the platform has twice as much."""


def at_origin(local, axis, radius):
    """Flexibility at O of a diagonal one at radius * axis, with the local x along the axis."""
    across = np.linalg.svd(axis[None])[2][1:]
    frame = np.column_stack([axis, *across])
    turn = np.kron(np.eye(2), frame)
    move = np.eye(6)
    move[:3, 3:] = skew(radius * axis)
    return move @ turn @ np.diag(local) @ turn.T @ move.T


def flanges(axis, radius, bushing, sign, gap):
    """Eight springs on a ring about the axis, pushing along it."""
    across = np.linalg.svd(axis[None])[2][1:]
    angles = 2.0 * np.pi * np.arange(SECTORS) / SECTORS
    ring = radius * axis + 4e-3 * (
        np.cos(angles)[:, None] * across[0] + np.sin(angles)[:, None] * across[1]
    )
    # By reciprocity the screw of the bushing is its flexibility times the sector's wrench.
    wrenches = sign * np.concatenate([np.tile(axis, (SECTORS, 1)), np.cross(ring, axis)], axis=1)
    screw = bushing @ wrenches.T
    return FlangeContact(
        sign=np.full(SECTORS, sign),
        screw=screw,
        approach=wrenches @ screw + 2e-7 * np.eye(SECTORS),
        weight_approach=np.zeros((SECTORS, 3)),
        gap=np.full(SECTORS, gap),
    )


@cache
def make_wrist(gap=0.0, flanged=True):
    """Table of the synthetic wrist on an orthogonal geometry of assumed dimensions."""
    values = yaml.safe_load(GEOMETRY.read_text())
    geometry = geometry_from_values(values, str(GEOMETRY))
    mechanism = mechanism_of(geometry)
    flexibility, contact = [], {}
    for name in ELASTIC:
        if name.startswith("joint"):
            axis, radius = geometry.axes[name], geometry.bushings[name].radius
            local = [2 * BUSHING_RADIAL, BUSHING_RADIAL, BUSHING_RADIAL] + 3 * [BUSHING_TILT]
            flexibility.append(at_origin(local, axis, radius))
            if flanged and name in PASSIVE_JOINTS:
                sign = 1.0 if name != "joint_4" else -1.0
                contact[name] = flanges(axis, radius, flexibility[-1], sign, gap)
        else:
            middle = sum(geometry.link_ends(name))
            middle = middle / np.linalg.norm(middle)
            local = [LINK_BEND] * 3 + [LINK_TURN] * 3
            flexibility.append(at_origin(local, middle, geometry.links[name].arc_radius))
    lever = {name: 0.03 * np.ones(3) / np.sqrt(3.0) for name in ELASTIC}
    side = np.array([weight(MASS / 2, lever[name]) for name in ELASTIC])
    platform = weight(2 * MASS, geometry.platform.centre_of_gravity)
    components = ElasticComponents(np.array(flexibility), side, side.copy(), platform, contact)
    nodes = Workspace(mechanism, geometry.limits).grid(5)
    operators = pack(contact_operators(mechanism.forward(nodes), components, geometry.gravity))
    header = TableHeader(
        geometry=values,
        interface="rigid",
        evaluation="closed_form",
        kernel="thin_plate",
        per_axis=5,
        mesh={},
        versions={},
        errors={"stated_relative": 0.01},
    )
    return Table(header, components, nodes, operators, np.zeros((len(nodes), 5)))


def weight(mass, place):
    return mass * np.concatenate([np.eye(3), skew(np.asarray(place))])


@pytest.fixture(scope="session")
def wrist():
    """Return the function that makes a table."""
    return make_wrist


@pytest.fixture(scope="module")
def bench():
    """Return a function that imports a file of the benchmark."""
    sys.path.insert(0, str(BENCH))
    yield importlib.import_module
    sys.path.remove(str(BENCH))
