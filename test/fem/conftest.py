"""Wrists, solids and condensed parts for the tests of the finite-element room."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import replace

import numpy as np
import pytest

from wrist_stiffness.fem.components import elastic_components
from wrist_stiffness.fem.parts import ElasticBody, Solid, assemble_body
from wrist_stiffness.fem.solids import MeshSettings
from wrist_stiffness.mechanism.components import ElasticComponents
from wrist_stiffness.mechanism.geometry import (
    BushingDimensions,
    Geometry,
    Limits,
    LinkDimensions,
    PlatformDimensions,
)
from wrist_stiffness.mechanism.material import Material

STEEL = Material(young=200e9, poisson=0.3, density=7850.0, expansion=12e-6)
POLYMER = Material(young=2.4e9, poisson=0.35, density=1460.0, expansion=1e-4)

COARSE = MeshSettings(
    link=4e-3, bore=2.4e-3, bushing=1.0e-3, bushing_corner=0.4e-3, bushing_arc=2.8e-3
)


def bushing(radius: float = 31e-3, gap: float | None = 20e-6) -> BushingDimensions:
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
    """An orthogonal wrist with c along x; `skew` [rad] makes every link angle another one."""
    sine, cosine = math.sin(skew), math.cos(skew)
    # joint_2 and joint_3 lie on the far side of O, so that signs of radii are tested too.
    radii = {
        "joint_1": 31e-3,
        "joint_2": -31e-3,
        "joint_3": -37e-3,
        "joint_4": 33e-3,
        "joint_5": 33e-3,
    }
    return Geometry(
        name="test wrist",
        status="assumed",
        axes={
            "joint_1": np.array([1.0, 0.0, 0.0]),
            "joint_2": np.array([sine, cosine, 0.0]),
            "joint_3": np.array([cosine, 0.0, -sine]),
            "joint_4": np.array([0.0, sine, cosine]),
            "joint_5": np.array([0.0, 1.0, 0.0]),
        },
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
            readout_points=np.vstack([np.eye(3), np.zeros(3)]) * 20e-3,
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


def flanged_solid() -> Solid:
    return Solid(
        replace(bushing(0.0), inner_gap=0.0, outer_gap=0.0),
        0.0,
        "pin_wall",
        "hub_wall",
        ("inner", "outer"),
    )


@pytest.fixture(scope="session")
def coarse() -> MeshSettings:
    return COARSE


@pytest.fixture(scope="session")
def make_wrist() -> Callable[..., Geometry]:
    return wrist


@pytest.fixture(scope="session")
def oracle_link() -> LinkDimensions:
    """The 90 degree link that four codes agree on."""
    return LinkDimensions(
        arc_radius=50e-3,
        section_radial=6e-3,
        section_axial=8e-3,
        overhang=8e-3,
        motor_bore=4e-3,
        platform_bore=4e-3,
        material=STEEL,
    )


@pytest.fixture(scope="session")
def flanged_bushing() -> ElasticBody:
    return assemble_body(flanged_solid(), COARSE)


@pytest.fixture(scope="session")
def plain_sleeve() -> ElasticBody:
    """A long sleeve without flanges, for which thick-walled formulas hold."""
    sleeve = replace(bushing(0.0, gap=None), length=16e-3)
    sizes = replace(COARSE, bushing=0.5e-3, bushing_arc=1.4e-3)
    return assemble_body(Solid(sleeve, 0.0, "pin_wall", "hub_wall", ()), sizes)


@pytest.fixture(scope="session")
def link_body(oracle_link: LinkDimensions) -> ElasticBody:
    return assemble_body(Solid(oracle_link, math.pi / 2, "motor_bore", "platform_bore", ()), COARSE)


@pytest.fixture(scope="session")
def skewed_components() -> tuple[Geometry, ElasticComponents]:
    geometry = wrist(skew=0.15)
    return geometry, elastic_components(geometry, COARSE)[0]
