"""The same kinematics, statics and contact, compiled: for streams and for blocks of samples.

For one pose a NumPy call costs more than its arithmetic, and for many the operators fill memory.
`native/` holds the formulas of `kinematics`, `statics`, `contact` and `rigid_motion` for one pose
in C; these stay their judges, serve where no compiler was at hand, and say why a pose cannot be
served.  A block of samples is the same code in a loop, so live nodes and replay agree to the bit.
"""

from __future__ import annotations

from copy import copy
from importlib import import_module
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from wrist_stiffness.mechanism.components import CARRIER, ELASTIC, Array, ElasticComponents
from wrist_stiffness.mechanism.configuration import BODIES, Configuration
from wrist_stiffness.mechanism.geometry import Limits
from wrist_stiffness.mechanism.influence import LIMB_1, LIMB_2
from wrist_stiffness.mechanism.kinematics import GRAM_ROUNDING, Mechanism
from wrist_stiffness.mechanism.vectors import skew

GROUPS = tuple(
    tuple(name for name in limb if CARRIER[name] == body)
    for limb, body in (
        (LIMB_1, "frame"),
        (LIMB_1, "link_1"),
        (LIMB_2, "frame"),
        (LIMB_2, "link_2"),
        (LIMB_2, "link_3"),
    )
)
"""Elastic components that lie in one limb and turn with one body."""


OF_LOAD = slice(3, 10)
OF_SCREWS = slice(10 + len(GROUPS) * (36 + 18), 10 + len(GROUPS) * (36 + 18 + 6))
SECTOR = 14
"""In `Parts` of `native/wrist.h`: factor and addition to the load, constant screws, numbers of a
sector, of which the last one is its gap."""


def mechanism_constants(
    mechanism: Mechanism, rectangle: tuple[Array, Array], limits: Limits
) -> Array:
    """Return what `native` must know of a kinematic scheme and its domain."""
    turn = np.zeros((24, 5))
    driven = np.stack([mechanism.b0, mechanism.d0])
    axes = np.stack([mechanism.a1, mechanism.a2])
    for i in range(2):
        along = np.outer(axes[i], axes[i])
        parts = np.stack([along, np.eye(3) - along, skew(axes[i])], axis=-1)
        columns = [0, 1 + 2 * i, 2 + 2 * i]
        turn[9 * i : 9 * i + 9, columns] = np.swapaxes(parts, 0, 1).reshape(9, 3)
        turn[18 + 3 * i : 21 + 3 * i, columns] = np.swapaxes(parts, 1, 2) @ driven[i]
    homes = [np.stack([each, mechanism.c0, np.cross(each, mechanism.c0)]) for each in driven]
    return np.concatenate(
        [
            turn.ravel(),
            np.linalg.inv(homes).ravel(),
            axes.ravel(),
            [mechanism.b0 @ mechanism.c0, mechanism.c0 @ mechanism.d0],
            [mechanism.assembly_mode, GRAM_ROUNDING],
            np.transpose(rectangle).ravel(),
            [limits.singularity, *limits.most_load],
        ]
    )


def parts_constants(components: ElasticComponents, gravity: Array) -> Array:
    """Return what `native` must know of the elastic parts."""
    sectors = components.sectors
    m, bodies = len(sectors.gap), len(BODIES)
    flexibility, weight_screw = np.zeros((len(GROUPS), 6, 6)), np.zeros((len(GROUPS), 6, 3))
    group_of, weight_gap = np.zeros((m, 1)), np.zeros((m, 3))
    weight = np.zeros((bodies, 6, 3))
    for group, names in enumerate(GROUPS):
        carried = np.zeros((6, 3))
        for name in reversed(names):
            k = ELASTIC.index(name)
            own = sectors.component == k
            here = carried + components.weight_platform_side[k]
            flexibility[group] += components.flexibility[k]
            weight_screw[group] += components.flexibility[k] @ here
            group_of[own] = group
            weight_gap[own] = sectors.weight_approach[own] + sectors.screw[own] @ here
            carried = here + components.weight_motor_side[k]
        weight[BODIES.index(CARRIER[names[0]])] = carried
    weight[BODIES.index("platform")] = components.platform_weight
    rows = [group_of, sectors.slide, sectors.screw, weight_gap, sectors.gap[:, None]]
    return np.concatenate(
        [
            gravity,
            [1.0],
            np.zeros(6),
            flexibility.ravel(),
            weight_screw.ravel(),
            np.zeros(6 * len(GROUPS)),
            weight.ravel(),
            np.hstack(rows).ravel(),
            sectors.approach.ravel(),
        ]
    )


