"""The columns of a campaign's table, and their numbers to and from SI without losing a digit."""

from __future__ import annotations

import re
from collections import Counter
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from datetime import UTC, datetime, timedelta
from decimal import Context, Decimal, InvalidOperation, Overflow
from math import inf

from wrist_stiffness.errors import InputError, with_a_point

TIME = "time_s"
MOTORS = ("motor_1_deg", "motor_2_deg")
LOAD = ("fx_N", "fy_N", "fz_N", "mx_Nm", "my_Nm", "mz_Nm")
POSITION = ("x_mm", "y_mm", "z_mm")
QUATERNION = ("qx", "qy", "qz", "qw")
MARKER = re.compile(r"p(\d+)([xyz])_mm")
TEMPERATURE = re.compile(r"T_([a-z0-9_]+)_degC")
COVARIATE = re.compile(r"[A-Za-z]\w*_\w+")

UNIT_ONE = "_1"
"""Ends the column of a covariate whose name has no unit; it is no part of the name."""

EXACT = Context(prec=60)
PI = Decimal("3.14159265358979323846264338327950288419716939937510582097494")
FACTORS = {"deg": PI / 180, "mm": Decimal("0.001")}
GAUGE_FACTORS = {
    **FACTORS,
    "um": Decimal("1e-6"),
    "in": Decimal("0.0254"),
    "mdeg": FACTORS["deg"] / 1000,
}
SIGNIFICANT = (15, 16, 17)
"""Digits tried; seventeen tell any double, and what somebody typed mostly has fewer."""

LARGEST_EXPONENT = 300
"""Of ten, in a number that still is one in SI."""

NANOSECONDS = Decimal(1_000_000_000)
DATE = re.compile(
    r"(\d{4}-\d\d-\d\d[T ]\d\d:\d\d:\d\d)(?:[.,](\d{1,9}))?(Z|[+-]\d\d:\d\d)?", re.ASCII
)
"""ISO 8601 with a date and seconds; Python's own reader drops digits behind the microsecond."""

EPOCH = datetime(1970, 1, 1, tzinfo=UTC)

LIMITS = {**dict.fromkeys(MOTORS, (-360.0, 360.0)), **dict.fromkeys(LOAD, (-1e4, 1e4))}
"""Beyond these, in the column's unit, no wrist is: a wrong unit or a slip.  None carries a tonne.
Those of a certain wrist are its table's, and looked at where recordings are read."""

TEMPERATURES_DEGC = (-273.15, 1000.0)

STEM = re.compile(r"(motor_[12]|[fm][xyz]|[xyz]|q[xyzw]|p\d+[xyz])(_.*)?", re.IGNORECASE)
"""What a column of the load or of the pose begins with: never that of a covariate."""


@dataclass(frozen=True)
class Columns:
    """Which columns a table has."""

    loads: bool  # whether it has the load
    pose: tuple[str, ...]  # columns of the platform's pose that are there
    markers: int  # number of markers; 0 for a table of poses
    # `temperatures`, `covariates`: column by component; by name
    temperatures: dict[str, str]
    covariates: dict[str, str]
    gauges: tuple[str, ...] = ()  # columns of dial gauges and inclinometers

    @property
    def names(self) -> tuple[str, ...]:
        """All columns in the order in which an export writes them."""
        return (
            TIME,
            *MOTORS,
            *(LOAD if self.loads else ()),
            *self.pose,
            *marker_columns(self.markers),
            *self.gauges,
            *self.temperatures.values(),
            *self.covariates.values(),
        )


def marker_columns(count: int) -> tuple[str, ...]:
    """Return the columns of so many markers, p1x_mm first."""
    return tuple(f"p{i}{axis}_mm" for i in range(1, count + 1) for axis in "xyz")


def columns_of(header: Sequence[str], gauges: Sequence[str] = ()) -> Columns:
    """Sort the columns of a table, in any order, by what they mean.

    `gauges`: columns that are readings of dial gauges and inclinometers.  Columns that are neither
    the machine's nor the pose's are temperatures (`T_COMPONENT_degC`) and covariates (`NAME_UNIT`).
    Raises `InputError` if a column is missing, named twice or has no unit or a wrong one, or
    nothing measured is there.
    """
    if not any(letter.isalpha() for name in header for letter in name):
        raise InputError("no column names in the first line")
    _require((TIME, *MOTORS), header)
    for name, times in Counter(header).items():
        if times > 1:
            raise InputError(f"column {name or '(without a name)'} is there twice")
    loads = any(name in header for name in LOAD)
    if loads:
        _require(LOAD, header, " of the load")
    if any(name in header for name in QUATERNION):
        _require(QUATERNION, header, " of the quaternion")
    pose = tuple(name for name in (*POSITION, *QUATERNION) if name in header)
    markers = _markers(header)
    if pose and markers:
        raise InputError(f"columns {pose[0]} and p1x_mm: a pose and markers exclude each other")
    _require(gauges, header, " of the gauges")
    if gauges and (pose or markers):
        raise InputError(
            f"columns {gauges[0]} and {(*pose, 'p1x_mm')[0]}: gauges and a pose exclude each other "
            "(z_mm is that of a gauge with point_mm [0, 0, 0])"
        )
    if not pose and not markers and not gauges:
        raise InputError(
            f"nothing measured: none of {', '.join((*POSITION, *QUATERNION))} or p1x_mm ... "
            f"among {', '.join(header)}; dial gauges and inclinometers need --gauges"
        )
    known = {TIME, *MOTORS, *LOAD, *pose, *marker_columns(markers), *gauges}
    temperatures, covariates = {}, {}
    for name in header:
        if name in known:
            continue
        if STEM.fullmatch(name):
            raise InputError(
                f"column {name} is neither of the load nor of the pose, which are "
                f"{', '.join((*LOAD, *POSITION, *QUATERNION))} and p1x_mm ...: check its unit"
            )
        if found := TEMPERATURE.fullmatch(name):
            temperatures[found[1]] = name
        elif COVARIATE.fullmatch(name):
            covariates[covariate_of(name)] = name
        else:
            raise InputError(f"column {name!r} is not known and no NAME_UNIT of a covariate")
    return Columns(loads, pose, markers, temperatures, covariates, tuple(gauges))


