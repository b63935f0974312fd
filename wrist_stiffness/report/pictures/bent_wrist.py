"""The bent wrist in three dimensions: where a load takes it, exaggerated.

The motion of every interface frame is that of the elastic model; along a bar between its two ends
it is interpolated.  Pins, which are rigid in the model, are lines.
"""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from wrist_stiffness.commands.budget import Push
from wrist_stiffness.lookup.response import respond
from wrist_stiffness.lookup.table import Table
from wrist_stiffness.mechanism.components import CARRIER, ELASTIC, ENDS, JOINTS, LINKS, Array
from wrist_stiffness.mechanism.configuration import Configuration
from wrist_stiffness.mechanism.energy import component_screws
from wrist_stiffness.mechanism.influence import influence
from wrist_stiffness.mechanism.modes import NaturalModes
from wrist_stiffness.mechanism.statics import contact_operators, platform_twist
from wrist_stiffness.mechanism.vectors import cross, frame_about, unit
from wrist_stiffness.report.pictures.figure import new_figure, save_figure

SHOWN_M = 0.010
"""The largest displacement is drawn about this long."""

ALONG, AROUND = 24, 24


@dataclass(frozen=True)
class Shape:
    """A drawn body: a grid of surface points and how they move."""

    points: Array  # (p, q, 3), of the rigid wrist in F [m]
    shift: Array  # (p, q, 3), displacement [m]


def bent_shapes(table: Table, theta: Array, push: Push) -> list[Shape]:
    """Return the bodies of the wrist at a pose with their displacements under a load alone.

    `theta` (2,): motor angles [rad]; `push`: the load; own weight is left out.  Raises
    `UnreachablePoseError` or `SingularPoseError` or `LoadRangeError` if the pose or the load is out
    of range.
    """
    configuration = table.workspace.configuration(theta)
    wrench = push.wrench(configuration.platform)
    table.check_load(wrench)
    response = respond(contact_operators(configuration, table.components, np.zeros(3)), wrench)
    screws = component_screws(configuration, table.components, wrench, response.force)
    return moved_shapes(table, configuration, screws)


def moved_shapes(table: Table, configuration: Configuration, screws: Array) -> list[Shape]:
    """Return the bodies of the wrist at a pose with their displacements.

    `screws` (8, 6): elastic screw of each component at O in F [m, rad].
    """
    projectors = influence(configuration)
    halves = screws.reshape(-1, 2, 3)
    # (8, 6) each: screw of the interface frame at the near and at the far end of each component.
    near, far = (
        np.einsum("mkij,khj->mhi", laws, halves).reshape(-1, 6) for laws in projectors.of_frames()
    )
    shapes = [
        (_link if name in LINKS else _bushing)(table, configuration, name, *ends)
        for name, *ends in zip(ELASTIC, near, far, strict=True)
    ]
    return [*shapes, _platform(table, configuration, platform_twist(projectors, screws))]


def draw_bent_wrist(table: Table, theta: Array, push: Push, path: Path) -> None:
    """Draw the wrist at angles (2,) [rad], rigid in grey, bent in colours of its displacement."""
    shapes = bent_shapes(table, theta, push)
    largest = _largest(shapes)
    factor = round_down(SHOWN_M / largest) if largest > 0.0 else 1.0
    figure = new_figure(8.0, 7.0)
    plot: Any = figure.add_subplot(projection="3d")
    colours = _draw_shapes(plot, shapes, factor, 1e6 * largest)
    configuration = table.mechanism.forward(theta)
    if (size := float(np.linalg.norm(push.force))) > 0.0:
        tip = 1e3 * (configuration.platform @ push.point)
        arrow = 25.0 * push.force / size
        plot.quiver(*(tip - arrow), *arrow, color="tab:red", linewidth=2.0)
    _draw_axes_and_pins(plot, table, configuration)
    plot.set_title(
        f"{_at(table, theta)} under {push.text}\ndisplacement exaggerated {factor:g} times; "
        "bars interpolated between their ends",
        fontsize=9,
    )
    figure.colorbar(colours, ax=plot, shrink=0.7, label="displacement [µm]")
    save_figure(figure, path)