def _native() -> Any:
    try:
        return import_module("wrist_stiffness.mechanism._native")
    except ImportError:
        return None


native: Any = _native()
"""The compiled functions; None where the package was installed without a C compiler."""

Flags = NDArray[np.bool_]

NOT_DEFINITE = "contact: the flexibility of the flanges is singular or not positive definite"


class PredictedRows(NamedTuple):
    """What a wrist does at n samples."""

    twist: Array  # (n, 6), of the platform at O in F [m, rad]
    configuration: Array  # (n, 66), as `Configuration.of_row` takes them
    active: Flags  # (n, m), sectors in contact
    # (n,), 0 where the sample could be served; of the others the rest is undefined
    status: NDArray[np.uint8]


def compilable(components: ElasticComponents) -> bool:
    """Tell whether the compiled formulas are there and can serve a wrist."""
    return native is not None and len(components.sectors.gap) <= native.MOST_SECTORS


class CompiledCommands(NamedTuple):
    """Commands with the loads to correct for.

    Stamps (n,) [ns], angles (n, 2) [rad], loads at O (n, 6) [N, N m], which of these are in U (n,),
    which commands shall be corrected (n,), and how much of each correction is applied (n,) [-].
    """

    stamp_ns: NDArray[np.int64]
    theta: Array
    load: Array
    on_platform: Flags
    wanted: Flags
    share: Array


class CompiledSupervisor(NamedTuple):
    """Judges the loads of commands before they are corrected for.

    What it goes by and believes (SUPERVISOR,), its stamps (2,) [ns], and whether each load was
    known and corrected for in full (n,); see `compensation.belief`.
    """

    row: Array
    stamps: NDArray[np.int64]
    valid: Flags


class CorrectorState(NamedTuple):
    """What is kept from command to command.

    The correction found before (2,) [rad], a first guess of the contact state (m,), the correction
    applied before (2,) [rad] and its stamp (1,) [ns].
    """

    held: Array
    closed: Flags
    applied: Array
    stamp_ns: NDArray[np.int64]


NEVER_NS = np.iinfo(np.int64).min
"""Stamp of no command."""


class CorrectedRows(NamedTuple):
    """Corrections of n commands."""

    # (n, 86), what the properties give, and from 14 on the Jacobian (3, 2) of the platform's
    # angular velocity at the command
    rows: Array
    active: Flags  # (n, m), sectors in contact at the corrected angles

    @classmethod
    def room(cls, n: int, sectors: int) -> CorrectedRows:
        """Return what is to be filled for n commands and a wrist's flange sectors."""
        return cls(np.empty((n, native.CORRECTED)), np.empty((n, sectors), dtype=bool))

    def put(self, place: int, after: Array, twist: Array, configuration: Configuration) -> None:
        """Write what another search found for one command, as it is applied."""
        row = self.rows[place]
        row[2:8], row[8:14], row[20:] = after, twist, configuration.row

    @property
    def applied(self) -> Array:
        """To be added to the commands, also where no correction was wanted, (n, 2) [rad]."""
        return self.rows[:, :2]

    @property
    def after(self) -> Array:
        """Residual twist at O in F, (n, 6) [m, rad]."""
        return self.rows[:, 2:8]

    @property
    def twist(self) -> Array:
        """Predicted twist at the corrected angles, (n, 6) [m, rad]."""
        return self.rows[:, 8:14]

    @property
    def configuration(self) -> Array:
        """The wrist there, (n, 66), as `Configuration.of_row` takes it."""
        return self.rows[:, 20:]


