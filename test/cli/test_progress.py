"""Progress of long work, on a terminal, in a file, and without tqdm."""

import io
import sys

import pytest

from wrist_stiffness.cli.progress import Progress, Status


class Terminal(io.StringIO):
    def isatty(self):
        return True


def shown(stream):
    """What is shown of a hundred steps, then of a status."""
    progress = Progress("poses", stream)
    for done in range(0, 101, 10):
        progress(done, 100)
    with Status(stream) as status:
        status("fit 1")
        status("fit 2")
    return stream.getvalue()


@pytest.mark.parametrize("stream", [io.StringIO, Terminal])
def test_a_short_computation_shows_nothing(stream):
    assert shown(stream()).strip() == ""


@pytest.fixture
def at_once(monkeypatch):
    monkeypatch.setattr("wrist_stiffness.cli.progress.SHOWN_AFTER_S", 0.0)


@pytest.mark.usefixtures("at_once")
def test_a_terminal_gets_a_bar_and_a_line_that_is_wiped():
    text = shown(Terminal())
    assert "poses: 100%|##########| 100/100" in text
    *_, state, wiped, rest = text.split("\n")[1].split("\r")
    assert ":" in state
    assert (wiped.strip(), rest) == ("", "")


@pytest.mark.usefixtures("at_once")
def test_a_file_gets_lines():
    text = shown(io.StringIO())
    assert "\r" not in text
    assert "\nposes: 100%|" in text


@pytest.mark.usefixtures("at_once")
def test_without_tqdm_nothing_is_shown(monkeypatch):
    monkeypatch.setitem(sys.modules, "tqdm", None)
    assert shown(Terminal()) == ""
