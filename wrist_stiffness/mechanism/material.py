"""Materials of the parts, and how a geometry file gives them."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any, cast

import numpy as np

from wrist_stiffness.inputs.document import Node
from wrist_stiffness.inputs.schema import (
    SOURCES,
    Quantity,
    Schema,
    list_of,
    number,
    record,
    vector,
)
from wrist_stiffness.mechanism.components import Array

LEAST_DETERMINANT = 1e-9
"""Of a compliance scaled to ones on its diagonal; below it is rounding."""


@dataclass(frozen=True)
class Material:
    """Linear isotropic material."""

    young: float  # Young's modulus [Pa]
    poisson: float  # Poisson's ratio [-]
    density: float  # [kg/m^3]
    expansion: float  # coefficient of linear thermal expansion [1/K]


@dataclass(frozen=True)
class OrthotropicMaterial:
    """Linear material of three planes of symmetry, as of fibres wound or layers printed.

    Its first axis points along the radius, its second around, its third along the axis: of a
    link's arc, that is normal to its plane, or of a bushing's bore.
    """

    young: tuple[float, float, float]  # Young's moduli along the three axes [Pa]
    # contraction along the second axis by the stretch along the first, along the third by that
    # along the first, along the third by that along the second [-]
    poisson: tuple[float, float, float]
    shear: tuple[float, float, float]  # shear moduli between the same pairs of axes [Pa]
    density: float  # [kg/m^3]
    expansion: float  # coefficient of linear thermal expansion [1/K]

    @property
    def compliance(self) -> Array:
        """Strains by stresses (6, 6) along 1, 2, 3 and between 2-3, 1-3, 1-2 [1/Pa]."""
        (e1, e2, e3), (nu12, nu13, nu23) = self.young, self.poisson
        compliance = np.diag([1.0 / e1, 1.0 / e2, 1.0 / e3, *(1.0 / g for g in self.shear[::-1])])
        compliance[0, 1] = compliance[1, 0] = -nu12 / e1
        compliance[0, 2] = compliance[2, 0] = -nu13 / e1
        compliance[1, 2] = compliance[2, 1] = -nu23 / e2
        return compliance


AnyMaterial = Material | OrthotropicMaterial


def _three(schema: Schema[float]) -> Schema[Array]:
    def read(node: Node) -> Array:
        numbers = vector()(node)
        list_of(schema)(node)
        return numbers

    return read


# From soft rubber and light foam to beyond diamond and osmium: what lies outside is another unit.
# Re-entrant foam has the least ratio of any isotropic solid (R. Lakes, Science 235, 1987).
_MODULUS = number(above=1e-4, below=2000.0)
_REST: dict[str, Any] = {
    "density_kg_m3": Quantity(number(above=10.0, below=25000.0)),
    "expansion_1e-6_K": Quantity(number()),
}
_ISOTROPIC = record(
    {"young_GPa": Quantity(_MODULUS), "poisson": number(at_least=-0.7, below=0.5), **_REST},
    sources=SOURCES,
    make=Material,
)
_ORTHOTROPIC = record(
    {
        "young_GPa": Quantity(_three(_MODULUS)),
        "poisson": vector(),
        "shear_GPa": Quantity(_three(_MODULUS)),
        **_REST,
    },
    sources=SOURCES,
    # Tuples, so that equal materials compare equal.
    make=lambda young, poisson, shear, **others: OrthotropicMaterial(
        tuple(young.tolist()), tuple(poisson.tolist()), tuple(shear.tolist()), **others
    ),
)


def read_material(node: Node) -> AnyMaterial:
    """Read a material: orthotropic where `young_GPa` is a list.

    Raises `GeometryError` if a value is missing or outside its limits, or some stress would do
    negative work.
    """
    young = node.value.get("young_GPa") if isinstance(node.value, dict) else None
    if young is None or not isinstance(young.value, list):
        return cast(Material, _ISOTROPIC(node))
    material: OrthotropicMaterial = _ORTHOTROPIC(node)
    # B. M. Lempriere, Poisson's ratio in orthotropic materials, AIAA J. 6 (1968) 2226.
    compliance = material.compliance[:3, :3]
    size = np.sqrt(np.diag(compliance))
    coupling = compliance / np.outer(size, size)
    for (i, j), ratio in zip(((0, 1), (0, 2), (1, 2)), material.poisson, strict=True):
        if abs(coupling[i, j]) >= 1.0:
            raise node["poisson"].refuse(
                f"{ratio:g} of axes {i + 1} and {j + 1} is not within {size[j] / size[i]:.4g}, "
                "the root of the ratio of their moduli"
            )
    if (left := float(np.linalg.det(coupling))) < LEAST_DETERMINANT:
        raise node["poisson"].refuse(
            f"{list(material.poisson)} with these moduli let a stress do negative work: "
            f"1 - nu12 nu21 - nu13 nu31 - nu23 nu32 - 2 nu21 nu32 nu13 is {left:.3g}, not above 0"
        )
    return material