class CompiledWrist:
    """One wrist with all that is constant.

    `mechanism` (MECHANISM,): from `mechanism_constants`; `gravity` (3,): acceleration of gravity in
    F [m/s^2].
    """

    def __init__(self, mechanism: Array, components: ElasticComponents, gravity: Array) -> None:
        self._mechanism = mechanism
        self.sectors = len(components.sectors.gap)
        self._parts = parts_constants(components, gravity)

    def with_constants(
        self, screws: Array | None, opening: Array | None, scale: float, added: Array | None
    ) -> CompiledWrist:
        """Return the wrist with further constants.

        `screws` (5, 6): of `GROUPS`, at O in the home frames of their bodies [m, rad]; `opening`
        (m,): of the sectors [m]; `scale`: factor on what the load sensor says; `added` (6,): to
        that then, in F [N, N m].
        """
        other, parts = copy(self), self._parts.copy()
        sectors = parts[native.PARTS :][: SECTOR * self.sectors].reshape(-1, SECTOR)
        parts[OF_LOAD.start] *= scale
        places = parts[OF_LOAD][1:], parts[OF_SCREWS], sectors[:, -1]
        for place, more in zip(places, (added, screws, opening), strict=True):
            if more is not None:
                place += np.ravel(more)
        other._parts = parts
        return other

    def forward(self, theta: Array) -> tuple[Configuration, Flags]:
        """Return the configurations at motor angles (n, 2) [rad], and which lie in the domain (n,).

        Those of the others are undefined.
        """
        rows = np.empty((len(theta), native.CONFIGURATION))
        status = np.empty(len(theta), dtype=np.uint8)
        native.forward(self._mechanism, np.ascontiguousarray(theta), rows, status)
        return Configuration.of_row(rows), status == 0

    def respond(
        self,
        configuration: Configuration,
        wrench: Array,
        active: Flags | None = None,
        limb_1: Array | None = None,
        limb_2: Array | None = None,
        opening: Array | None = None,
    ) -> tuple[Array, Array, Flags] | None:
        """Solve for the platform's twist under loads, with contact and own weight.

        `configuration`: of shape (n,); `wrench` (n, 6): load on the platform at O in F, as it acts
        [N, N m].  `active` (m,) or (n, m): first guess of the sectors in contact; leaves no trace
        in the result.  `limb_1`, `limb_2` (n, 6): further screws in the limbs at O in F [m, rad].
        `opening` (n, m): further opening of the sectors [m].  Gives `twist` (n, 6): of the platform
        at O in F, first order [m, rad], `force` (n, m): of each sector [N], and `active` (n, m):
        sectors in contact; or None where a sample has no answer, and `solve_contacts` says why.
        """
        n = len(wrench)
        twist, force = np.empty((n, 6)), np.empty((n, self.sectors))
        closed = np.zeros((n, self.sectors), dtype=bool)
        if active is not None:
            closed[...] = active
        arrays = (
            None if e is None else np.ascontiguousarray(e, float)
            for e in (configuration.row, wrench, limb_1, limb_2, opening)
        )
        if native.respond(self._parts, *arrays, closed, twist, force, self.sectors):
            return None
        return twist, force, closed

    def predict(
        self, theta: Array, load: Array, on_platform: Flags, closed: Flags, wanted: Flags | None
    ) -> PredictedRows:
        """Predict n samples in their order.

        `theta` (n, 2): motor angles [rad].  `load` (n, 6): as the load sensor says it at O [N, N
        m].  `on_platform` (n,): which of them are in U, not in F.  `closed` (m,): first guess of
        the contact state; afterwards that of the last sample.  `wanted` (n,): samples to serve; all
        if None.
        """
        n = len(on_platform)
        rows = PredictedRows(
            np.empty((n, 6)),
            np.empty((n, native.CONFIGURATION)),
            np.empty((n, self.sectors), dtype=bool),
            np.empty(n, dtype=np.uint8),
        )
        native.predict(
            self._mechanism,
            self._parts,
            theta,
            load,
            on_platform,
            closed,
            wanted,
            rows.twist,
            rows.configuration,
            rows.active,
            rows.status,
            self.sectors,
        )
        return rows

    def correct(
        self,
        task: Array | None,
        safety: Array | None,
        commands: CompiledCommands,
        state: CorrectorState,
        found: CorrectedRows,
        supervisor: CompiledSupervisor | None = None,
        begin: int = 0,
        end: int | None = None,
    ) -> int:
        """Correct commands in their order (see `compensation.correction.correct` and `safety`).

        `task` (11,): what to make right and how far (see `compensation.corrector`); None where
        `found` was searched before.  `safety` (8,): from `SafetySettings.compiled`; None where
        nothing is to be applied yet.  `state`: of the command before; afterwards that of the last
        command done.  `supervisor`: writes the loads to correct for over the measured ones, and the
        shares.  Gives which command comes next: the first that cannot be done here, else the end.
        """
        done: int = native.correct(
            self._mechanism,
            self._parts,
            task,
            safety,
            commands.theta,
            commands.stamp_ns,
            commands.load,
            commands.on_platform,
            commands.wanted,
            commands.share,
            *state,
            found.rows,
            found.active,
            *(supervisor or (None, None, None)),
            self.sectors,
            begin,
            len(commands.wanted) if end is None else end,
        )
        return done
