"""Where an instrument stands and how its target sits, told by the motion of the wrist itself."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from wrist_stiffness.errors import InputError
from wrist_stiffness.mechanism.components import Array
from wrist_stiffness.mechanism.vectors import block_diagonal
from wrist_stiffness.sessions.reading.registration import agreement, places_of, turns_of


@dataclass(frozen=True, eq=False)
class Registration:
    """How an instrument sees the wrist: position X (R q) + X o, rotation X R Y, with R rigid."""

    # `instrument`, `target`: (3, 3), X and Y: the turn of F as the instrument sees it, and of the
    # target on the platform
    instrument: Array
    target: Array
    # `origin`, `place`: (3,), o and q: O from the instrument, in the axes of F; the target in U [m]
    origin: Array
    place: Array

    def in_base(self, shift: Array, rotation: Array) -> tuple[Array, Array]:
        """Return positions (n, 3) of O in F [m] and rotations (n, 3, 3) U -> F."""
        turned = self.instrument.T @ rotation @ self.target.T
        return shift @ self.instrument - self.origin - turned @ self.place, turned

    def covariance(self, stated: Array) -> Array:
        """Return a covariance (6, 6) of the instrument's axes in those of F."""
        axes = block_diagonal(self.instrument.T)
        return np.asarray(axes @ stated @ axes.T)

    def __str__(self) -> str:
        """Say where the instrument stands, to be checked in the cell."""
        cosine = np.clip(0.5 * (np.trace(self.instrument) - 1.0), -1.0, 1.0)
        stand, sits = (
            ", ".join(f"{1e3 * each:.0f}" for each in place) for place in (-self.origin, self.place)
        )
        return (
            f"the instrument was registered by angles and poses: it stands at ({stand}) mm in "
            f"wrist_base, turned by {np.degrees(np.arccos(cosine)):.1f} deg, and its target sits "
            f"at ({sits}) mm on the platform"
        )


def registered(shift: Array, rotation: Array, rigid: Array) -> Registration:
    """Return where an instrument stands, in closed form.

    `shift` (n, 3): measured positions of the target [m]; NaN = not measured.  `rotation` (n, 3, 3):
    measured rotations; NaN = not measured.  `rigid` (n, 3, 3): rotations U -> F of the rigid wrist.
    Raises `InputError` if no pose has both, or the platform turned about one axis only.
    """
    known = np.isfinite(rotation).all(axis=(1, 2)) & np.isfinite(shift).all(axis=1)
    if not known.any():
        raise InputError(
            "an instrument of which nobody knows where it stands needs positions and rotations of "
            "the same poses, or three markers; map its frame"
        )
    seen, said = rotation[known], rigid[known]
    instrument, target = (each.as_matrix() for each in turns_of(seen, said))
    swing = said @ said[0].T
    axes = np.stack(
        [
            swing[:, 2, 1] - swing[:, 1, 2],
            swing[:, 0, 2] - swing[:, 2, 0],
            swing[:, 1, 0] - swing[:, 0, 1],
        ],
        axis=1,
    )  # twice the sine about each axis
    spread = np.linalg.svd(axes, compute_uv=False) / (2.0 * np.sqrt(len(axes)))
    misfit = agreement(seen, said).misfit_turned
    if spread[1] <= misfit:
        raise InputError(
            f"the platform turned by {np.degrees(spread[1]):.2g} deg (RMS) about a second axis, "
            f"poses are off by {np.degrees(misfit):.2g} deg: too little to tell where the "
            "instrument stands; move both motors, or map its frame"
        )
    place, origin = places_of(shift[known] @ instrument, said)
    return Registration(instrument, target, origin, place)
