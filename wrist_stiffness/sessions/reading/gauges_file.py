"""Which columns of a table are dial gauges and inclinometers, and where these stand (YAML)."""

from __future__ import annotations

from pathlib import Path

import numpy as np

from wrist_stiffness.errors import InputError
from wrist_stiffness.inputs.document import Node, read_yaml
from wrist_stiffness.inputs.schema import Quantity, list_of, record, text, vector, version
from wrist_stiffness.mechanism.components import Array
from wrist_stiffness.sessions.gauges import Gauge

LENGTHS, ANGLES = ("mm", "um", "in"), ("deg", "mdeg")


def _direction(node: Node) -> Array:
    """Read a direction of any length (3,), and return its unit vector."""
    along = vector()(node)
    length = float(np.linalg.norm(along))
    if length == 0.0:
        raise node.refuse("is no direction: all three numbers are 0")
    return np.asarray(along / length)


GAUGE = record({"column": text(), "direction": _direction}, {"point_mm": Quantity(vector())})
FILE = record({"schema": version(1), "gauges": list_of(lambda node: node, at_least=1)})


def gauge_of(column: str) -> str:
    """Return the name of a column without its unit."""
    return column.rpartition("_")[0]


def read_gauges(path: str | Path) -> dict[str, Gauge]:
    """Read which gauge reads which column, in the file's order (InputError if it is wrong)."""
    found: dict[str, Gauge] = {}
    for node in FILE(read_yaml(path, InputError))["gauges"]:
        column, gauge = _gauge(node)
        if gauge.name in (known.name for known in found.values()):
            raise node["column"].refuse(f"{gauge.name!r} is there twice")
        found[column] = gauge
    return found


def _gauge(node: Node) -> tuple[str, Gauge]:
    own = GAUGE(node)
    name, _, unit = own["column"].rpartition("_")
    if not name or unit not in (*LENGTHS, *ANGLES):
        ends = ", ".join(f"_{each}" for each in (*LENGTHS, *ANGLES))
        raise node["column"].refuse(f"{own['column']!r} is no name with its unit ({ends})")
    if (unit in LENGTHS) != ("point" in own):
        what = "a dial gauge needs a" if unit in LENGTHS else "an inclinometer has no"
        raise node.refuse(f"{own['column']}: {what} point_mm")
    return own["column"], Gauge(name, own["direction"], own.get("point"))
