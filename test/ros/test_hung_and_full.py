"""A cell in which a node hangs or the recorder's disk is full: it says so, and ends in an error."""

import os
import resource
import signal
import subprocess
import time
from pathlib import Path

import numpy as np
import pytest
from std_msgs.msg import Float64MultiArray

from wrist_stiffness.cli import main as command_line
from wrist_stiffness.cli import simulate
from wrist_stiffness.commands import cell
from wrist_stiffness.commands.node_list import RECORDER_NODE
from wrist_stiffness.errors import InputError
from wrist_stiffness.recording import open_recording

DEADLINE_S = 60.0
SMALL_FILE = 4096
LARGE_FILE = 400_000

pytestmark = pytest.mark.slow


def node_of_this_process(name):
    """Return the process id of a node that was started from here."""
    children = Path(f"/proc/{os.getpid()}/task/{os.getpid()}/children")
    for child in children.read_text().split():
        command = Path(f"/proc/{child}/cmdline").read_bytes()
        if f"__node:={name}\0".encode() in command:
            return int(child)
    raise AssertionError(f"no process of {name}")


def hidden_in(folder):
    return [path for path in folder.iterdir() if path.name.startswith(".")]


def test_a_node_that_hangs_is_named_and_the_recording_is_kept(tmp_path, monkeypatch, capfd):
    monkeypatch.setattr(cell, "END_PATIENCE_S", 6.0)
    path, stopped = tmp_path / "hung.mcap", []

    def stop(done, total):
        # A chunk has been written: samples flow.
        if not stopped and any(part.stat().st_size > SMALL_FILE for part in hidden_in(tmp_path)):
            stopped.append(node_of_this_process("pose_error_predictor"))
            os.kill(stopped[0], signal.SIGSTOP)

    monkeypatch.setattr(simulate, "Progress", lambda label: stop)
    seconds = ["--seconds", "4", "--rate", "50"]
    assert command_line.main(["cell", *seconds, "--record", str(path)]) == 1
    out, errors = capfd.readouterr()
    assert out == f"written: {path}\n"
    silent, killed = [line for line in errors.splitlines() if line.startswith("wrist-stiffness")]
    assert "error: pose_error_predictor: no answer heard to" in silent
    assert killed == (
        "wrist-stiffness: cell: node pose_error_predictor had not ended 6 s after it was told to; "
        "killed"
    )
    recording = open_recording(path)
    counts = {topic.name: topic.count for topic in recording.topics}
    assert recording.damage == ""
    assert 0 < counts["/pose_error_predicted"] < counts["/joint_states"] - 50


def refuse_files(pid, beyond_bytes):
    """Let a process write no larger files: as on a full disk, writing is refused."""
    resource.prlimit(pid, resource.RLIMIT_FSIZE, (beyond_bytes, resource.RLIM_INFINITY))


NOISE = Float64MultiArray(data=np.random.default_rng(1).normal(size=SMALL_FILE).tolist())
"""That no compression makes small."""


@pytest.mark.parametrize(
    ("when", "room"), [("while it writes", 0), ("while it writes", LARGE_FILE), ("as it ends", 0)]
)
def test_a_recorder_on_a_full_disk_says_so_and_keeps_what_it_wrote(graph, tmp_path, when, room):
    output = tmp_path / "full.mcap"
    node = RECORDER_NODE.having({"output": str(output)})
    end_s = time.monotonic() + DEADLINE_S
    with subprocess.Popen(node.command(), stderr=subprocess.PIPE, text=True) as process:
        try:
            graph.until(lambda: hidden_in(tmp_path), "beginning of the recording")
            refuse_files(process.pid, room)
            while when == "while it writes" and process.poll() is None:
                assert time.monotonic() < end_s
                graph.publish("/motor_positions_corrected", NOISE)
            process.send_signal(signal.SIGTERM)
            _, errors = process.communicate(timeout=DEADLINE_S)
        finally:
            process.kill()
    part = tmp_path / "full.partial.mcap"
    assert list(tmp_path.iterdir()) == ([part] if room else [])
    count = open_recording(part).topics[0].count if room else 0
    kept = f"; the first {count} messages are kept in {part}" if count else ""
    assert errors.splitlines() == [
        f"wrist-stiffness node: error: {output} cannot be written: File too large{kept}"
    ]
    assert process.returncode == 2


def test_a_cell_whose_recorder_fails_as_it_ends_ends_in_an_error(tmp_path, capfd):
    path, limited = tmp_path / "full.mcap", []

    def fill(done, total):
        if not limited and hidden_in(tmp_path):
            limited.append(node_of_this_process("recorder"))
            refuse_files(limited[0], SMALL_FILE)  # Its line on stderr goes to a file, too.

    with pytest.raises(InputError, match="node recorder ended with code 2"):
        # Slow enough for one chunk to hold it all: it is written at the end.
        cell.run_cell(seconds=2.0, record=path, rate_hz=5.0, progress=fill)
    told = capfd.readouterr().err
    assert f"{path} cannot be written: File too large" in told
    assert "Traceback" not in told
    assert list(tmp_path.iterdir()) == []


def test_a_cell_whose_recorder_hangs_ends_in_an_error(tmp_path, monkeypatch):
    """It ends by a signal, not by a code; what it had written has no name."""
    monkeypatch.setattr(cell, "END_PATIENCE_S", 5.0)
    path, stopped, told = tmp_path / "hung.mcap", [], []

    def stop(done, total):
        if not stopped and any(part.stat().st_size > SMALL_FILE for part in hidden_in(tmp_path)):
            stopped.append(node_of_this_process("recorder"))
            os.kill(stopped[0], signal.SIGSTOP)

    with pytest.raises(InputError, match="node recorder ended with code -9"):
        cell.run_cell(seconds=2.5, record=path, rate_hz=50.0, progress=stop, tell=told.append)
    assert "cell: node recorder had not ended 5 s after it was told to; killed" in told
    assert not path.exists()
    assert [part.name.endswith(".partial") for part in tmp_path.iterdir()] == [True]
