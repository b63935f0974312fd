"""Numbers as a person reads them."""

from __future__ import annotations

import math


def number(value: float, digits: int = 3) -> str:
    """Return significant digits, without an exponent where a person writes none; NaN is -."""
    if math.isnan(value):
        return "-"
    text = f"{value:.{digits}g}"
    return f"{value:.0f}" if "e+" in text and abs(value) < 1e6 else text


def plus_minus(value: float, sigma: float) -> str:
    """Return a value and its uncertainty with two digits of the latter."""
    digits = 3
    if math.isfinite(sigma) and sigma > 0.0:
        digits = min(max(1 - math.floor(math.log10(sigma)), 0), 9)
    return f"{round(value, digits) + 0.0:.{digits}f} +- {sigma:.{digits}f}"


def percent(share: float) -> str:
    """Return a probability or share with as many digits as it needs: 7 %, 99 %, 99.9 %."""
    value = 100.0 * share
    if value > 99.0:
        # Not rounded up: nothing is certain.
        return "over 99.9 %" if value > 99.9 else f"{value:.1f} %"
    return f"{value:.0f} %" if value >= 1.0 else "under 1 %"
