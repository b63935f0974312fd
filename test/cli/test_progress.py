"""Progress of long work, on a terminal and in a file."""

import io

import pytest

from wrist_stiffness.cli.progress import Progress, Status


class Terminal(io.StringIO):
    def isatty(self):
        return True


def run_progress(stream, seconds_per_step, steps=100):
    now_s = [0.0]
    progress = Progress("poses", stream, clock=lambda: now_s[0])
    for done in range(1, steps + 1):
        now_s[0] += seconds_per_step
        progress(done, steps)
    return stream.getvalue()


@pytest.mark.parametrize("stream", [io.StringIO, Terminal])
def test_a_short_computation_shows_no_progress(stream):
    assert run_progress(stream(), seconds_per_step=0.019) == ""


def test_a_file_gets_a_plain_line_every_ten_percent():
    lines = run_progress(io.StringIO(), seconds_per_step=1.0).splitlines()
    assert lines[0] == "poses: 10 % (10 of 100)"
    assert lines[-1] == "poses: 100 % (100 of 100)"
    assert len(lines) == 10


def test_a_terminal_gets_a_bar_with_the_time_left():
    shown = run_progress(Terminal(), seconds_per_step=1.0).split("\r")
    assert shown[0] == ""
    assert shown[1].startswith("poses [..............................]   2 % 98 s left")
    assert "[###############...............]  50 % 50 s left" in shown[49]
    assert shown[-1].startswith("poses [##############################] 100 % 100 s")
    assert shown[-1].endswith("\n")
    assert len({len(line.rstrip("\n")) for line in shown[1:]}) == 1


def run_status(stream, seconds_per_step, texts):
    now_s = [0.0]
    with Status(stream, clock=lambda: now_s[0]) as status:
        for text in texts:
            now_s[0] += seconds_per_step
            status(text)
    return stream.getvalue()


def test_what_has_no_known_end_says_what_it_does():
    texts = [f"fit {n}" for n in range(1, 13)]
    lines = run_status(io.StringIO(), 1.0, texts).splitlines()
    assert lines == ["   2 s  fit 2", "   7 s  fit 7", "  12 s  fit 12"]
    shown = run_status(Terminal(), 1.0, texts).split("\r")
    assert [line.rstrip() for line in shown[1:12]] == [f"{n:4d} s  fit {n}" for n in range(2, 13)]
    # A line stands over the one before, and nothing is left at the end.
    assert len({len(line) for line in shown[1:13]}) == 1
    assert shown[12:] == [" " * len(shown[1]), ""]
    assert run_status(Terminal(), 0.1, texts) == run_status(io.StringIO(), 0.1, texts) == ""
