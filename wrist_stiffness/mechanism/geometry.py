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
    """Circular arc bar about O between two joint axes, with a radial bore for the pin at each end.

    Parameters
    ----------
    arc_radius : float
        Radius of the centre line [m].
    section_radial, section_axial : float
        Section along the radius and along the normal of the arc's plane [m].
    overhang : float
        Arc length of the bar past each bore's centre [m].
    motor_bore, platform_bore : float
        Diameter of the radial bore at the motor-side and platform-side joint [m].
    stiffness : OwnStiffness or None
        Given by the file instead of the bar's; the bar still says what it weighs.
    """

    arc_radius: float
    section_radial: float
    section_axial: float
    overhang: float
    motor_bore: float
    platform_bore: float
    material: AnyMaterial
    stiffness: OwnStiffness | None = None


@dataclass(frozen=True)
class BushingDimensions:
    """Polymer sleeve around a pin, centred at `radius` times the joint axis, with end flanges.

    "Inner" is the end nearer to O.  A passive joint's flange touches the face of the hub that it
    looks at; its gap is the play of the unloaded joint at that face.

    Parameters
    ----------
    radius : float
        Place of the centre along the joint axis from O [m]; negative on the far side of O.
    pin_diameter : float
        Inner diameter [m].
    length : float
        Length of the sleeve between the flanges' hub-side faces [m].
    wall : float
        Wall thickness of the sleeve [m].
    flange_diameter, flange_thickness : float
        Of each flange present [m].
    inner_gap, outer_gap : float or None
        Gap between flange and hub face [m]; None where there is no flange.
    stiffness : OwnStiffness or None
        Given by the file, or of its ball bearings, instead of the sleeve's, where no flange takes
        part in contact.
    """

    radius: float
    pin_diameter: float
    length: float
    wall: float
    flange_diameter: float
    flange_thickness: float
    inner_gap: float | None
    outer_gap: float | None
    material: AnyMaterial
    stiffness: OwnStiffness | None = None


@dataclass(frozen=True)
class PlatformDimensions:
    """Rigid mobile platform.

    Parameters
    ----------
    normal : (3,) float
        Home normal n0, unit vector in F.
    centre : (3,) float
        Plate centre P0 in U [m].
    diameter, thickness : float
        Of the round plate [m].
    mass : float
        [kg].
    centre_of_gravity : (3,) float
        In U [m].
    tool_point : (3,) float
        In U [m].
    readout_points : (n, 3) float
        Points for Eqs. (1)-(10), in U [m].
    """

    normal: Array
    centre: Array
    diameter: float
    thickness: float
    mass: float
    centre_of_gravity: Array
    tool_point: Array
    readout_points: Array


@dataclass(frozen=True)
class Limits:
    """Where the wrist may work.

    Parameters
    ----------
    joint_lower, joint_upper : (2,) float
        Motor angles [rad].
    operative_tilt : float
        Largest tilt of the platform normal from home in the operative workspace [rad].
    map_margin : float
        The map's domain is the operative workspace's bounding rectangle times this [-].
    singularity : float
        Least |D| in the map's domain [-].
    force, moment : float
        Largest components' norm of the load at O [N, N m].
    encoder_step : float
        Resolution of the motor encoders [rad].
    """

    joint_lower: Array
    joint_upper: Array
    operative_tilt: float
    map_margin: float
    singularity: float
    force: float
    moment: float
    encoder_step: float

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
    """Everything the geometry file says about one wrist.

    Parameters
    ----------
    name, status : str
        Name, and `assumed`, `calibrated` or `measured` for the whole.
    axes : dict of str to (3,) float
        Home axes of `joint_1` ... `joint_5`, unit vectors through O in F.
    links, bushings : dict
        Dimensions by component name.
    platform : PlatformDimensions
        The mobile platform.
    limits : Limits
        Joint, load and workspace limits.
    gravity : (3,) float
        Acceleration of gravity in F [m/s^2].
    reference_temperature : float
        [degC].
    load_point : (3,) float
        Where the rated 1 N load of the maps acts, in U [m].
    sha256 : str
        Checksum of the file's values, the same for the same values in any layout.
    pins : Material, optional
        Of which all pins are, as beams; None where they are taken as rigid.
    """

    name: str
    status: str
    axes: dict[str, Array]
    links: dict[str, LinkDimensions]
    bushings: dict[str, BushingDimensions]
    platform: PlatformDimensions
    limits: Limits
    gravity: Array
    reference_temperature: float
    load_point: Array
    sha256: str
    pins: Material | None = None

    def joint_side(self, joint: str) -> Array:
        """Direction from O to the joint's bushing at home, unit vector in F (3,)."""
        return np.copysign(1.0, self.bushings[joint].radius) * self.axes[joint]

    def link_ends(self, link: str) -> tuple[Array, Array]:
        """Directions from O to a link's motor-side and platform-side bores at home, (3,) each."""
        motor_side, platform_side = ENDS[link]
        return self.joint_side(motor_side), self.joint_side(platform_side)