def covariate_of(column: str) -> str:
    """Return the covariate's name: that of the column, less a unit of one."""
    plain = column.removesuffix(UNIT_ONE)
    return plain if "_" not in plain else column


def column_of(covariate: str) -> str:
    """Return the column of a covariate (inverse of `covariate_of`)."""
    return covariate if "_" in covariate else covariate + UNIT_ONE


def _markers(header: Sequence[str]) -> int:
    found = [name for name in header if MARKER.fullmatch(name)]
    # Three columns each, numbered from 1: a number too large has columns missing before it.
    count = -(-len(found) // 3)
    _require(marker_columns(count), header, " of the markers")
    return count


def _require(names: Sequence[str], header: Sequence[str], whose: str = "") -> None:
    """Refuse a table without one of these columns."""
    if missing := [name for name in names if name not in header]:
        columns, are = ("column", "is") if len(missing) == 1 else ("columns", "are")
        raise InputError(
            f"{columns} {', '.join(missing)}{whose} {are} missing (found: {', '.join(header)})"
        )


def reader_of(column: str, factors: Mapping[str, Decimal] = FACTORS) -> Callable[[str], float]:
    """Return the function from the text of a column to its number in SI, rounded once.

    It raises ValueError where the text is no finite number, or one that cannot be.
    """
    unit = column.rpartition("_")[2]
    factor = factors.get(unit)
    lower, upper = LIMITS.get(column, (-inf, inf))
    if TEMPERATURE.fullmatch(column):
        lower, upper = TEMPERATURES_DEGC

    def read(text: str) -> float:
        try:
            exact = Decimal(text.strip())
        except InvalidOperation as error:
            raise ValueError(f"{text!r} is no number{with_a_point(text)}") from error
        if not exact.is_finite() or exact.adjusted() > LARGEST_EXPONENT:
            raise ValueError(f"{text!r} is not finite")
        if not lower <= exact <= upper:
            raise ValueError(f"{text} is outside {lower:g} to {upper:g} {unit}")
        return float(exact if factor is None else EXACT.multiply(exact, factor))

    return read


def writer_of(column: str) -> Callable[[float], str]:
    """Return the function from a number in SI to the shortest text that reads as it again."""
    factor = FACTORS.get(column.rpartition("_")[2])

    def write(value: float) -> str:
        if factor is None:
            return repr(value).removesuffix(".0")
        exact = EXACT.divide(Decimal(value), factor)
        for digits in SIGNIFICANT:
            rounded = Context(prec=digits).plus(exact)
            if float(EXACT.multiply(rounded, factor)) == value:
                break
        return repr(float(rounded)).removesuffix(".0") if digits < 16 else f"{rounded:g}"

    return write


def nanoseconds(text: str) -> int:
    """Return the stamp [ns] of a time in seconds or of a date; ValueError where it has none.

    A date without an offset is taken as UTC.
    """
    if date := DATE.fullmatch(text.strip()):
        since = datetime.fromisoformat(date[1] + (date[3] or "Z")) - EPOCH
        return since // timedelta(seconds=1) * 1_000_000_000 + int((date[2] or "").ljust(9, "0"))
    try:
        exact = EXACT.multiply(Decimal(text.strip()), NANOSECONDS)
    except (InvalidOperation, Overflow) as error:
        raise ValueError(
            f"{text!r} is neither seconds nor a date like 2026-03-02T10:15:00{with_a_point(text)}"
        ) from error
    if (
        not exact.is_finite()
        or exact.adjusted() > LARGEST_EXPONENT
        or exact != exact.to_integral_value()
    ):
        raise ValueError(f"{text!r} is no whole number of nanoseconds")
    return int(exact)


def seconds(time_ns: int) -> str:
    """Return a stamp [ns] as seconds, all digits and no more."""
    return f"{Decimal(time_ns).scaleb(-9).normalize():f}"
