"""Colours that people with any colour vision tell apart (Okabe and Ito)."""

COLOURS = ("#0072b2", "#d55e00", "#009e73", "#cc79a7", "#e69f00", "#56b4e9")
"""For series, in their order; more repeat."""

FLOOR = "#444444"
"""For what noise alone does."""


def colour(number: int) -> str:
    """Return the colour of a series."""
    return COLOURS[number % len(COLOURS)]
