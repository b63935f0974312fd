"""The analysis of one tab in a process of its own: long sums never hold the page up."""

from __future__ import annotations

import shlex
import signal
import traceback
from collections.abc import Callable, Mapping, Sequence
from contextlib import suppress
from dataclasses import dataclass
from datetime import UTC, datetime
from functools import partial
from multiprocessing.connection import Connection
from multiprocessing.synchronize import Event
from pathlib import Path
from typing import Any

import numpy as np

from wrist_stiffness.analysis import Analysis, Version
from wrist_stiffness.atomic_file import writing
from wrist_stiffness.commands.diagnose import Diagnosed
from wrist_stiffness.commands.extend import FormulaEffect, common_covariates
from wrist_stiffness.commands.import_csv import import_csv
from wrist_stiffness.commands.provenance import Provenance
from wrist_stiffness.commands.read_sessions import (
    Recordings,
    read_sessions,
    sha256_by_name,
    was_fitted_to,
)
from wrist_stiffness.comparing.comparison import Comparison
from wrist_stiffness.comparing.curve import Curve
from wrist_stiffness.comparing.sentences import sentences
from wrist_stiffness.errors import InputError, WristError
from wrist_stiffness.identification.wrist_diagnosis import WristDiagnosis
from wrist_stiffness.inference.giving import told
from wrist_stiffness.mechanism.components import Array
from wrist_stiffness.model.effect import Effect
from wrist_stiffness.model.formula_law import words_of
from wrist_stiffness.model.model_file import file_sha256, load_model, save_model
from wrist_stiffness.planning.loads_file import Weight
from wrist_stiffness.planning.plan import Conditions
from wrist_stiffness.planning.rivals import dwell_noise
from wrist_stiffness.planning.timeline import Pace
from wrist_stiffness.report.diagnosis_report import report_of_diagnosis
from wrist_stiffness.report.page import write_page
from wrist_stiffness.report.plan import plan_summary, write_plan
from wrist_stiffness.shipped import shipped_file
from wrist_stiffness.web.examples import EXAMPLES, recordings_of
from wrist_stiffness.web.workspace import Workspace

USUAL_PACE = Pace(float(np.radians(30.0)), 2.0, True)
HANG_S = 10.0
"""That it takes to hang a weight on or off, as `plan` says where nobody does [s]."""

HEAVIEST_G = 1000.0

RIVALS = 2
"""Other proposed laws that are shown."""

SHIPPED = "config/palmieri2015_model.yaml"

CANCELLED = "cancelled"

Changes = dict[str, Any]
"""What a call changed of what a tab shows, by the names of `tab.Tab`."""


@dataclass(frozen=True)
class Row:
    """A version as the page lists it."""

    name: str  # of the version
    held_out: Mapping[str, float]  # error on unseen data by the key of the quantity
    warnings: tuple[str, ...]  # what speaks against it
    # of the effect that was added: value and one standard uncertainty
    parameters: Mapping[str, tuple[float, float]]

    def titled(self, place: int) -> str:
        """Return the name of the version that stands at a place."""
        return f"version {place}: {self.name}"


@dataclass(frozen=True, eq=False)
class Seen:
    """What a candidate would explain."""

    # `name`, `sentence`, `check`: `law@component`, what it does, and what to check on the machine
    name: str
    sentence: str
    check: str
    change: Array  # (u, 6), what it takes away of each unit [m, rad]
    parameters: Mapping[str, float]  # as fitted


@dataclass(frozen=True, eq=False)
class Depends:
    """On what the rest of a version depends."""

    sentences: tuple[str, ...]  # for a technician
    curves: Mapping[str, Curve]  # by condition
    not_varied: tuple[str, ...]  # conditions of which nothing can be said
    # a sentence on a sign, unit or name that may be wrong in the recordings; empty for none
    mistake: str


