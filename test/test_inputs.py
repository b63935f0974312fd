"""Files that stall, exhaust or confuse a reader are refused in one line."""

import os
import zipfile

import numpy as np
import pytest
import yaml
from hypothesis import given
from hypothesis import strategies as st

from wrist_stiffness.errors import InputError, TableError
from wrist_stiffness.inputs.document import LARGEST_BYTES, read_json, read_yaml, yaml_node
from wrist_stiffness.inputs.opening import open_input
from wrist_stiffness.inputs.schema import Quantity, number, record
from wrist_stiffness.lookup.table_file import load_table

LAUGHS = "l0: &l0 [1, 1]\n" + "".join(f"l{i}: &l{i} [*l{i - 1}, *l{i - 1}]\n" for i in range(1, 40))
PLAIN = st.recursive(
    st.none() | st.booleans() | st.integers() | st.floats(allow_nan=False) | st.text(),
    lambda inner: st.lists(inner, max_size=4) | st.dictionaries(st.text(), inner, max_size=4),
    max_leaves=12,
)


@given(PLAIN)
def test_what_pyyaml_writes_is_read_as_it_was(value):
    class Plain(yaml.SafeDumper):
        def ignore_aliases(self, data):
            return True

    assert yaml_node(yaml.dump(value, Dumper=Plain), "a.yaml", InputError).plain == value


@pytest.mark.parametrize(
    ("text", "why"),
    [
        (LAUGHS, "line 1: anchor &l0 is not read"),
        ("a: *b", "line 1: aliases are not read, write the value out"),
        ("a: 1\nb: !!bool maybe", "line 2: tag tag:yaml.org,2002:bool is not read"),
        ("a: !!timestamp x", "line 1: tag tag:yaml.org,2002:timestamp is not read"),
        ("[" * 5000, "line 1: nested deeper than 32"),
        ("a: 0b_", "line 1: 0b_ is no number"),
        ("? [a]\n: 1", "line 1: a key is a list or a mapping, not a text"),
        ("a: 1\n---\nb: 1", "line 2: a second document is not read"),
        ("a: 1\nb:\n  a: 1\n  a: 2", "line 4: key 'a' is given twice"),
        ("a: \x00", "not a YAML file: unacceptable character"),
        ("a: \ud800", "not a YAML file: 'utf-8' codec can't encode"),
    ],
)
def test_yaml_that_only_a_program_needs_is_refused_with_its_line(text, why):
    with pytest.raises(InputError) as caught:
        yaml_node(text, "a.yaml", InputError)
    assert str(caught.value).startswith("a.yaml")
    assert why in str(caught.value)
    assert "\n" not in str(caught.value)


@pytest.mark.parametrize("text", ["2001-13-99", "2001-01-01", "<<", "9" * 5000])
def test_dates_and_endless_digits_are_texts(text):
    assert yaml_node(f"a: {text}", "a.yaml", InputError).plain == {"a": text}


def test_errors_name_file_line_key_value_and_limit(tmp_path):
    path = tmp_path / "a.yaml"
    path.write_text("# first\nb:\n  width_mm: -3\n")
    schema = record({"b": record({"width_mm": Quantity(number(above=0.0))})})
    with pytest.raises(InputError) as caught:
        schema(read_yaml(path, InputError))
    assert str(caught.value) == f"{path}, line 3: b.width_mm: -3 is not above 0"
    path.write_text("b: {width_mm: 3}")
    assert schema(read_yaml(path, InputError)) == {"b": {"width": 3e-3}}


def test_a_number_of_500_digits_is_not_finite():
    node = yaml_node("a: " + "9" * 390, "a.yaml", InputError)
    with pytest.raises(InputError, match=r"a: 9+\.\.\. is not a finite number"):
        record({"a": number()})(node)


@pytest.mark.parametrize("read", [read_yaml, read_json, open_input])
def test_what_is_no_file_is_refused_at_once(tmp_path, read):
    os.mkfifo(tmp_path / "pipe")
    for path, why in {
        tmp_path / "pipe": "a pipe or a device, not a file",
        "/dev/zero": "a pipe or a device, not a file",
        tmp_path: "a folder, not a file",
        tmp_path / ("a" * 300): "File name too long",
        tmp_path / "a\0b": "null byte",
        tmp_path / "none": "No such file",
    }.items():
        with pytest.raises(InputError, match=f"cannot be read: .*{why}"):
            read(path, InputError)


def test_a_text_is_read_up_to_a_limit(tmp_path):
    path = tmp_path / "large.json"
    with path.open("wb") as stream:
        stream.truncate(LARGEST_BYTES + 1)
    with pytest.raises(InputError, match=f"is larger than {LARGEST_BYTES} bytes"):
        read_yaml(path, InputError)
    path.write_text("[" * 100_000)
    with pytest.raises(InputError, match="not a JSON file"):
        read_json(path, InputError)


@pytest.mark.parametrize(
    ("shape", "kind", "why"),
    [
        ((10**11,), "<f8", "is not that of its"),
        ((2**32, 2**32, 4), "<f8", "is not that of its"),
        ((-5,), "<f8", "is not that of its"),
        ((), "|O", "objects are not read"),
    ],
)
def test_the_size_of_an_array_is_checked_before_memory_is_taken(tmp_path, shape, kind, why):
    path = tmp_path / "table.npz"
    with zipfile.ZipFile(path, "w") as archive, archive.open("header.npy", "w") as stream:
        np.lib.format.write_array_header_1_0(
            stream, {"shape": shape, "descr": kind, "fortran_order": False}
        )
    with pytest.raises(TableError, match=why):
        load_table(path)


def test_a_table_that_would_unpack_to_gigabytes_is_refused(tmp_path):
    path = tmp_path / "table.npz"
    with (
        zipfile.ZipFile(path, "w", zipfile.ZIP_DEFLATED) as archive,
        archive.open("header.npy", "w", force_zip64=True) as stream,
    ):
        for _ in range(17):
            stream.write(bytes(1 << 24))
    with pytest.raises(TableError, match="states 285212672 bytes unpacked, more than 268435456"):
        load_table(path)
