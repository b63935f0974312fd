"""Processes of a cell end when they are told to, the recorder after all that it hears."""

import sys
import time
from types import SimpleNamespace

from wrist_stiffness.workflows.cell import _processes
from wrist_stiffness.workflows.node_list import RECORDER_NODE, WRIST_NODES

DEADLINE_S = 20.0

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


def test_the_recorder_ends_when_all_others_have_ended(tmp_path):
    log = tmp_path / "ended"

    def node(name, lasts_s):
        command = [sys.executable, "-c", NODE, str(log), name, str(lasts_s)]
        return SimpleNamespace(name=name, command=lambda: command)

    slow = [node(each.name, 0.3) for each in WRIST_NODES]
    names = [RECORDER_NODE.name, *(each.name for each in WRIST_NODES)]
    with _processes([node(RECORDER_NODE.name, 0.0), *slow]) as running:
        assert list(running) == names
        deadline_s = time.monotonic() + DEADLINE_S
        while not all((tmp_path / f"ended.{name}").exists() for name in names):
            assert time.monotonic() < deadline_s
            time.sleep(0.01)
    assert log.read_text().splitlines()[-1] == RECORDER_NODE.name
    assert sorted(log.read_text().split()) == sorted(names)
