"""What the table says of a block, whatever effects are there, those of the elastic parts aside."""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np

from wrist_stiffness.lookup.table import Evaluation, Table
from wrist_stiffness.mechanism.components import Array, ElasticComponents
from wrist_stiffness.mechanism.configuration import Configuration
from wrist_stiffness.mechanism.influence import Influence, influence
from wrist_stiffness.mechanism.statics import (
    ContactOperators,
    assembled_operators,
    changed_operators,
    turned_flexibilities,
    weight_wrench,
)
from wrist_stiffness.model.block import Block


@dataclass(frozen=True, eq=False)
class BlockStatics:
    """n samples at their configurations with elastic parts.

    Models that share it share the work: nothing is computed before it is asked for, or twice.
    """

    block: Block  # the samples, with speeds
    load: Array  # (n, 6), what the load sensor says, in F at O [N, N m]
    configuration: Configuration  # of shape (n,)
    evaluation: Evaluation  # `closed_form` or `spline`
    table: Table
    parts: ElasticComponents  # elastic parts as they are with a model's effects

    def with_parts(self, parts: ElasticComponents) -> BlockStatics:
        """Return the statics of the same samples with other parts."""
        other = replace(self, parts=parts)
        for name in ("influence", "jacobian"):
            if name in self.__dict__:
                other.__dict__[name] = self.__dict__[name]
        same = ("weight_motor_side", "weight_platform_side", "platform_weight")
        if all(getattr(parts, name) is getattr(self.parts, name) for name in same):
            # The free slides make the wrist isostatic: own weight finds its way without springs.
            other.__dict__["own_weight"] = self.own_weight
            if (
                self.evaluation == "closed_form"
                and parts.contact.keys() == self.parts.contact.keys()
            ):
                other.__dict__["operators"] = changed_operators(
                    self.operators,
                    self.configuration,
                    self.parts,
                    parts,
                    self.table.geometry.gravity,
                    self.own_weight,
                )
        return other

    @cached_property
    def operators(self) -> ContactOperators:
        """Elastic operators of shape (n,)."""
        if self.evaluation == "spline":
            return self.table.operators_at(self.configuration, "spline")
        return assembled_operators(
            self.configuration,
            self.influence,
            self.parts,
            self.turned_flexibility,
            self.table.geometry.gravity,
            self.own_weight,
        )

    @cached_property
    def influence(self) -> Influence:
        """Projectors of the configurations."""
        return influence(self.configuration)

    @cached_property
    def turned_flexibility(self) -> Array:
        """Flexibility of each component at O in F, (n, 8, 6, 6) [m/N, rad/N, rad/(N m)]."""
        return turned_flexibilities(self.configuration, self.parts)

    @cached_property
    def jacobian(self) -> Array:
        """Jacobian of the platform's angular velocity, (n, 3, 2)."""
        return self.table.mechanism.jacobian(self.configuration)

    @cached_property
    def own_weight(self) -> Array:
        """Wrench of own weight through the elastic components, (n, 8, 6) [N, N m]."""
        return weight_wrench(
            self.configuration, self.parts, self.table.geometry.gravity, self.influence
        )

    @cached_property
    def told(self) -> tuple[Array, Array]:
        """Twist and gaps under the told load and own weight alone, slides free, (n, 6), (n, m)."""
        column, operators = self.load[..., None], self.operators
        twist = operators.weight_twist + (operators.compliance @ column)[..., 0]
        gap = operators.gap + (np.swapaxes(operators.force_twist, -1, -2) @ column)[..., 0]
        return twist, gap
