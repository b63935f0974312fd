"""Temperatures: a part's own thermometer, or the lag behind ambient and its motor."""

from dataclasses import replace

import numpy as np
import pytest

LOAD = (0.2, 0.1, -1.0)


def heated(make, **temperatures):
    """Return an hour at one pose, a sample a minute, temperatures stepping after the first."""
    block = make.rest((20.0, -10.0), LOAD, n=61)
    step = np.where(np.arange(61) > 0, 1.0, 0.0)
    return replace(
        block,
        time=60.0 * block.time,
        temperatures={name: 20.0 + rise * step for name, rise in temperatures.items()},
    )


def growth(model, make, block, **values):
    effect = make.effect("thermal_expansion@link_1", **values)
    return np.linalg.norm(make.added(model, effect, block)[:, :3], axis=1)


def test_a_thermometer_is_believed_as_it_is(free_model, make):
    grown = growth(free_model, make, heated(make, link_1=10.0, ambient=50.0))
    geometry = free_model.table.geometry
    chord = np.subtract(*geometry.link_ends("link_1")) * geometry.links["link_1"].arc_radius
    assert grown[0] == 0.0
    assert np.allclose(grown[1:], grown[1], rtol=1e-9)
    # G of limb 1 takes a part of the chord away.
    assert 0.0 < grown[1] < 3.0 * 11.5e-6 * 10.0 * np.linalg.norm(chord)


def test_a_part_lags_behind_ambient(free_model, make):
    """The step falls between the first two samples: half of that minute counts."""
    at_once = growth(free_model, make, heated(make, link_1=10.0))[-1]
    grown = growth(free_model, make, heated(make, ambient=10.0), lag_s=600.0)
    minutes = np.arange(61)
    first = 0.5 * (1.0 - np.exp(-0.1))
    expected = 1.0 - (1.0 - first) * np.exp(-0.1 * (minutes - 1))
    assert np.allclose(grown[1:], at_once * expected[1:], rtol=1e-9)


@pytest.mark.parametrize("share", [25.0, 100.0])
def test_motor_heat_pulls_by_its_share(free_model, make, share):
    by_motor = growth(
        free_model, make, heated(make, motor_1=10.0, ambient=4.0), motor_share_percent=share
    )
    by_ambient = growth(free_model, make, heated(make, ambient=10.0))
    mixture = 0.01 * share + 0.4 * (1.0 - 0.01 * share)
    assert np.allclose(by_motor, mixture * by_ambient, rtol=1e-9)


def test_softening_grows_with_warmth(weightless, make):
    effect = make.effect("thermal_softening@joint_3", softening_percent_per_K=1.0)
    cold, warm, hot = (
        make.added(weightless, effect, heated(make, joint_3=rise))[-1] for rise in (0.0, 5.0, 10.0)
    )
    assert not cold.any()
    assert np.linalg.norm(warm) > 0.0
    assert np.allclose(hot, 2.0 * warm, rtol=1e-9)


def test_what_is_missing_is_named(free_model, make):
    block = heated(make, motor_2=5.0)
    for share, missing in ((0.0, "ambient"), (100.0, "motor_1")):
        effect = make.effect("thermal_expansion@link_1", motor_share_percent=share)
        (said,) = free_model.with_effects(effect).batch(block).warnings
        assert f"temperature of {missing} is missing" in said
