"""Wrists and parts for the tests of the finite-element room."""

from __future__ import annotations

import math

import numpy as np

from wrist_stiffness.mechanism.geometry import (
    BushingDimensions,
    Geometry,
    Limits,
    LinkDimensions,
    Material,
    PlatformDimensions,
)

STEEL = Material(young=200e9, poisson=0.3, density=7850.0, expansion=12e-6)
POLYMER = Material(young=2.4e9, poisson=0.35, density=1460.0, expansion=1e-4)

ORACLE_LINK = LinkDimensions(
    arc_radius=50e-3,
    section_radial=6e-3,
    section_axial=8e-3,
    overhang=8e-3,
    motor_bore=4e-3,
    platform_bore=4e-3,
    material=STEEL,
)


def bushing(radius: float = 31e-3, gap: float | None = 20e-6) -> BushingDimensions:
    """Return a flanged bushing at `radius` [m] with equal gaps [m] (None: plain sleeve)."""
    return BushingDimensions(
        radius=radius,
        pin_diameter=5.4e-3,
        length=6.5e-3,
        wall=0.75e-3,
        flange_diameter=9.5e-3,
        flange_thickness=0.75e-3,
        inner_gap=gap,
        outer_gap=gap,
        material=POLYMER,
    )


def link(arc_radius: float, motor_bore: float = 5.4e-3) -> LinkDimensions:
    """Return a bar of 10 mm x 6 mm section at `arc_radius` [m]."""
    return LinkDimensions(
        arc_radius=arc_radius,
        section_radial=6e-3,
        section_axial=10e-3,
        overhang=8e-3,
        motor_bore=motor_bore,
        platform_bore=5.4e-3,
        material=STEEL,
    )


def wrist(gap: float | None = 20e-6, skew: float = 0.0) -> Geometry:
    """Return an orthogonal wrist (c along x), or one whose home axes are skewed by `skew` [rad]."""
    turn = math.sin(skew), math.cos(skew)
    axes = {
        "joint_1": np.array([1.0, 0.0, 0.0]),
        "joint_2": np.array([turn[0], turn[1], 0.0]),
        "joint_3": np.array([turn[1], 0.0, -turn[0]]),
        "joint_4": np.array([0.0, turn[0], turn[1]]),
        "joint_5": np.array([0.0, 1.0, 0.0]),
    }
    # joint_2 on the far side of O, where it cannot meet the motor of limb 2.
    radii = {"joint_1": 31e-3, "joint_2": -31e-3, "joint_3": -37e-3, "joint_4": 33e-3}
    radii["joint_5"] = 33e-3
    return Geometry(
        name="test wrist",
        status="assumed",
        axes=axes,
        links={
            "link_1": link(31e-3),
            "link_2": link(33e-3),
            "link_3": link(35e-3, motor_bore=6.9e-3),
        },
        bushings={name: bushing(radius, gap) for name, radius in radii.items()},
        platform=PlatformDimensions(
            normal=np.array([0.0, 0.0, 1.0]),
            centre=np.array([0.0, 0.0, -18e-3]),
            diameter=50e-3,
            thickness=4e-3,
            mass=0.0212,
            centre_of_gravity=np.array([1e-3, -2e-3, -15e-3]),
            tool_point=np.array([0.0, 0.0, -18e-3]),
            readout_points=np.eye(3) * 20e-3,
        ),
        limits=Limits(
            joint_lower=np.full(2, -1.0),
            joint_upper=np.full(2, 1.0),
            operative_tilt=math.radians(54.7),
            map_margin=1.2,
            singularity=0.2,
            force=5.0,
            moment=0.1,
            encoder_step=2.6e-4,
        ),
        gravity=np.array([0.0, 0.0, -9.81]),
        reference_temperature=20.0,
        load_point=np.zeros(3),
        sha256="0" * 64,
    )
