"""Platform error from points on the platform, before and after the load.

Two fits for two kinds of points:

- `fit_platform_error` is the method of the paper (Palmieri 2015, section 4, Eqs. 1-10) for FEM
  readouts: unconstrained least squares, polar factor, mean of the point-wise shifts.  It needs
  points that are not coplanar.
- `fit_markers` is the constrained rigid fit for measured markers.  It tolerates coplanar points
  and lost markers, and noise disturbs it less because it never estimates the six strains.

Both return T_err with P_D = T_err P_U for points in the fixed axes of F, so the rotation is
R_err = R_D R_U^T (left-multiplied) and s is the shift of the platform's point at the origin O.
"""

from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike, NDArray
from scipy.spatial.transform import Rotation

from wrist_stiffness.errors import InputError
from wrist_stiffness.mechanism.vectors import vee

MIN_SPREAD_RATIO = 0.1
"""Smallest usable extent of the points relative to their largest (ratio of singular values)."""


@dataclass(frozen=True, eq=False)
class PlatformError:
    """Rigid motion of the platform from its nominal to its actual pose, about O in F."""

    shift: NDArray[np.float64]  # (..., 3), shift s of the platform's point at O [m]
    rotation: NDArray[np.float64]  # (..., 3, 3), R_err = R_D R_U^T, a proper rotation

    @property
    def shift_norm(self) -> NDArray[np.float64]:
        """Length of s, (...,) [m]."""
        return np.linalg.norm(self.shift, axis=-1)

    @property
    def phi(self) -> NDArray[np.float64]:
        """Angle of R_err in [0, pi], (...,) [rad].

        From sine and cosine together: the arccos of the trace alone loses every angle
        below 1e-8 rad.
        """
        r = self.rotation
        twice_sine = np.linalg.norm(vee(r), axis=-1)
        return np.arctan2(twice_sine, np.trace(r, axis1=-2, axis2=-1) - 1.0)


def fit_platform_error(points_undeformed: ArrayLike, points_deformed: ArrayLike) -> PlatformError:
    """Fit the platform error to FEM readouts, Eqs. (1)-(10) of Palmieri (2015).

    The fit works on the displacements and on centred points: with H their least-squares gradient,
    the first estimate of Eq. (4) is I + H.  Rounding then stays near 2e-16 rad in phi and, for
    points centimetres from O, 1e-17 m in s, wherever O lies; only the rounding of the given
    coordinates is added.

    `points_undeformed` (n, 3) or (..., n, 3): readout points of the rigid wrist in F [m], one set
    for all, or one per pose, four or more and not near a plane, as every geometry's are;
    `points_deformed` (..., n, 3): the same points under load in F [m].
    """
    undeformed = np.asarray(points_undeformed, dtype=float)
    deformed = np.asarray(points_deformed, dtype=float)
    displacement = deformed - undeformed
    gradient = np.swapaxes(np.linalg.pinv(_centred(undeformed)) @ displacement, -1, -2)  # Eq. (4)
    rotation = _nearest_rotation(np.eye(3) + gradient)  # Eq. (5)
    turned = undeformed @ np.swapaxes(rotation - np.eye(3), -1, -2)
    return PlatformError((displacement - turned).mean(axis=-2), rotation)  # Eqs. (8), (10)


def fit_markers(points_reference: ArrayLike, points_measured: ArrayLike) -> PlatformError:
    """Fit the platform error to measured markers: the rigid motion with the least squared misfit.

    `points_reference` (n, 3): nominal marker positions of the rigid wrist in F [m];
    `points_measured` (n, 3): measured positions in F [m]; a marker with any NaN coordinate is lost
    and left out.  Raises `InputError`: fewer than three markers seen, or markers near a line
    (second singular value of the centred points below `MIN_SPREAD_RATIO` of the first).
    """
    reference = np.asarray(points_reference, dtype=float)
    measured = np.asarray(points_measured, dtype=float)
    seen = ~np.isnan(measured).any(axis=-1)
    reference, measured = reference[seen], measured[seen]
    _require_spread(reference, "reference markers")
    _require_spread(measured, "measured markers")

    rotation = Rotation.align_vectors(_centred(measured), _centred(reference))[0].as_matrix()
    turned = reference.mean(axis=0) @ (rotation - np.eye(3)).T
    return PlatformError((measured - reference).mean(axis=0) - turned, rotation)


def _centred(points: NDArray[np.float64]) -> NDArray[np.float64]:
    return points - points.mean(axis=-2, keepdims=True)


def _nearest_rotation(matrix: NDArray[np.float64]) -> NDArray[np.float64]:
    """Orthogonal polar factor of (..., 3, 3) matrices, with det = +1."""
    u, _, vt = np.linalg.svd(matrix)
    # A reflection is no platform motion: turn the direction of the smallest singular value.
    u[..., :, 2] *= np.sign(np.linalg.det(u @ vt))[..., None]
    return u @ vt


def _require_spread(points: NDArray[np.float64], what: str) -> None:
    """Reject points (n, 3) of which a line does not tell all three rotations."""
    if len(points) < 3:
        raise InputError(f"{what}: {len(points)} given; at least 3 needed")
    largest, second, _ = np.linalg.svd(_centred(points), compute_uv=False)
    ratio = second / max(largest, np.finfo(float).tiny)
    if ratio < MIN_SPREAD_RATIO:
        raise InputError(
            f"{what}: they lie near a line: ratio of singular values {ratio:.3g}, "
            f"limit {MIN_SPREAD_RATIO}"
        )
