"""Every law of the catalogue speaks to a technician, in units that its names tell."""

from itertools import product

import numpy as np
import pytest

from wrist_stiffness.model.parameters import si_factor
from wrist_stiffness.model.registry import catalogue


@pytest.mark.parametrize("law", catalogue().values(), ids=lambda law: law.id)
def test_every_law_speaks_to_a_technician_and_has_sane_parameters(law):
    for place in law.places:
        text = law.sentence.format(place=place)
        assert len(text) > 20
        assert "{" not in text
        keys = [p.key for p in law.parameters(place)]
        assert keys
        assert len(set(keys)) == len(keys)
        for p in law.parameters(place):
            assert p.lower <= p.mean <= p.upper
            assert 0.0 < p.scale < np.inf
            assert si_factor(p.key) > 0.0
    assert len(law.check) > 20
    assert len(law.excited_by) > 10


@pytest.mark.parametrize("law", catalogue().values(), ids=lambda law: law.id)
def test_next_to_no_effect_adds_next_to_nothing(model, make, law):
    """Nor beside joints that rub and a pin in its play: a search would else find it there."""
    rubs = {"coefficient": 0.15, "preload_N": 0.2, "bristle_um_per_N": 50.0}
    worn = [make.effect(f"joint_friction@{joint}", **rubs) for joint in ("joint_2", "joint_4")]
    worn.append(make.effect("joint_clearance@joint_1", clearance_um=5.0))
    block = make.block(20)
    for beside, place in product((worn[:2], worn), law.places):
        own = law.parameters(place)
        if f"{law.id}@{place}" in {each.name for each in beside} or own[0].mean:
            continue
        bare = model.with_effects(*beside).batch(block).measured
        little, usual = (
            model.with_effects(*beside, make.effect(f"{law.id}@{place}", **sizes)).batch(block)
            for sizes in ({p.key: p.mean or size * p.scale for p in own} for size in (1e-5, 1.0))
        )
        for part in (slice(0, 3), slice(3, 6)):
            off, size = (
                np.linalg.norm((each.measured - bare)[:, part]) for each in (little, usual)
            )
            assert off <= 1e-2 * size + 1e-14


CATALOGUE = """
    link_stiffness bushing_stiffness drive_compliance mount_compliance frame_compliance
    platform_compliance gravity joint_clearance flange_contact bushing_hardening joint_friction
    backlash encoder_offset encoder_eccentricity transmission_error axis_misalignment
    thermal_expansion thermal_softening creep cable_wrench load_bias load_scale
    load_cross_talk load_misalignment load_point measurement_frame target_mounting drift time_delay
    inertia
"""


def test_the_catalogue_is_complete():
    assert " ".join(sorted(catalogue())) == " ".join(sorted(CATALOGUE.split()))


@pytest.mark.parametrize(
    ("key", "factor"),
    [
        ("clearance_um", 1e-6),
        ("offset_mdeg", np.pi / 180e3),
        ("x_um_per_N", 1e-6),
        ("turn_x_mdeg_per_Nm", np.pi / 180e3),
        ("shift_x_um_per_h", 1e-6 / 3600.0),
        ("expansion_ppm_per_K", 1e-6),
        ("mx_1_Nmm_per_rad", 1e-3),
        ("order", 1.0),
        ("m", 1.0),
        ("per_N", 1.0),
    ],
)
def test_units_in_names(key, factor):
    assert si_factor(key) == pytest.approx(factor, rel=1e-15)
