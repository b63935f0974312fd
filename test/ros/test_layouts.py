"""The layouts for Foxglove and PlotJuggler name topics and fields that exist."""

import json
import re
from pathlib import Path
from xml.etree import ElementTree

import pytest

from wrist_stiffness.recording.messages import MESSAGE_TYPES, MSG_LINE
from wrist_stiffness.ros.angle_corrector import AngleCorrector
from wrist_stiffness.ros.cell_simulator import CellSimulator
from wrist_stiffness.ros.model_monitor import ModelMonitor
from wrist_stiffness.ros.pose_error_predictor import PoseErrorPredictor
from wrist_stiffness.ros.recorder import TOPICS
from wrist_stiffness.shipped import shipped_file

MARKERS = "visualization_msgs/msg/MarkerArray"
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


FOXGLOVE_KEYS = {"configById", "globalVariables", "userNodes", "playbackConfig", "layout"}
"""Of the layouts that Foxglove's public code has as its defaults."""


def check_split(tree, panels):
    """Follow the tree of split panes: two sides, a direction, and panels at the ends."""
    if isinstance(tree, str):
        assert tree in panels
        kind, _, name = tree.partition("!")
        assert kind in {"3D", "Plot", "DiagnosticSummary"}
        assert name
        return
    assert set(tree) - {"splitPercentage"} == {"direction", "first", "second"}
    assert tree["direction"] in ("row", "column")
    assert 0 < tree.get("splitPercentage", 50) < 100
    for side in ("first", "second"):
        check_split(tree[side], panels)


def test_foxglove_finds_the_structure_that_it_writes_itself():
    layout = json.loads(Path(shipped_file("config/foxglove_layout.json")).read_text())
    assert set(layout) == FOXGLOVE_KEYS
    check_split(layout["layout"], layout["configById"])
    for name, panel in layout["configById"].items():
        if name.startswith("Plot!"):
            assert {"value", "enabled", "timestampMethod"} <= set(panel["paths"][0])
            assert panel["xAxisVal"] == "timestamp"


def test_plotjuggler_finds_the_structure_that_it_writes_itself():
    root = ElementTree.parse(shipped_file("config/plotjuggler_layout.xml")).getroot()
    assert root.tag == "root"
    for tab in root.find("tabbed_widget").findall("Tab"):
        assert int(tab.get("containers")) == len(tab.findall("Container"))
        for splitter in tab.iter("DockSplitter"):
            sizes = [float(size) for size in splitter.get("sizes").split(";")]
            assert len(sizes) == int(splitter.get("count")) == len(splitter)
            assert sum(sizes) == pytest.approx(1.0)
            for area in splitter:
                assert area.tag == "DockArea"
                assert area.find("plot").get("mode") == "TimeSeries"


def topics_of_the_layouts():
    layout = json.loads(Path(shipped_file("config/foxglove_layout.json")).read_text())
    found = set()
    for panel in layout["configById"].values():
        found |= {split(path["value"], ".")[0] for path in panel.get("paths", [])}
        found |= {topic for topic in panel.get("topics", {}) if topic.startswith("/")}
        found |= {panel["topicToRender"]} if "topicToRender" in panel else set()
    root = ElementTree.parse(shipped_file("config/plotjuggler_layout.xml")).getroot()
    return found | {split(curve.get("name"), "/")[0] for curve in root.iter("curve")}


def test_what_the_layouts_show_is_published_with_the_type_that_they_expect(graph, model_path):
    """By the nodes of a cell, the virtual wrist's drivers among them."""
    for make_node in (PoseErrorPredictor, AngleCorrector, ModelMonitor):
        graph.add(make_node, model_file=str(model_path))
    graph.add(CellSimulator)
    shown = topics_of_the_layouts()
    assert {"/wrist_markers", "/diagnostics", "/pose_error/s_um", "/load_estimate"} <= shown
    for topic in shown:
        graph.until(lambda topic=topic: graph.probe.count_publishers(topic), f"publisher {topic}")
        published = {end.topic_type for end in graph.probe.get_publishers_info_by_topic(topic)}
        wanted = MARKERS if topic == "/wrist_markers" else TOPICS[topic].ros_type
        assert published == {wanted}
