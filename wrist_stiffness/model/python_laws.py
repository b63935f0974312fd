"""Whether models may name Python files as laws: such a file is run as a program."""

from __future__ import annotations

import os
from collections.abc import Iterator
from contextlib import contextmanager

from wrist_stiffness.errors import InputError

ALLOWED = "WRIST_STIFFNESS_ALLOW_PYTHON_LAWS"
"""Environment variable: what a command may run, the processes that it starts may run."""


@contextmanager
def python_laws(allowed: bool) -> Iterator[None]:
    """Let models name Python files as laws, or leave it as it was."""
    before = os.environ.get(ALLOWED, "")
    os.environ[ALLOWED] = "1" if allowed else before
    try:
        yield
    finally:
        os.environ[ALLOWED] = before


def require_python_laws(reference: str) -> None:
    """Refuse the Python file that a model names, unless somebody said that it may be run.

    Raises `InputError` with how to say so.
    """
    if os.environ.get(ALLOWED) != "1":
        raise InputError(
            f"{reference} is a program, and none is run unasked: if you trust it, "
            "allow_python_laws (a node's parameter) or --allow-python-laws (a command's option)"
        )
