"""`creep`: a bushing goes on giving way under a load that stays."""

from __future__ import annotations

import numpy as np

from wrist_stiffness.mechanism.components import ELASTIC, Array
from wrist_stiffness.mechanism.vectors import block_diagonal
from wrist_stiffness.simulation.block import Block
from wrist_stiffness.simulation.laws.law import Flowing


class Creep(Flowing):
    """Kelvin-Voigt elements in series with the bushing, in its own axes (a Prony series).

        dx_i/dt = (share_i C w - x_i) / tau_i        screw = sum_i x_i

    `joint`: whose bushing.  `shares`: flexibility of each element over the elastic one [-].
    `times_s`: time constants [s]; one is the standard linear solid, a geometric row of them is
    nearly the power law of creep.
    """

    def __init__(self, joint: str, shares: Array, times_s: Array) -> None:
        self.component = joint
        self._shares = np.asarray(shares)[:, None]
        self._times_s = np.asarray(times_s)[:, None]
        self._state: tuple[float, Array, Array] | None = None

    def flow(self, block: Block, wrench: Array, remember: bool) -> Array:
        """Integrate exactly for a wrench that changes linearly between samples."""
        joint = self.component
        turn = block_diagonal(block.rotation(joint))
        k = ELASTIC.index(joint)
        elastic = (block.flexibility[:, k] @ wrench[..., None])[..., 0]
        drive = np.einsum("nji,nj->ni", turn, elastic)
        if self._state is None:
            # The wrist has stood as it stands at the start for long.
            before, past, strain = block.time_s[0], drive[0], self._shares * drive[0]
        else:
            before, past, strain = self._state
        out = np.empty_like(drive)
        for i, now in enumerate(block.time_s):
            x = (now - before) / self._times_s
            decay = np.exp(-x)
            # Mean of the exponential over the step: the weight of the linear part.
            ramp = np.where(x > 1e-8, -np.expm1(-x) / np.maximum(x, 1e-8), 1.0)
            target = drive[i] * (1.0 - ramp) + past * (ramp - decay)
            strain = decay * strain + self._shares * target
            out[i] = strain.sum(axis=0)
            before, past = now, drive[i]
        if remember:
            self._state = float(before), past.copy(), strain
        return np.einsum("nij,nj->ni", turn, out)
