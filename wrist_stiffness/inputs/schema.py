"""What a file must hold, said in one place: a schema is a function from a node to its value.

    MATERIAL = record({"young_GPa": Quantity(number(above=0.0)), ...}, make=Material)

Each raises the error of its node, with place, value and limit; keys that a record does not know are
an error, so a misspelt one never goes unnoticed.
"""

from __future__ import annotations

from collections.abc import Callable, Collection, Iterable, Mapping
from dataclasses import dataclass
from typing import Any, TypeVar

import numpy as np
import yaml
from numpy.typing import NDArray

from wrist_stiffness.errors import with_a_point
from wrist_stiffness.inputs.document import Node

UNITS = {
    "N_um": 1e6,
    "mm": 1e-3,
    "um": 1e-6,
    "deg": np.pi / 180.0,
    "mdeg": np.pi / 180e3,
    "GPa": 1e9,
    "1e-6_K": 1e-6,
    **dict.fromkeys(("s", "kg", "N", "Nm", "kg_m3", "m_s2", "degC"), 1.0),
}
"""How a key may end, longer ends first, and how much that is in SI (a temperature stays in degrees
Celsius)."""

UNIT_TOLERANCE = 1e-6
"""Axes are typed with finite digits: they are made unit if their length is this close to 1."""

SOURCE = "source"
SOURCES = ("paper", "assumed", "calibrated", "measured")
"""What a geometry file may say of where its values are from."""

T = TypeVar("T")
Schema = Callable[[Node], T]


@dataclass(frozen=True)
class Quantity:
    """What has its unit at the end of its key: a record makes it SI and drops the unit's name."""

    schema: Schema[Any]


Keys = Mapping[str, Schema[Any] | Quantity]


def number(
    *,
    above: float = -np.inf,
    below: float = np.inf,
    at_least: float = -np.inf,
    at_most: float = np.inf,
) -> Schema[float]:
    """Return the schema of a finite number within limits."""

    def read(node: Node) -> float:
        value = node.value
        if not _is_number(value):
            raise node.refuse(f"{short(node)} is not a finite number{_as_number(value)}")
        if value <= above:
            raise node.refuse(f"{value} is not above {above:g}")
        if value < at_least:
            raise node.refuse(f"{value} is below {at_least:g}")
        if value >= below:
            raise node.refuse(f"{value} is not below {below:g}")
        if value > at_most:
            raise node.refuse(f"{value} is above {at_most:g}")
        return float(value)

    return read


def version(wanted: int) -> Schema[int]:
    """Return the schema of the version of a file's layout, of which only one is read."""

    def read(node: Node) -> int:
        if number()(node) != wanted:
            raise node.refuse(
                f"{node.value:g} is not {wanted}, the version that this program reads: make the "
                "file anew with it, or use the program that wrote it"
            )
        return wanted

    return read


def text(*allowed: str) -> Schema[str]:
    """Return the schema of a text, if given one of the allowed ones."""

    def read(node: Node) -> str:
        if not isinstance(node.value, str) or (allowed and node.value not in allowed):
            wanted = f"one of {', '.join(allowed)}" if allowed else "a text"
            raise node.refuse(f"{short(node)} is not {wanted}")
        return node.value

    return read


def whole(node: Node) -> int:
    """Read a whole number."""
    if isinstance(node.value, bool) or not isinstance(node.value, int):
        raise node.refuse(f"{short(node)} is not a whole number")
    return node.value


def truth(node: Node) -> bool:
    """Read true or false."""
    if not isinstance(node.value, bool):
        raise node.refuse(f"{short(node)} is not true or false")
    return node.value


def vector(size: int = 3) -> Schema[NDArray[np.float64]]:
    """Return the schema of (size,) finite numbers."""

    def read(node: Node) -> NDArray[np.float64]:
        value = node.plain
        if not (isinstance(value, list) and len(value) == size and all(map(_is_number, value))):
            raise node.refuse(f"{short(node)} is not a list of {size} finite numbers")
        return np.array(value, dtype=float)

    return read


def direction(node: Node) -> NDArray[np.float64]:
    """Read a unit vector (3,); the file's must have length 1 to within `UNIT_TOLERANCE`."""
    along = vector()(node)
    length = float(np.linalg.norm(along))
    if abs(length - 1.0) > UNIT_TOLERANCE:
        raise node.refuse(
            f"{along.tolist()} has length {length:.9g}, not 1 (within {UNIT_TOLERANCE:.0e})"
        )
    return along / length


def nullable(schema: Schema[T]) -> Schema[T | None]:
    """Return the schema of a value or null."""
    return lambda node: None if node.value is None else schema(node)


