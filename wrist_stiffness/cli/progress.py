"""Progress on stderr: a bar for what has a known end, a status line for what has none."""

from __future__ import annotations

import sys
import time
from collections.abc import Callable
from typing import TextIO

SHOWN_AFTER_S = 2.0
REDRAWN_EVERY_S = 0.1
BAR_CHARACTERS = 30
LINE_STEP_PERCENT = 10
LINE_EVERY_S = 5.0
STATUS_CHARACTERS = 100


class Progress:
    """Shows how far a long computation is, once it has taken two seconds.

    A terminal gets a bar with the time left, anything else a plain line every 10 %.

    Parameters
    ----------
    label
        What is being done, for example "poses".
    stream
        Where to write; stderr if None.
    clock
        Monotonic time [s].
    """

    def __init__(
        self,
        label: str,
        stream: TextIO | None = None,
        clock: Callable[[], float] = time.monotonic,
    ) -> None:
        self._label = label
        self._stream = sys.stderr if stream is None else stream
        self._clock = clock
        self._start_s = clock()
        self._drawn_s = -float("inf")
        self._line_percent = 0

    def __call__(self, done: int, total: int) -> None:
        """Take notice that `done` of `total` steps are behind us (0 <= done <= total)."""
        now_s = self._clock()
        elapsed_s = now_s - self._start_s
        if elapsed_s < SHOWN_AFTER_S or total <= 0:
            return
        percent = 100 * done // total
        if self._stream.isatty():
            if done == total or now_s - self._drawn_s >= REDRAWN_EVERY_S:
                self._drawn_s = now_s
                self._draw_bar(done, total, elapsed_s)
        elif percent >= self._line_percent + LINE_STEP_PERCENT:
            self._line_percent = percent - percent % LINE_STEP_PERCENT
            print(f"{self._label}: {percent} % ({done} of {total})", file=self._stream, flush=True)

    def _draw_bar(self, done: int, total: int, elapsed_s: float) -> None:
        bar = ("#" * (BAR_CHARACTERS * done // total)).ljust(BAR_CHARACTERS, ".")
        left = f"{elapsed_s * (total - done) / done:.0f} s left" if done else "starting"
        if done == total:
            left = f"{elapsed_s:.0f} s"
        # Blanks wipe the rest of a longer line before.
        text = f"\r{self._label} [{bar}] {100 * done // total:3d} % {left:<14}"
        self._stream.write(text + ("\n" if done == total else ""))
        self._stream.flush()


class Status:
    """Shows what is being done and for how long, once it has taken two seconds.

    A terminal gets one line that changes, anything else a plain line every five seconds.  Leaving
    its context wipes the terminal's line.

    Parameters
    ----------
    stream
        Where to write; stderr if None.
    clock
        Monotonic time [s].
    """

    def __init__(
        self, stream: TextIO | None = None, clock: Callable[[], float] = time.monotonic
    ) -> None:
        self._stream = sys.stderr if stream is None else stream
        self._clock = clock
        self._start_s = clock()
        self._told_s = self._start_s + SHOWN_AFTER_S - LINE_EVERY_S
        self._shown = False

    def __call__(self, text: str) -> None:
        """Take notice of what begins now."""
        now_s = self._clock()
        line = f"{now_s - self._start_s:4.0f} s  {text}"
        if now_s - self._start_s < SHOWN_AFTER_S:
            return
        if self._stream.isatty():
            self._stream.write(f"\r{line[:STATUS_CHARACTERS]:<{STATUS_CHARACTERS}}")
            self._stream.flush()
            self._shown = True
        elif now_s - self._told_s >= LINE_EVERY_S:
            self._told_s = now_s
            print(line, file=self._stream, flush=True)

    def __enter__(self) -> Status:
        """Return it."""
        return self

    def __exit__(self, *_: object) -> None:
        """Wipe the line."""
        if self._shown:
            self._stream.write(f"\r{'':<{STATUS_CHARACTERS}}\r")
            self._stream.flush()
