"""Links and bushings that are more flexible than modelled."""

from __future__ import annotations

from wrist_stiffness.mechanism.components import JOINTS, LINKS
from wrist_stiffness.model.scaled_part import ScaledPart


class LinkStiffness(ScaledPart):
    """Flexibility of a link times (1 + fraction)."""

    id = "link_stiffness"
    places = LINKS
    sentence = "{place} bends more (or less) than modelled"
    check = "compare the link's section and material with the drawing; look for a crack"
    excited_by = "loads of several sizes and directions at poses all over the workspace"


class BushingStiffness(ScaledPart):
    """Flexibility of a bushing, its flanges included, times (1 + fraction)."""

    id = "bushing_stiffness"
    places = JOINTS
    sentence = "the bushing of {place} gives more (or less) than modelled"
    check = "check the bushing's material, moisture and length; swap it for a new one"
    excited_by = "loads of several sizes and directions at poses all over the workspace"
