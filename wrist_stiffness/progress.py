"""How what takes long says how far it is."""

from collections.abc import Callable

Progress = Callable[[int, int], None]
"""Told steps done and all steps."""


def silent(done: int, total: int) -> None:
    """Show no progress."""
