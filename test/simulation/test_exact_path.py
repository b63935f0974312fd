"""The fast path against the equilibrium of all bodies at once, which knows nothing of G."""

from dataclasses import replace

import numpy as np
import pytest
from exact_with_laws import ExactWrist

from wrist_stiffness.mechanism.rigid_motion import log_motion
from wrist_stiffness.simulation.catalogue import CATALOGUE, HiddenEffect, build, places
from wrist_stiffness.simulation.experiment import random_load, random_pose
from wrist_stiffness.simulation.heat import HEATED
from wrist_stiffness.simulation.wrist import TrueWrist

# The fast path adds small screws as vectors; at the 1 mrad of these cases what finite rotations
# leave is a thousandth of the motion.
SECOND_ORDER = 2e-3
# A sector's force is a small difference of motions, which a finite rotation touches more.
FORCE_SECOND_ORDER = 5e-3
# Both integrate the slip from pose to pose; at whole degrees apart this is what is left of it.
FRICTION = 1e-2
# A pin with play leans further for the same error of a reaction that nearly vanishes.
FRICTION_AND_PLAY = 2e-2
# Passes end at 0.1 nm; where a pin is about to flip, what they leave grows along the path.  A tenth
# of the white noise of the finest instrument is not seen [m].
SETTLED = 7e-8
LEVER = np.repeat([1.0, 0.03], 3)
# At rest effects that live in motion or in sensors do nothing, and creep only in time.
STATIC = [
    place
    for place in places(CATALOGUE)
    if place[0]
    in {
        "link_stiffness",
        "bushing_stiffness",
        "drive_compliance",
        "mount_compliance",
        "gravity",
        "joint_clearance",
        "flange_contact",
        "bushing_hardening",
        "axis_misalignment",
        "thermal_expansion",
        "thermal_softening",
        "cable_wrench",
    }
]


def with_gaps(table, gap):
    contact = {j: replace(f, gap=f.gap + gap) for j, f in table.components.contact.items()}
    return replace(table, components=replace(table.components, contact=contact))


def twist_of(table, theta, rotation, shift):
    return LEVER * log_motion(rotation @ table.mechanism.forward(theta).platform.T, shift)


def compare(table, hidden, steps, kelvin):
    """Both paths over the same steps (theta, load): twists (n, 6) with turns as lengths."""
    fast, exact = (
        kind(table, [build(h, table) for h in hidden]) for kind in (TrueWrist, ExactWrist)
    )
    theta, load = (np.array(values) for values in zip(*steps, strict=True))
    state = fast.at(np.arange(len(steps)) * 1.0, theta, load, np.tile(kelvin, (len(steps), 1)))
    solved = [exact.solve(t, w, kelvin) for t, w in steps]
    ours = [twist_of(table, *row) for row in zip(theta, state.rotation, state.shift, strict=True)]
    theirs = [twist_of(table, t, s.rotation, s.shift) for t, s in zip(theta, solved, strict=True)]
    return np.array(ours), np.array(theirs), state, solved


@pytest.mark.parametrize("number", range(72))
def test_fast_path_is_the_equilibrium_of_all_bodies(number, wrist):
    rng = np.random.default_rng(number)
    gap = (0.0, 1e-6, 1.0)[number % 3]
    table = with_gaps(wrist(), gap)
    chosen = [STATIC[number % len(STATIC)]]
    chosen += [STATIC[i] for i in rng.choice(len(STATIC), number % 3, replace=False)]
    hidden = [
        HiddenEffect(*place, CATALOGUE[place[0]].plausible, int(rng.integers(1000)))
        for place in chosen
    ]
    steps = [(random_pose(table.workspace, rng), random_load(rng))]
    ours, theirs, _, _ = compare(table, hidden, steps, rng.uniform(-5.0, 15.0, len(HEATED)))
    assert np.linalg.norm(ours - theirs) < SECOND_ORDER * np.linalg.norm(theirs)


def test_flange_forces_and_slides_agree(wrist):
    table, rng = wrist(), np.random.default_rng(5)
    steps = [(random_pose(table.workspace, rng), random_load(rng)) for _ in range(6)]
    hidden = [HiddenEffect("axis_misalignment", "joint_4", "plain", 2e-5, 3)]
    _, _, state, solved = compare(table, hidden, steps, np.zeros(len(HEATED)))
    forces = np.array([s.force for s in solved])
    assert np.max(forces) > 0.01
    assert np.max(np.abs(state.equilibrium.force - forces)) < FORCE_SECOND_ORDER * np.max(forces)
    slides = np.array([s.slip[:, 0] for s in solved])
    error = np.max(np.abs(state.equilibrium.slips[..., 0] - slides))
    assert error < FORCE_SECOND_ORDER * np.max(np.abs(slides))


