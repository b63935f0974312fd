"""The geometry of one wrist: what the geometry file says, in SI units, checked.

Reading the file is `geometry_file.py`; here are the values and what follows from them.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np

from wrist_stiffness.mechanism.components import ENDS, Array
from wrist_stiffness.mechanism.material import AnyMaterial, Material
from wrist_stiffness.mechanism.own_stiffness import OwnStiffness

ROUNDING = 1e-9
"""Share by which a number may pass a limit that it stands at."""


@dataclass(frozen=True)
class LinkDimensions:
    """Circular arc bar about O between two joint axes, with a radial bore for a pin at each end."""

    arc_radius: float  # radius of the centre line [m]
    # `section_radial`, `section_axial`: section along the radius and along the normal of the arc's
    # plane [m]
    section_radial: float
    section_axial: float
    overhang: float  # arc length of the bar past each bore's centre [m]
    # `motor_bore`, `platform_bore`: diameter of the radial bore at the motor-side and platform-side
    # joint [m]
    motor_bore: float
    platform_bore: float
    material: AnyMaterial
    # given by the file instead of the bar's; the bar still says what it weighs
    stiffness: OwnStiffness | None = None


@dataclass(frozen=True)
class BushingDimensions:
    """Polymer sleeve around a pin, centred at `radius` times the joint axis, with end flanges.

    "Inner" is the end nearer to O.  A passive joint's flange touches the face of the hub that it
    looks at; its gap is the play of the unloaded joint at that face.
    """

    # place of the centre along the joint axis from O [m]; negative on the far side of O
    radius: float
    pin_diameter: float  # inner diameter [m]
    length: float  # length of the sleeve between the flanges' hub-side faces [m]
    wall: float  # wall thickness of the sleeve [m]
    # `flange_diameter`, `flange_thickness`: of each flange present [m]
    flange_diameter: float
    flange_thickness: float
    # `inner_gap`, `outer_gap`: gap between flange and hub face [m]; None where there is no flange
    inner_gap: float | None
    outer_gap: float | None
    material: AnyMaterial
    # given by the file, or of its ball bearings, instead of the sleeve's, where no flange takes
    # part in contact
    stiffness: OwnStiffness | None = None


@dataclass(frozen=True)
class PlatformDimensions:
    """Rigid mobile platform."""

    normal: Array  # (3,), home normal n0, unit vector in F
    centre: Array  # (3,), plate centre P0 in U [m]
    # `diameter`, `thickness`: of the round plate [m]
    diameter: float
    thickness: float
    mass: float  # [kg]
    centre_of_gravity: Array  # (3,), in U [m]
    tool_point: Array  # (3,), in U [m]
    readout_points: Array  # (n, 3), points for Eqs. (1)-(10), in U [m]


@dataclass(frozen=True)
class Limits:
    """Where the wrist may work."""

    # `joint_lower`, `joint_upper`: (2,), motor angles [rad]
    joint_lower: Array
    joint_upper: Array
    # largest tilt of the platform normal from home in the operative workspace [rad]
    operative_tilt: float
    # the map's domain is the operative workspace's bounding rectangle times this [-]
    map_margin: float
    singularity: float  # least |D| in the map's domain [-]
    # `force`, `moment`: largest components' norm of the load at O [N, N m]
    force: float
    moment: float
    encoder_step: float  # resolution of the motor encoders [rad]

    @cached_property
    def reach(self) -> tuple[tuple[float, float], ...]:
        """Lowest and highest angle that a drive may be told, of each motor [rad].

        Less than an encoder step beyond a limit is the limit itself, as far as the drive can tell.
        """
        lowest = (self.joint_lower - self.encoder_step).tolist()
        highest = (self.joint_upper + self.encoder_step).tolist()
        return tuple(zip(lowest, highest, strict=True))

    @cached_property
    def most_load(self) -> tuple[float, float]:
        """Largest force and moment at O that are taken [N, N m]: the limits, but for rounding.

        A load at the very limit rounds beyond it when it is turned with the platform.
        """
        return self.force * (1.0 + ROUNDING), self.moment * (1.0 + ROUNDING)


@dataclass(frozen=True, eq=False)
class Geometry:
    """Everything the geometry file says about one wrist."""

    # `name`, `status`: name, and `assumed`, `calibrated` or `measured` for the whole
    name: str
    status: str
    # dict of str to (3,), home axes of `joint_1` ... `joint_5`, unit vectors through O in F
    axes: dict[str, Array]
    # `links`, `bushings`: dimensions by component name
    links: dict[str, LinkDimensions]
    bushings: dict[str, BushingDimensions]
    platform: PlatformDimensions  # the mobile platform
    limits: Limits  # joint, load and workspace limits
    gravity: Array  # (3,), acceleration of gravity in F [m/s^2]
    reference_temperature: float  # [degC]
    load_point: Array  # (3,), where the rated 1 N load of the maps acts, in U [m]
    sha256: str  # checksum of the file's values, the same for the same values in any layout
    # of which all pins are, as beams; None where they are taken as rigid
    pins: Material | None = None

    def joint_side(self, joint: str) -> Array:
        """Direction from O to the joint's bushing at home, unit vector in F (3,)."""
        return np.copysign(1.0, self.bushings[joint].radius) * self.axes[joint]

    def link_ends(self, link: str) -> tuple[Array, Array]:
        """Directions from O to a link's motor-side and platform-side bores at home, (3,) each."""
        motor_side, platform_side = ENDS[link]
        return self.joint_side(motor_side), self.joint_side(platform_side)
