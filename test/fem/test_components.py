"""From geometry to components: placement, sharing of equal parts, provenance, bad input."""

import math
from dataclasses import replace

import numpy as np
import pytest
from netgen.occ import OCCGeometry, WorkPlane

from wrist_stiffness.errors import GeometryError
from wrist_stiffness.fem.components import elastic_components
from wrist_stiffness.fem.mesh import generate_mesh
from wrist_stiffness.fem.parts import Placement, wrist_parts
from wrist_stiffness.fem.solids import link_shape
from wrist_stiffness.mechanism.components import ELASTIC, LINKS, PASSIVE_JOINTS


def test_order_symmetry_and_definiteness(skewed_components):
    _, components = skewed_components
    assert components.flexibility.shape == (len(ELASTIC), 6, 6)
    for flexibility in components.flexibility:
        scale = np.sqrt(np.diag(flexibility))
        normalised = flexibility / np.outer(scale, scale)
        np.testing.assert_allclose(normalised, normalised.T, atol=1e-12)
        assert np.linalg.eigvalsh(normalised)[0] > 0


def test_parts_lie_where_the_axes_are(make_wrist):
    """Each bore's and bushing's axis, placed in F, is the joint's axis through O."""
    geometry = make_wrist(skew=0.15)
    for part in wrist_parts(geometry):
        if part.name in LINKS:
            motor_side, platform_side = geometry.link_ends(part.name)
            angle = part.solid.angle
            placed = part.home.rotation @ [math.cos(angle), math.sin(angle), 0.0]
            np.testing.assert_allclose(part.home.rotation[:, 0], motor_side, atol=1e-12)
            np.testing.assert_allclose(placed, platform_side, atol=1e-11)
        else:
            centre = geometry.bushings[part.name].radius * geometry.axes[part.name]
            np.testing.assert_allclose(part.home.origin, centre, atol=1e-15)
            np.testing.assert_allclose(
                part.home.rotation[:, 2], geometry.joint_side(part.name), atol=1e-15
            )
        np.testing.assert_allclose(np.linalg.det(part.home.rotation), 1.0)


def test_screws_and_wrenches_move_with_the_same_work():
    rng = np.random.default_rng(3)
    rotation = np.linalg.qr(rng.normal(size=(3, 3)))[0]
    placement = Placement(rotation * np.linalg.det(rotation), rng.normal(size=3))
    np.testing.assert_allclose(placement.screw.T @ placement.wrench, np.eye(6), atol=1e-14)
    # A point of the part moves the same whether seen from its own origin or from O.
    screw, point = rng.normal(size=6), rng.normal(size=3)
    local = screw[:3] + np.cross(screw[3:], point)
    moved = placement.screw @ screw
    at = placement.rotation @ point + placement.origin
    np.testing.assert_allclose(
        moved[:3] + np.cross(moved[3:], at), placement.rotation @ local, atol=1e-14
    )


def test_total_weight_is_the_mass_of_all_parts(skewed_components):
    geometry, components = skewed_components
    both = components.weight_motor_side + components.weight_platform_side
    for part, weight in zip(wrist_parts(geometry), both, strict=True):
        mass = np.diag(weight[:3]).mean()
        np.testing.assert_allclose(weight[:3], mass * np.eye(3), atol=1e-9 * mass)
        if part.name in LINKS:
            volume = link_shape_volume(geometry.links[part.name], part.solid.angle)
            assert mass == pytest.approx(7850.0 * volume, rel=1e-3)
        else:
            # A symmetric bushing weighs at its centre: its moment at O is centre x force.
            centre = geometry.bushings[part.name].radius * geometry.axes[part.name]
            moment = np.cross(centre, mass * np.eye(3)).T
            np.testing.assert_allclose(weight[3:], moment, atol=1e-9 * mass)


def link_shape_volume(link, angle):
    """Bar minus two bores with cylindrical caps, integrated over the bores' discs [m^3]."""
    arc = angle + 2 * link.overhang / link.arc_radius
    bar = link.section_radial * link.section_axial * link.arc_radius * arc
    outer, inner = (link.arc_radius + s * link.section_radial / 2 for s in (1, -1))
    bores = 0.0
    for diameter in (link.motor_bore, link.platform_bore):
        y = (np.arange(2000) + 0.5) / 2000 * diameter - diameter / 2
        width = 2 * np.sqrt(diameter**2 / 4 - y**2)
        depth = np.sqrt(outer**2 - y**2) - np.sqrt(inner**2 - y**2)
        bores += float(np.sum(width * depth)) * diameter / 2000
    return bar - bores


