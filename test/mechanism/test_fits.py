"""Bodies that cannot be put together are refused with the place and the limit."""

import copy
from pathlib import Path

import pytest
import yaml

from wrist_stiffness.errors import GeometryError
from wrist_stiffness.inputs.document import node_of
from wrist_stiffness.mechanism.fits import check_fits
from wrist_stiffness.mechanism.geometry_file import geometry_of
from wrist_stiffness.shipped import shipped_file

CONFIG = Path(shipped_file("config/palmieri2015.yaml")).parent
VALUES = yaml.safe_load((CONFIG / "palmieri2015.yaml").read_text())
PINS = {
    "joint_1": "link_1.motor_bore",
    "joint_2": "link_1.platform_bore",
    "joint_3": "link_3.platform_bore",
    "joint_4": "link_2.platform_bore",
    "joint_5": "link_2.motor_bore",
}


def checked(values):
    root = node_of(values, "wrist.yaml", GeometryError)
    check_fits(root, geometry_of(root))


def refused(block, name, key, value):
    """The message after `wrist.yaml: ` and the place of the value, which it has to name."""
    values = copy.deepcopy(VALUES)
    values[block][name][key] = value
    with pytest.raises(GeometryError) as caught:
        checked(values)
    return str(caught.value).removeprefix("wrist.yaml: ")


@pytest.mark.parametrize("variant", ["", "_variant_b", "_variant_c"])
def test_every_shipped_wrist_can_be_put_together(variant):
    checked(yaml.safe_load((CONFIG / f"palmieri2015{variant}.yaml").read_text()))


@pytest.mark.parametrize("joint", PINS)
@pytest.mark.parametrize("change", [-0.371, 0.371])
def test_a_pin_of_another_size_than_its_bore_is_refused(joint, change):
    size = VALUES["bushings"][joint]["pin_diameter_mm"]
    message = refused("bushings", joint, "pin_diameter_mm", size + change)
    assert message == (
        f"bushings.{joint}.pin_diameter_mm: {size + change:g} does not fit "
        f"links.{PINS[joint]}_mm, which has room for {size:g} (may differ by 0.37)"
    )


@pytest.mark.parametrize("joint", PINS)
def test_a_loose_fit_is_not_refused(joint):
    values = copy.deepcopy(VALUES)
    values["bushings"][joint]["pin_diameter_mm"] -= 0.369
    checked(values)


def test_a_sleeve_in_the_bar_has_to_fit_and_one_beside_it_not():
    message = refused("bushings", "joint_4", "wall_mm", 1.5)
    assert message == (
        "bushings.joint_4.pin_diameter_mm: 6 does not fit links.link_3.motor_bore_mm, "
        "which has room for 5 (may differ by 0.37)"
    )
    values = copy.deepcopy(VALUES)
    values["bushings"]["joint_4"] |= {"wall_mm": 1.5, "radius_mm": -52.0}
    checked(values)


def test_bars_that_cross_in_every_pose_are_refused():
    message = refused("links", "link_3", "arc_radius_mm", 42.0)
    assert message == (
        "links.link_3.arc_radius_mm: 42 is 2.75 mm from that of link_2, and the bars cross at "
        "joint_4: half of both section_radial_mm is 3.96 mm"
    )
