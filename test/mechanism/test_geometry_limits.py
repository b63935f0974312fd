"""Values of a geometry file that cannot be: each is refused with its place and its limit."""

import pytest
from changed_geometry import changed, refused

CASES = {
    "wrong schema": (
        "schema",
        2,
        ": 2 is not 1",
    ),
    "axis not unit": (
        "axes.joint_3",
        [1.0, 0.1, 0.0],
        ": [1.0, 0.1, 0.0] has length 1.00498756, not 1",
    ),
    "axis of two": (
        "axes.joint_3",
        [1.0, 0.0],
        ": [1.0, 0.0] is not a list of 3",
    ),
    "axis with NaN": (
        "axes.joint_3",
        [1.0, float("nan"), 0.0],
        ": [1.0, nan, 0.0] is not a list of 3 finite",
    ),
    "parallel neighbours": (
        "axes.joint_2",
        [1.0, 0.0, 0.0],
        "axes: home axes of joint_1 and joint_2 are parallel",
    ),
    "coplanar home axes": (
        "axes.joint_3",
        [0.0, 0.6, 0.8],
        "axes: home pose is singular: |D| = 0.00e+00 below 1e-06",
    ),
    "modulus in Pa": (
        "materials.steel.young_GPa",
        200e9,
        "young_GPa: 200000000000.0 is not below 2000",
    ),
    "modulus in MPa": (
        "materials.polymer.young_GPa",
        2400.0,
        "young_GPa: 2400.0 is not below 2000",
    ),
    "density in g/cm3": (
        "materials.steel.density_kg_m3",
        7.85,
        "density_kg_m3: 7.85 is not above 10",
    ),
    "normal along b": (
        "platform.normal",
        [0.0, 1.0, 0.0],
        "axes: home axes of joint_2 and the platform normal",
    ),
    "coplanar readouts": (
        "platform.readout_points_mm",
        [[0, 0, -18], [20, 0, -18], [0, 20, -18], [9, 9, -17]],
        ": nearly coplanar, smallest over largest spread is 0.0",
    ),
    "one readout point": (
        "platform.readout_points_mm",
        [[0, 0, 0], [0, 0, 0], [0, 0, 0], [0, 0, 0], [0, 0, 0]],
        "nearly coplanar, smallest over largest spread is 0.000, below 0.1",
    ),
    "three readouts": (
        "platform.readout_points_mm",
        [[0, 0, 0], [1, 0, 0], [0, 1, 0]],
        ": 3 entries, needs a list of at least 4",
    ),
    "readout of two": (
        "platform.readout_points_mm",
        [[0, 0, 0], [1, 0, 0], [0, 1], [0, 0, 1]],
        "[2]: [0, 1] is not a list of 3",
    ),
    "bore wider than bar": (
        "links.link_2.motor_bore_mm",
        10.0,
        ": 10 does not fit into the bar (section_axial_mm and twice overhang_mm leave 10)",
    ),
    "bore past overhang": (
        "links.link_2.overhang_mm",
        2.0,
        (
            "links.link_2.motor_bore_mm: 5.4 does not fit into the bar (section_axial_mm "
            "and twice overhang_mm leave 4)"
        ),
    ),
    "bar over O": (
        "links.link_1.section_radial_mm",
        62.0,
        ": 62 reaches past O (twice arc_radius_mm is 62)",
    ),
    "bushing over O": (
        "bushings.joint_4.radius_mm",
        -3.25,
        ": -3.25 puts the bushing over O (half of length_mm is 3.25)",
    ),
    "flange too small": (
        "bushings.joint_4.flange_diameter_mm",
        6.8,
        ": 6.8 is not larger than the sleeve, 6.9",
    ),
    "negative gap": (
        "bushings.joint_2.outer_gap_um",
        -1.0,
        ": -1.0 is below 0",
    ),
    "gap at a motor": (
        "bushings.joint_1.outer_gap_um",
        0.0,
        "bushings.joint_1: unknown key outer_gap_um",
    ),
    "incompressible": (
        "materials.steel.poisson",
        0.5,
        ": 0.5 is not below 0.5",
    ),
    "unknown material": (
        "links.link_1.material",
        "brass",
        ": 'brass' is not one of steel, polymer, aluminium",
    ),
    "wrong load point": (
        "platform.load_at",
        "P1",
        ": 'P1' is not one of O, P0",
    ),
    "wrong status": (
        "status",
        "guessed",
        ": 'guessed' is not one of paper, assumed, calibrated, measured",
    ),
    "wrong source": (
        "site.source",
        "guessed",
        ": 'guessed' is not one of paper, assumed, calibrated, measured",
    ),
    "wrong source of one key": (
        "materials.steel.source",
        {"poisson": "me", "rest": "paper"},
        ": 'me' is not one of",
    ),
    "source that is a list": (
        "site.source",
        ["paper"],
        ": ['paper'] is not one of",
    ),
    "source of unknown key": (
        "materials.steel.source",
        {"young": "paper", "rest": "paper"},
        ": names unknown key young",
    ),
    "source without the rest": (
        "materials.steel.source",
        {"young_GPa": "paper"},
        ": says nothing of density_kg_m3, expansion_1e-6_K, poisson",
    ),
    "limits crossed": (
        "limits.joint_lower_deg",
        [-66.0, 70.0],
        ": [-66.0, 70.0] is not below joint_upper_deg, [66.0, 66.0]",
    ),
    "tilt past the pole": (
        "limits.operative_tilt_deg",
        180.0,
        ": 180.0 is not below 180",
    ),
    "margin inwards": (
        "limits.map_margin",
        0.9,
        ": 0.9 is below 1",
    ),
    "below absolute zero": (
        "site.reference_temperature_degC",
        -300.0,
        ": -300.0 is not above -273.15",
    ),
    "block that is a number": (
        "links.link_1",
        3.0,
        ": 3.0 is not a mapping",
    ),
    "block that is empty": (
        "platform",
        None,
        " is empty",
    ),
}


@pytest.mark.parametrize(("place", "value", "message"), CASES.values(), ids=CASES)
def test_value_that_cannot_be_is_named_with_its_limit(place, value, message):
    found = refused(changed(tuple(place.split(".")), value))
    # What is wrong with two values together may stand at the other one, or at their block.
    assert found.startswith(f"wrist.yaml: {place.rpartition('.')[0]}") or "home axes" in found
    assert message in found
