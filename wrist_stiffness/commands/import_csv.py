"""A campaign's table becomes a recording: one row, one measured pose."""

from __future__ import annotations

import csv
import json
import re
from collections.abc import Iterator
from dataclasses import dataclass
from io import TextIOWrapper
from pathlib import Path
from typing import Any

import numpy as np

from wrist_stiffness import topics
from wrist_stiffness.compensation.measured_pose import UNIT_TOLERANCE
from wrist_stiffness.errors import InputError
from wrist_stiffness.inputs.opening import open_input
from wrist_stiffness.progress import Progress, silent
from wrist_stiffness.recording import RecordingWriter
from wrist_stiffness.recording import messages as msg
from wrist_stiffness.recording.samples import DEFAULT_JOINTS
from wrist_stiffness.sessions.gauges import gauge_of, read_gauges
from wrist_stiffness.sessions.reading.csv_columns import (
    GAUGE_FACTORS,
    LOAD,
    MOTORS,
    POSITION,
    QUATERNION,
    TIME,
    Columns,
    columns_of,
    marker_columns,
    nanoseconds,
    reader_of,
)
from wrist_stiffness.sessions.reading.gauge_readings import GAUGES
from wrist_stiffness.sessions.reading.pose_track import LEAST_MARKERS
from wrist_stiffness.topics import BASE_FRAME

NAN = float("nan")
HUGE = 1e6
"""Variance of what was not measured [m^2, rad^2]."""

TIME_ZERO_NS = 1_700_000_000_000_000_000
"""Stamp of time zero where a table counts from its own start: a stamp of zero says 'no stamp'."""

EPOCH_FROM_NS = 1_000_000_000_000_000_000
"""Times from here on (September 2001) are taken as stamps since 1970."""

LAST_STAMP_NS = (2**31 - 1) * 1_000_000_000
"""ROS 2 counts the seconds of a stamp in 32 bits."""

ROWS_A_REPORT = 1000
SEPARATORS = ";\t"
"""Where they and not commas separate the columns, a comma may be the decimal mark."""

DECIMAL = re.compile(r"[+-]?\d*([.,])\d*(?:[eE][+-]?\d+)?")
LONGEST_LINE = csv.field_size_limit()
"""Of column names: what Python's reader takes for one cell."""


@dataclass(frozen=True)
class Imported:
    """What was written."""

    recording: Path
    # `rows`, `measured`: rows of the table; those in which something was measured
    rows: int
    measured: int
    seconds: float  # from the first row to the last [s]; a wrong unit of time shows in it
    # `temperatures`, `covariates`: components and names that were found
    temperatures: tuple[str, ...]
    covariates: tuple[str, ...]
    cut_row: int  # the last row, left out because the file ends in it; 0 if the file is whole


def import_csv(
    table: str | Path,
    output: str | Path,
    unloaded: bool = False,
    overwrite: bool = False,
    progress: Progress = silent,
    frame: str = BASE_FRAME,
    gauges_file: str | Path | None = None,
) -> Imported:
    """Write a table of measured poses as a recording.

    `table`: CSV file with the columns of `sessions.reading.csv_columns`; `output`: rosbag2 folder,
    or file where it ends in `.mcap`; `unloaded`: whether load columns are missing because nothing
    pulled at the platform; `progress`: told rows done and in all; `gauges_file`: which columns are
    dial gauges and inclinometers, and where these stand.  Raises `InputError` if a column is
    missing or unknown, or a cell cannot be used, with its row (the first line of the file is row 1)
    and column; `RecordingError` if the recording exists or cannot be written.  Then nothing is
    written.
    """
    table = Path(table)
    form = _survey(table)
    gauges = read_gauges(gauges_file) if gauges_file else {}
    try:
        columns = _columns(form.header, unloaded, tuple(gauges))
    except InputError as error:
        raise InputError(f"{table}: {error}") from error
    rows = measured = first_ns = last_ns = 0
    with RecordingWriter(output, overwrite=overwrite) as writer:
        for row in _rows(table, form, columns):
            if rows == 0:
                facts: dict[str, Any] = {"table": table.name, "time_zero_ns": row.zero_ns}
                if gauges:
                    facts[GAUGES] = [each.note for each in gauges.values()]
                if unloaded:
                    facts["load_source"] = "constant"
                note = msg.String(json.dumps(facts, sort_keys=True))
                first_ns = row.stamp_ns
                writer.write(topics.RECORDING_NOTES, note, first_ns)
            for topic, message in _messages(row, columns, frame):
                writer.write(topic, message, row.stamp_ns)
            rows, last_ns = rows + 1, row.stamp_ns
            measured += row.is_measured(columns)
            if rows % ROWS_A_REPORT == 0:
                progress(rows, form.total)
        if rows == 0:
            raise InputError(f"{table}: no rows below the column names")
        if measured == 0:
            raise InputError(f"{table}: nothing is measured in any of its {rows} rows")
    progress(rows, rows)
    return Imported(
        Path(output),
        rows,
        measured,
        1e-9 * (last_ns - first_ns),
        tuple(columns.temperatures),
        tuple(columns.covariates),
        form.cut_row,
    )


