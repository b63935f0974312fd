"""Limits beyond which a hidden effect is absurd."""

import pytest

from wrist_stiffness.simulation.catalogue import ALL, HiddenEffect, is_plausible


@pytest.mark.parametrize("effect", ALL)
def test_limit_lies_between_what_is_usual_and_what_is_simulated(effect):
    entry = ALL[effect]
    assert entry.plausible < entry.largest <= entry.limit


@pytest.mark.parametrize(("kilogram", "plausible"), [(0.05, True), (-0.05, True), (25.0, False)])
def test_a_tool_of_25_kg_is_no_tool_of_this_wrist(kilogram, plausible):
    hidden = HiddenEffect("inertia", "platform", "plain", kilogram, 1)
    assert is_plausible(hidden) is plausible
