"""Laws as columns: what they say of themselves is what they do."""

import os
import subprocess
import sys

import numpy as np
import pytest

from wrist_stiffness.errors import InputError
from wrist_stiffness.model.effect import effect_at
from wrist_stiffness.model.parameters import Parameter
from wrist_stiffness.model.registry import catalogue, find_law

COLUMNS = """
from wrist_stiffness.model.registry import catalogue

for law in catalogue().values():
    for place in law.places:
        own = law.linearised(place, frozenset(("motor_1", "link_1")))
        for shape in own.shapes:
            print(law.id, place, [(c.factor.key, c.trial, c.origin) for c in own.columns(shape)])
"""


def test_the_columns_of_every_law_come_in_one_order():
    """Python orders sets of names by a seed that is drawn anew in every process."""
    said = [
        subprocess.run(
            [sys.executable, "-c", COLUMNS],
            env={**os.environ, "PYTHONHASHSEED": seed},
            capture_output=True,
            text=True,
            check=True,
        ).stdout
        for seed in ("1", "3")
    ]
    assert "gravity platform" in said[0]
    assert said[0] == said[1]


@pytest.fixture(scope="module")
def block(make):
    return make.block(40)


def shown(model, block, law, place, values):
    """What the pose sensor shows of a law at a place, (n, 6)."""
    with_it = model.with_effects(effect_at(law, place, values)).batch(block)
    return with_it.measured - model.with_effects().batch(block).measured


def matrix(model, block, law, place, shape):
    """The columns of a law, (6n, k), with their factors' names and typical magnitudes."""
    columns = law.linearised(place, frozenset(block.temperatures)).columns(shape)
    rows = []
    for each in columns:
        change = shown(model, block, law, place, each.trial)
        if each.origin:
            change = change - shown(model, block, law, place, each.origin)
        rows.append(change.ravel() / each.size)
    sizes = {each.factor.key: each.factor.scale for each in columns}
    return np.stack(rows, axis=1), sizes


@pytest.mark.parametrize(
    "name",
    [
        *("gravity@platform", "gravity@link_2", "cable_wrench@platform", "creep@joint_3"),
        *("platform_compliance@platform", "thermal_expansion@frame", "load_point@load_sensor"),
        "encoder_eccentricity@motor_2",
    ],
)
def test_columns_times_factors_are_what_the_law_does_from_its_start(free_model, block, name):
    """Without contact, and of laws that are linear in what they say that they are linear in."""
    law, place = name.split("@")
    law = find_law(law)
    recipe = law.linearised(place, frozenset(block.temperatures))
    shape = recipe.shapes[-1]
    columns, sizes = matrix(free_model, block, law, place, shape)
    rng = np.random.default_rng(4)
    factors = {key: 0.1 * size * abs(rng.normal()) for key, size in sizes.items()}
    start = recipe.start(factors, shape)
    law_itself = shown(free_model, block, law, place, start).ravel()
    together = columns @ np.array(list(factors.values()))
    assert np.linalg.norm(together - law_itself) < 5e-3 * np.linalg.norm(law_itself) != 0.0


@pytest.mark.parametrize("name", ["gravity@link_1", "inertia@platform"])
def test_a_mass_begins_where_its_first_moment_says(name):
    """And within its bounds: a small mass may ask for any arm."""
    law, place = name.split("@")
    law = find_law(law)
    recipe = law.linearised(place, frozenset())
    heavy, *moved = recipe.columns(())[:4]
    arm = np.array([1.0, -2.0, 3.0])
    names = [each.factor.key for each in moved]
    zero = {each.factor.key: 0.0 for each in recipe.columns(())}
    found = zero | {"mass_g": 40.0} | dict(zip(names, 40.0 * arm, strict=True))
    start = recipe.start(found, ())
    assert start["mass_g"] == 40.0
    place_mm = [start[key] - heavy.trial[key] for key in ("x_mm", "y_mm", "z_mm")]
    assert place_mm == pytest.approx(arm)
    bounds = {each.key: each for each in law.parameters(place)}
    far = recipe.start(found | {names[0]: 1e9}, ())
    assert far["x_mm"] == bounds["x_mm"].upper


CARRIED = [
    (law, place)
    for law in catalogue().values()
    for place in law.places
    if law.linearised(place, frozenset()).carried
]


@pytest.mark.parametrize(("law", "place"), CARRIED, ids=lambda each: getattr(each, "id", each))
def test_a_carrier_times_signals_is_the_law_between_the_points_of_its_grid_too(
    free_model, block, law, place
):
    recipe = law.linearised(place, frozenset())
    carried = recipe.carried
    shape = tuple(0.3 * each.grid[0] + 0.7 * each.grid[1] for each in recipe.shape)
    columns, _ = matrix(free_model, block, law, place, shape)
    carrier = shown(free_model, block, find_law(carried.law), place, carried.values)
    signals = carried.signals(shape, block)
    product = (carrier[:, :, None] * signals[:, None, :]).reshape(columns.shape)
    assert np.allclose(product, columns, rtol=0.0, atol=1e-5 * np.abs(columns).max())


@pytest.mark.parametrize("grid", [(1.0,), (2.0, 1.0), (1.0, 1.0), (1.0, np.nan)])
def test_a_grid_that_cannot_be_searched_is_refused(grid):
    with pytest.raises(InputError, match="lag_s: grid .*: not two or more increasing values"):
        Parameter("lag_s", 0.0, 1.0, 1.0, grid=grid)