@pytest.mark.parametrize("joint", ["joint_2", "joint_3", "joint_4"])
@pytest.mark.parametrize("gap", [0.0, 1.0], ids=["closed", "open"])
def test_friction_along_a_path(joint, gap, wrist):
    """Moves of whole degrees, then loads at rest: stick, slip and the shared budget."""
    table, rng = with_gaps(wrist(), gap), np.random.default_rng(11)
    start, end = random_pose(table.workspace, rng), random_pose(table.workspace, rng)
    loads = [random_load(rng), random_load(rng)]
    steps = [(start + x * (end - start), loads[0]) for x in np.linspace(0.0, 1.0, 8)]
    steps += [(end, loads[0] + x * (loads[1] - loads[0])) for x in np.linspace(0.1, 1.0, 8)]
    hidden = [HiddenEffect("joint_friction", joint, "coulomb", 0.3, 2)]
    ours, theirs, _, _ = compare(table, hidden, steps, np.zeros(len(HEATED)))
    without, _, _, _ = compare(table, [], steps, np.zeros(len(HEATED)))
    effect = np.linalg.norm(theirs - without, axis=1)
    assert np.max(effect) > 1e-7
    assert np.max(np.linalg.norm(ours - theirs, axis=1)) < FRICTION * np.max(effect)


@pytest.mark.parametrize(
    ("rubbing", "loose"), [("joint_2", "joint_1"), ("joint_3", "joint_4"), ("joint_4", "joint_3")]
)
def test_friction_and_play_settle_together(rubbing, loose, wrist):
    """A loose pin gives way to what friction pushes, and what it gives changes the friction."""
    table, rng = with_gaps(wrist(), 1.0), np.random.default_rng(11)
    start, end = random_pose(table.workspace, rng), random_pose(table.workspace, rng)
    loads = [random_load(rng), random_load(rng)]
    steps = [(start + x * (end - start), loads[0]) for x in np.linspace(0.0, 1.0, 8)]
    steps += [(end, loads[0] + x * (loads[1] - loads[0])) for x in np.linspace(0.1, 1.0, 8)]
    hidden = [
        HiddenEffect("joint_friction", rubbing, "coulomb", 0.1, 2),
        HiddenEffect("joint_clearance", loose, "algebraic", 2e-6, 3),
    ]
    ours, theirs, _, _ = compare(table, hidden, steps, np.zeros(len(HEATED)))
    without, _, _, _ = compare(table, hidden[1:], steps, np.zeros(len(HEATED)))
    effect = np.linalg.norm(theirs - without, axis=1)
    assert np.max(effect) > 1e-7
    assert np.max(np.linalg.norm(ours - theirs, axis=1)) < FRICTION_AND_PLAY * np.max(effect)


@pytest.mark.parametrize(
    ("rubbing", "loose", "form", "mu", "play"),
    [
        ("joint_3", "joint_4", "exponential", 0.05, 1.4e-5),
        ("joint_4", "joint_3", "algebraic", 0.05, 2e-5),
        ("joint_3", "joint_4", "algebraic", 0.3, 1e-5),
    ],
)
def test_friction_beside_much_play_is_the_same_in_one_block_and_sample_by_sample(
    rubbing, loose, form, mu, play, wrist
):
    """The exact path finds no equilibrium there; the fast one must not depend on how it is cut."""
    table, rng = with_gaps(wrist(), 1.0), np.random.default_rng(11)
    poses, loads = (
        np.array([draw() for _ in range(4)])
        for draw in (lambda: random_pose(table.workspace, rng), lambda: random_load(rng))
    )
    knots, at = np.arange(4.0), np.linspace(0.0, 3.0, 90)
    theta, load = (
        np.column_stack([np.interp(at, knots, column) for column in values.T])
        for values in (poses, loads)
    )
    hidden = [
        HiddenEffect("joint_friction", rubbing, "coulomb", mu, 2),
        HiddenEffect("joint_clearance", loose, form, play, 3),
    ]
    shifts = []
    for size in (len(at), 1):
        true = TrueWrist(table, [build(each, table) for each in hidden])
        parts = [slice(first, first + size) for first in range(0, len(at), size)]
        states = [
            true.at(at[rows], theta[rows], load[rows], np.zeros((len(at[rows]), len(HEATED))))
            for rows in parts
        ]
        shifts.append(np.concatenate([state.shift for state in states]))
    assert np.ptp(shifts[0], axis=0).max() > 1e-5
    assert np.max(np.abs(shifts[0] - shifts[1])) < SETTLED
