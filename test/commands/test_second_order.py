"""What the build says where no wrist can rest under what its geometry asks for."""

from dataclasses import replace

import pytest

from wrist_stiffness.commands.uncertainty import second_order
from wrist_stiffness.errors import InputError


@pytest.mark.parametrize(
    ("block", "key", "value", "told"),
    [
        ("limits", "moment_Nm", 100.0, "limits.force_N = 5, limits.moment_Nm = 100 or a gravity"),
        ("site", "gravity_m_s2", [0.0, 0.0, -9810.0], "a gravity of 9810 m/s.2 bends it too far"),
    ],
)
def test_a_value_in_another_unit_is_named(table, block, key, value, told):
    geometry = table.header.geometry
    wrong = geometry | {block: geometry[block] | {key: value}}
    with pytest.raises(InputError, match=f"finds no rest at motor angles .* deg: .*{told}"):
        second_order(replace(table, header=replace(table.header, geometry=wrong)))
