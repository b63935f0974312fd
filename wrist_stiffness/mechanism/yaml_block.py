"""Read values from a YAML file so that every error names place, value and limit.

A `Block` is one mapping of the file.  It hands out checked values in SI units, remembers which keys
were read, and complains about the rest; so a misspelt key never goes unnoticed.
"""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np
import yaml

from wrist_stiffness.errors import WristError, with_a_point
from wrist_stiffness.mechanism.components import Array
from wrist_stiffness.mechanism.vectors import unit

UNIT_TOLERANCE = 1e-6
"""Axes are typed with finite digits: they are made unit if their length is this close to 1."""


class _Loader(yaml.SafeLoader):
    """YAML's safe loader, but a key given twice is an error instead of a silent choice."""

    def construct_mapping(self, node: yaml.MappingNode, deep: bool = False) -> dict[Any, Any]:
        keys = [self.construct_object(key, deep=True) for key, _ in node.value]
        for key in keys:
            if keys.count(key) > 1:
                raise yaml.constructor.ConstructorError(
                    None, None, f"key {key!r} is given twice", node.start_mark
                )
        return super().construct_mapping(node, deep=deep)


def read_yaml(path: str | Path, error: type[WristError]) -> Any:
    """Read a YAML file.

    Parameters
    ----------
    path : path
        The file.
    error : type
        Error to raise.

    Returns
    -------
    object
        Whatever the file holds: mappings, lists, numbers, texts.

    Raises
    ------
    WristError
        Of the given type, if the file cannot be read, is not YAML or has a key twice.
    """
    try:
        return yaml.load(Path(path).read_text(encoding="utf-8"), Loader=_Loader)
    except OSError as cause:
        raise error(f"{path}: cannot be read: {cause.strerror}") from cause
    except (yaml.YAMLError, UnicodeDecodeError, RecursionError, ValueError) as cause:
        raise error(f"{path}: not a YAML file: {' '.join(str(cause).split())}") from cause


