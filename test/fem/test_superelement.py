"""Condensed parts: rigid motions, symmetry, reciprocity, weights, interface models."""

import math
from dataclasses import fields, replace

import numpy as np
import pytest
from scipy import sparse
from scipy.sparse.linalg import spsolve

from wrist_stiffness.fem.elasticity import rigid_motion
from wrist_stiffness.fem.revolve import SECTORS
from wrist_stiffness.fem.solids import link_shape
from wrist_stiffness.fem.superelement import condense, frame_stiffness

ROUND_OFF = 1e-9
"""Of a solve whose stiffnesses span the metre and the radian."""


@pytest.fixture(scope="module", params=["link_body", "flanged_bushing"])
def body(request):
    return request.getfixturevalue(request.param)


@pytest.fixture(scope="module", params=["rigid", "distributing", "sliding"])
def element(request, body):
    return condense(body, request.param)


def test_frames_carry_exactly_six_rigid_motions(body):
    stiffness, _, _, _ = frame_stiffness(body, body.weight)
    both = np.vstack([np.eye(6), np.eye(6)])
    scale = np.sqrt(np.outer(np.diag(stiffness), np.diag(stiffness)))
    assert np.abs((stiffness @ both) / scale[:, :6]).max() < ROUND_OFF
    values = np.linalg.eigvalsh(stiffness / scale)
    assert np.sum(values < ROUND_OFF * values[-1]) == 6


def test_flexibility_is_symmetric_positive_definite(element):
    np.testing.assert_array_equal(element.flexibility, element.flexibility.T)
    carried = np.flatnonzero(np.diag(element.flexibility))
    assert len(carried) in (4, 6)
    assert np.linalg.eigvalsh(element.flexibility[np.ix_(carried, carried)])[0] > 0


def test_weight_on_the_two_frames_is_the_whole_weight(body, element):
    total = element.weight_motor_side + element.weight_platform_side
    resultant = rigid_motion(body.mesh.nodes).T @ body.weight
    # Each nearly zero entry cancels from two sides: compare on the scale of mass times size.
    scale = np.abs(resultant).max(axis=1).max()
    np.testing.assert_allclose(total, resultant, atol=ROUND_OFF * scale)


def test_weight_is_density_times_volume(link_body, oracle_link, coarse):
    # The CAD kernel integrates the exact cylinders; a coarse quadratic mesh misses 1e-4 of them.
    solid = link_shape(oracle_link, math.pi / 2, coarse).shape
    mass = oracle_link.material.density * solid.mass * 1e-9
    force, moment = np.split(rigid_motion(link_body.mesh.nodes).T @ link_body.weight, 2)
    np.testing.assert_allclose(force, mass * np.eye(3), rtol=1e-4, atol=mass * 1e-12)
    centre = np.array([*solid.center]) * 1e-3
    np.testing.assert_allclose(
        moment[2], [-mass * centre[1], mass * centre[0], 0], atol=1e-4 * mass
    )


def test_bushing_weight_is_density_times_volume(flanged_bushing):
    bushing = flanged_bushing.solid.dimensions
    pin, sleeve = bushing.pin_diameter / 2, bushing.pin_diameter / 2 + bushing.wall
    volume = math.pi * (sleeve**2 - pin**2) * bushing.length
    volume += 2 * math.pi * ((bushing.flange_diameter / 2) ** 2 - pin**2) * bushing.flange_thickness
    # One quadratic arc over 45 degrees misses 8e-4 of a circle's area.
    assert flanged_bushing.weight.sum() / 3 == pytest.approx(
        bushing.material.density * volume, rel=1e-3
    )


def test_condensed_loads_move_the_free_frame_as_in_the_full_model(body):
    """One solve with the frame's six unknowns beside all inner ones, nothing condensed."""
    element = condense(body, "rigid")
    size = body.stiffness.shape[0]
    held, rigid = (
        (3 * body.mesh.surface_nodes(wall)[:, None] + np.arange(3)).ravel()
        for wall in (body.solid.motor_wall, body.solid.platform_wall)
    )
    inner = np.setdiff1d(np.arange(size), np.concatenate([held, rigid]))
    on_wall = np.zeros((size, 6))
    on_wall[rigid] = rigid_motion(body.mesh.nodes)[rigid]
    follow = sparse.hstack([sparse.eye(size).tocsc()[:, inner], sparse.csc_matrix(on_wall)])
    loads = np.hstack([body.weight, body.pressure])
    solution = spsolve((follow.T @ body.stiffness @ follow).tocsc(), follow.T @ loads)

    expected = np.hstack([element.flexibility @ element.weight_platform_side, element.sector_screw])
    for half in (slice(0, 3), slice(3, 6)):
        scale = np.abs(expected[half]).max()
        np.testing.assert_allclose(solution[-6:][half], expected[half], atol=ROUND_OFF * scale)
    work = body.pressure.T @ (follow @ solution)[:, 3:]
    np.testing.assert_allclose(work, element.sector_approach, rtol=1e-7, atol=1e-14)


