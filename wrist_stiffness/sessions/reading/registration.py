"""Where an instrument stands and how its target sits, told by the motion of the wrist itself."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy.spatial.transform import Rotation

from wrist_stiffness.errors import InputError
from wrist_stiffness.lookup.table import Table
from wrist_stiffness.mechanism.components import Array
from wrist_stiffness.mechanism.rigid_motion import rotation_vector
from wrist_stiffness.mechanism.vectors import block_diagonal, vee
from wrist_stiffness.sessions.in_pieces import in_pieces, rigid_rotation

POSES_USED = 1000

ROUNDS = 4
"""After which registrations change no more."""

SOUND = 3.0
"""Times the median misfit up to which a measurement has a full say in a registration."""


@dataclass(frozen=True)
class Agreement:
    """How well measured rotations follow rigid ones, the target turned on the platform as fits."""

    misfit: float  # median angle that is left with the instrument as it stands [rad]
    misfit_turned: float  # the same with the instrument turned as fits best [rad]
    turn: float  # angle of that turn [rad]


def agreement(measured: Array, rigid: Array) -> Agreement:
    """Compare measured with rigid rotations U -> F, both (n, 3, 3) and finite."""
    used = np.unique(np.linspace(0, len(measured) - 1, POSES_USED).astype(int))
    seen, said = Rotation.from_matrix(measured[used]), Rotation.from_matrix(rigid[used])
    turn = _instrument(seen, said, np.ones(len(used)))
    seen, said = seen * seen.mean().inv(), said * said.mean().inv()
    turned = turn * said * turn.inv()
    return Agreement(
        float(np.median((seen * said.inv()).magnitude())),
        float(np.median((seen * turned.inv()).magnitude())),
        float(turn.magnitude()),
    )


def _instrument(seen: Rotation, said: Rotation, weight: Array) -> Rotation:
    """Return the turn X of the instrument in F that fits best.

    With X and a turn Y of the target on the platform, measured is X rigid Y.  So the rotations from
    the mean of one side are those of the other, turned by X alone.
    """
    measured, rigid = ((each * each.mean(weight).inv()).as_rotvec() for each in (seen, said))
    left, _, right = np.linalg.svd((weight * measured.T) @ rigid)
    left[:, 2] *= np.linalg.det(left @ right)
    return Rotation.from_matrix(left @ right)


def put_right(measured: Array, theta: Array, table: Table, limit: float) -> str:
    """Return what to change so that rotations agree, empty for nothing known.

    `measured` (n, 3, 3): U -> F, finite; `theta` (n, 2): motor angles as they were recorded [rad];
    `limit`: largest misfit of rotations that agree [rad].
    """
    w_first = Rotation.from_quat(Rotation.from_matrix(measured).as_quat()[:, [1, 2, 3, 0]])
    changes = (
        ("the motors swapped", measured, theta[:, ::-1]),
        ("the sign of motor 1 turned", measured, theta * [-1.0, 1.0]),
        ("the sign of motor 2 turned", measured, theta * [1.0, -1.0]),
        ("both signs turned", measured, -theta),
        ("angles taken as degrees", measured, np.radians(theta)),
        ("the angles of a table's _deg columns taken as radians", measured, np.degrees(theta)),
        ("quaternions taken in the order w x y z", w_first.as_matrix(), theta),
        ("the rotations taken from base to platform", np.swapaxes(measured, 1, 2), theta),
    )
    # Small turns nearly agree with both signs turned and taken the other way round.
    best, said = limit, ""
    for change, rotation, angles in changes:
        if table.mechanism.reachable(angles).all():
            misfit = agreement(rotation, rigid_rotation(table, angles)).misfit
            if misfit < best:
                best, said = misfit, change
    return said


def turns_of(measured: Array, rigid: Array) -> tuple[Rotation, Rotation]:
    """Return the turns X of the instrument and Y of its target, measured being X rigid Y.

    Both are (n, 3, 3) float and finite; a few wild ones do no harm.
    """
    used = np.unique(np.linspace(0, len(measured) - 1, POSES_USED).astype(int))
    seen, said = Rotation.from_matrix(measured[used]), Rotation.from_matrix(rigid[used])
    weight = np.ones(len(used))
    for _ in range(ROUNDS):
        instrument = _instrument(seen, said, weight)
        target = (said.inv() * instrument.inv() * seen).mean(weight)
        off = (seen * (instrument * said * target).inv()).magnitude()
        # All keep a say: at rest the misfit is least, and it is motion that tells the instrument.
        weight = 1.0 / (off**2 + (SOUND * np.median(off)) ** 2 + np.finfo(float).eps)
    return instrument, target


def turn_left(measured: Array, rigid: Array) -> Array:
    """Return what constant turns of instrument and target leave of measured rotations.

    `measured`, `rigid` (n, 3, 3): U -> F; measured ones are NaN where they are not.  Gives (n, 3):
    rotation vectors in F, from rigid to measured with the instrument and the target turned back
    [rad].
    """
    known = np.flatnonzero(np.isfinite(measured).all(axis=(1, 2)))
    if len(known) == 0:
        return np.full((len(measured), 3), np.nan)
    instrument, target = turns_of(measured[known], rigid[known])
    back, and_back = instrument.inv().as_matrix(), target.inv().as_matrix()
    return in_pieces(
        lambda here, there: rotation_vector(back @ here @ and_back @ np.swapaxes(there, 1, 2)),
        measured,
        rigid,
    )


def place_left(shift: Array, rigid: Array) -> tuple[Array, Array]:
    """Return what a constant place of the target in U and one in F leave of positions.

    `shift` (n, 3): measured positions [m]; NaN = not measured; `rigid` (n, 3, 3): U -> F.  Gives
    `left` (n, 3): [m], and `target` (3,): that place in U, as far as motion tells it [m].
    """
    target, origin = places_of(shift, rigid)
    return shift - rigid @ target - origin, target


def places_of(shift: Array, rigid: Array) -> tuple[Array, Array]:
    """Return the place of the target in U and of O where it is measured, (3,) and (3,) [m].

    Of positions (n, 3), NaN = not measured, and rotations (n, 3, 3); a few wild ones do no harm.
    """
    used = np.unique(np.linspace(0, len(shift) - 1, POSES_USED).astype(int))
    places = np.concatenate([rigid[used], np.tile(np.eye(3), (len(used), 1, 1))], axis=2)
    design, seen = places.reshape(-1, 6), shift[used].ravel()
    good = np.isfinite(seen)
    fitted = np.zeros(6)
    for _ in range(ROUNDS if good.any() else 0):
        fitted = np.linalg.lstsq(design[good], seen[good], rcond=None)[0]
        off = np.abs(seen - design @ fitted)
        # A lost beam is far beyond three times the median of what is left.
        good = off <= SOUND * np.nanmedian(off)
    return fitted[:3], fitted[3:]


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
        turn = np.degrees(Rotation.from_matrix(self.instrument).magnitude())
        stand, sits = (
            ", ".join(f"{1e3 * each:.0f}" for each in place) for place in (-self.origin, self.place)
        )
        return (
            f"the instrument was registered by angles and poses: it stands at ({stand}) mm in "
            f"wrist_base, turned by {turn:.1f} deg, and its target sits "
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
            "points alone do not tell where the instrument stands: measure rotations as well, or "
            "three markers, or points in the axes of wrist_base (a table: import without "
            "--register)"
        )
    seen, said = rotation[known], rigid[known]
    instrument, target = (each.as_matrix() for each in turns_of(seen, said))
    axes = vee(said @ said[0].T)  # twice the sine about each axis
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