class Block:
    """One mapping of a file that knows where it stands.

    Parameters
    ----------
    values : object
        What the file has at this place; anything but a mapping is refused.
    place : str
        File and keys down to here, as error messages name it.
    error : type
        Error to raise.
    sources : tuple of str
        Words that a block may give as its `source`.

    Raises
    ------
    WristError
        Of the given type, here and in every method, with place, value and limit.
    """

    def __init__(
        self, values: Any, place: str, error: type[WristError], sources: tuple[str, ...]
    ) -> None:
        if values is None:
            raise error(f"{place} is empty: keys with values are expected")
        if not isinstance(values, Mapping):
            raise error(f"{place}: {_short(values)} is not a mapping of keys to values")
        self.values: Mapping[Any, Any] = values
        self.place = place
        self._error = error
        self._sources = sources
        self._used: set[str] = set()

    def take(self, key: str) -> Any:
        """Return the raw value of a key that must be there."""
        if key not in self.values:
            raise self._error(f"{self.place}: {key} is missing")
        self._used.add(key)
        return self.values[key]

    def block(self, key: str) -> Block:
        """Return the mapping at a key."""
        return Block(self.take(key), f"{self.place}.{key}", self._error, self._sources)

    def blocks(self, key: str) -> list[Block]:
        """Return the mappings of a list at a key."""
        values = self.take(key)
        if not isinstance(values, list):
            raise self._error(f"{self.place}.{key}: {_short(values)} is not a list")
        return [
            Block(value, f"{self.place}.{key}[{number}]", self._error, self._sources)
            for number, value in enumerate(values)
        ]

    def text(self, key: str, allowed: tuple[str, ...] | None = None) -> str:
        """Return a text, if given one of the allowed words."""
        value = self.take(key)
        if not isinstance(value, str) or (allowed is not None and value not in allowed):
            wanted = "a text" if allowed is None else f"one of {', '.join(allowed)}"
            raise self._error(f"{self.place}.{key}: {_short(value)} is not {wanted}")
        return value

    def number(
        self,
        key: str,
        scale: float = 1.0,
        above: float = -np.inf,
        below: float = np.inf,
        at_least: float = -np.inf,
    ) -> float:
        """Return a finite number times `scale`; the limits are in the file's unit."""
        value = self.take(key)
        if not _is_number(value):
            raise self._error(
                f"{self.place}.{key}: {_short(value)} is not a finite number{_as_number(value)}"
            )
        if value <= above:
            raise self._error(f"{self.place}.{key}: {value} is not above {above:g}")
        if value < at_least:
            raise self._error(f"{self.place}.{key}: {value} is below {at_least:g}")
        if value >= below:
            raise self._error(f"{self.place}.{key}: {value} is not below {below:g}")
        return float(value) * scale

    def optional_number(
        self, key: str, scale: float = 1.0, at_least: float = -np.inf
    ) -> float | None:
        """Return a number as `number` does, or None where the file says null."""
        return None if self.take(key) is None else self.number(key, scale, at_least=at_least)

    def vector(self, key: str, scale: float = 1.0, size: int = 3) -> Array:
        """Return (size,) finite numbers times `scale`."""
        value = self.take(key)
        if not _is_row(value, size):
            raise self._error(
                f"{self.place}.{key}: {_short(value)} is not a list of {size} finite numbers"
            )
        return np.array(value, dtype=float) * scale

    def rows(self, key: str, scale: float = 1.0, at_least: int = 1) -> Array:
        """Return (n, 3) finite numbers times `scale`, n not below `at_least`."""
        value = self.take(key)
        if not isinstance(value, list) or len(value) < at_least:
            found = f"{len(value)} rows" if isinstance(value, list) else _short(value)
            raise self._error(
                f"{self.place}.{key}: {found}, needs a list of at least {at_least} rows"
            )
        for i, row in enumerate(value):
            if not _is_row(row, 3):
                raise self._error(
                    f"{self.place}.{key}[{i}]: {_short(row)} is not a list of 3 finite numbers"
                )
        return np.array(value, dtype=float) * scale

    def direction(self, key: str) -> Array:
        """Return a unit vector (3,); the file's must have length 1 to within `UNIT_TOLERANCE`."""
        vector = self.vector(key)
        length = float(np.linalg.norm(vector))
        if abs(length - 1.0) > UNIT_TOLERANCE:
            raise self._error(
                f"{self.place}.{key}: {vector.tolist()} has length {length:.9g}, "
                f"not 1 (within {UNIT_TOLERANCE:.0e})"
            )
        return unit(vector)

    def done(self) -> None:
        """Check that a block of values says its source, and that no key was left unread."""
        if "source" in self.values:
            self._check_source(self.take("source"))
        elif any(not isinstance(value, Mapping) for value in self.values.values()):
            raise self._error(
                f"{self.place}: source is missing (one of {', '.join(self._sources)})"
            )
        self.no_more_keys()

    def no_more_keys(self) -> None:
        """Check that no key was left unread."""
        if unknown := set(self.values) - self._used:
            # Within braces, `0,33` is the number 0 and a key 33.
            comma = any(isinstance(key, int) for key in unknown)
            hint = ": numbers have a decimal point, no comma" if comma else ""
            names = ", ".join(sorted(map(str, unknown)))
            raise self._error(f"{self.place}: unknown key {names}{hint}")

    def _check_source(self, source: Any) -> None:
        by_key = source if isinstance(source, Mapping) else {"rest": source}
        for word in by_key.values():
            if word not in self._sources:
                raise self._error(
                    f"{self.place}.source: {_short(word)} is not one of {', '.join(self._sources)}"
                )
        if extra := set(by_key) - set(self.values) - {"rest"}:
            raise self._error(
                f"{self.place}.source: names unknown key {', '.join(sorted(map(str, extra)))}"
            )
        if "rest" not in by_key and (silent := set(self.values) - set(by_key) - {"source"}):
            raise self._error(
                f"{self.place}.source: says nothing of {', '.join(sorted(map(str, silent)))} "
                "(add them or rest)"
            )


def _is_number(value: Any) -> bool:
    # A YAML truth value is no number; an integer may be too large for a float.
    if isinstance(value, bool) or not isinstance(value, int | float):
        return False
    return abs(value) <= float(np.finfo(float).max)


def _as_number(value: Any) -> str:
    """Return how YAML 1.1 writes a number that it reads as a text, as `1e6`; empty for no number.

    It wants a point and the sign of the exponent (https://yaml.org/type/float.html).
    """
    if isinstance(value, str) and (hint := with_a_point(value)):
        return hint
    try:
        number = float(value) if isinstance(value, str) else np.nan
    except ValueError:
        return ""
    if not np.isfinite(number):
        return ""
    return f": YAML takes it for a text, write {yaml.safe_dump(number).split()[0]}"


def _is_row(value: Any, size: int) -> bool:
    return isinstance(value, list) and len(value) == size and all(map(_is_number, value))


def _short(value: Any) -> str:
    text = " ".join(repr(value).split())
    return text if len(text) <= 60 else f"{text[:57]}..."
