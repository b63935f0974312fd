"""How large a hidden effect may be on a wrist that still works; beyond it, it is absurd."""

from __future__ import annotations

from wrist_stiffness.simulation.catalogue import HiddenEffect

LARGEST: dict[str, tuple[float, str]] = {
    "link_stiffness": (2.0, "aluminium where steel was drawn bends three times as much"),
    "bushing_stiffness": (3.0, "the softest grade of the polymer has a quarter of the modulus"),
    "drive_compliance": (0.05, "a belt that gives 3 deg at 1 N m is off its wheel"),
    "mount_compliance": (1e-5, "a bracket that gives 10 um at 1 N is seen to move by hand"),
    "frame_compliance": (1e-5, "as a bracket"),
    "platform_compliance": (1e-5, "as a bracket"),
    "gravity": (0.2, "200 g are several times the platform, and a tilt of 4 m/s2 is 24 deg"),
    "joint_clearance": (1e-4, "a pin with 0.1 mm of play rattles"),
    "flange_contact": (1e-4, "shims are graded in tenths of a millimetre"),
    "bushing_hardening": (0.5, "half of the flexibility is gone under load"),
    "joint_friction": (0.5, "dry polymer on rough steel"),
    "backlash": (5e-3, "0.3 deg of lost motion is felt by hand"),
    "encoder_offset": (0.02, "1 deg is seen at the home mark"),
    "encoder_eccentricity": (5e-3, "a disc of 20 mm that is 0.1 mm off its centre"),
    "transmission_error": (2e-3, "teeth of the worst grade"),
    "axis_misalignment": (2e-4, "a bore that is 0.2 mm and 0.4 deg off is not assembled"),
    "thermal_expansion": (1e-4, "the polymer with the largest growth"),
    "thermal_softening": (0.05, "a polymer at its glass transition loses 5 % in each kelvin"),
    "creep": (1.0, "as much creep as elastic strain"),
    "cable_wrench": (50.0, "a hose, not a cable"),
    "load_bias": (0.5, "half of the rated force is seen at rest"),
    "load_scale": (0.3, "another sensor's calibration sheet"),
    "load_cross_talk": (0.1, "a tenth of full scale on the wrong axis: the cable is torn"),
    "load_misalignment": (0.2, "11 deg are seen by eye"),
    "load_point": (0.03, "as far off as the sensor is long"),
    "measurement_frame": (1e-2, "seen by eye"),
    "target_mounting": (1e-2, "seen by eye"),
    "drift": (1e-4, "0.1 mm in five minutes: the tripod is not fixed"),
    "time_delay": (0.1, "a tenth of a second is a dropped message"),
    "inertia": (0.5, "more than twenty times the platform"),
    "resonance": (1.0, "a tool that rings more than it moves"),
    "oil_film": (5e-5, "thicker than the clearance of any bearing of this size"),
    "loose_seat": (1e-4, "0.1 mm of play rattles"),
    "plastic_set": (1e-4, "0.1 mm at 1 N is a broken bushing"),
    "head_change": (2e-4, "two heads that disagree by 0.2 mm were never calibrated"),
    "cable_stop": (1e4, "a wall"),
    "dent": (1e-4, "0.1 mm is seen by eye"),
    "thermal_bow": (2e-4, "0.2 mm for one kelvin"),
    "floor_tilt": (0.2, "11 deg: the wrist falls over"),
    "swelling": (1e-4, "0.1 mm seizes the joint"),
}
"""Magnitude in the catalogue's unit, and why a larger one is no wrist that still works."""


def is_plausible(hidden: HiddenEffect) -> bool:
    """Return whether a wrist with this effect still works."""
    return abs(hidden.magnitude) <= LARGEST[hidden.effect][0]
