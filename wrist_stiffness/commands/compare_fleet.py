"""One line for each of many recordings, each of a wrist of its own."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import partial
from pathlib import Path
from typing import Any

from wrist_stiffness.commands.compare import compare
from wrist_stiffness.commands.fleet import FleetRow, map_recordings, table_lines, table_values
from wrist_stiffness.commands.provenance import Run
from wrist_stiffness.commands.read_sessions import Recordings
from wrist_stiffness.comparing.wiring import LOOK_FIRST
from wrist_stiffness.progress import Progress
from wrist_stiffness.sessions.reading.folder import recordings_in


@dataclass(frozen=True)
class FleetComparison:
    """The last model against each recording by itself.

    Parameters
    ----------
    rows : tuple of FleetRow
        What `compare` gives for a program, or the error.
    """

    rows: tuple[FleetRow[dict[str, Any]], ...]

    def lines(self) -> list[str]:
        """Return one table for a terminal."""
        models = {row.result["models"][-1]["model"] for row in self.rows if row.result is not None}
        titles = f"{'s [um]':>10}{'noise':>8}{'phi [mdeg]':>12}{'noise':>8}  strongest dependence"
        return [
            *(f"{name}, RMS with registrations, zeros, tare refitted" for name in models),
            *table_lines(self.rows, titles, _cells, "compared", _mistakes),
        ]

    def as_values(self) -> dict[str, Any]:
        """Return what programs read."""
        return table_values(self.rows, "comparison")


def _mistakes(values: dict[str, Any]) -> list[str]:
    return [sentence for sentence in values["verdict"] if sentence.startswith(LOOK_FIRST)]


def _cells(values: dict[str, Any]) -> str:
    model = values["models"][-1]
    out = ""
    for key, width in (("s_um", 10), ("phi_mdeg", 12)):
        size = model["after_registration"].get(key)
        # A recording may lack a quantity.
        rms = "-" if size is None else f"{size['rms']:.3g}"
        noise = "-" if size is None else f"{values['instrument_noise'][key]:.3g}"
        out += f"{rms:>{width}}{noise:>8}"
    depends = model["depends_on"]
    return f"{out}  {depends[0]['condition'] if depends else 'nothing beyond chance'}"


def compare_each(
    models: Sequence[str | Path],
    recordings: Recordings,
    run: Run,
    scheduler: str | None,
    progress: Progress,
) -> FleetComparison:
    """Compare models with every recording by itself, in parallel.

    Parameters
    ----------
    models : sequence of path
        Model files.
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
    one = partial(_values, models=list(models), recordings=recordings, run=run)
    return FleetComparison(tuple(map_recordings(one, paths, scheduler, progress=progress)))


def _values(
    path: Path, models: list[str | Path], recordings: Recordings, run: Run
) -> dict[str, Any]:
    return compare(models, replace(recordings, paths=[path]), run).as_values()
