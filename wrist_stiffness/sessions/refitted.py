"""What is refitted whatever is asked: how a session was set up, and how the wrist was built."""

from __future__ import annotations

from collections.abc import Iterable

from wrist_stiffness.mechanism.components import JOINTS, LINKS, MOTORS, PASSIVE_JOINTS

AXES, GAPS = "axis_misalignment", "flange_contact"

REGISTRATIONS = ("measurement_frame", "target_mounting")
"""Of what measures poses.  Gauges have a mounting each instead, of which these are a part: see
`UnitSession.common`."""

SET_UP = (
    *((law, ("pose_sensor",)) for law in REGISTRATIONS),
    ("encoder_offset", MOTORS),
    ("load_bias", ("load_sensor",)),
)
"""What is set up anew in every session."""

BUILT = (
    (AXES, JOINTS),
    (GAPS, PASSIVE_JOINTS),
    ("link_stiffness", LINKS),
    ("bushing_stiffness", JOINTS),
    ("load_scale", ("load_sensor",)),
)
"""What differs from wrist to wrist within its tolerances.  The gaps of the flanges are among them
because whoever fits a wrist shims them to its axes; the load sensor's scale, because softer parts
look nearly like it.

A gap is free here by the prior of its law, tens of micrometres: a calibration describes whatever
wrist stands there.  A diagnosis, and the fit of what it names, hold it to what shims leave
(`identification.free_effects`), because a flange that stands otherwise is a fault to be named."""

ANSWERS_LOAD = frozenset({"link_stiffness", "bushing_stiffness", "load_scale"})
"""Those of the tolerances that say how much a load does."""

TOLERATED = frozenset(law for law, _ in BUILT)
"""Laws of the wrist's tolerances: what they do within their priors is no finding."""


def names_of(group: Iterable[tuple[str, tuple[str, ...]]]) -> tuple[str, ...]:
    """Return `law@place` of all in a group."""
    return tuple(f"{law}@{place}" for law, places in group for place in places)