def test_platform_weight_acts_at_its_centre_of_gravity(skewed_components):
    geometry, components = skewed_components
    platform = geometry.platform
    force, moment = np.split(components.platform_weight @ geometry.gravity, 2)
    np.testing.assert_allclose(force, platform.mass * geometry.gravity)
    np.testing.assert_allclose(moment, np.cross(platform.centre_of_gravity, force))


def test_equal_bushings_are_the_same_bushing_elsewhere(skewed_components):
    """Seen from their own centres and along their own axes, joint_2 and joint_4 are one part."""
    geometry, components = skewed_components
    seen = []
    for part in wrist_parts(geometry):
        if part.name in PASSIVE_JOINTS:
            back = np.linalg.inv(part.home.screw)
            flexibility = components.flexibility[ELASTIC.index(part.name)]
            seen.append(back @ flexibility @ back.T)
    np.testing.assert_allclose(seen[1], seen[0], atol=1e-9 * np.abs(seen[0]).max())
    np.testing.assert_allclose(seen[2], seen[0], atol=1e-9 * np.abs(seen[0]).max())


def test_a_slide_outwards_opens_the_inner_gap(skewed_components, make_wrist):
    geometry, components = skewed_components
    for joint, contact in components.contact.items():
        outwards = np.sign(geometry.bushings[joint].radius)
        np.testing.assert_array_equal(contact.sign, outwards * np.repeat([1.0, -1.0], 8))
        np.testing.assert_allclose(contact.approach, contact.approach.T)
        assert np.linalg.eigvalsh(contact.approach)[0] > 0


def test_gaps_are_the_geometrys(make_wrist, coarse):
    geometry = make_wrist()
    lopsided = replace(geometry.bushings["joint_3"], inner_gap=5e-6, outer_gap=None)
    plain = replace(geometry.bushings["joint_4"], inner_gap=None, outer_gap=None)
    bushings = geometry.bushings | {"joint_3": lopsided, "joint_4": plain}
    components, provenance = elastic_components(replace(geometry, bushings=bushings), coarse)
    assert set(components.contact) == {"joint_2", "joint_3"}
    np.testing.assert_array_equal(components.contact["joint_2"].gap, np.full(16, 20e-6))
    np.testing.assert_array_equal(components.contact["joint_3"].gap, np.full(8, 5e-6))
    assert provenance.elements["joint_3"] < provenance.elements["joint_2"]
    assert provenance.packages["netgen-mesher"]


def test_progress_counts_every_part(make_wrist, coarse):
    seen = []
    geometry = make_wrist(gap=None)
    elastic_components(geometry, coarse, progress=lambda done, total: seen.append(done))
    assert seen == [*range(len(ELASTIC) + 1)]


def test_distributing_walls_soften_every_part_in_every_direction(skewed_components, coarse):
    geometry, rigid = skewed_components
    distributing, _ = elastic_components(geometry, coarse, interface="distributing")
    for softer, stiffer in zip(distributing.flexibility, rigid.flexibility, strict=True):
        scale = np.sqrt(np.diag(stiffer))
        assert np.linalg.eigvalsh((softer - stiffer) / np.outer(scale, scale))[0] > 0


def test_shapes_that_cannot_be_built_are_refused(make_wrist, coarse):
    link = make_wrist().links["link_1"]
    with pytest.raises(GeometryError, match=r"need an angle in \(0, 180\) deg"):
        link_shape(link, 0.0, coarse)
    with pytest.raises(GeometryError, match="bores 5.600 mm apart .* add up to 6.150 mm"):
        link_shape(replace(link, motor_bore=6.9e-3), 0.2, coarse)


def test_a_shape_that_netgen_cannot_mesh_is_one_clear_error():
    crossed = WorkPlane().MoveTo(0, 0).LineTo(1, 1).LineTo(1, 0).LineTo(0, 1).Close().Face()
    with pytest.raises(GeometryError, match="the mesher gave up on a part: OCC-Triangulation"):
        generate_mesh(OCCGeometry(crossed, dim=2))
