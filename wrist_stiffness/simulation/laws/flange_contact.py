"""`flange_contact`: a flange stands nearer or farther than the table's gap."""

from __future__ import annotations

from dataclasses import dataclass, replace

from wrist_stiffness.errors import InputError
from wrist_stiffness.mechanism.components import ElasticComponents
from wrist_stiffness.simulation.laws.law import Law


@dataclass(frozen=True)
class FlangeGap(Law):
    """Another axial gap at the flanges of a passive joint."""

    joint: str  # passive joint with flanges
    change: float  # of the gap [m]; negative presses the flange on

    def parts(self, parts: ElasticComponents) -> ElasticComponents:
        """Move the flange.

        Raises `InputError` if the joint has no flange in this table.
        """
        if self.joint not in parts.contact:
            raise InputError(f"flange_contact: {self.joint} has no flange in this table")
        flange = parts.contact[self.joint]
        contact = dict(parts.contact)
        contact[self.joint] = replace(flange, gap=flange.gap + self.change)
        return replace(parts, contact=contact)
