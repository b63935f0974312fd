"""Every way to get a geometry file wrong gives one line that names place, value and limit."""

import contextlib
import copy
import itertools
import re
from functools import reduce
from pathlib import Path

import numpy as np
import pytest
import yaml
from changed_geometry import ORTHOGONAL, VALUES, changed, refused
from hypothesis import given
from hypothesis import strategies as st

from wrist_stiffness.errors import GeometryError
from wrist_stiffness.mechanism.geometry_file import (
    geometry_from_values,
    load_geometry,
)


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


PLACES = list(leaves(VALUES))
NUMBERS = [
    place
    for place in PLACES
    if type(reduce(lambda block, key: block[key], place, VALUES)) in (int, float)
]


def dotted(place):
    return ".".join(place)


def under(place):
    return f"wrist.yaml: {dotted(place)}" if place else "wrist.yaml"


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
    around = [geometry.axes[f"joint_{k}"] for k in (1, 2, 3, 4, 5, 1)]
    cosines = [one @ other for one, other in itertools.pairwise(around)]
    np.testing.assert_allclose(cosines, 0.0, atol=1e-15)


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
    assert refused(without(place)) == f"{under(place[:-1])}: {place[-1]} is missing"


@pytest.mark.parametrize("place", PLACES, ids=dotted)
def test_wrong_type_is_named(place):
    for value in ({"a": 1}, ["a", 1.0], True):
        message = refused(changed(place, value))
        assert message.startswith(under(place))
        assert "is not" in message or "needs a list" in message


def test_a_file_without_a_material_is_refused():
    values = {**VALUES, "materials": {"source": "assumed"}}
    assert refused(values) == "wrist.yaml: materials: names no material, parts need one"


@pytest.mark.parametrize("place", NUMBERS, ids=dotted)
def test_value_that_is_no_number_is_named(place):
    hint = ": YAML takes it for a text, write "
    for value, written in {
        np.nan: "",
        np.inf: "",
        "12": "12.0",
        "1e-3": "0.001",
        10**400: "",
    }.items():
        message = refused(changed(place, value))
        assert message.startswith(f"{under(place)}: {repr(value)[:20]}")
        assert message.endswith("is not a finite number" + (hint + written if written else ""))


MAY_BE_NEGATIVE = {"radius_mm", "poisson", "expansion_1e-6_K", "reference_temperature_degC"}


@pytest.mark.parametrize(
    "place", [p for p in NUMBERS if p[-1] not in MAY_BE_NEGATIVE | {"schema"}], ids=dotted
)
def test_negative_number_is_named_with_its_limit(place):
    message = refused(changed(place, -3.5))
    assert message.startswith(f"{under(place)}: -3.5 is")
    assert re.search(r"(not above|below) (0|0\.0001|1|10)$", message)


@pytest.mark.parametrize(
    "block", sorted({place[:-1] for place in PLACES}), ids=lambda place: dotted(place) or "root"
)
def test_unknown_key_is_named(block):
    values = changed((*block, "radios_mm"), 3.0)
    expected = under(block)
    message = refused(values)
    # Any name is a material; a number is no material.
    assert message.startswith((f"{expected}: unknown key radios_mm", f"{expected}.radios_mm: 3.0"))


@pytest.mark.parametrize("block", ["site", "axes", "limits", "platform"])
def test_missing_source_is_named(block):
    assert refused(without((block, "source"))).startswith(f"wrist.yaml: {block}: source is missing")


@pytest.mark.parametrize(
    ("content", "message"),
    [
        (b"links: [1, 2\nname: x", "not a YAML file"),
        (b"name: \xff\xfe", "not a text in UTF-8"),
        (b"name: !!python/object/apply:os.getcwd []", "line 1: tag tag:yaml.org"),
        (b"schema: 1\nschema: 2\n", "key 'schema' is given twice"),
        (b"? [a, b]\n: 1\n", "line 1: a key is a list"),
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
