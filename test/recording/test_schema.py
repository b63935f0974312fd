"""Schema texts and type hashes against the installed ROS packages and rosbags."""

import json
import re
import sys
from pathlib import Path

import pytest
from rosbags.typesys import Stores, get_types_from_msg, get_typestore

from wrist_stiffness.recording.messages import MESSAGE_TYPES
from wrist_stiffness.recording.schema import definition_text, type_hash

BY_NAME = pytest.mark.parametrize("ros_type", MESSAGE_TYPES)
SEPARATOR = "=" * 80 + "\nMSG: "


def installed(ros_type, suffix):
    package, _, name = ros_type.split("/")
    path = Path(sys.prefix) / "share" / package / "msg" / f"{name}{suffix}"
    if not path.exists():
        pytest.skip(f"{package} is not installed here")
    return path.read_text()


def parts_of(ros_type):
    main, *nested = definition_text(ros_type).split(SEPARATOR)
    texts = {ros_type: main}
    for part in nested:
        name, _, text = part.partition("\n")
        package, _, type_name = name.partition("/")
        texts[f"{package}/msg/{type_name}"] = text
    return texts


def significant_lines(text):
    """Return the lines without comments, and with single spaces."""
    lines = (re.sub(r"\s+", " ", line.partition("#")[0]).strip() for line in text.splitlines())
    return [line for line in lines if line]


@BY_NAME
def test_every_part_is_the_installed_definition(ros_type):
    for name, text in parts_of(ros_type).items():
        assert significant_lines(text) == significant_lines(installed(name, ".msg")), name


@BY_NAME
def test_hash_is_the_installed_one(ros_type):
    described = json.loads(installed(ros_type, ".json"))
    hashes = {entry["type_name"]: entry["hash_string"] for entry in described["type_hashes"]}
    assert type_hash(ros_type) == hashes[ros_type]


@BY_NAME
def test_rosbags_parses_the_text_to_the_same_types(ros_type):
    official = get_typestore(Stores.ROS2_JAZZY)
    parsed = get_types_from_msg(definition_text(ros_type), ros_type)
    assert ros_type in parsed
    for name, (_, fields) in parsed.items():
        assert fields == official.fielddefs[name][1], name
