"""A link more flexible than modelled."""

from __future__ import annotations

from wrist_stiffness.mechanism.components import LINKS
from wrist_stiffness.model.scaled_part import ScaledPart


class LinkStiffness(ScaledPart):
    """Flexibility of a link times (1 + fraction)."""

    id = "link_stiffness"
    places = LINKS
    sentence = "{place} bends more (or less) than modelled"
    check = "compare the link's section and material with the drawing; look for a crack"
    excited_by = "loads of several sizes and directions at poses all over the workspace"
