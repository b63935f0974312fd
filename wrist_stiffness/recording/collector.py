"""Rows of one topic, collected from its payloads, and what was wrong with them."""

from __future__ import annotations

from collections import defaultdict
from collections.abc import Callable
from dataclasses import dataclass, field
from typing import Any

import numpy as np
from numpy.typing import NDArray

from wrist_stiffness.recording.fixed_layout import Batch, decode_batches
from wrist_stiffness.recording.mcap_chunk import Payloads
from wrist_stiffness.recording.messages import (
    JointState,
    Message,
    PoseArray,
    String,
    Temperature,
)

FloatArray = NDArray[np.float64]
TimeArray = NDArray[np.int64]
Rows = dict[str, NDArray[Any]]
"""Columns by name, all of one length."""


@dataclass(frozen=True)
class Fault:
    """What was wrong with `count` messages of a topic, first at a log time [ns]."""

    topic: str
    kind: str
    count: int
    first_log_time_ns: int

    def __str__(self) -> str:
        """Return the fault as one line."""
        return f"{self.topic}: {self.count} × {self.kind}, first at {self.first_log_time_ns} ns"


Extract = Callable[[Batch], Rows | str]
"""Takes a batch; returns its rows, or the name of the fault for which it has none."""
IGNORED = "names none of the joints"
_MISSING_JOINT = "joint missing"
_MARKER_COUNT = "other number of markers than at first"
_OTHER_GAUGES = "other gauges than at first"


def stacked(**paths: tuple[str, ...]) -> Extract:
    """Return the extraction of columns beside each other, (m, k) of k attribute paths by name."""
    return lambda batch: {name: _stack(batch, *parts) for name, parts in paths.items()}


def single(path: str) -> Extract:
    """Return the extraction of the numbers at an attribute path as ``value`` (m,)."""
    return lambda batch: {"value": batch.columns[path]}


def _stack(batch: Batch, *paths: str) -> FloatArray:
    return np.stack([batch.columns[path] for path in paths], axis=1)


def xyz(prefix: str) -> tuple[str, ...]:
    """Return the attribute paths of a vector's components."""
    return tuple(f"{prefix}.{axis}" for axis in "xyz")


def joint_rows(joints: tuple[str, ...]) -> Extract:
    """Return the extraction of named joints from joint states, in the order of the names.

    `joints`: names; other joints are ignored.  Its rows have position and velocity, each (m, number
    of joints).
    """

    def extract(batch: Batch) -> Rows | str:
        message = batch.first
        assert isinstance(message, JointState)  # the collector decodes this type only
        found = [message.name.index(joint) for joint in joints if joint in message.name]
        if not found:
            return IGNORED
        if len(found) < len(joints) or len(message.position) != len(message.name):
            return _MISSING_JOINT
        velocity = np.full((batch.indices.size, len(joints)), np.nan)
        if len(message.velocity) == len(message.name):
            velocity = batch.columns["velocity"][:, found]
        return {"position": batch.columns["position"][:, found], "velocity": velocity}

    return extract


def pose_rows(prefix: str) -> Extract:
    """Return the extraction of poses at an attribute path, with covariance where it has one."""

    def extract(batch: Batch) -> Rows:
        rows = {
            "position": _stack(batch, *xyz(f"{prefix}.position")),
            "quaternion": _stack(batch, *xyz(f"{prefix}.orientation"), f"{prefix}.orientation.w"),
        }
        if "pose.covariance" in batch.columns:
            rows["covariance"] = batch.columns["pose.covariance"].reshape(-1, 6, 6)
        return rows

    return extract


def marker_rows() -> Extract:
    """Return the extraction of markers (m, k, 3) [m]; the first message sets k."""
    expected: list[int] = []

    def extract(batch: Batch) -> Rows | str:
        assert isinstance(batch.first, PoseArray)  # the collector decodes this type only
        count = len(batch.first.poses)
        expected.append(count)
        if count != expected[0]:
            return _MARKER_COUNT
        if not count:
            return {"position": np.empty((batch.indices.size, 0, 3))}
        paths = [xyz(f"poses.{marker}.position") for marker in range(count)]
        return {"position": np.stack([_stack(batch, *path) for path in paths], axis=1)}

    return extract