class Bench:
    """The analysis behind one tab.

    `folder`: workspace.  `tell`, `progress`: told in words what is being done, and steps done and
    in all; they may raise to end it.
    """

    def __init__(
        self, folder: Path, tell: Callable[[str], None], progress: Callable[[int, int], None]
    ) -> None:
        self._workspace = Workspace(folder)
        self._tell, self._progress = tell, progress
        self._analysis: Analysis | None = None
        self._answers: dict[int, WristDiagnosis] = {}
        self._model, self._paths = Path(), [Path()]
        self._looked: tuple[str | Effect, str] = "", ""
        self._hashes: tuple[dict[str, str], dict[str, str]] = {}, {}
        self._options: list[str] = []

    def open_example(self, name: str) -> Changes:
        """Open an example, made where it is not there yet."""
        (example,) = (each for each in EXAMPLES if each.name == name)
        model = shipped_file(SHIPPED)
        folder = self._workspace.folder / ".examples"
        paths = recordings_of(example, folder, load_model(model).table, self._tell)
        return self._open(paths, model)

    def open_named(self, names: Sequence[str], model: str) -> Changes:
        """Open recordings of the workspace; an empty name of a model is the shipped one."""
        if not names:
            raise InputError("choose at least one recording")
        paths = [self._recording(self._workspace.path(name)) for name in names]
        return self._open(paths, self._workspace.model(model) if model else shipped_file(SHIPPED))

    def _recording(self, path: Path) -> Path:
        if path.suffix.lower() != ".csv":
            return path
        folder = self._workspace.folder / ".imported"
        folder.mkdir(exist_ok=True)
        return import_csv(path, folder / f"{path.stem}.mcap", overwrite=True).recording

    def _open(self, paths: Sequence[Path], model: Path) -> Changes:
        self._tell("reading")
        loaded = load_model(model)
        sessions = read_sessions(Recordings(paths, {}), [loaded], self._progress)
        self._tell("finding where the instrument stands")
        told, again = (self._progress, self._tell), was_fitted_to(loaded, sessions)
        self._analysis = Analysis(loaded, list(sessions.values()), *told, again)
        self._answers, self._model, self._paths = {}, model, list(sessions)
        # Of what was read: the files may be others, or gone, when a report names them.
        self._hashes = {model.stem: file_sha256(model)}, sha256_by_name(sessions)
        self._options = []
        return {
            "covariates": tuple(common_covariates(sessions.values())),
            "names": tuple(path.name for path in sessions),
            "model_path": model,
            "contents": self._analysis.contents(),
            "remarks": tuple(line for each in sessions.values() for line in each.remarks),
            "views": {},
            "depends": {},
            **self._newest(),
        }

    @property
    def _opened(self) -> Analysis:
        if self._analysis is None:
            raise InputError("open a recording first")
        return self._analysis

    @property
    def _answer(self) -> WristDiagnosis | None:
        """The last answer to what is missing."""
        return next(reversed(self._answers.values()), None)

    def calibrate(self) -> Changes:
        """Fit set-up and tolerances."""
        self._tell("fitting set-up and tolerances")
        self._opened.calibrate()
        return self._newest()

    def compare(self, number: int) -> Changes:
        """Ask on what the rest of a version depends."""
        self._tell("asking on what the error depends")
        return {"depends_on": (number, _depends(self._opened.compare(number)))}

    def rank(self) -> Changes:
        """Ask what is missing."""
        self._tell("asking which effect is missing")
        answer = self._opened.rank()
        self._answers[len(self._opened.versions) - 1] = answer
        offers, found = [], answer.proposals
        if found:
            # Only the first and those in its place exclude each other.
            offers += [("Proposed", law.as_values()) for law in found.terms[:1]]
            offers += [("Or in its place", law.as_values()) for law in found.rivals[:RIVALS]]
            offers += [("And once the first is added", law.as_values()) for law in found.terms[1:]]
        return {"diagnosis": answer.diagnosis, "offers": tuple(offers), "seen": None}

    def look_at(self, candidate: str | FormulaEffect) -> Changes:
        """Find what a candidate would explain: `law@component`, or a formula."""
        asked: str | Effect = ""
        if isinstance(candidate, str):
            asked, option = candidate, f"--effect {candidate}"
        else:
            asked = candidate.effect(common_covariates(self._opened.sessions))
            option = f"--formula {shlex.quote(candidate.expression)} --component "
            way = shlex.quote(words_of(candidate.direction))
            option += f"{candidate.component} --direction {way} --name {candidate.id}"
        self._tell(f"fitting {asked if isinstance(asked, str) else asked.name}")
        seen = self._opened.preview(asked)
        effect = seen.effect
        self._looked = asked, option
        values = {key: each.value for key, each in effect.estimates.items()}
        findings = self._answer.diagnosis.findings if self._answer else ()
        gives = [each.gives.items() for each in findings if each.name == effect.name]
        sentences = [effect.law.sentence.format(place=effect.component)]
        sentences += [told(way, *size).rstrip(".") for own in gives for way, size in own]
        shown = (
            effect.name,
            ". ".join(sentences),
            # Nobody but its author knows what a formula stands for.
            effect.law.check.replace("{place}", effect.component) if asked == candidate else "",
            seen.change,
            values,
        )
        return {"seen": Seen(*shown), "version": len(self._opened.versions) - 1}

    def add(self) -> Changes:
        """Add what was looked at last."""
        asked, option = self._looked
        self._tell("fitting everything together, with and without it")
        self._opened.add(asked)
        self._options.append(option)
        return self._newest()

    def plan(self, rivals: Sequence[str], grams: float) -> Changes:
        """Plan the experiment that tells rivals apart with a weight that can be hung on."""
        analysis, answer = self._opened, self._answer
        if answer is None:
            raise InputError("ask what is missing first")
        if not 0.0 < grams <= HEAVIEST_G:
            raise InputError(f"a weight of {grams:g} g is not above 0 and up to {HEAVIEST_G:g} g")
        self._tell(f"planning an experiment between {' and '.join(rivals)}")
        table = analysis.model.table
        noise = dwell_noise(table, answer.diagnosis.noise)
        weight = Weight(f"{grams:g} g", 1e-3 * grams, table.geometry.load_point, HANG_S)
        conditions = Conditions((weight,), USUAL_PACE, noise, None, seed=0)
        found = analysis.plan(rivals, conditions)
        text = plan_summary(found)
        if found.timeline is None:
            return {"planned": (text, "")}
        name = self._workspace.free("next_experiment")
        write_plan(table, found.timeline, text, self._workspace.path(name))
        return {"planned": (text, name)}

    def export(self, number: int) -> Changes:
        """Write a version's model, the last diagnosis on the way to it and the same as commands."""
        self._tell("writing model, report and commands")
        name, written = self._workspace.free("wrist"), {}
        parts: list[tuple[str, str, Callable[[Path], None]]] = [
            ("yaml", "model", partial(save_model, self._opened.versions[number].model))
        ]
        if lines := self._commands(number):
            parts.append(("txt", "commands that do the same", partial(_write_lines, lines)))
        if asked := [n for n in self._answers if n <= number]:
            date = datetime.now(UTC).isoformat(timespec="seconds")
            provenance = Provenance("wrist-stiffness workbench", date, *self._hashes)
            told = tuple(provenance.recordings), "", (), provenance
            page = report_of_diagnosis(Diagnosed(self._answers[asked[-1]], *told))
            parts.append(("html", "report of the diagnosis", partial(write_page, page=page)))
        try:
            for ending, what, write in parts:
                path = self._workspace.path(f"{name}.{ending}")
                write(path)
                written[path] = what
        except BaseException:
            for path in written:
                path.unlink(missing_ok=True)
            raise
        return {"written": tuple((path.name, what) for path, what in written.items())}

    def _commands(self, number: int) -> list[str]:
        """Return what a terminal would do the same with, up to a version."""
        days = shlex.join(str(path) for path in self._paths)
        model, options, lines = shlex.quote(str(self._model)), iter(self._options), []
        for n, version in enumerate(self._opened.versions[: number + 1]):
            if n > 0:
                how = f"calibrate {model}"
                if version.added is not None:
                    how = f"extend {model} {next(options)}"
                model = f"step_{n}.yaml"
                lines.append(f"wrist-stiffness {how} --fit {days} -o {model}")
            if n in self._answers:
                lines.append(f"wrist-stiffness diagnose {days} --model {model}")
        return lines

    def undo(self) -> Changes:
        """Take the newest version back."""
        gone = self._opened.versions[-1]
        self._opened.undo()
        self._answers.pop(len(self._opened.versions), None)
        if gone.added is not None:
            self._options.pop()
        return self._newest()

    def _newest(self) -> Changes:
        versions = self._opened.versions
        last = len(versions) - 1
        return {
            "rows": tuple(_row(each) for each in versions),
            "version": last,
            "view": (last, self._opened.view(last)),
            "seen": None,
            "diagnosis": None,
            "offers": (),
        }


