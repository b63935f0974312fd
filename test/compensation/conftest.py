"""A small wrist table without finite elements, for tests of what is done with a table."""

from dataclasses import replace

import numpy as np
import pytest
import yaml

from wrist_stiffness.compensation.objective import Objective
from wrist_stiffness.lookup.operators import pack
from wrist_stiffness.lookup.table import Table, TableHeader
from wrist_stiffness.lookup.table_file import save_table
from wrist_stiffness.mechanism.components import (
    ELASTIC,
    PASSIVE_JOINTS,
    ElasticComponents,
    FlangeContact,
)
from wrist_stiffness.mechanism.statics import contact_operators
from wrist_stiffness.mechanism.vectors import skew
from wrist_stiffness.model.error_model import ErrorModel
from wrist_stiffness.model.model_file import load_model
from wrist_stiffness.shipped import shipped_file

BUSHING_M = 0.03
"""Distance of the parts' elastic centres from O [m]."""


def soft_part(rng):
    """Return a flexibility of about 1 um/N and 1e-3 rad/(N m) at a centre off O, as seen at O."""
    root = rng.normal(size=(6, 6)) + 3.0 * np.eye(6)
    local = np.diag([3e-4] * 3 + [0.008] * 3) @ root
    centre = BUSHING_M * rng.normal(size=3) / np.sqrt(3.0)
    at_origin = np.eye(6)
    at_origin[:3, 3:] = skew(centre)
    return at_origin @ local @ local.T @ at_origin.T


def synthetic_table(seed=1, softness=1.0, sectors=3):
    """Return a wrist of the shipped geometry with random positive definite parts and flanges."""
    rng = np.random.default_rng(seed)
    contact = {}
    for joint in PASSIVE_JOINTS:
        root = rng.normal(size=(sectors, sectors)) + 3.0 * np.eye(sectors)
        contact[joint] = FlangeContact(
            sign=np.ones(sectors),
            screw=np.zeros((6, sectors)),
            approach=1e-7 * root @ root.T,
            weight_approach=np.zeros((sectors, 3)),
            gap=np.full(sectors, 1e-6),
        )
    weights = 3e-4 * rng.normal(size=(2, len(ELASTIC), 6, 3))
    components = ElasticComponents(
        softness * np.array([soft_part(rng) for _ in ELASTIC]),
        weights[0],
        weights[1],
        3e-4 * rng.normal(size=(6, 3)),
        contact,
    )
    header = TableHeader(
        geometry=yaml.safe_load(shipped_file("config/palmieri2015.yaml").read_text()),
        interface="rigid",
        evaluation="closed_form",
        kernel="thin_plate",
        per_axis=5,
        mesh={},
        versions={},
        errors={"stated_relative": 0.005},
    )
    empty = Table(header, components, np.zeros((0, 2)), np.zeros((0, 0)), np.zeros((0, 5)))
    nodes = empty.workspace.grid(header.per_axis)
    operators = contact_operators(
        empty.mechanism.forward(nodes), components, empty.geometry.gravity
    )
    return replace(
        empty, nodes=nodes, operators=pack(operators), map_values=np.zeros((len(nodes), 5))
    )


def write_model(folder, table, name="synthetic"):
    """Write a table and a model file that names it, and return the model file's path."""
    save_table(table, folder / f"{name}.npz")
    path = folder / f"{name}_model.yaml"
    path.write_text(
        yaml.safe_dump({"schema": 1, "name": name, "table": {"path": f"{name}.npz"}, "effects": []})
    )
    return path


@pytest.fixture(scope="session")
def table():
    return synthetic_table()


@pytest.fixture(scope="session")
def model(table):
    return ErrorModel("synthetic", table, "closed_form")


@pytest.fixture(scope="session")
def make_table():
    return synthetic_table


@pytest.fixture(scope="session")
def make_model_file():
    return write_model


@pytest.fixture(scope="session")
def model_path(tmp_path_factory, table):
    path = write_model(tmp_path_factory.mktemp("model"), table)
    load_model(path)
    return path


@pytest.fixture
def objective(table):
    def make(name):
        return Objective(name, table.geometry.platform.normal, np.array([0.0, 0.0, 0.05]))

    return make