def gauge_rows() -> Extract:
    """Return the extraction of readings (m, k) [m, rad] by name; the first message sets names."""
    expected: list[tuple[str, ...]] = []

    def extract(batch: Batch) -> Rows | str:
        message = batch.first
        assert isinstance(message, JointState)  # the collector decodes this type only
        expected.append(message.name)
        if message.name != expected[0] or len(message.position) != len(message.name):
            return _OTHER_GAUGES
        names = np.tile(np.array(message.name, np.str_), (batch.indices.size, 1))
        return {"value": batch.columns["position"], "names": names}

    return extract


def text_rows(batch: Batch) -> Rows:
    """Return texts (m,)."""
    assert isinstance(batch.first, String)  # the collector decodes this type only
    return {"text": np.full(batch.indices.size, batch.first.data)}


@dataclass
class Collector:
    """Rows and faults of one topic."""

    topic: str  # name in the recording
    message_type: type[Message]  # class of its messages
    extract: Extract  # makes rows of a batch
    # columns in which NaN is a fault; a lost marker or an absent velocity is none
    finite: tuple[str, ...]
    blocks: list[Rows] = field(default_factory=list)  # rows so far
    # log times [ns] of the messages that gave no row, by kind of fault
    counts: dict[str, list[int]] = field(default_factory=lambda: defaultdict(list))

    def add(self, times: TimeArray, payloads: Payloads) -> None:
        """Append payloads with their log times [ns]."""
        batches, undecodable = decode_batches(self.message_type, payloads)
        self._count("payload cannot be decoded", times[undecodable])
        parts: list[Rows] = []
        order: list[NDArray[np.intp]] = []
        for batch in batches:
            rows = self.extract(batch)
            if isinstance(rows, str):
                self._count(rows, times[batch.indices])
                continue
            stamps = batch.columns.get("header.stamp_ns", times[batch.indices])
            frame = batch.first.header.frame_id if hasattr(batch.first, "header") else ""
            parts.append(
                {
                    "time_ns": stamps,
                    "log_time_ns": times[batch.indices],
                    "frame_id": np.full(batch.indices.size, frame),
                    **rows,
                }
            )
            order.append(batch.indices)
        if len(parts) == 1:
            self.blocks.extend(parts)
        elif parts:
            received = np.argsort(np.concatenate(order))
            self.blocks.append({key: value[received] for key, value in _joined(parts).items()})

    def rows(self) -> Rows:
        """Return all rows in the order of reception, an empty dict without any."""
        if not self.blocks:
            return {}
        rows = _joined(self.blocks)
        if np.any(np.diff(rows["log_time_ns"]) < 0):
            received = np.argsort(rows["log_time_ns"], kind="stable")
            rows = {key: value[received] for key, value in rows.items()}
        self.blocks = [rows]
        return rows

    def faults(self) -> list[Fault]:
        """Return what was wrong, one entry for each kind."""
        rows = self.rows()
        found = defaultdict(list, {kind: [*own] for kind, own in self.counts.items()})
        found.pop(IGNORED, None)
        if rows:
            log_times = rows["log_time_ns"]
            for name in self.finite:
                values = rows[name].reshape(log_times.size, -1)
                found[f"{name} not finite"] += log_times[~np.isfinite(values).all(axis=1)].tolist()
            for own in self._of_one_clock(rows):
                step, later = np.diff(rows["time_ns"][own]), log_times[own][1:]
                found["stamp repeated"] += later[step == 0].tolist()
                found["stamp running backwards"] += later[step < 0].tolist()
        return [
            Fault(self.topic, kind, len(times), min(times))
            for kind, times in found.items()
            if times
        ]

    def _of_one_clock(self, rows: Rows) -> list[Any]:
        """Return which rows have stamps that must rise."""
        if self.message_type is Temperature:  # one topic serves several components
            return [rows["frame_id"] == name for name in np.unique(rows["frame_id"])]
        return [] if self.message_type is String else [slice(None)]

    def _count(self, kind: str, times: TimeArray) -> None:
        if times.size:
            self.counts[kind].extend(times.tolist())


def _joined(parts: list[Rows]) -> Rows:
    if len(parts) == 1:
        return parts[0]
    return {key: np.concatenate([part[key] for part in parts]) for key in parts[0]}
