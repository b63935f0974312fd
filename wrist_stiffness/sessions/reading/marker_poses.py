"""Platform poses from measured markers, for a whole recording at once."""

from __future__ import annotations

import numpy as np

from wrist_stiffness.lookup.readout import MIN_SPREAD_RATIO
from wrist_stiffness.mechanism.components import Array

LEAST_MARKERS = 3

MIRROR_SHARE = 0.5
"""Of markers in a plane the mirror image is a motion too: then both misfits are noise."""


def poses_from_markers(nominal: Array, measured: Array) -> tuple[Array, Array]:
    """Return the rigid motions with the least squared misfit (Kabsch), as `fit_markers` does.

    `nominal` (k, 3): markers in U [m]; `measured` (n, k, 3): in F [m]; a marker with any NaN is
    lost.  Gives `shift` (n, 3): position of the platform's point O in F [m], and `rotation` (n, 3,
    3): U -> F.  NaN where fewer than three markers were seen or these lie near a line.
    """
    seen = np.isfinite(measured).all(axis=2)
    shift, rotation = np.full((len(measured), 3), np.nan), np.full((len(measured), 3, 3), np.nan)
    # One fit for each set of markers that were seen together.
    patterns, belongs = np.unique(seen, axis=0, return_inverse=True)
    for number, pattern in enumerate(patterns):
        if pattern.sum() < LEAST_MARKERS:
            continue
        reference = nominal[pattern] - nominal[pattern].mean(axis=0)
        sigma = np.linalg.svd(reference, compute_uv=False)
        if sigma[1] < MIN_SPREAD_RATIO * sigma[0]:
            continue
        rows = np.flatnonzero(belongs.reshape(-1) == number)
        points = measured[rows][:, pattern]
        centre = points.mean(axis=1)
        correlation = np.swapaxes(points - centre[:, None], 1, 2) @ reference
        left, _, right = np.linalg.svd(correlation)
        # A reflection is no motion: turn the direction that the markers tell least about.
        left[:, :, 2] *= np.sign(np.linalg.det(left @ right))[:, None]
        rotation[rows] = left @ right
        shift[rows] = centre - rotation[rows] @ nominal[pattern].mean(axis=0)
    return shift, rotation


def mirrored(nominal: Array, measured: Array) -> bool:
    """Tell whether measured markers, as in `poses_from_markers`, are those of a mirror image."""
    motion, mirror = (_misfit(nominal, sign * measured) for sign in (1.0, -1.0))
    return mirror < MIRROR_SHARE * motion


def _misfit(nominal: Array, measured: Array) -> float:
    """Return the median misfit of a rigid motion [m]; infinite where there is none."""
    shift, rotation = poses_from_markers(nominal, measured)
    off = measured - nominal @ np.swapaxes(rotation, 1, 2) - shift[:, None]
    known = np.linalg.norm(off[np.isfinite(off).all(axis=2)], axis=1)
    return float(np.median(known)) if len(known) else np.inf