def draw_mode_shapes(
    table: Table, configuration: Configuration, modes: NaturalModes, path: Path
) -> None:
    """Draw the four slowest natural modes at one pose, a stack of one; rigid in grey."""
    figure = new_figure(10.0, 9.0)
    # The layout does not see the names of vertical axes.
    figure.get_layout_engine().set(rect=(0.0, 0.0, 0.96, 1.0))
    pose = Configuration.of_row(configuration.row[0])
    for number in range(4):
        plot: Any = figure.add_subplot(2, 2, number + 1, projection="3d")
        shapes = moved_shapes(table, pose, modes.screws[0, number])
        _draw_shapes(plot, shapes, SHOWN_M / _largest(shapes), 1.0, named=number == 0)
        plot.set_title(f"mode {number + 1}: {modes.frequency[0, number]:.0f} Hz", fontsize=10)
    figure.suptitle(
        f"{_at(table, pose.theta)}: natural modes, motors locked, flanges as they rest\n"
        "colour: displacement over the largest one",
        fontsize=10,
    )
    save_figure(figure, path)


def _at(table: Table, theta: Array) -> str:
    return "{} at ({:.0f}, {:.0f}) deg".format(table.geometry.name, *np.degrees(theta))


def _largest(shapes: list[Shape]) -> float:
    return max(float(np.max(np.linalg.norm(shape.shift, axis=-1))) for shape in shapes)


