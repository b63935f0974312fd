"""Limits that several steps share (assumed, or kept because the benchmarks came out better)."""

FEWEST_UNITS = 12
"""From fewer units noise cannot be told from error, nor a lost beam from a good one."""

OUTLIER_LIMIT = 7.0
"""Robust standard deviations from a rich model beyond which a unit is lost."""

HELD_OUT = 0.2
"""Part of the units that judges where there is one session only."""
