"""Bodies that cannot be put together are refused with the place and the limit."""

import copy
from pathlib import Path

import pytest
import yaml
from changed_geometry import LAYERS, checked

from wrist_stiffness.errors import GeometryError
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


def test_pins_that_bend_may_be_long():
    values = copy.deepcopy(VALUES)
    values["bushings"]["joint_2"]["radius_mm"] = 12.0
    with pytest.raises(GeometryError, match="taken as rigid; pins: {material: steel} lets"):
        checked(values)
    checked({**values, "pins": {"material": "steel", "source": "assumed"}})
    values["materials"]["layers"] = LAYERS
    with pytest.raises(GeometryError, match="pins.material: layers is orthotropic"):
        checked({**values, "pins": {"material": "layers", "source": "assumed"}})


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


IN_THE_WAY = "the boss of joint_4 and link_2"
IN_ONE_PLACE = r"are in one place at motor angles \(.*\) deg, in the operative workspace"


@pytest.mark.parametrize(
    ("block", "name", "key", "value", "message"),
    [
        ("links", "link_3", "arc_radius_mm", 42.0, f"link_3 and link_2 {IN_ONE_PLACE}"),
        ("links", "link_1", "section_radial_mm", 60.0, f"the plate and link_1 {IN_ONE_PLACE}"),
        (
            "bushings",
            "joint_1",
            "radius_mm",
            -53.0,
            f"the pin of joint_1 and link_2 {IN_ONE_PLACE}",
        ),
        (
            "bushings",
            "joint_4",
            "radius_mm",
            -20.0,
            f"{IN_THE_WAY} {IN_ONE_PLACE}",
        ),
        ("bushings", "joint_4", "length_mm", 8.0, f"{IN_THE_WAY} {IN_ONE_PLACE}"),
        (
            "bushings",
            "joint_2",
            "radius_mm",
            5.0,
            r"joint_2.radius_mm: 5 leaves 24.8 mm of pin .* more than link_1 \(at most 15.5 mm\)",
        ),
        (
            "bushings",
            "joint_2",
            "inner_gap_um",
            2000.0,
            r"2000 is wider .* \(at most 370",
        ),
        ("materials", "polymer", "poisson", -0.9, r"poisson: -0.9 .*-0.7"),
        (
            "limits",
            "joint_upper_deg",
            None,
            [78.0, 60.0],
            r"joint_upper_deg: \[78.0, 60.0\] stops short .* to \(61.5, 60.4\) deg",
        ),
        ("limits", "singularity", None, 0.999, r"no pose of the operative workspace has such a"),
        ("platform", "diameter_mm", None, 70.0, f"the plate and link_1 {IN_ONE_PLACE}"),
        ("limits", "operative_tilt_deg", None, 89.9, "89.9 is not reached in every direction"),
        ("materials", "steel", "young_GPa", 20.0, "20 is not steel, which has 200"),
        ("materials", "steel", "density_kg_m3", 785.0, "785 is not steel, which has 7850"),
        ("materials", "polymer", "young_GPa", 1500.0, "speed of sound of 3.17e.04 m/s"),
        ("materials", "polymer", "density_kg_m3", 14900.0, "speed of sound of 401 m/s"),
    ],
)
def test_what_cannot_be_is_refused_with_its_place(block, name, key, value, message):
    values = copy.deepcopy(VALUES)
    keys = [block, name, *([key] if key else [])]
    inner = values
    for each in keys[:-1]:
        inner = inner[each]
    inner[keys[-1]] = value
    with pytest.raises(GeometryError, match=message):
        checked(values)


def test_bars_in_one_shell_that_never_meet_are_not_refused():
    """It is the workspace that decides: these two lie on opposite sides of O."""
    values = copy.deepcopy(VALUES)
    values["links"]["link_1"]["arc_radius_mm"] = values["links"]["link_2"]["arc_radius_mm"]
    checked(values)


@pytest.mark.parametrize(
    ("change", "message"),
    [
        ({"poisson": [0.5, 0.2, 0.4]}, "poisson: 0.5 of axes 1 and 2 is not within 0.4714, the ro"),
        ({"poisson": [0.4, 0.6, 0.9]}, r"poisson: \[0.4, 0.6, 0.9\] .* negative work: .* is -"),
        ({"young_GPa": [2.0, 9000.0, 3.5]}, r"young_GPa.* 9000.0 is not below 2000"),
        ({"shear_GPa": [0.9, 0.6]}, r"shear_GPa: \[0.9, 0.6\] is not a list of 3 finite numbers"),
        ({"poisson": 0.3}, "poisson: 0.3 is not a list of 3"),
        ({"young_GPa": [1500.0] * 3}, "1500 with 1400 kg/m.3 makes a speed of sound"),
    ],
)
def test_layers_that_cannot_be_are_refused(change, message):
    values = copy.deepcopy(VALUES)
    values["materials"]["layers"] = LAYERS
    values["bushings"]["joint_1"]["material"] = values["links"]["link_2"]["material"] = "layers"
    checked(values)
    values["materials"]["layers"] = LAYERS | change
    with pytest.raises(GeometryError, match=message):
        checked(values)
