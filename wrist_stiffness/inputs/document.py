"""YAML and JSON as nodes that know their place.

YAML is read event by event, without recursion, at some 3 MB/s.  What only a program needs is
refused: tags, anchors and aliases (483 bytes of them can stand for a gigabyte), a second document,
keys that are no texts, a key given twice.  A date is a text.
"""

from __future__ import annotations

import json
from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import yaml

from wrist_stiffness.errors import WristError
from wrist_stiffness.inputs.opening import read_text

LARGEST_BYTES = 4 << 20
"""A model with twenty thousand recordings in its lineage has half of it."""
DEEPEST = 32
LONGEST_NUMBER = 400
"""Characters; any double can be written out in fewer."""

_Loader = getattr(yaml, "CSafeLoader", yaml.SafeLoader)
_NUMBERS = yaml.constructor.SafeConstructor()
_READ_AS = {
    "tag:yaml.org,2002:null": _NUMBERS.construct_yaml_null,
    "tag:yaml.org,2002:bool": _NUMBERS.construct_yaml_bool,
    "tag:yaml.org,2002:int": _NUMBERS.construct_yaml_int,
    "tag:yaml.org,2002:float": _NUMBERS.construct_yaml_float,
}
"""What a plain scalar may be; anything else is a text."""


@dataclass(frozen=True, slots=True, eq=False)
class Node:
    """One value of a file."""

    # None, bool, int, float, str, list of Node or dict of str to Node
    value: Any
    file: str  # as error messages name it
    path: str  # keys down to here, joined by points; empty for the whole file
    line: int  # where it begins, from 1; 0 where that is not known
    error: type[WristError]  # of whatever reads the file

    @property
    def place(self) -> str:
        """File, line and keys."""
        line = f", line {self.line}" if self.line and self.path else ""
        return f"{self.file}{line}" + (f": {self.path}" if self.path else "")

    def refuse(self, why: str) -> WristError:
        """Return the error that names this place."""
        return self.error(f"{self.place}: {why}")

    def __getitem__(self, key: str) -> Node:
        """Return the node at a key that is there."""
        return self.value[key]

    @property
    def plain(self) -> Any:
        """The value without places: lists and dicts of plain values."""
        if isinstance(self.value, dict):
            return {key: node.plain for key, node in self.value.items()}
        if isinstance(self.value, list):
            return [node.plain for node in self.value]
        return self.value


def read_yaml(path: str | Path, error: type[WristError]) -> Node:
    """Read the one document of a YAML file; that of an empty file holds None.

    Raises `WristError`: of the given type, here and in the schema that reads the nodes: if the file
    cannot be read, is too large, is not YAML, or has something in it that this module refuses.
    """
    return yaml_node(read_text(path, error, LARGEST_BYTES), str(path), error)


def read_json(path: str | Path, error: type[WristError]) -> Node:
    """Read a JSON file; as `read_yaml`, without lines."""
    text = read_text(path, error, LARGEST_BYTES)
    try:
        return node_of(json.loads(text), str(path), error)
    except (ValueError, RecursionError) as cause:
        raise error(f"{path}: not a JSON file: {cause}") from cause


def node_of(value: Any, file: str, error: type[WristError], path: str = "") -> Node:
    """Return values that no longer are in a file as nodes, without lines."""
    if isinstance(value, Mapping):
        value = {
            str(key): node_of(inner, file, error, _joined(path, str(key)))
            for key, inner in value.items()
        }
    elif isinstance(value, list | tuple):
        value = [
            node_of(inner, file, error, f"{path}[{index}]") for index, inner in enumerate(value)
        ]
    return Node(value, file, path, 0, error)


def yaml_node(text: str, file: str, error: type[WristError]) -> Node:
    """Read a YAML text; as `read_yaml`, `file` is what error messages call it."""
    try:
        return _Builder(file, error).build(yaml.parse(text, Loader=_Loader))
    except (yaml.YAMLError, UnicodeError) as cause:
        raise error(f"{file}: not a YAML file: {' '.join(str(cause).split())}") from cause


def _joined(path: str, key: str) -> str:
    return f"{path}.{key}" if path else key


class _Builder:
    """Puts the events of one document together; the containers not yet closed are a stack."""

    def __init__(self, file: str, error: type[WristError]) -> None:
        self._file = file
        self._error = error
        self._open: list[Node] = []
        # Of each open mapping the key whose value comes next.
        self._keys: list[str | None] = []
        self._root = Node(None, file, "", 0, error)

    def build(self, events: Iterator[Any]) -> Node:
        documents = 0
        for event in events:
            if isinstance(event, yaml.DocumentStartEvent):
                documents += 1
                if documents > 1:
                    raise self._refused(event, "a second document is not read")
            elif isinstance(event, yaml.AliasEvent):
                raise self._refused(event, "aliases are not read, write the value out")
            elif isinstance(event, yaml.NodeEvent):
                self._begin(event)
            elif isinstance(event, yaml.CollectionEndEvent):
                self._open.pop()
                self._keys.pop()
        return self._root

    def _begin(self, event: Any) -> None:
        if event.anchor is not None:
            raise self._refused(event, f"anchor &{event.anchor} is not read")
        if event.tag is not None:
            raise self._refused(event, f"tag {event.tag} is not read")
        is_scalar = isinstance(event, yaml.ScalarEvent)
        in_mapping = bool(self._open) and isinstance(self._open[-1].value, dict)
        if in_mapping and self._keys[-1] is None:
            if not is_scalar:
                raise self._refused(event, "a key is a list or a mapping, not a text")
            if event.value in self._open[-1].value:
                raise self._refused(event, f"key {event.value!r} is given twice")
            self._keys[-1] = event.value
            return
        if len(self._open) >= DEEPEST:
            raise self._refused(event, f"nested deeper than {DEEPEST}")
        empty: Any = {} if isinstance(event, yaml.MappingStartEvent) else []
        value = self._scalar(event) if is_scalar else empty
        node = Node(value, self._file, self._path(), event.start_mark.line + 1, self._error)
        if not self._open:
            self._root = node
        elif in_mapping:
            self._open[-1].value[self._keys[-1]] = node
            self._keys[-1] = None
        else:
            self._open[-1].value.append(node)
        if not is_scalar:
            self._open.append(node)
            self._keys.append(None)

    def _path(self) -> str:
        if not self._open:
            return ""
        parent = self._open[-1]
        if isinstance(parent.value, list):
            return f"{parent.path}[{len(parent.value)}]"
        return _joined(parent.path, str(self._keys[-1]))

    def _scalar(self, event: Any) -> Any:
        if event.style in ("'", '"', "|", ">") or len(event.value) > LONGEST_NUMBER:
            return event.value
        first = event.value[:1]
        for tag, pattern in yaml.SafeLoader.yaml_implicit_resolvers.get(first, []):
            if tag in _READ_AS and pattern.match(event.value):
                try:
                    return _READ_AS[tag](yaml.ScalarNode(tag, event.value))
                except ValueError as cause:
                    raise self._refused(event, f"{event.value} is no number") from cause
        return event.value

    def _refused(self, event: Any, why: str) -> WristError:
        return self._error(f"{self._file}, line {event.start_mark.line + 1}: {why}")
