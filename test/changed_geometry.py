"""The values of a geometry file with some of them changed, and how they are checked."""

import copy
from functools import reduce
from pathlib import Path

import pytest
import yaml

from wrist_stiffness.errors import GeometryError
from wrist_stiffness.inputs.document import node_of
from wrist_stiffness.mechanism.fits import check_fits
from wrist_stiffness.mechanism.geometry_file import geometry_from_values, geometry_of

ORTHOGONAL = Path(__file__).parent / "mechanism" / "orthogonal_wrist.yaml"
VALUES = yaml.safe_load(ORTHOGONAL.read_text())

LAYERS = {
    "young_GPa": [2.0, 9.0, 3.5],
    "poisson": [0.1, 0.2, 0.4],
    "shear_GPa": [0.9, 0.6, 1.7],
    "density_kg_m3": 1400.0,
    "expansion_1e-6_K": 30.0,
    "source": "assumed",
}
"""A material of layers, printed or wound."""


def changed(path, value):
    """The values with another value at a place like ("site", "gravity_m_s2")."""
    values = copy.deepcopy(VALUES)
    reduce(lambda block, key: block[key], path[:-1], values)[path[-1]] = value
    return values


def checked(values):
    """The geometry of values that can be built."""
    root = node_of(values, "wrist.yaml", GeometryError)
    geometry = geometry_of(root)
    check_fits(root, geometry)
    return geometry


def refused(values):
    with pytest.raises(GeometryError) as caught:
        geometry_from_values(values, "wrist.yaml")
    message = str(caught.value)
    assert "\n" not in message
    assert message.startswith("wrist.yaml")
    return message
