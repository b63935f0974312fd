"""What a node says: the cause of a fault survives the faults that follow from it."""

import pytest

pytest.importorskip("rclpy")

from wrist_stiffness.errors import FrameError, StaleLoadError
from wrist_stiffness.ros.guarded_node import Health


def values(status):
    return {value.key: value.value for value in status.values}


def test_an_unknown_frame_is_not_hidden_by_the_missing_load_it_causes():
    health = Health("node")
    health.fault(FrameError("load: frame 'gripper' is not known"))
    for _ in range(50):
        health.fault(StaleLoadError("no load estimate"))
    status = health.report({}, "", "")
    assert status.message.startswith("51 refused: load: frame 'gripper' is not known; no load")
    assert values(status)["refused FrameError"] == "1"
    assert values(status)["last FrameError"] == "load: frame 'gripper' is not known"
    assert values(status)["last fault"] == "no load estimate"


def test_an_old_fault_is_remembered_but_no_longer_said():
    health = Health("node")
    health.fault(FrameError("load: frame 'gripper' is not known"))
    health.report({}, "", "")
    health.good()
    status = health.report({}, "", "")
    assert status.message == "1 samples"
    assert values(status)["last FrameError"]
