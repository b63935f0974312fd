"""Natural modes of the condensed wrist against the whole one, CalculiX and plain statics."""

import shutil
from dataclasses import replace

import numpy as np
import pytest
from whole_wrist.calculix import run_modal_deck, write_modal_deck
from whole_wrist.model import build_wrist, factor_pose
from whole_wrist.solve import natural_frequencies

from wrist_stiffness.errors import InputError, TableError
from wrist_stiffness.fem.components import elastic_components
from wrist_stiffness.mechanism.geometry_file import mechanism_of
from wrist_stiffness.mechanism.modes import RigidBody, natural_modes, plate
from wrist_stiffness.mechanism.statics import component_shares

CONDENSED = 0.01
"""Of six modes; inertia inside a part follows its frames as in statics."""

SAME_MESH = 1e-5
"""CalculiX prints seven digits."""

PAYLOAD = RigidBody(0.1, np.array([5e-3, 0.0, -30e-3]), np.diag([2e-5, 1e-5, 1.5e-5]))
POSE = np.array([0.3, -0.2])

STATES = {
    "open": np.zeros(48, dtype=bool),
    "some touch": np.arange(48) % 3 == 0,
    "closed": np.ones(48, dtype=bool),
}


@pytest.fixture(scope="module", params=["rigid", "sliding"])
def wrist(make_wrist, coarse, request):
    geometry = make_wrist(gap=2e-6, skew=0.15)
    components, _ = elastic_components(geometry, coarse, request.param)
    whole = build_wrist(geometry, coarse, request.param == "sliding")
    model = factor_pose(whole, mechanism_of(geometry).forward(POSE))
    return components, model


def bodies_of(geometry, loaded):
    return (plate(geometry.platform), PAYLOAD) if loaded else (plate(geometry.platform),)


@pytest.mark.slow
@pytest.mark.parametrize("state", STATES)
def test_condensed_masses_give_the_modes_of_the_whole_wrist(wrist, state):
    components, model = wrist
    for loaded in (False, True):
        bodies = bodies_of(model.wrist.geometry, loaded)
        whole = natural_frequencies(model, bodies, STATES[state])
        found = natural_modes(model.configuration, components, bodies, STATES[state])
        # Fewer freedoms are never softer.
        assert np.all(found.frequency > whole * (1.0 - 1e-6))
        np.testing.assert_allclose(found.frequency, whole, rtol=CONDENSED)


@pytest.mark.slow
@pytest.mark.skipif(
    shutil.which("ccx") is None, reason="needs CalculiX: apt-get install calculix-ccx"
)
def test_calculix_finds_the_same_frequencies(wrist, tmp_path):
    _, model = wrist
    bodies = bodies_of(model.wrist.geometry, True)
    deck = tmp_path / "modes.inp"
    write_modal_deck(model, deck, bodies, STATES["some touch"])
    whole = natural_frequencies(model, bodies, STATES["some touch"])
    np.testing.assert_allclose(run_modal_deck(deck), whole, rtol=SAME_MESH)


def test_massless_limbs_leave_the_platform_on_its_compliance(skewed_components):
    geometry, components = skewed_components
    light = replace(components, mass=np.zeros_like(components.mass))
    pose = mechanism_of(geometry).forward(POSE)
    turn = np.kron(np.eye(2), pose.platform)
    mass = turn @ PAYLOAD.at_centre @ turn.T
    product = component_shares(pose, components).sum(axis=-3) @ mass
    expected = 1.0 / (2.0 * np.pi * np.sqrt(np.sort(np.linalg.eigvals(product).real)[::-1]))
    found = natural_modes(pose, light, (PAYLOAD,), STATES["open"])
    np.testing.assert_allclose(found.frequency, expected, rtol=1e-6)


def test_mass_slows_and_closed_flanges_quicken_every_mode(skewed_components):
    geometry, components = skewed_components
    poses = mechanism_of(geometry).forward(np.array([POSE, [-0.5, 0.4]]))
    frequency = {
        (state, loaded): natural_modes(
            poses, components, bodies_of(geometry, loaded), np.tile(STATES[state], (2, 1))
        ).frequency
        for state in STATES
        for loaded in (False, True)
    }
    for state in STATES:
        assert np.all(frequency[state, True] < frequency[state, False])
    for loaded in (False, True):
        assert np.all(frequency["open", loaded] <= frequency["some touch", loaded])
        assert np.all(frequency["some touch", loaded] <= frequency["closed", loaded])


def test_condensed_mass_is_the_mass_and_the_weight(skewed_components):
    """A part that is moved as a whole has its whole mass, and its weight on each frame."""
    _, components = skewed_components
    both = np.vstack([np.eye(6), np.eye(6)])[:, :3]
    force = components.mass @ both
    weight = [components.weight_motor_side, components.weight_platform_side]
    np.testing.assert_allclose(
        force, np.concatenate(weight, axis=1), rtol=0.0, atol=1e-9 * np.abs(force).max()
    )


def test_kinetic_energy_of_a_body_is_that_of_its_points():
    rng = np.random.default_rng(5)
    places, masses = rng.normal(size=(40, 3)), rng.uniform(0.5, 1.5, 40)
    centre = masses @ places / masses.sum()
    arms = places - centre
    inertia = sum(
        m * (r @ r * np.eye(3) - np.outer(r, r)) for m, r in zip(masses, arms, strict=True)
    )
    screw = rng.normal(size=6)
    speed = screw[:3] + np.cross(screw[3:], places)
    body = RigidBody(masses.sum(), centre, inertia)
    assert screw @ body.at_centre @ screw == pytest.approx(masses @ (speed**2).sum(axis=1))


@pytest.mark.parametrize(
    ("mass", "inertia", "said"),
    [(-1.0, [1, 1, 1], "-1 kg"), (1.0, [1, 1, 3], "1, 1, 3"), (1.0, [-1, 1, 1], "-1, 1, 1")],
)
def test_what_no_body_is_is_refused(mass, inertia, said):
    with pytest.raises(InputError, match=said):
        RigidBody(mass, np.zeros(3), np.diag(inertia))


def test_a_table_without_masses_says_so(skewed_components):
    geometry, components = skewed_components
    pose = mechanism_of(geometry).forward(POSE)
    with pytest.raises(TableError, match="build it again"):
        natural_modes(pose, replace(components, mass=None), (PAYLOAD,), STATES["open"])