def list_of(schema: Schema[T], at_least: int = 0) -> Schema[list[T]]:
    """Return the schema of a list with so many values of one kind."""

    def read(node: Node) -> list[T]:
        if not isinstance(node.value, list):
            raise node.refuse(f"{short(node)} is not a list")
        if len(node.value) < at_least:
            raise node.refuse(f"{len(node.value)} entries, needs a list of at least {at_least}")
        return [schema(inner) for inner in node.value]

    return read


def mapping_of(schema: Schema[T], sources: Collection[str] = ()) -> Schema[dict[str, T]]:
    """Return the schema of values of one kind under any keys; `sources` as in `record`."""

    def read(node: Node) -> dict[str, T]:
        keys = [key for key in _keys_of(node) if not (sources and key == SOURCE)]
        values = {key: schema(node[key]) for key in keys}
        if sources:
            _check_source(node, sources)
        return values

    return read


def record(
    keys: Keys,
    optional: Keys | None = None,
    *,
    sources: Collection[str] = (),
    others: bool = False,
    make: Callable[..., Any] = dict,
) -> Schema[Any]:
    """Return the schema of a mapping with certain keys.

    `keys`, `optional`: those that must and those that may be there.  `sources`: words of which the
    mapping must say, under `source`, where each of its values is from; empty for none.  `others`:
    whether it may have other keys as well, which are left unread.  Gives what `make` returns.
    """
    schemas = {**keys, **(optional or {})}

    def read(node: Node) -> Any:
        found = _keys_of(node)
        values: dict[str, Any] = {}
        for key, schema in schemas.items():
            if key in found:
                values.update([_value(key, schema, found[key])])
            elif key in keys:
                raise node.refuse(f"{key} is missing")
        if sources:
            _check_source(node, sources)
        if not others:
            _no_more_keys(node, [*schemas, SOURCE] if sources else schemas)
        return make(**values)

    return read


def _no_more_keys(node: Node, known: Iterable[str]) -> None:
    if unknown := sorted(set(node.value) - set(known)):
        # Within braces, `0,33` is the number 0 and a key 33.
        comma = any(key.isdecimal() for key in unknown)
        hint = ": numbers have a decimal point, no comma" if comma else ""
        more = f" and {len(unknown) - 5} more" if len(unknown) > 5 else ""
        raise node.refuse(f"unknown key {', '.join(unknown[:5])}{more}{hint}")


def _value(key: str, schema: Schema[Any] | Quantity, node: Node) -> tuple[str, Any]:
    if not isinstance(schema, Quantity):
        return key, schema(node)
    name, size = next(
        (key.removesuffix(f"_{u}"), k) for u, k in UNITS.items() if key.endswith(f"_{u}")
    )
    value = schema.schema(node)
    return name, None if value is None else value * size


def short(node: Node) -> str:
    """Return a value as an error message shows it."""
    shown = " ".join(repr(node.plain).split())
    return shown if len(shown) <= 60 else f"{shown[:57]}..."


def _keys_of(node: Node) -> dict[str, Node]:
    if node.value is None:
        raise node.refuse("is empty: keys with values are expected")
    if not isinstance(node.value, dict):
        raise node.refuse(f"{short(node)} is not a mapping of keys to values")
    return node.value


def _check_source(node: Node, sources: Collection[str]) -> None:
    """Check that a mapping says of each value that is no mapping itself where it is from."""
    values = set(node.value) - {SOURCE}
    if SOURCE not in node.value:
        if any(not isinstance(node[key].value, dict) for key in values):
            raise node.refuse(f"source is missing (one of {', '.join(sources)})")
        return
    source = node[SOURCE]
    by_key = source.value if isinstance(source.value, dict) else {"rest": source}
    for word in by_key.values():
        if word.value not in sources:
            raise source.refuse(f"{short(word)} is not one of {', '.join(sources)}")
    if extra := set(by_key) - values - {"rest"}:
        raise source.refuse(f"names unknown key {', '.join(sorted(extra))}")
    if "rest" not in by_key and (silent := values - set(by_key)):
        raise source.refuse(f"says nothing of {', '.join(sorted(silent))} (add them or rest)")


def _is_number(value: Any) -> bool:
    # A YAML truth value is no number; an integer may be too large for a float.
    if isinstance(value, bool) or not isinstance(value, int | float):
        return False
    return abs(value) <= float(np.finfo(float).max)


def _as_number(value: Any) -> str:
    """Return how YAML 1.1 writes a number that it reads as a text, as `1e6`; empty for no number.

    It wants a point and the sign of the exponent (https://yaml.org/type/float.html).
    """
    if not isinstance(value, str):
        return ""
    if hint := with_a_point(value):
        return hint
    try:
        finite = float(value)
    except ValueError:
        return ""
    if not np.isfinite(finite):
        return ""
    return f": YAML takes it for a text, write {yaml.safe_dump(finite).split()[0]}"
