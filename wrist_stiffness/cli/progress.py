"""Progress on stderr once a command has taken two seconds; none where tqdm is not installed."""

from __future__ import annotations

import sys
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from typing import Any, TextIO

SHOWN_AFTER_S = 2.0
LINE_EVERY_S = 5.0


def _bar(stream: TextIO | None, **options: Any) -> Any:
    """Return tqdm's bar: one line that changes on a terminal, a line now and then in a file."""
    with suppress(ImportError):
        from tqdm import tqdm

        # No thread beside the work: commands start processes.
        tqdm.monitor_interval = 0
        stream = stream or sys.stderr
        if not stream.isatty():
            options |= {"file": _Lines(stream), "mininterval": LINE_EVERY_S, "ncols": 80}
        shared = {"file": stream, "delay": SHOWN_AFTER_S, "miniters": 1, "ascii": True}
        return tqdm(**(shared | options))
    return None


class _Lines:
    """A file in which each state of a bar is a line of its own."""

    def __init__(self, stream: TextIO) -> None:
        self._stream = stream

    def write(self, text: str) -> None:
        self._stream.write(f"{text.strip()}\n" if text.strip() else "")

    def flush(self) -> None:
        self._stream.flush()


_begun: list[Any] = []


@contextmanager
def bars_ended() -> Iterator[None]:
    """End the lines of bars that a `with` block leaves before their end."""
    try:
        yield
    finally:
        while _begun:
            _begun.pop().close()


class Progress:
    """Shows how far a computation with a known end is: called with steps done and all steps."""

    def __init__(self, label: str, stream: TextIO | None = None) -> None:
        self._bar = _bar(stream, desc=label)
        if self._bar is not None:
            _begun.append(self._bar)

    def __call__(self, done: int, total: int) -> None:
        """Take notice that `done` of `total` steps are behind us."""
        if self._bar is not None:
            self._bar.total = total
            self._bar.update(done - self._bar.n)
            if done >= total:
                self._bar.close()


class Status:
    """Context manager that shows what is being done; its line is wiped at the end."""

    def __init__(self, stream: TextIO | None = None) -> None:
        self._bar = _bar(stream, bar_format="{elapsed}  {desc}", leave=False)

    def __call__(self, text: str) -> None:
        """Take notice of what begins now."""
        if self._bar is not None:
            self._bar.set_description_str(text, refresh=False)
            self._bar.update()

    def __enter__(self) -> Status:
        """Return it."""
        return self

    def __exit__(self, *_: object) -> None:
        """Wipe the line."""
        if self._bar is not None:
            self._bar.close()
