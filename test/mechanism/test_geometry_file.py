"""Every way to get a geometry file wrong gives one line that names place, value and limit."""

import contextlib
import copy
from functools import reduce
from pathlib import Path

import numpy as np
import pytest
import yaml
from hypothesis import given
from hypothesis import strategies as st

from wrist_stiffness.errors import GeometryError
from wrist_stiffness.mechanism.geometry_file import (
    geometry_from_values,
    load_geometry,
    mechanism_of,
)

ORTHOGONAL = Path(__file__).with_name("orthogonal_wrist.yaml")
VALUES = yaml.safe_load(ORTHOGONAL.read_text())


def changed(path, value):
    """The values with another value at a place like ("site", "gravity_m_s2")."""
    values = copy.deepcopy(VALUES)
    reduce(lambda block, key: block[key], path[:-1], values)[path[-1]] = value
    return values


def without(path):
    values = copy.deepcopy(VALUES)
    del reduce(lambda block, key: block[key], path[:-1], values)[path[-1]]
    return values


def leaves(values, path=()):
    """Places of everything that is no mapping, sources apart."""
    for key, value in values.items():
        if isinstance(value, dict) and key != "source":
            yield from leaves(value, (*path, key))
        elif key not in ("source", "note"):
            yield (*path, key)


def refused(values):
    with pytest.raises(GeometryError) as caught:
        geometry_from_values(values, "wrist.yaml")
    message = str(caught.value)
    assert "\n" not in message
    assert message.startswith("wrist.yaml")
    return message


PLACES = list(leaves(VALUES))
NUMBERS = [
    place
    for place in PLACES
    if type(reduce(lambda block, key: block[key], place, VALUES)) in (int, float)
]


def dotted(place):
    return ".".join(place)


def test_geometry_reads_in_si_units():
    geometry = load_geometry(ORTHOGONAL)
    assert geometry.name == "orthogonal"
    link, raw = geometry.links["link_1"], VALUES["links"]["link_1"]
    assert link.arc_radius == pytest.approx(raw["arc_radius_mm"] * 1e-3)
    assert link.material.young == pytest.approx(
        VALUES["materials"][raw["material"]]["young_GPa"] * 1e9
    )
    bushing, raw = geometry.bushings["joint_2"], VALUES["bushings"]["joint_2"]
    assert bushing.radius == pytest.approx(raw["radius_mm"] * 1e-3)
    assert (bushing.inner_gap is None) == (raw["inner_gap_um"] is None)
    assert geometry.bushings["joint_1"].outer_gap is None
    assert geometry.limits.operative_tilt == pytest.approx(
        np.radians(VALUES["limits"]["operative_tilt_deg"])
    )
    points = np.array(VALUES["platform"]["readout_points_mm"]) * 1e-3
    np.testing.assert_allclose(geometry.platform.readout_points, points)
    for joint, axis in geometry.axes.items():
        assert np.linalg.norm(axis) == pytest.approx(1.0, abs=1e-15), joint
    np.testing.assert_allclose(mechanism_of(geometry).alphas, np.radians([90.0] * 5))


@pytest.mark.parametrize(
    "path",
    sorted((Path(__file__).parents[2] / "config").glob("palmieri2015*.yaml")),
    ids=lambda path: path.stem,
)
def test_shipped_geometries_are_calibrated(path):
    if not path.stem.endswith("_model"):
        assert load_geometry(path).status == "calibrated"


def test_plate_mass_and_centre_of_gravity_follow_from_its_size():
    platform = load_geometry(ORTHOGONAL).platform
    raw = VALUES["platform"]
    volume = np.pi * (raw["diameter_mm"] / 2e3) ** 2 * raw["thickness_mm"] / 1e3
    density = VALUES["materials"][raw["material"]]["density_kg_m3"]
    assert platform.mass == pytest.approx(volume * density)
    depth = (platform.centre - platform.centre_of_gravity) @ platform.normal
    assert depth == pytest.approx(raw["thickness_mm"] / 2e3)


def test_load_point_follows_the_word_in_the_file():
    at_plate = geometry_from_values(changed(("platform", "load_at"), "P0"))
    at_centre = geometry_from_values(changed(("platform", "load_at"), "O"))
    np.testing.assert_array_equal(at_plate.load_point, at_plate.platform.centre)
    np.testing.assert_array_equal(at_centre.load_point, np.zeros(3))


def test_written_values_read_back_the_same(tmp_path):
    path = tmp_path / "again.yaml"
    path.write_text(yaml.safe_dump(VALUES, sort_keys=True, default_flow_style=False))
    again, first = load_geometry(path), load_geometry(ORTHOGONAL)
    assert again.sha256 == first.sha256
    assert again.links == first.links
    assert again.bushings == first.bushings
    assert list(again.axes) == list(first.axes)


@pytest.mark.parametrize("place", PLACES, ids=dotted)
def test_missing_key_is_named(place):
    message = refused(without(place))
    assert (
        f"wrist.yaml{''.join('.' + key for key in place[:-1])}: {place[-1]} is missing" == message
    )


@pytest.mark.parametrize("place", PLACES, ids=dotted)
def test_wrong_type_is_named(place):
    for value in ({"a": 1}, ["a", 1.0], True):
        message = refused(changed(place, value))
        assert message.startswith(f"wrist.yaml.{dotted(place)}")
        assert "is not" in message or "needs a list" in message


