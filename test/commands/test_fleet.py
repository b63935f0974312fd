"""Many recordings at once: each answers or says why not."""

import os
import signal
import subprocess
import sys
import time
from functools import partial
from pathlib import Path

import cloudpickle
import pytest
from distributed import LocalCluster

from wrist_stiffness.commands.fleet import map_recordings, spread
from wrist_stiffness.errors import InputError, RecordingError

PATHS = [Path(name) for name in ("good", "bad", "ugly", "best")]


def judge(path, length):
    """Stand in for a command; at module level, as workers need it."""
    if path.name == "bad":
        raise RecordingError(f"{path} is no\nrecording")
    if path.name == "ugly":
        raise ZeroDivisionError("of its own")
    if path.name == "dead":
        os._exit(1)
    return len(path.name) + length, os.getpid()


@pytest.fixture(scope="module", autouse=True)
def _importable():
    """Send functions of this file whole: pytest imports it in a way that workers cannot."""
    cloudpickle.register_pickle_by_value(sys.modules[__name__])
    yield
    cloudpickle.unregister_pickle_by_value(sys.modules[__name__])


@pytest.fixture(scope="module")
def cluster():
    with LocalCluster(
        n_workers=1, threads_per_worker=1, dashboard_address="127.0.0.1:0"
    ) as cluster:
        yield cluster


def expected_of(rows):
    return [(row.path.name, row.result and row.result[0], row.error) for row in rows]


EXPECTED = [
    ("good", 104, ""),
    ("bad", None, "bad is no recording"),
    ("ugly", None, "ZeroDivisionError: of its own"),
    ("best", 104, ""),
]


@pytest.mark.slow
def test_processes_of_this_machine_answer_in_the_order_of_the_paths():
    told = []
    rows = map_recordings(
        partial(judge, length=100), PATHS, workers=2, progress=lambda *counts: told.append(counts)
    )
    assert expected_of(rows) == EXPECTED
    assert told == [(1, 4), (2, 4), (3, 4), (4, 4)]
    assert os.getpid() not in {row.result[1] for row in rows if row.result}


def test_a_cluster_is_used_where_a_scheduler_is_named(cluster):
    rows = map_recordings(partial(judge, length=100), PATHS, cluster.scheduler_address)
    assert expected_of(rows) == EXPECTED


def test_a_function_that_workers_cannot_load_is_the_rows_error(cluster):
    cloudpickle.unregister_pickle_by_value(sys.modules[__name__])
    try:
        (row,) = map_recordings(partial(judge, length=0), PATHS[:1], cluster.scheduler_address)
    finally:
        cloudpickle.register_pickle_by_value(sys.modules[__name__])
    assert "ModuleNotFoundError" in row.error


def test_one_recording_needs_no_other_process():
    (row,) = map_recordings(partial(judge, length=0), PATHS[:1])
    assert row.result == (4, os.getpid())


@pytest.mark.slow
def test_a_worker_that_dies_is_a_row_with_its_error():
    paths = [Path("dead"), Path("good")]
    dead, good = map_recordings(partial(judge, length=0), paths, workers=1)
    assert "the worker died" in dead.error
    assert good.result[0] == 4


def dies_once(number, folder):
    """Take the worker along, the first time that a number comes."""
    marker = folder / str(number)
    if number % 2 and not marker.exists():
        marker.touch()
        os.kill(os.getpid(), signal.SIGKILL)
    return number**2


@pytest.mark.slow
def test_a_worker_that_dies_loses_nothing(tmp_path):
    answers = spread(partial(dies_once, folder=tmp_path), range(6), workers=2)
    assert [answer.result for answer in answers] == [0, 1, 4, 9, 16, 25]
    assert sorted(path.name for path in tmp_path.iterdir()) == ["1", "3", "5"]


def test_a_scheduler_that_is_not_there_is_named(monkeypatch):
    monkeypatch.setattr("wrist_stiffness.commands.fleet.CONNECT_S", 0.5)
    with pytest.raises(InputError, match="tcp://127.0.0.1:9"):
        map_recordings(partial(judge, length=0), PATHS, "tcp://127.0.0.1:9")


DEADLINE_S = 60.0

HANGING = """
import sys
from pathlib import Path
from threading import Event
from wrist_stiffness.commands.fleet import map_recordings

def hang(path):
    path.write_text("begun")
    # The other worker is idle by then: one that is not has no word to say.
    if path.name == "hangs":
        Event().wait()

if __name__ == "__main__":
    try:
        map_recordings(hang, [Path(name) for name in sys.argv[1:]], workers=2)
    except KeyboardInterrupt:
        sys.exit(130)
"""


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
        deadline_s = time.monotonic() + DEADLINE_S
        while not all(path.exists() for path in begun):
            assert ran.poll() is None
            assert time.monotonic() < deadline_s
            os.sched_yield()
        os.killpg(ran.pid, signal.SIGINT)
        assert ran.communicate(timeout=DEADLINE_S)[1] == b""
        assert ran.returncode == 130
    finally:
        if ran.poll() is None:
            os.killpg(ran.pid, signal.SIGKILL)
            ran.wait(DEADLINE_S)