def _draw_shapes(
    plot: Any, shapes: list[Shape], factor: float, largest: float, named: bool = True
) -> Any:
    """Draw shapes with displacements times a factor, and return their colours.

    `largest`: what the largest displacement is called, in the unit of the colours.
    """
    from matplotlib.cm import ScalarMappable
    from matplotlib.colors import Normalize

    colours = ScalarMappable(Normalize(0.0, largest), "viridis")
    per_metre = largest / max(_largest(shapes), 1e-12)
    middles = []
    for shape in shapes:
        # The displacement decides the colour, millimetres the place.
        size = per_metre * np.linalg.norm(shape.shift, axis=-1)
        rows = size[:-1] + size[1:]
        faces = colours.to_rgba(0.25 * (rows[:, :-1] + rows[:, 1:]))
        bent = 1e3 * (shape.points + factor * shape.shift)
        rigid = 1e3 * shape.points
        plot.plot_surface(
            *np.moveaxis(bent, -1, 0), facecolors=faces, rstride=1, cstride=1, shade=False
        )
        plot.plot_wireframe(
            *np.moveaxis(rigid, -1, 0), color="grey", linewidth=0.3, rstride=2, cstride=3, alpha=0.5
        )
        middles.append(bent[len(bent) // 2].mean(axis=0))
    plot.set_aspect("equal")
    if named:
        _write_names(plot, np.array(middles))
    plot.set_xlabel("x [mm]")
    plot.set_ylabel("y [mm]")
    plot.set_zlabel("z [mm]")
    return colours


def _write_names(plot: Any, middles: Array) -> None:
    """Write the names of the bodies at points (9, 3), none upon another."""
    plot.apply_aspect()
    seen = np.column_stack([middles, np.ones(len(middles))]) @ plot.get_proj().T
    at = seen[:, :2] / seen[:, 3:]
    points = plot.transData.transform(at) * 72.0 / plot.figure.dpi
    label = {"facecolor": "white", "edgecolor": "none", "alpha": 0.7, "pad": 1.0}
    style = {"fontsize": 8, "ha": "center", "va": "center", "bbox": label, "zorder": 1000}
    for name, place, up in zip((*ELASTIC, "platform"), at, raised(points, 40.0, 12.0), strict=True):
        plot.annotate(name, place, (0.0, up), textcoords="offset points", **style)


def raised(places: Array, width: float, height: float) -> Array:
    """Return how far up labels of one size at (n, 2) must go so that none covers another, (n,)."""
    free = places.copy()
    done: list[int] = []
    for number in np.argsort(places[:, 1]).tolist():
        for other in sorted(done, key=lambda each: free[each, 1]):
            if (np.abs(free[number] - free[other]) < (width, height)).all():
                free[number, 1] = free[other, 1] + height
        done.append(number)
    return np.asarray(free[:, 1] - places[:, 1])


def _shift(points: Array, screw: Array) -> Array:
    return screw[..., :3] + cross(screw[..., 3:], points)


def _link(table: Table, configuration: Configuration, name: str, near: Array, far: Array) -> Shape:
    bar = table.geometry.links[name]
    turn = configuration.rotations[name]
    u, v = (turn @ end for end in table.geometry.link_ends(name))
    normal = unit(cross(u, v))
    across = cross(normal, u)
    angle = float(np.arctan2(v @ across, v @ u))
    past = bar.overhang / bar.arc_radius
    along = np.linspace(-past, angle + past, ALONG)
    radial = np.outer(np.cos(along), u) + np.outer(np.sin(along), across)
    half_radial, half_axial = bar.section_radial / 2.0, bar.section_axial / 2.0
    corners = ((1, 1), (1, -1), (-1, -1), (-1, 1), (1, 1))
    points = np.stack(
        [(bar.arc_radius + i * half_radial) * radial + j * half_axial * normal for i, j in corners],
        axis=1,
    )
    place = np.clip(along / angle, 0.0, 1.0)[:, None, None]
    blend = place * place * (3.0 - 2.0 * place)
    return Shape(points, _shift(points, near + blend * (far - near)))


def _axis(configuration: Configuration, table: Table, joint: str) -> Array:
    moving = {"joint_2": configuration.b, "joint_3": configuration.c, "joint_4": configuration.d}
    return moving.get(joint, table.geometry.axes[joint])


def _bushing(
    table: Table, configuration: Configuration, joint: str, near: Array, far: Array
) -> Shape:
    bushing = table.geometry.bushings[joint]
    axis = _axis(configuration, table, joint)
    ring = (bushing.pin_diameter / 2.0 + bushing.wall) * _around(axis, AROUND)
    half = bushing.length / 2.0
    centres = [(bushing.radius + end) * axis for end in (-half, half)]
    points = np.stack([centre + ring for centre in centres])
    # The pin's wall moves with its body; halfway to the hub's wall is the sleeve's middle.
    fixed = CARRIER[joint] == "frame"
    return Shape(points, _shift(points, far if fixed else 0.5 * (near + far)))


def _around(axis: Array, count: int) -> Array:
    """Return unit vectors all around an axis, (count, 3)."""
    across = frame_about(axis)[:, 1:]
    turn = np.linspace(0.0, 2.0 * np.pi, count)
    return np.asarray(np.stack([np.cos(turn), np.sin(turn)], axis=1) @ across.T)


def _platform(table: Table, configuration: Configuration, twist: Array) -> Shape:
    plate = table.geometry.platform
    normal = configuration.platform @ plate.normal
    centre = configuration.platform @ plate.centre
    radii = plate.diameter / 2.0 * np.array([0.0, 0.5, 1.0])
    points = centre + radii[:, None, None] * _around(normal, 2 * AROUND)
    return Shape(points, _shift(points, twist))


def _draw_axes_and_pins(plot: Any, table: Table, configuration: Configuration) -> None:
    for joint in JOINTS:
        end = 1e3 * table.geometry.bushings[joint].radius * _axis(configuration, table, joint)
        plot.plot(*np.stack([np.zeros(3), end]).T, color="black", linewidth=0.4, linestyle=":")
    for link in LINKS:
        for joint in ENDS[link]:
            side = np.sign(table.geometry.bushings[joint].radius)
            axis = _axis(configuration, table, joint)
            ends = (
                side * table.geometry.links[link].arc_radius,
                table.geometry.bushings[joint].radius,
            )
            plot.plot(*np.stack([1e3 * end * axis for end in ends]).T, color="black", linewidth=2.0)


def round_down(value: float) -> float:
    """Return the largest of 1, 2, 5, 10, ... that is not above a value."""
    size = 10.0 ** np.floor(np.log10(value))
    return float(size * max(step for step in (1.0, 2.0, 5.0) if step * size <= value))
