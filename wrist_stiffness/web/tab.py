"""What one tab of the browser shows; the process that finds it is at its side."""

from __future__ import annotations

import multiprocessing
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Any

import numpy as np

from wrist_stiffness.analysis import View
from wrist_stiffness.comparing.curve import Curve
from wrist_stiffness.inference.answer import Diagnosis
from wrist_stiffness.inference.observations import Mask, Quantity
from wrist_stiffness.lookup.table import Table
from wrist_stiffness.model.model_file import load_model
from wrist_stiffness.web.bench import Changes, Depends, Row, Seen, work
from wrist_stiffness.web.figures import Shown, length, strongest

ASIDE = 99.0
"""Percentile of the errors at which the scale of colours ends: one wild unit greys no others."""


class Worker:
    """A process that does the long work of one tab.

    Parameters
    ----------
    folder : Path
        Workspace.
    """

    def __init__(self, folder: Path) -> None:
        context = multiprocessing.get_context("spawn")
        self._wires, theirs = context.Pipe()
        self._stop = context.Event()
        self._process = context.Process(target=work, args=(folder, theirs, self._stop), daemon=True)
        self._process.start()
        theirs.close()

    def call(
        self, told: Callable[[tuple[Any, ...]], None], method: str, *arguments: object
    ) -> tuple[Changes, str]:
        """Do one thing and return what it changed, and why it failed, empty if it did not."""
        self._stop.clear()
        try:
            self._wires.send((method, arguments))
            while True:
                kind, *rest = self._wires.recv()
                if kind == "good":
                    return rest[0], ""
                if kind == "bad":
                    return {}, str(rest[0])
                told((kind, *rest))
        except (EOFError, OSError):
            return {}, "The process behind this page ended; load the page again."

    def cancel(self) -> None:
        """Let what is being done end at its next step."""
        self._stop.set()

    def end(self) -> None:
        """End the process."""
        self._process.terminate()
        self._wires.close()


class Tab:
    """What a tab shows.

    Parameters
    ----------
    folder : Path
        Workspace.
    """

    def __init__(self, folder: Path) -> None:
        self.worker = Worker(folder)
        self.words, self.done, self.total = "", 0, 0
        self.names: tuple[str, ...] = ()
        self.model_path = Path()
        self.glances: tuple[dict[str, str], ...] = ()
        self.remarks: tuple[str, ...] = ()
        self.rows: tuple[Row, ...] = ()
        self.views: dict[int, View] = {}
        self.depends: tuple[Depends, ...] = ()
        self.diagnosis: Diagnosis | None = None
        self.seen: Seen | None = None
        self.covariates: tuple[str, ...] = ()
        self.planned = "", ""
        self.written: tuple[str, ...] = ()
        self.version = 0
        self.against: int | None = None
        self.chosen: Mask | None = None
        self.moment = 0
        self.axis: int | None = None
        self.table: Table | None = None

    def work(self, method: str, *arguments: object) -> str:
        """Let the process do something; return why it failed, empty if it did not."""
        changes, why = self.worker.call(self._hear, method, *arguments)
        if not why:
            self._take(changes)
        return why

    def _hear(self, message: tuple[Any, ...]) -> None:
        if message[0] == "told":
            self.words, self.done, self.total = message[1], 0, 0
        else:
            self.done, self.total = message[1:]

    def _take(self, changes: Changes) -> None:
        view = changes.pop("view", None)
        for name, value in changes.items():
            setattr(self, name, value)
        if view is not None:
            number, seen = view
            self.against = None
            self.views = {n: v for n, v in self.views.items() if n < number} | {number: seen}
            self.depends = self.depends[: number + 1]
        if "glances" in changes:
            self.chosen, self.axis, self.planned, self.written = None, None, ("", ""), ()
            self.table = load_model(self.model_path).table
            self.moment = int(np.nanargmax(length(self.views[0].left.values, self.quantities[-1])))

    @property
    def candidate(self) -> str:
        """What is looked at before it is added; empty for nothing."""
        return "" if self.seen is None else self.seen.name

    @property
    def quantities(self) -> tuple[Quantity, ...]:
        """What was measured."""
        return self.views[0].left.reported

    def shown(self, quantity: Quantity) -> Shown:
        """Return what all pictures show."""
        view = self.views[self.version]
        values = view.left.values
        after, name = None, self.candidate
        if self.seen is not None:
            after = values - self.seen.change
        elif self.against in self.views:
            other = self.views[self.against].left.values
            after = other if other.shape == values.shape else None
            name = self.rows[self.against].name
        # One scale of colours and one direction for all versions: so the error is seen to fall.
        first = self.views[0].left.values
        scale = float(np.nanpercentile(length(first, quantity), ASIDE))
        axis = strongest(first, quantity) if self.axis is None else self.axis
        chosen = self.chosen
        if chosen is not None and len(chosen) != len(values):
            chosen = None
        moment = min(self.moment, len(values) - 1)
        return Shown(view, after, name, quantity, axis, scale, chosen, moment)

    @property
    def curves(self) -> dict[str, Curve]:
        """What was drawn of the version that is shown, by condition."""
        return dict(self.depends[self.version].curves) if self.version < len(self.depends) else {}

    @property
    def sentences(self) -> Sequence[str]:
        """On what the rest of the version that is shown depends."""
        return self.depends[self.version].sentences if self.version < len(self.depends) else ()
