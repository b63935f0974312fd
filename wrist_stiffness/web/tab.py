"""What one tab of the browser shows; the process that finds it is at its side.

Every panel knows the tab alone, and the tab knows none of them: it calls those that listen.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from multiprocessing import get_context
from multiprocessing.process import BaseProcess
from pathlib import Path
from typing import Any

import numpy as np
from nicegui import background_tasks, run, ui

from wrist_stiffness.analysis import View
from wrist_stiffness.comparing.comparison import lengths
from wrist_stiffness.inference.answer import Diagnosis
from wrist_stiffness.inference.noise import at_most
from wrist_stiffness.inference.observations import Mask, Observations, Quantity
from wrist_stiffness.lookup.table import Table
from wrist_stiffness.model.model_file import load_model
from wrist_stiffness.sessions.contents import Contents
from wrist_stiffness.web.bench import CANCELLED, Changes, Depends, Row, Seen, work
from wrist_stiffness.web.figures import Shown, strongest
from wrist_stiffness.web.workspace import Workspace

DEPENDS, VERSIONS = "Depends on", "Versions"

FOUND = {"rows", "diagnosis", "written"}
"""What is lost with the page, and what has saved it."""

ASIDE = 99.0
"""Percentile of the errors at which the scale of colours ends: one wild unit greys no others."""

FORKS = get_context("forkserver")
"""See `server.serve`."""


class Worker:
    """A process that does the long work of one tab; one that only looks around needs none."""

    def __init__(self, folder: Path) -> None:
        self._folder, self._stop = folder, FORKS.Event()
        self._process: BaseProcess | None = None

    def call(
        self, told: Callable[[str | None, int, int], None], method: str, *arguments: object
    ) -> tuple[Changes, str]:
        """Do one thing and return what it changed, and why it failed, empty if it did not."""
        self._stop.clear()
        try:
            if self._process is None:
                self._wires, theirs = FORKS.Pipe()
                own = self._folder, theirs, self._stop
                self._process = FORKS.Process(target=work, args=own, daemon=True)
                self._process.start()
                theirs.close()
            self._wires.send((method, arguments))
            while len(answer := self._wires.recv()) > 2:
                told(*answer)
            return answer
        except (EOFError, OSError):
            return {}, "The process behind this page ended; load the page again."

    def cancel(self) -> None:
        """Let what is being done end at its next step."""
        self._stop.set()

    def end(self) -> None:
        """End the process."""
        if self._process is not None:
            self._process.terminate()
            self._wires.close()


class Tab:
    """What a tab shows."""

    def __init__(self, workspace: Workspace) -> None:
        self.workspace = workspace
        self.worker = Worker(workspace.folder)
        self.listeners: list[Callable[[], None]] = []
        self.busy, self._client = False, ui.context.client
        self.words, self.done, self.total, self.calls = "", 0, 0, 0
        self.names: tuple[str, ...] = ()
        self.model_path = Path()
        self.contents: tuple[Contents, ...] = ()
        self.remarks: tuple[str, ...] = ()
        self.rows: tuple[Row, ...] = ()
        self.views: dict[int, View] = {}
        self.depends: dict[int, Depends] = {}
        self.diagnosis: Diagnosis | None = None
        # role and values of laws that are proposed where no effect of the catalogue explains all
        self.offers: tuple[tuple[str, dict[str, Any]], ...] = ()
        self.seen: Seen | None = None
        self.covariates: tuple[str, ...] = ()
        self.planned = "", ""
        self.written: tuple[tuple[str, str], ...] = ()
        self.unsaved = False
        self.version = 0
        self.against: int | None = None
        self.chosen: Mask | None = None
        self.moment = 0
        self.axis: int | None = None
        self.table: Table | None = None
        self.panel, self.lower, self.quantity = "Open", DEPENDS, 1

    def draw(self) -> None:
        """Let everything be drawn anew."""
        for listener in self.listeners:
            listener()

    def work(self, *calls: Sequence[Any], then: tuple[str, str] = ("", "")) -> None:
        """Do things that take long, one after the other, everything drawn anew after each.

        At the end it asks on what the error of the version that is then shown depends.

        `calls`: name of a method of `bench.Bench`, and its arguments; `then` (str, str): panel and
        lower picture to go to after the first.
        """
        if self.busy:
            ui.notify("Wait for the running task, or cancel it", type="warning")
            return
        self.busy = True
        background_tasks.create(self._work(calls, then))

    async def _work(self, calls: Sequence[Sequence[Any]], then: tuple[str, str]) -> None:
        why, left = "", [tuple(call) for call in calls]
        while left or (self.rows and self.told is None):
            method, *arguments = left.pop(0) if left else ("compare", self.version)
            found = await run.io_bound(self.worker.call, self._hear, method, *arguments)
            changes, why = found or ({}, "The workbench is being ended.")
            if why:
                break
            self._take(changes)
            self.panel, self.lower = then[0] or self.panel, then[1] or self.lower
            self.draw()
        self.busy, self.words, self.calls = False, "", self.calls + 1
        with self._client:
            if why == CANCELLED:
                ui.notify("Cancelled. Nothing was changed.")
            elif why:
                ui.notify(why, type="warning", multi_line=True, close_button="OK", timeout=0)

    def _hear(self, words: str | None, done: int, total: int) -> None:
        self.words = self.words if words is None else words
        self.done, self.total = done, total

    def _take(self, changes: Changes) -> None:
        if FOUND & changes.keys():
            self.unsaved = "written" not in changes
        view, told = changes.pop("view", None), changes.pop("depends_on", None)
        for name, value in changes.items():
            setattr(self, name, value)
        if view is not None:
            number, seen = view
            self.against = None
            self.views = {n: v for n, v in self.views.items() if n < number} | {number: seen}
            self.depends = {n: told for n, told in self.depends.items() if n < number}
        if told is not None:
            place, what = told
            self.depends[place] = what
        if "contents" in changes:
            self.chosen, self.axis, self.planned, self.written = None, None, ("", ""), ()
            self.lower = DEPENDS
            self.table = load_model(self.model_path).table
            first = self.views[0]
            # Begin with the quantity that stands farthest above its noise, where it is worst.
            errors = first.left.rms(np.nan_to_num(first.left.values) ** 2)
            over = [errors[q.key] / first.noise[q.key] for q in self.quantities]
            self.quantity = int(np.nanargmax(over))
            self.moment = self._worst(first.left)

    def _worst(self, left: Observations, chosen: Mask | None = None) -> int:
        sizes = np.nan_to_num(lengths(left, self.quantities[self.quantity]))
        return int(np.argmax(sizes if chosen is None else np.where(chosen, sizes, -1.0)))

    def choose(self, chosen: Mask | None) -> None:
        """Look at some of the units, or at all, and at the worst of them in three dimensions."""
        self.chosen = chosen
        self.moment = self._worst(self.views[self.version].left, chosen)
        self.draw()

    def look(self, version: int) -> None:
        """Look at a version."""
        self.version, self.seen, self.against = version, None, None
        self.draw()
        if self.told is None and not self.busy:
            self.work()

    @property
    def candidate(self) -> str:
        """What is looked at before it is added; empty for nothing."""
        return "" if self.seen is None else self.seen.name

    @property
    def quantities(self) -> tuple[Quantity, ...]:
        """What was measured."""
        return self.views[0].left.reported

    @property
    def shown(self) -> Shown | None:
        """What all pictures show; None while nothing is opened."""
        if self.version not in self.views:
            return None
        view, quantity = self.views[self.version], self.quantities[self.quantity]
        left, after, name = view.left, None, ""
        if self.seen is not None:
            after = left.with_values(left.values - self.seen.change)
            name = f"with {self.candidate}"
        elif self.against in self.views:
            after = self.views[self.against].left
            name = self.rows[self.against].titled(self.against)
        # One scale of colours and one direction for all versions: so the error is seen to fall.
        first = self.views[0].left
        scale = float(np.nanpercentile(lengths(first, quantity), ASIDE))
        axis = strongest(first.values, quantity) if self.axis is None else self.axis
        return Shown(view, after, name, quantity, axis, scale, self.chosen, self.moment)

    @property
    def told(self) -> Depends | None:
        """On what the rest of the version that is shown depends; None where it was not asked."""
        return self.depends.get(self.version)

    @property
    def noise(self) -> dict[str, float]:
        """Noise floor as the newest version tells it, by the key of the quantity."""
        return dict(self.views[max(self.views)].noise)

    @property
    def noise_floor(self) -> str:
        """What it is called."""
        return f"noise floor{at_most(self.views[max(self.views)].noise_known)}"
