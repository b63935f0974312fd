"""Write and read a table (`.npz`): arrays plus a JSON header, checked by a checksum.

The file is read with `allow_pickle=False`, written to a temporary name first and holds no clock, so
the same geometry gives the same table.
"""

from __future__ import annotations

import hashlib
import json
import struct
import zipfile
import zlib
from collections.abc import Mapping
from dataclasses import asdict, fields, replace
from math import prod
from pathlib import Path
from tokenize import TokenError
from typing import Any

import numpy as np

from wrist_stiffness.atomic_file import writing
from wrist_stiffness.errors import TableError, WristError
from wrist_stiffness.inputs.opening import open_input
from wrist_stiffness.lookup.biharmonic import KERNEL, TREND
from wrist_stiffness.lookup.operators import column_count
from wrist_stiffness.lookup.table import EVALUATIONS, MAP_COLUMNS, Table, TableHeader
from wrist_stiffness.mechanism.components import (
    ELASTIC,
    PASSIVE_JOINTS,
    Array,
    ElasticComponents,
    FlangeContact,
)

SCHEMA = 2
MAGIC = "wrist_stiffness table"

LARGEST_BYTES = 256 << 20
"""Unpacked; the shipped table of 961 poses has 4 million."""

_DAMAGED = (
    *(ValueError, EOFError, KeyError, TypeError, SyntaxError, TokenError),
    *(NotImplementedError, RuntimeError, struct.error, zlib.error, zipfile.BadZipFile),
)
"""What zipfile raises of a damaged archive, and numpy of a damaged array's head."""

UNITS = "m, rad, N, N m, m/s^2; 6-vectors (translation; rotation) or (force; moment) at O in F"


def save_table(table: Table, path: str | Path) -> Table:
    """Write a table.

    `path`: ends in `.npz`; an older file is replaced only when the new one is complete, a device or
    pipe is written to.  Raises `TableError` if the file cannot be written.
    """
    path = Path(path)
    arrays = _to_arrays(table)
    checksum = _checksum(asdict(table.header), arrays)
    header = {
        "magic": MAGIC,
        "schema": SCHEMA,
        "units": UNITS,
        "geometry_sha256": table.geometry.sha256,
        "checksum": checksum,
        **asdict(table.header),
        "spline": {
            "kernel": KERNEL,
            "trend": TREND,
            "offset_rad": table.map_spline.offset.tolist(),
            "scale_rad": table.map_spline.scale.tolist(),
        },
    }
    # A stream, because numpy adds .npz to a name without it.
    with writing(path, TableError) as written, written.open("wb") as stream:
        np.savez_compressed(stream, header=np.array(json.dumps(header)), **arrays)  # type: ignore[arg-type]
    return replace(table, checksum=checksum)


def load_table(path: str | Path) -> Table:
    """Read a table and check it.

    `path`: a file that `save_table` wrote.  Gives `Table`: complete and with a checksum that fits.
    Raises `TableError` if the file is missing, no table, of another version, damaged or
    contradictory.
    """
    arrays = _read_arrays(path)
    try:
        header = json.loads(str(arrays.pop("header")))
    except (KeyError, ValueError, RecursionError) as error:
        raise TableError(f"{path}: not a table of this program (no header)") from error
    if not isinstance(header, dict) or header.get("magic") != MAGIC:
        raise TableError(f"{path}: not a table of this program")
    if header.get("schema") != SCHEMA:
        raise TableError(
            f"{path}: table of version {header.get('schema')!r}, this program reads {SCHEMA}; "
            "build it again with 'wrist-stiffness table build'"
        )
    try:
        values = {field.name: header[field.name] for field in fields(TableHeader)}
        checksum = _checksum(values, arrays)
        if checksum != header["checksum"]:
            stated = header["checksum"][:12]
            raise TableError(f"{path}: damaged: checksum {checksum[:12]}, its header says {stated}")
        table = _from_arrays(TableHeader(**values), arrays, checksum)
        if table.geometry.sha256 != header["geometry_sha256"]:
            raise TableError(f"{path}: geometry checksum does not fit the geometry in the header")
    except KeyError as error:
        raise TableError(f"{path}: damaged: {error} is missing") from error
    except TableError:
        raise
    except (WristError, ValueError, TypeError) as error:
        raise TableError(f"{path}: {error}") from error
    _check(table, path)
    return table