def _write_lines(lines: Sequence[str], path: Path) -> None:
    with writing(path) as written:
        written.write_text("\n".join(lines) + "\n", encoding="utf-8")


def _row(version: Version) -> Row:
    found = {} if version.added is None else version.added.estimates
    values = {key: (each.value, each.sigma) for key, each in found.items()}
    return Row(version.name, dict(version.held_out), version.warnings, values)


def _depends(found: Comparison) -> Depends:
    explained = found.models[0].explained
    curves = {each.name: each.curve for each in explained.told if len(each.curve.names) == 1}
    return Depends(sentences(explained), curves, explained.not_varied, found.mistake)


def work(folder: Path, wires: Connection, stop: Event) -> None:
    """Do what is asked over a connection until that is closed.

    `wires`: takes (method, arguments); answers (words or None, steps done, steps in all) any number
    of times, and at the end (changes, sentence), which says why it failed or is empty.
    """
    signal.signal(signal.SIGINT, signal.SIG_IGN)

    def tell(words: str | None, done: int = 0, total: int = 0) -> None:
        if stop.is_set():
            raise WristError(CANCELLED)
        wires.send((words, done, total))

    bench = Bench(folder, tell, partial(tell, None))
    with suppress(EOFError):
        while True:
            method, arguments = wires.recv()
            changes, why = {}, ""
            try:
                changes = getattr(bench, method)(*arguments)
            except WristError as error:
                why = str(error)
            except Exception as error:
                traceback.print_exc()
                why = f"An error of the program, written to its terminal: {error!r}"
            wires.send((changes, why))
