"""Processes of a cell end when they are told to, the recorder after all that it hears."""

import os
import signal
import sys
import time
from types import SimpleNamespace

import pytest

from wrist_stiffness.commands import cell
from wrist_stiffness.commands.cell import _processes
from wrist_stiffness.commands.node_list import RECORDER_NODE, WRIST_NODES

DEADLINE_S = 20.0

# Its sleep is what is tested: a node that takes its time to end.
NODE = """
import pathlib, signal, sys, time
def end(*signal):
    time.sleep(float(sys.argv[3]))
    with open(sys.argv[1], "a") as log:
        log.write(sys.argv[2] + "\\n")
    sys.exit(0)
signal.signal(signal.SIGTERM, end)
pathlib.Path(sys.argv[1] + "." + sys.argv[2]).touch()
signal.pause()
"""


@pytest.fixture
def log(tmp_path):
    return tmp_path / "ended"


def process(log, name, lasts_s):
    command = [sys.executable, "-c", NODE, str(log), name, str(lasts_s)]
    return SimpleNamespace(name=name, command=lambda: command)


def wait_for_start(log, names):
    deadline_s = time.monotonic() + DEADLINE_S
    while not all(log.with_name(f"ended.{name}").exists() for name in names):
        assert time.monotonic() < deadline_s
        os.sched_yield()


def test_the_recorder_ends_when_all_others_have_ended(log):
    killed = []
    slow = [process(log, each.name, 0.3) for each in WRIST_NODES]
    names = [RECORDER_NODE.name, *(each.name for each in WRIST_NODES)]
    with _processes([process(log, RECORDER_NODE.name, 0.0), *slow], killed.append) as running:
        assert list(running) == names
        wait_for_start(log, names)
    assert log.read_text().splitlines()[-1] == RECORDER_NODE.name
    assert sorted(log.read_text().split()) == sorted(names)
    assert killed == []


@pytest.mark.parametrize("hung", [WRIST_NODES[0].name, RECORDER_NODE.name])
def test_a_node_that_does_not_end_is_killed_and_named(log, monkeypatch, hung):
    monkeypatch.setattr(cell, "END_PATIENCE_S", 1.0)
    killed = []
    names = [RECORDER_NODE.name, *(each.name for each in WRIST_NODES)]
    nodes = [process(log, name, DEADLINE_S if name == hung else 0.0) for name in names]
    with _processes(nodes, killed.append) as running:
        wait_for_start(log, names)
    assert killed == [hung]
    assert running[hung].returncode == -signal.SIGKILL
    assert sorted([*log.read_text().split(), hung]) == sorted(names)