@dataclass(frozen=True)
class _Form:
    """Column names, what separates them, whole lines below the first, and the row that is cut."""

    header: list[str]
    separator: str
    total: int
    cut_row: int


@dataclass(frozen=True)
class _Row:
    """Its stamp and that of the table's time zero [ns], SI values by column without blank cells."""

    stamp_ns: int
    zero_ns: int
    values: dict[str, float]

    def of(self, names: tuple[str, ...]) -> list[float]:
        return [self.values.get(name, NAN) for name in names]

    def is_measured(self, columns: Columns) -> bool:
        """Tell whether a component of the pose is there, or three whole markers are."""
        if columns.markers:
            points = np.reshape(self.of(marker_columns(columns.markers)), (-1, 3))
            return int(np.isfinite(points).all(axis=1).sum()) >= LEAST_MARKERS
        return bool(np.isfinite(self.of((*columns.pose, *columns.gauges))).any())


def _survey(table: Path) -> _Form:
    """Return how the table is written."""
    try:
        with _opened(table) as stream:
            first = last = stream.readline(LONGEST_LINE + 1)
            if len(first) > LONGEST_LINE:
                raise InputError(f"{table}: row 1 has more than {LONGEST_LINE} characters")
            total = 0
            for line in stream:
                total, last = total + 1, line
    except OSError as error:
        raise InputError(f"{table}: cannot be read: {error.strerror}") from error
    except UnicodeDecodeError as error:
        raise InputError(f"{table}: is no text in UTF-8; save it as such") from error
    separator = next((mark for mark in SEPARATORS if mark in first), ",")
    try:
        header = [name.strip() for name in next(csv.reader([first], delimiter=separator), [])]
    except csv.Error as error:
        raise InputError(f"{table}: row 1: {error}") from error
    cut = total > 0 and last.strip() and not last.endswith(("\n", "\r"))
    if cut and last.count(separator) < len(header) - 1:
        return _Form(header, separator, total - 1, total + 1)
    return _Form(header, separator, total, 0)


def _opened(table: Path) -> TextIOWrapper:
    return TextIOWrapper(open_input(table, InputError), "utf-8-sig", newline="")


def _columns(header: list[str], unloaded: bool, gauges: tuple[str, ...]) -> Columns:
    columns = columns_of(header, gauges)
    if unloaded and columns.loads:
        raise InputError("there are load columns, so it is not --unloaded")
    if not unloaded and not columns.loads:
        raise InputError(
            f"load columns {', '.join(LOAD)} are missing; say --unloaded if nothing pulled at the "
            "platform"
        )
    return columns


def _cells(table: Path, form: _Form) -> Iterator[tuple[str, list[str]]]:
    """Give the cells of each row that is whole and not blank, and where it is."""
    with _opened(table) as stream:
        lines = csv.reader(stream, delimiter=form.separator)
        try:
            next(lines)
            for cells in lines:
                if form.cut_row and lines.line_num >= form.cut_row:
                    return
                if any(cell.strip() for cell in cells):
                    yield f"{table}: row {lines.line_num}", cells
        except csv.Error as error:
            raise InputError(f"{table}: row {lines.line_num}: {error}") from error


def _rows(table: Path, form: _Form, columns: Columns) -> Iterator[_Row]:
    """Read the rows one by one and check them."""
    header, mark = form.header, ""
    readers = {name: reader_of(name) for name in header if name != TIME}
    readers |= {name: reader_of(name, GAUGE_FACTORS) for name in columns.gauges}
    required = {*MOTORS, *(LOAD if columns.loads else ())}
    before: tuple[int, str] | None = None
    zero_ns = 0
    for place, cells in _cells(table, form):
        if len(cells) != len(header):
            decimal = len(cells) > len(header) and form.separator == ","
            why = "; decimal commas need semicolons or tabs between columns" if decimal else ""
            raise InputError(f"{place}: {len(cells)} cells for {len(header)} columns{why}")
        written = dict(zip(header, cells, strict=True))
        text = {
            name: "" if cell.strip().lower() == "nan" else cell for name, cell in written.items()
        }
        if form.separator != ",":
            mark = _with_points(place, text, mark)
        try:
            time_ns = nanoseconds(text[TIME])
        except ValueError as error:
            raise InputError(f"{place}, column {TIME}: {error}") from error
        if before is None:
            zero_ns = 0 if time_ns >= EPOCH_FROM_NS else TIME_ZERO_NS
        elif time_ns <= before[0]:
            raise InputError(
                f"{place}, column {TIME}: {text[TIME]} is not later than {before[1]} of the row "
                "before"
            )
        if not 0 <= zero_ns + time_ns <= LAST_STAMP_NS:
            raise InputError(
                f"{place}, column {TIME}: {text[TIME]} s is a stamp outside 0 to "
                f"{LAST_STAMP_NS / 1e9:.0f} s since 1970"
            )
        before = time_ns, text[TIME]
        values = {}
        for name, read in readers.items():
            if text[name].strip():
                try:
                    values[name] = read(text[name])
                except ValueError as error:
                    raise InputError(f"{place}, column {name}: {error}") from error
            elif name in required:
                is_what = "is NaN" if written[name].strip() else "is blank"
                why = "angles and loads must be in every line; delete the line"
                raise InputError(f"{place}, column {name} {is_what}: {why}")
        yield _checked(place, _Row(zero_ns + time_ns, zero_ns, values))


