"""Pins as beams: against solid finite elements, and in series with a link."""

from dataclasses import replace
from functools import cache

import numpy as np
import pytest
import rigid_parts
from netgen.occ import Cylinder, Dir, OCCGeometry, Pnt
from scipy.linalg import eigvalsh

from wrist_stiffness.commands.uncertainty import STEEL
from wrist_stiffness.fem.components import elastic_components
from wrist_stiffness.fem.condensed_store import condense_solid
from wrist_stiffness.fem.mesh import mesh_solid
from wrist_stiffness.mechanism.components import ELASTIC, JOINTS, LINKS
from wrist_stiffness.mechanism.geometry_file import load_geometry, mechanism_of
from wrist_stiffness.mechanism.modes import natural_modes, plate
from wrist_stiffness.mechanism.pins import in_series, pin_flexibilities, pin_length
from wrist_stiffness.shipped import shipped_file

CLAMPED = 0.06
"""A clamped end of a solid cannot contract sideways, a beam's can."""


@pytest.mark.parametrize(
    ("link", "joint", "side"), [("link_1", "joint_2", 1), ("link_2", "joint_5", 0)]
)
def test_a_pin_bends_as_a_solid_of_its_size(link, joint, side):
    """One points to O, one away from it; both ends rigid."""
    geometry = load_geometry(shipped_file("config/palmieri2015.yaml"))
    bar, seat, axis = geometry.links[link], geometry.bushings[joint], geometry.joint_side(joint)
    way = np.sign(abs(seat.radius) - bar.arc_radius)
    root = 1e3 * (bar.arc_radius + way * bar.section_radial / 2.0) * axis
    pin = Cylinder(
        Pnt(*root),
        Dir(*(way * axis)),
        r=5e2 * seat.pin_diameter,
        h=1e3 * pin_length(geometry, link, joint),
    )
    along = [np.dot(tuple(face.center), way * axis) for face in pin.faces]
    pin.faces[int(np.argmin(along))].name = "root"
    pin.faces[int(np.argmax(along))].name = "tip"
    pin.solids.maxh = 2e2 * seat.pin_diameter
    solid = rigid_parts.frames_flexibility(mesh_solid(OCCGeometry(pin)), STEEL, ("tip", "root"))
    beam = pin_flexibilities(geometry, link, STEEL)[side]
    assert np.abs(eigvalsh(beam, solid) - 1.0).max() < CLAMPED


def test_in_series_is_the_chain_of_three_springs():
    rng = np.random.default_rng(3)
    roots = rng.normal(size=(3, 6, 6))
    chain = [root @ root.T + np.eye(6) for root in roots]
    # Motor-side end, the part's two frames, platform-side end.
    stiffness = np.zeros((4, 6, 4, 6))
    for k, flexibility in enumerate(chain):
        spring = np.linalg.inv(flexibility)
        for i, j in ((k, k), (k + 1, k + 1), (k, k + 1), (k + 1, k)):
            stiffness[i, :, j] += spring if i == j else -spring
    inner = stiffness[1:3, :, 1:3].reshape(12, 12)
    outer = stiffness[1:3][:, :, [0, 3]].reshape(12, 12)
    whole, follow = in_series(*chain)
    np.testing.assert_allclose(follow, -np.linalg.solve(inner, outer), atol=1e-12)
    np.testing.assert_allclose(whole, sum(chain))


@pytest.mark.slow
def test_pins_are_in_the_links_of_a_wrist(coarse, make_wrist):
    geometry = make_wrist(skew=0.15)
    seats = geometry.bushings.items()
    away = {joint: replace(seat, radius=1.4 * seat.radius) for joint, seat in seats}
    geometry, condense = replace(geometry, bushings=away), cache(condense_solid)
    rigid, bent = (
        elastic_components(replace(geometry, pins=pins), coarse, condenser=condense)[0]
        for pins in (None, STEEL)
    )
    for link in LINKS:
        k = ELASTIC.index(link)
        added = bent.flexibility[k] - rigid.flexibility[k]
        assert np.linalg.norm(added) > 0.1 * np.linalg.norm(rigid.flexibility[k])
        np.testing.assert_allclose(
            added, sum(pin_flexibilities(geometry, link, STEEL)), atol=1e-9 * np.abs(added).max()
        )
        weights = [
            parts.weight_motor_side[k] + parts.weight_platform_side[k] for parts in (bent, rigid)
        ]
        np.testing.assert_allclose(*weights, atol=1e-9 * np.abs(weights[0]).max())
    bushings = [ELASTIC.index(joint) for joint in JOINTS]
    assert np.array_equal(bent.flexibility[bushings], rigid.flexibility[bushings])
    pose, free = mechanism_of(geometry).forward(np.array([0.3, -0.2])), np.zeros(48, dtype=bool)
    slower, quicker = (
        natural_modes(pose, parts, (plate(geometry.platform),), free).frequency
        for parts in (bent, rigid)
    )
    assert np.all(slower < quicker)
