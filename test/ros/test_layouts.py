"""The layouts for Foxglove and PlotJuggler name topics and fields that exist."""

import json
import re
from pathlib import Path
from xml.etree import ElementTree

import pytest

from wrist_stiffness.recording.messages import MESSAGE_TYPES, MSG_LINE
from wrist_stiffness.ros.recorder import TOPICS
from wrist_stiffness.shipped import shipped_file

PRIMITIVES = {"float64", "bool", "string"}


def ends_in_a_number(message_type, fields):
    """Follow field names from a message to a number."""
    for i, field in enumerate(fields):
        lines = [
            f.metadata[MSG_LINE].split()[:2] for f in message_type.__dataclass_fields__.values()
        ]
        kind = next((kind for kind, name in lines if name == field), None)
        if kind is None:
            return False
        if kind in PRIMITIVES:
            return i == len(fields) - 1
        package = message_type.ros_type.split("/")[0]
        full = kind if "/" in kind else f"{package}/{kind}"
        message_type = MESSAGE_TYPES[full.replace("/", "/msg/")]
    return False


def split(path, separator):
    for topic in sorted(TOPICS, key=len, reverse=True):
        if path.startswith(topic + separator):
            return topic, path[len(topic) + 1 :].split(separator)
    pytest.fail(f"{path} is of no topic of the wrist")


def test_foxglove_plots_fields_that_exist():
    layout = json.loads(Path(shipped_file("config/foxglove_layout.json")).read_text())
    panels = layout["configById"]
    placed = re.findall(r'"(\w+!\w+)"', json.dumps(layout["layout"]))
    assert sorted(placed) == sorted(panels)
    paths = [path["value"] for panel in panels.values() for path in panel.get("paths", [])]
    assert len(paths) > 5
    for path in paths:
        topic, fields = split(path, ".")
        assert ends_in_a_number(TOPICS[topic], fields), path


def test_plotjuggler_plots_fields_that_exist():
    root = ElementTree.parse(shipped_file("config/plotjuggler_layout.xml")).getroot()
    curves = [curve.get("name") for curve in root.iter("curve")]
    assert len(curves) > 5
    for curve in curves:
        topic, fields = split(curve, "/")
        assert ends_in_a_number(TOPICS[topic], fields), curve


def test_a_field_that_does_not_exist_is_found():
    pose = TOPICS["/pose_error_residual"]
    assert ends_in_a_number(pose, ["pose", "pose", "position", "x"])
    assert not ends_in_a_number(pose, ["pose", "position", "x"])
    assert not ends_in_a_number(pose, ["pose", "pose", "position"])
