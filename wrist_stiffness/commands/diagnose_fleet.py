"""What is missing in each of many wrists: one line for each recording."""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import partial
from pathlib import Path
from typing import Any

from wrist_stiffness.commands.diagnose import diagnose_recordings
from wrist_stiffness.commands.fleet import FleetRow, map_recordings, table_lines, table_values
from wrist_stiffness.commands.provenance import Run
from wrist_stiffness.commands.read_sessions import Recordings
from wrist_stiffness.progress import Progress
from wrist_stiffness.report.fit_report import TITLES
from wrist_stiffness.sessions.reading.folder import recordings_in


@dataclass(frozen=True)
class FleetDiagnosis:
    """A diagnosis of each recording by itself.

    Parameters
    ----------
    rows : tuple of FleetRow
        What `diagnose` gives for a program, or the error.
    """

    rows: tuple[FleetRow[dict[str, Any]], ...]

    def lines(self) -> list[str]:
        """Return one table for a terminal."""
        titles = "".join(f"{title:>22}{'noise':>8}" for title in TITLES.values()) + "  missing"
        return [
            "held-out RMS, before and after what is missing is added, and instrument noise",
            *table_lines(
                self.rows,
                titles,
                _cells,
                "diagnosed",
                lambda values: [each for each in [values["set_up_mistake"]] if each],
            ),
        ]

    def as_values(self) -> dict[str, Any]:
        """Return what programs read."""
        return table_values(self.rows, "diagnosis")


def _cells(values: dict[str, Any]) -> str:
    out = ""
    for key in TITLES:
        before, after = (values[when].get(f"rms_{key}") for when in ("before", "after"))
        noise = values["noise"].get(key)
        # A recording may lack a quantity.
        fall = "-" if before is None else f"{before:.3g} -> {after:.3g}"
        out += f"{fall:>22}{'-' if noise is None else f'{noise:.3g}':>8}"
    return f"{out}  {_missing(values)}"


def _missing(values: dict[str, Any]) -> str:
    """Return what is missing: a class by its best member, and whether more is unknown."""
    named = []
    for finding in values["findings"]:
        best, *others = (f"{each['effect']}@{each['component']}" for each in finding["class"])
        named.append(f"{best} (or {len(others)} more)" if others else best)
    if values["verdict"] == "unknown":
        named.append("something unknown")
    return ", ".join(named) or "nothing"


def diagnose_each(
    model: str | Path,
    recordings: Recordings,
    run: Run,
    scheduler: str | None,
    progress: Progress,
) -> FleetDiagnosis:
    """Diagnose every recording by itself, in parallel.

    Parameters
    ----------
    model : path
        Model file.
    recordings : Recordings
        Recordings, or folders of them.
    run : Run
        For the report.
    scheduler : str or None
        Address of a Dask scheduler; processes of this machine if None.
    progress : callable
        Told recordings done and in all.

    Raises
    ------
    InputError
        If there is no recording, or no scheduler answers.
    """
    paths = recordings_in(recordings.paths)
    one = partial(_values, model=model, recordings=recordings, run=run)
    return FleetDiagnosis(tuple(map_recordings(one, paths, scheduler, progress=progress)))


def _values(path: Path, model: str | Path, recordings: Recordings, run: Run) -> dict[str, Any]:
    return diagnose_recordings(model, replace(recordings, paths=[path]), run).as_values()
