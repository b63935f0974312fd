"""What all messages share (see `messages.py`)."""

from __future__ import annotations

from dataclasses import field
from typing import Any, ClassVar

MSG_LINE = "msg_line"


def line(text: str, default: Any) -> Any:
    """Declare one field of a message.

    `text`: line of the ``.msg`` file: type, name and, where the file has one, the default value;
    `default`: value in Python where none is given; immutable.
    """
    return field(default=default, metadata={MSG_LINE: text})


class Message:
    """Base of all messages; `ros_type` is the full type name, ``package/msg/Type``."""

    __slots__ = ()
    ros_type: ClassVar[str]
    constants: ClassVar[tuple[str, ...]] = ()
