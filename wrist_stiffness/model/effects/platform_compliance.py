"""Something between the platform and the place of the load that gives."""

from __future__ import annotations

from wrist_stiffness.mechanism.components import Array
from wrist_stiffness.mechanism.geometry import Geometry
from wrist_stiffness.model.spring import Spring


class PlatformCompliance(Spring):
    """Spring between the joints' hubs and the plate with tool and target, at the plate's centre."""

    id = "platform_compliance"
    places = ("platform",)
    sentence = "the platform, its screws or the tool's holder give"
    check = "tighten the tool's and the target's screws; tap the tool and watch the target"
    excited_by = "loads of several directions at different tilts"

    def centre(self, geometry: Geometry, place: str) -> Array:
        """Return the plate's centre."""
        return geometry.platform.centre