def test_a_rigid_wall_is_never_softer_than_a_distributing_one(body):
    softer = condense(body, "distributing").flexibility - condense(body, "rigid").flexibility
    scale = np.sqrt(np.diag(condense(body, "rigid").flexibility))
    assert np.linalg.eigvalsh(softer / np.outer(scale, scale))[0] > 0


def test_a_sliding_wall_grips_along_no_direction_and_is_softer_across(flanged_bushing):
    rigid, sliding = (condense(flanged_bushing, m) for m in ("rigid", "sliding"))
    along, across = [2, 5], [0, 1, 3, 4]
    assert not sliding.flexibility[along].any()
    assert not sliding.weight_platform_side[along].any()
    # The free surface of the flange's root is part of the wall: less glue, never less motion.
    scale = np.sqrt(np.diag(rigid.flexibility)[across])
    softer = (sliding.flexibility - rigid.flexibility)[np.ix_(across, across)]
    assert np.linalg.eigvalsh(softer / np.outer(scale, scale))[0] > 0
    assert np.all(np.diag(softer) > 0.03 * scale**2)


@pytest.mark.parametrize("interface", ["rigid", "sliding"])
def test_a_link_is_held_alike_whether_bushings_slide(link_body, interface):
    expected = condense(link_body, "rigid").flexibility
    np.testing.assert_array_equal(condense(link_body, interface).flexibility, expected)


def test_interface_model_matters_as_much_as_known(link_body):
    """Load-distributing walls turn the oracle link's joint 5.5 to 11 per cent further."""
    rigid, distributing = (condense(link_body, m).flexibility for m in ("rigid", "distributing"))
    ratio = np.diag(distributing)[3:] / np.diag(rigid)[3:]
    assert np.all((ratio > 1.05) & (ratio < 1.11))


def test_sector_forces_balance_between_hub_and_flange(flanged_bushing):
    wrench = condense(flanged_bushing, "rigid").sector_wrench
    bushing = flanged_bushing.solid.dimensions
    pin = bushing.pin_diameter / 2 + bushing.wall
    rim = bushing.flange_diameter / 2
    rings = flanged_bushing.solid.rings
    assert rings == 2
    # Inner flange pushes the hub outwards, centre of pressure at the centroid of a ring's quarter.
    np.testing.assert_allclose(wrench[2], np.repeat([1.0, -1.0], rings * SECTORS), atol=1e-12)
    np.testing.assert_allclose(wrench[[0, 1, 5]], 0, atol=1e-15)
    half = math.pi / SECTORS
    borders = np.array([pin, pin + (rim - pin) / 4, rim])
    centroid = 2 / 3 * math.sin(half) / half * np.diff(borders**3) / np.diff(borders**2)
    # One quadratic arc over 45 degrees places the centroid within 1e-3.
    expected = np.tile(np.repeat(centroid, SECTORS), 2)
    np.testing.assert_allclose(np.hypot(*wrench[3:5]), expected, rtol=2e-3)


@pytest.mark.parametrize("interface", ["rigid", "distributing", "sliding"])
def test_sectors_are_equal_under_turns_by_a_quarter(flanged_bushing, interface):
    """The swept mesh is symmetric to the last digits, not only up to its error."""
    element = condense(flanged_bushing, interface)
    inner = element.sector_approach[:SECTORS, :SECTORS]
    for shift in range(1, SECTORS):
        turned = np.roll(inner, (shift, shift), axis=(0, 1))
        np.testing.assert_allclose(turned, inner, atol=1e-9 * inner.max())
    axial = element.sector_screw[2, :SECTORS]
    np.testing.assert_allclose(axial, axial[0], rtol=1e-8)


@pytest.mark.parametrize("interface", ["rigid", "sliding"])
def test_harmonics_solve_the_same_equations(flanged_bushing, interface):
    """Slice by slice in harmonics, or all unknowns of the ring at once."""
    ring = replace(flanged_bushing, mesh=replace(flanged_bushing.mesh, slices=1))
    by_harmonics, at_once = condense(flanged_bushing, interface), condense(ring, interface)
    assert flanged_bushing.mesh.slices % SECTORS == 0
    for field in fields(at_once):
        expected = getattr(at_once, field.name)
        difference = np.abs(getattr(by_harmonics, field.name) - expected).max()
        assert difference <= ROUND_OFF * np.abs(expected).max(), field.name


def test_a_symmetry_that_is_not_there_is_refused(flanged_bushing):
    body = replace(flanged_bushing, mesh=replace(flanged_bushing.mesh, slices=5))
    with pytest.raises(ValueError, match="not symmetric under turns by 1/5"):
        condense(body, "rigid")


def test_flange_modes_are_positive_definite(flanged_bushing):
    element = condense(flanged_bushing, "rigid")
    approach = element.sector_approach
    np.testing.assert_array_equal(approach, approach.T)
    assert np.linalg.eigvalsh(approach)[0] > 0
