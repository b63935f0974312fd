"""The wrist's elastic operators as spline columns that keep their definiteness.

[[C, B], [B', A]] is the flexibility of the whole wrist to the platform's wrench and to the contact
forces together, hence positive definite.  Interpolated entry by entry it would lose that between
the nodes; its Cholesky factor keeps it.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from wrist_stiffness.errors import TableError
from wrist_stiffness.mechanism.components import ELASTIC, PASSIVE_JOINTS, Array, ElasticComponents
from wrist_stiffness.mechanism.influence import influence
from wrist_stiffness.mechanism.kinematics import Configuration
from wrist_stiffness.mechanism.statics import ContactOperators, contact_joints


@dataclass(frozen=True)
class SectorLayout:
    """Which joint and which way each contact sector belongs to.

    Parameters
    ----------
    slide : (m,) int
        Index of the sector's joint in `PASSIVE_JOINTS`.
    sign : (m,) float
        Opening of the gap for a unit slide.
    """

    slide: np.ndarray
    sign: Array

    @classmethod
    def of(cls, components: ElasticComponents) -> SectorLayout:
        """Return the layout in which `contact_operators` stacks the sectors."""
        joints = contact_joints(components)
        sizes = [len(components.contact[joint].gap) for joint in joints]
        slide = np.repeat([PASSIVE_JOINTS.index(joint) for joint in joints], sizes).astype(int)
        signs = [components.contact[joint].sign for joint in joints]
        return cls(slide, np.concatenate(signs) if signs else np.zeros(0))

    @property
    def columns(self) -> int:
        """Number of spline columns per pose."""
        size = 6 + len(self.sign)
        return size * (size + 1) // 2 + len(self.sign) + 6


def pack(operators: ContactOperators) -> Array:
    """Return the operators at n poses as spline columns.

    Parameters
    ----------
    operators : ContactOperators
        At n poses.

    Returns
    -------
    (n, columns) float
        Lower Cholesky factor of [[C, B], [B', A]], then gaps, then the twist of own weight.

    Raises
    ------
    TableError
        If the flexibility is not positive definite at a pose.
    """
    b_transposed = np.swapaxes(operators.force_twist, -1, -2)
    whole = np.concatenate(
        [
            np.concatenate([operators.compliance, operators.force_twist], axis=-1),
            np.concatenate([b_transposed, operators.approach], axis=-1),
        ],
        axis=-2,
    )
    try:
        factor = np.linalg.cholesky(whole)
    except np.linalg.LinAlgError as error:
        raise TableError("the wrist's flexibility is not positive definite at a node") from error
    rows, columns = np.tril_indices(whole.shape[-1])
    return np.concatenate(
        [factor[..., rows, columns], operators.gap, operators.weight_twist], axis=-1
    )


def unpack(columns: Array, layout: SectorLayout, configuration: Configuration) -> ContactOperators:
    """Return the operators from interpolated spline columns.

    Parameters
    ----------
    columns : (..., columns) float
        As `pack` orders them.
    layout : SectorLayout
        Of the table.
    configuration : Configuration
        The poses, for the slides that a screw at a component makes (kinematics, not elasticity).

    Returns
    -------
    ContactOperators
        C and A positive semi-definite at every pose.
    """
    m = len(layout.sign)
    size = 6 + m
    rows, places = np.tril_indices(size)
    lead = columns.shape[:-1]
    factor = np.zeros((*lead, size, size))
    factor[..., rows, places] = columns[..., : len(rows)]
    whole = factor @ np.swapaxes(factor, -1, -2)
    gap = columns[..., len(rows) : len(rows) + m]
    return ContactOperators(
        compliance=whole[..., :6, :6],
        force_twist=whole[..., :6, 6:],
        approach=whole[..., 6:, 6:],
        gap=gap,
        weight_twist=columns[..., len(rows) + m :],
        screw_gap=sector_slides(layout, configuration),
    )


def sector_slides(layout: SectorLayout, configuration: Configuration) -> Array:
    """Return each gap's opening by the slides that a component's screw makes, (..., m, 8, 6)."""
    slides = influence(configuration).slides()
    out = np.zeros((*slides.shape[:-3], len(layout.sign), len(ELASTIC), 6))
    for i, (joint, sign) in enumerate(zip(layout.slide, layout.sign, strict=True)):
        out[..., i, :, :3] = sign * slides[..., :, joint, :]
    return out
