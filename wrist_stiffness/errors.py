"""Every error that a user of the wrist can meet, under one base class.

A message is one line that names the value, the place and the limit.  The command line turns a
`WristError` into that line and exit code 2; a node turns it into a diagnostic and a safe output.
"""

import re
from collections.abc import Iterable
from difflib import get_close_matches

DECIMAL_COMMA = re.compile(r"[+-]?\d+,\d+([eE][+-]?\d+)?")


def with_a_point(text: str) -> str:
    """Return what to say, behind what is wrong, of a number with a decimal comma; empty if none."""
    if not DECIMAL_COMMA.fullmatch(text.strip()):
        return ""
    return f": write {text.strip().replace(',', '.')}, with a decimal point"


def meant(name: str, known: Iterable[str]) -> str:
    """Return what to say, behind a name that is not known, of the one most like it; else empty."""
    near = get_close_matches(name, list(known), 1)
    return f"; did you mean {near[0]}?" if near else ""


class WristError(Exception):
    """Base of all errors that have an answer outside the code."""


class InputError(WristError):
    """A value that somebody typed or sent is not usable (NaN, missing joint, wrong shape)."""


class GeometryError(WristError):
    """A geometry file is incomplete, contradictory or outside its limits."""


class UnreachablePoseError(WristError):
    """The five-bar does not close at these angles, or the platform normal is out of reach."""


class SingularPoseError(WristError):
    """The pose is nearer to a singularity than the geometry file allows."""


class LoadRangeError(WristError):
    """A load is outside the range for which the table was made."""


class FrameError(WristError):
    """A message is expressed in a frame that is neither known nor mapped."""


class TableError(WristError):
    """A table is damaged, foreign, of another version or of another geometry."""


class RecordingError(WristError):
    """A recording cannot be read or written as asked."""


class StaleLoadError(InputError):
    """No load estimate belongs to a joint state: none yet, or the newest is too old."""


class StaleCommandError(InputError):
    """A command is too old to be obeyed: it waited while the node, or its sender, was held up."""
