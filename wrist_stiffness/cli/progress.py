"""A progress display on stderr, given to workflows as the callback `progress(done, total)`."""

import sys
import time
from collections.abc import Callable
from typing import TextIO

SHOWN_AFTER_S = 2.0
REDRAWN_EVERY_S = 0.1
BAR_CHARACTERS = 30
LINE_STEP_PERCENT = 10


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
