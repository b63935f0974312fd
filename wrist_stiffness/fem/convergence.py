"""Mesh convergence of a wrist: a sequence of meshes, the limit they tend to, the error left."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from wrist_stiffness.errors import InputError
from wrist_stiffness.fem.components import Condenser, elastic_components
from wrist_stiffness.fem.condensed_store import condense_solid
from wrist_stiffness.fem.solids import MeshSettings
from wrist_stiffness.fem.superelement import Interface
from wrist_stiffness.lookup.rated_load import rated_map
from wrist_stiffness.mechanism.components import Array
from wrist_stiffness.mechanism.configuration import Configuration
from wrist_stiffness.mechanism.geometry import Geometry
from wrist_stiffness.mechanism.statics import contact_operators
from wrist_stiffness.progress import Progress

QUANTITIES = ("s", "phi", "compliance")
"""Mean |s| [m] and phi [rad] under the rated load over the poses, and the norm of C."""

SLOWEST_ORDER = 0.75
"""Of the energy with the size of the elements, at a bushing's hub corner under a flange, where a
held and a free face meet at 270 degrees; an observed order below it is not believed."""

FASTEST_ORDER = 1.42
"""Of the energy at the rim of a held bore, where a held and a free face meet at 90 degrees (stress
singular with the exponent 0.71 at Poisson's ratio 0.3); a faster observed order is that of the
smooth part alone and would flatter the error."""


@dataclass(frozen=True)
class Convergence:
    """A mesh convergence study, coarsest level first, in the order of `QUANTITIES`.

    Parameters
    ----------
    factors : (n,) float
        Element sizes of each level over the reference sizes.
    elements : (n,) int
        Elements of all eight parts.
    values : (n, 3) float
        The quantities.
    order : (3,) float
        Observed order of convergence of the last three levels, within its physical limits.
    limit : (3,) float
        Richardson's extrapolation to vanishing elements.
    """

    factors: Array
    elements: Array
    values: Array
    order: Array
    limit: Array

    def errors(self) -> Array:
        """Relative error of each level against the limit (n, 3); negative where too stiff."""
        return self.values / self.limit - 1.0


def mesh_convergence(
    geometry: Geometry,
    configuration: Configuration,
    sizes: MeshSettings,
    factors: tuple[float, ...],
    interface: Interface = "rigid",
    condenser: Condenser = condense_solid,
    progress: Progress | None = None,
) -> Convergence:
    """Condense a wrist on a sequence of meshes and extrapolate.

    Parameters
    ----------
    geometry : Geometry
        The wrist.
    configuration : Configuration
        Poses (n,) over which s and phi are averaged and the norm of C is taken.
    sizes : MeshSettings
        Reference element sizes.
    factors : tuple of float
        At least three multiples of them in a falling geometric sequence.
    interface : {"rigid", "distributing", "sliding"}
        How walls follow their frames.
    condenser : callable
        `condense_solid`, or a `CondensedStore` that remembers.
    progress : callable, optional
        Called with levels done and in all.

    Returns
    -------
    Convergence
        Of the mean response to the rated load, flange contact solved, and of the compliance.

    Raises
    ------
    InputError
        If the factors are no falling geometric sequence of three or more.
    """
    ratio = _common_ratio(factors)
    values, elements = [], []
    for done, factor in enumerate(factors):
        if progress is not None:
            progress(done, len(factors))
        components, provenance = elastic_components(
            geometry, sizes.times(factor), interface, condenser=condenser
        )
        operators = contact_operators(configuration, components, np.zeros(3))
        # Columns 3 and 4 of the map are |s| and phi.
        s, phi = rated_map(configuration, operators, geometry)[:, 3:].mean(axis=0)
        norm = _compliance_norm(operators.compliance, geometry)
        values.append([s, phi, norm])
        elements.append(sum(provenance.elements.values()))
    order, limit = richardson(np.array(values), ratio)
    return Convergence(np.array(factors), np.array(elements), np.array(values), order, limit)


def richardson(values: Array, ratio: float) -> tuple[Array, Array]:
    """Observed order and limit of a sequence from its last three members.

    Parameters
    ----------
    values : (n, k) float
        k sequences of n >= 3 members on meshes of falling size.
    ratio : float
        Size of a level over that of the next one, > 1.

    Returns
    -------
    order, limit : (k,) float
        The order is kept within `SLOWEST_ORDER` and `FASTEST_ORDER`; where the steps do not fall
        it is the slowest, so that the error is not flattered.
    """
    earlier, later = np.diff(values[-3:], axis=0)
    falling = np.where((earlier * later > 0.0) & (earlier != 0.0), later / earlier, 1.0)
    order = np.clip(-np.log(falling) / np.log(ratio), SLOWEST_ORDER, FASTEST_ORDER)
    return order, values[-1] + later / (ratio**order - 1.0)


def _common_ratio(factors: tuple[float, ...]) -> float:
    steps = np.array(factors[:-1]) / np.array(factors[1:])
    if len(factors) < 3 or not (np.allclose(steps, steps[0], rtol=0.02) and steps[0] > 1.0):
        raise InputError(
            f"mesh factors {', '.join(f'{f:g}' for f in factors)}: need three or more in a "
            "falling geometric sequence"
        )
    return float(steps.mean())


def _compliance_norm(compliance: Array, geometry: Geometry) -> float:
    """Mean Frobenius norm of C, rotations taken at the platform's rim [m/N]."""
    rim = geometry.platform.diameter / 2.0
    scale = np.repeat([1.0, rim], 3)
    scaled = compliance * np.outer(scale, scale)
    return float(np.linalg.norm(scaled, axis=(-2, -1)).mean())