@pytest.mark.parametrize("place", NUMBERS, ids=dotted)
def test_value_that_is_no_number_is_named(place):
    for value in (float("nan"), float("inf"), "12", "1e-3", 10**400):
        message = refused(changed(place, value))
        assert message.startswith(f"wrist.yaml.{dotted(place)}: {repr(value)[:20]}")
        assert message.endswith("is not a finite number")


MAY_BE_NEGATIVE = {"radius_mm", "poisson", "expansion_1e-6_K", "reference_temperature_degC"}


@pytest.mark.parametrize(
    "place", [p for p in NUMBERS if p[-1] not in MAY_BE_NEGATIVE | {"schema"}], ids=dotted
)
def test_negative_number_is_named_with_its_limit(place):
    message = refused(changed(place, -3.5))
    assert message.startswith(f"wrist.yaml.{dotted(place)}: -3.5 is")
    assert "above 0" in message or "below 0" in message or "below 1" in message


@pytest.mark.parametrize(
    "block", sorted({place[:-1] for place in PLACES}), ids=lambda place: dotted(place) or "root"
)
def test_unknown_key_is_named(block):
    values = changed((*block, "radios_mm"), 3.0)
    expected = f"wrist.yaml{''.join('.' + key for key in block)}"
    message = refused(values)
    # Any name is a material; a number is no material.
    assert message.startswith((f"{expected}: unknown key radios_mm", f"{expected}.radios_mm: 3.0"))


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
        ".axes: home axes of joint_1 and joint_2 are parallel",
    ),
    "coplanar home axes": (
        "axes.joint_3",
        [0.0, 0.6, 0.8],
        ".axes: home pose is singular: |D| = 0.00e+00 below 1e-06",
    ),
    "normal along b": (
        "platform.normal",
        [0.0, 1.0, 0.0],
        ".axes: home axes of joint_2 and the platform normal",
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
        ": 3 rows, needs a list of at least 4",
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
            ".links.link_2.motor_bore_mm: 5.4 does not fit into the bar (section_axial_mm "
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
        ".bushings.joint_1: unknown key outer_gap_um",
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
    assert found.startswith(f"wrist.yaml.{place.rpartition('.')[0]}") or "home axes" in found
    assert message in found


@pytest.mark.parametrize("block", ["site", "axes", "limits", "platform"])
def test_missing_source_is_named(block):
    assert refused(without((block, "source"))).startswith(f"wrist.yaml.{block}: source is missing")


@pytest.mark.parametrize(
    ("content", "message"),
    [
        (b"links: [1, 2\nname: x", "not a YAML file"),
        (b"name: \xff\xfe", "not a YAML file"),
        (b"name: !!python/object/apply:os.getcwd []", "not a YAML file"),
        (b"schema: 1\nschema: 2\n", "key 'schema' is given twice"),
        (b"? [a, b]\n: 1\n", "not a YAML file"),
        (b"", " is empty"),
        (b"- 1\n- 2\n", "[1, 2] is not a mapping"),
        (b"just words", "'just words' is not a mapping"),
    ],
    ids=["open list", "not UTF-8", "code", "key twice", "list as key", "empty", "list", "words"],
)
def test_file_that_is_no_geometry_is_named(tmp_path, content, message):
    path = tmp_path / "bad.yaml"
    path.write_bytes(content)
    with pytest.raises(GeometryError) as caught:
        load_geometry(path)
    assert str(caught.value).startswith(str(path))
    assert message in str(caught.value)
    assert "\n" not in str(caught.value)


def test_file_that_cannot_be_read_is_named(tmp_path):
    for path in (tmp_path / "absent.yaml", tmp_path):
        with pytest.raises(GeometryError, match="cannot be read") as caught:
            load_geometry(path)
        assert str(path) in str(caught.value)


def reordered(values):
    """The same values, mappings backwards."""
    if isinstance(values, dict):
        return {key: reordered(values[key]) for key in reversed(list(values))}
    return values


def test_checksum_ignores_layout_comments_and_order(tmp_path):
    path = tmp_path / "same.yaml"
    path.write_text("# another comment\n" + yaml.safe_dump(reordered(VALUES), sort_keys=False))
    assert load_geometry(path).sha256 == load_geometry(ORTHOGONAL).sha256


def test_checksum_takes_whole_numbers_for_what_they_are():
    """40 and 40.0 are the same length."""
    whole = geometry_from_values(changed(("bushings", "joint_1", "radius_mm"), 40))
    point = geometry_from_values(changed(("bushings", "joint_1", "radius_mm"), 40.0))
    assert whole.sha256 == point.sha256


@given(
    st.sampled_from([p for p in NUMBERS if p != ("schema",) and p[-1] != "map_margin"]),
    st.floats(1e-12, 1e-6),
)
def test_checksum_depends_on_every_number(place, change):
    value = reduce(lambda block, key: block[key], place, VALUES)
    other = value * (1.0 - change) if value else change
    assert geometry_from_values(changed(place, other)).sha256 != geometry_from_values(VALUES).sha256


@given(
    st.sampled_from(PLACES),
    st.recursive(
        st.none() | st.booleans() | st.integers() | st.floats() | st.text(max_size=5),
        lambda inner: st.lists(inner, max_size=4) | st.dictionaries(st.text(max_size=3), inner),
        max_leaves=6,
    ),
)
def test_any_value_anywhere_is_read_or_refused_in_one_line(place, value):
    with contextlib.suppress(GeometryError):
        geometry_from_values(changed(place, value), "wrist.yaml")
        return
    refused(changed(place, value))