def _read_arrays(path: str | Path) -> dict[str, Array]:
    """Return what an `.npz` file holds, sizes checked before any of it is unpacked."""
    # Opened here, because numpy leaves a damaged file open.
    with open_input(path, TableError) as stream:
        try:
            with zipfile.ZipFile(stream) as archive:
                parts = archive.infolist()
                if (total := sum(part.file_size for part in parts)) > LARGEST_BYTES:
                    raise TableError(
                        f"{path}: states {total} bytes unpacked, more than {LARGEST_BYTES}"
                    )
                return {part.filename.removesuffix(".npy"): _array(archive, part) for part in parts}
        except OSError as error:
            raise TableError(f"{path}: cannot be read: {error.strerror or error}") from error
        except _DAMAGED as error:
            raise TableError(
                f"{path}: damaged or not a table: {' '.join(str(error).split())}"
            ) from error


def _array(archive: zipfile.ZipFile, part: zipfile.ZipInfo) -> Array:
    with archive.open(part) as stream:
        version = np.lib.format.read_magic(stream)
        if version != (1, 0):
            raise ValueError(f"{part.filename}: npy version {version} is not 1.0")
        shape, fortran, kind = np.lib.format.read_array_header_1_0(stream)
        if kind.hasobject:
            raise ValueError(f"{part.filename}: objects are not read")
        # Python's whole numbers, that do not overflow.
        if prod(shape) * kind.itemsize != part.file_size - stream.tell():
            raise ValueError(
                f"{part.filename}: shape {shape} is not that of its {part.file_size} bytes"
            )
        array = np.frombuffer(stream.read(), kind)
        return array.reshape(shape, order="F" if fortran else "C")


def _check(table: Table, path: str | Path) -> None:
    n, sectors = len(table.nodes), len(table.components.sectors.gap)
    for name, array, shape in (
        ("nodes", table.nodes, (n, 2)),
        ("operators", table.operators, (n, column_count(sectors))),
        ("map_values", table.map_values, (n, len(MAP_COLUMNS))),
        ("flexibility", table.components.flexibility, (len(ELASTIC), 6, 6)),
        ("mass", table.components.mass, (len(ELASTIC), 12, 12)),
    ):
        if array is None:
            continue
        if array.shape != shape:
            raise TableError(f"{path}: {name} has shape {array.shape}, not {shape}")
        if not np.all(np.isfinite(array)):
            raise TableError(f"{path}: {name} holds values that are not finite")
    if table.header.kernel != KERNEL:
        raise TableError(f"{path}: kernel {table.header.kernel!r} of the splines is not {KERNEL}")
    if table.header.evaluation not in EVALUATIONS:
        raise TableError(
            f"{path}: evaluation {table.header.evaluation!r} is not one of {EVALUATIONS}"
        )


_OF_TABLE = ("nodes", "operators", "map_values")
_OF_PARTS = ("flexibility", "weight_motor_side", "weight_platform_side", "platform_weight")


def _to_arrays(table: Table) -> dict[str, Array]:
    parts = table.components
    arrays = {name: getattr(table, name) for name in _OF_TABLE}
    arrays |= {name: getattr(parts, name) for name in _OF_PARTS}
    for joint, contact in parts.contact.items():
        for field in fields(FlangeContact):
            arrays[f"{joint}_{field.name}"] = getattr(contact, field.name)
    if parts.mass is not None:
        arrays["mass"] = parts.mass
    return arrays


def _from_arrays(header: TableHeader, arrays: Mapping[str, Array], checksum: str) -> Table:
    contact = {
        joint: FlangeContact(**{f.name: arrays[f"{joint}_{f.name}"] for f in fields(FlangeContact)})
        for joint in PASSIVE_JOINTS
        if f"{joint}_gap" in arrays
    }
    parts: dict[str, Any] = {name: arrays[name] for name in _OF_PARTS}
    components = ElasticComponents(**parts, contact=contact, mass=arrays.get("mass"))
    own: dict[str, Any] = {name: arrays[name] for name in _OF_TABLE}
    return Table(header, components, **own, checksum=checksum)


def _checksum(header: Mapping[str, Any], arrays: Mapping[str, Array]) -> str:
    digest = hashlib.sha256(json.dumps(header, sort_keys=True).encode())
    for name in sorted(arrays):
        array = np.ascontiguousarray(arrays[name])
        digest.update(f"{name} {array.dtype.str} {array.shape}".encode())
        digest.update(array.tobytes())
    return digest.hexdigest()