def _with_points(place: str, text: dict[str, str], mark: str) -> str:
    """Write decimal commas of a row as points, and return the table's decimal mark.

    Raises `InputError` if the table has both: one of them then stands between thousands.
    """
    for name, cell in text.items():
        if found := DECIMAL.fullmatch(cell.strip()):
            if mark and found[1] != mark:
                raise InputError(
                    f"{place}, column {name}: {cell.strip()} has a decimal {found[1]!r}, numbers "
                    f"before it {mark!r}: write all of them with one"
                )
            mark = found[1]
            text[name] = cell.replace(",", ".")
    return mark


def _checked(place: str, row: _Row) -> _Row:
    """Refuse a quaternion that is none."""
    quaternion = row.of(QUATERNION)
    blank = [name for name in QUATERNION if name not in row.values]
    if 0 < len(blank) < len(QUATERNION):
        raise InputError(f"{place}, column {blank[0]}: blank in a quaternion")
    norm = float(np.linalg.norm(quaternion))
    if not blank and abs(norm - 1.0) > UNIT_TOLERANCE:
        raise InputError(f"{place}, columns qx qy qz qw: norm {norm:.4g}, not 1")
    return row


def _messages(row: _Row, columns: Columns, frame: str) -> Iterator[tuple[str, msg.Message]]:
    """Give the messages of a row; the load goes first, so that it has arrived with its angles."""
    stamp_ns = row.stamp_ns
    header = msg.Header(stamp_ns, BASE_FRAME)
    load = row.of(LOAD) if columns.loads else [0.0] * 6
    wrench = msg.Wrench(msg.Vector3(*load[:3]), msg.Vector3(*load[3:]))
    yield topics.LOAD_ESTIMATE, msg.WrenchStamped(header, wrench)
    for component, name in columns.temperatures.items():
        if name in row.values:
            message = msg.Temperature(msg.Header(stamp_ns, component), row.values[name])
            yield topics.TEMPERATURES, message
    for covariate, name in columns.covariates.items():
        if name in row.values:
            yield topics.COVARIATES + covariate, msg.Float64(row.values[name])
    motors = msg.Header(stamp_ns, "")
    yield topics.JOINT_STATES, msg.JointState(motors, DEFAULT_JOINTS, tuple(row.of(MOTORS)))
    if columns.gauges:
        names = tuple(map(gauge_of, columns.gauges))
        yield topics.GAUGE_READINGS, msg.JointState(motors, names, tuple(row.of(columns.gauges)))
    elif columns.markers:
        points = np.reshape(row.of(marker_columns(columns.markers)), (-1, 3))
        poses = tuple(msg.Pose(msg.Point(*point)) for point in points.tolist())
        yield topics.PLATFORM_MARKERS, msg.PoseArray(msg.Header(stamp_ns, frame), poses)
    else:
        pose = msg.PoseWithCovarianceStamped(msg.Header(stamp_ns, frame), _pose(row))
        yield topics.PLATFORM_POSE, pose


def _pose(row: _Row) -> msg.PoseWithCovariance:
    """Return the pose of a row; what is blank has a huge variance, what is not an unknown one."""
    position, quaternion = row.of(POSITION), row.of(QUATERNION)
    turned = not np.isnan(quaternion).any()
    known = np.append(np.isfinite(position), [turned] * 3)
    pose = msg.Pose(
        msg.Point(*np.where(known[:3], position, 0.0).tolist()),
        msg.Quaternion(*quaternion) if turned else msg.Quaternion(),
    )
    return msg.PoseWithCovariance(pose, tuple(np.diag(np.where(known, 0.0, HUGE)).ravel().tolist()))
