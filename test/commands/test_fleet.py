"""Many recordings at once: each answers or says why not."""

import operator
import os
import signal
import subprocess
import sys
from functools import partial
from pathlib import Path

import pytest
from waiting import wait_until

from wrist_stiffness.commands.fleet import attempt, spread
from wrist_stiffness.errors import RecordingError

# Workers cannot import this file, as pytest can: what they call is Python's own.
READS = operator.methodcaller("read_text")


def test_an_error_is_one_line():
    def refuse(path):
        raise RecordingError(f"{path} is no\nrecording")

    assert attempt(refuse, Path("bad")) == (Path("bad"), None, "bad is no recording")


@pytest.mark.slow
def test_processes_of_this_machine_answer_in_the_order_of_the_paths(tmp_path):
    paths = [tmp_path / name for name in ("good", "bad", "best")]
    for path in (paths[0], paths[2]):
        path.write_text(f"read {path.name}")
    told = []
    rows = spread(READS, paths, workers=2, progress=lambda *counts: told.append(counts))
    assert [row.item for row in rows] == paths
    assert [row.result for row in rows] == ["read good", None, "read best"]
    assert [row.error[:17] for row in rows] == ["", "FileNotFoundError", ""]
    assert told == [(1, 3), (2, 3), (3, 3)]


@pytest.mark.slow
def test_workers_are_other_processes_of_one_thread_each():
    asked = ["__import__('os').getpid()", "__import__('os').environ['OMP_NUM_THREADS']"]
    process, threads = spread(eval, asked)
    assert process.result not in (None, os.getpid())
    assert threads.result == "1"


def unknown_to_workers(path):
    return path


@pytest.mark.slow
def test_a_function_that_workers_cannot_load_is_the_rows_error():
    for row in spread(unknown_to_workers, [Path("a"), Path("b")]):
        assert "ModuleNotFoundError" in row.error


def test_one_recording_needs_no_other_process():
    (row,) = spread(lambda _: os.getpid(), [Path("good")])
    assert row.result == os.getpid()


@pytest.mark.slow
def test_a_worker_that_dies_is_an_answer_with_its_error():
    dead, good = spread(eval, ["__import__('os')._exit(7)", "2 + 2"], workers=1)
    assert dead[1:] == (None, "the worker died: exit code 7")
    assert good[1:] == (4, "")


DIES_ONCE = """
import os, signal
def dies_once(number, folder):
    marker = folder / str(number)
    if number % 2 and not marker.exists():
        marker.touch()
        os.kill(os.getpid(), signal.SIGKILL)
    return number**2
"""


@pytest.mark.slow
def test_a_worker_that_dies_loses_nothing(tmp_path, monkeypatch):
    (tmp_path / "mortal.py").write_text(DIES_ONCE)
    monkeypatch.syspath_prepend(tmp_path)
    from mortal import dies_once

    (folder := tmp_path / "died").mkdir()
    answers = spread(partial(dies_once, folder=folder), range(6), workers=2)
    assert [answer.result for answer in answers] == [0, 1, 4, 9, 16, 25]
    assert sorted(path.name for path in folder.iterdir()) == ["1", "3", "5"]


DEADLINE_S = 60.0

HANGING = """
import sys
from pathlib import Path
from threading import Event
from wrist_stiffness.commands.fleet import spread

def hang(path):
    path.write_text("begun")
    # The other worker is idle by then: one that is not has no word to say.
    if path.name == "hangs":
        Event().wait()

if __name__ == "__main__":
    try:
        spread(hang, [Path(name) for name in sys.argv[1:]], workers=2)
    except KeyboardInterrupt:
        sys.exit(130)
"""


@pytest.mark.slow
def test_an_interrupt_at_the_terminal_ends_all_without_a_word(tmp_path):
    """Ctrl-C goes to every process of the terminal; each worker ended with a traceback."""
    program = tmp_path / "hanging.py"
    program.write_text(HANGING)
    begun = [tmp_path / name for name in ("ends", "hangs")]
    ran = subprocess.Popen(
        [sys.executable, str(program), *map(str, begun)],
        stderr=subprocess.PIPE,
        start_new_session=True,
        # What a shell starts behind it, as a test may be, is deaf to Ctrl-C.
        preexec_fn=lambda: signal.signal(signal.SIGINT, signal.SIG_DFL),
    )
    try:
        wait_until(lambda: all(path.exists() for path in begun), ran)
        os.killpg(ran.pid, signal.SIGINT)
        assert ran.communicate(timeout=DEADLINE_S)[1] == b""
        assert ran.returncode == 130
    finally:
        if ran.poll() is None:
            os.killpg(ran.pid, signal.SIGKILL)
            ran.wait(DEADLINE_S)
