"""`wrist-stiffness table build | part | check | show`: the offline sweep and its table."""

from __future__ import annotations

import argparse
from dataclasses import asdict
from typing import Any

from wrist_stiffness.cli.options import table_named, whole_load
from wrist_stiffness.cli.parser import (
    EXIT_DONE,
    EXIT_NO,
    Commands,
    command,
    flag,
    option,
    output,
    say,
    value,
)
from wrist_stiffness.cli.progress import Progress
from wrist_stiffness.errors import InputError
from wrist_stiffness.shipped import shipped_file

SHIPPED = shipped_file("config/palmieri2015.yaml")
TABLE = option("table", "table file (default: the shipped one)", nargs="?")


@command(
    option("geometry", "geometry file (default: the shipped wrist's)", nargs="?"),
    output("TABLE", "ends in .npz"),
    value("--tolerance", 0.025, "largest error of s and phi to be stated", "FRACTION"),
    option("--grid", "fixed N x N grid; 5 gives the paper's 25 poses", "N", type=int),
    option(
        "--interface",
        "how a pin or hub holds a wall: every point, in the mean, or a bushing's by pressure "
        "alone (default: rigid)",
        choices=("rigid", "distributing", "sliding"),
        default="rigid",
    ),
    option(
        "--evaluation",
        "what the nodes use (default: closed_form)",
        choices=("closed_form", "spline"),
        default="closed_form",
    ),
)
def build(arguments: argparse.Namespace) -> int:
    """Run the finite-element sweep.

    Condense the links and bushings of a geometry by solid finite elements and sweep the wrist over
    its joint space. Mesh, contact rings and grid are refined until the stated error keeps the
    tolerance, or it says what does not. Takes one to three minutes with the default.

    example, a wrist of one's own:
      wrist-stiffness table build my_wrist.yaml -o my_wrist.npz
    """
    from wrist_stiffness.commands import table
    from wrist_stiffness.report.terminal import fact_lines

    built = table.build(
        arguments.geometry or SHIPPED,
        arguments.output,
        evaluation=arguments.evaluation,
        interface=arguments.interface,
        tolerance=arguments.tolerance,
        per_axis=arguments.grid,
        progress=Progress("sweep"),
    )
    lines = [*fact_lines(built)]
    errors = built.header.errors
    if (stated := errors["stated_relative"]) > arguments.tolerance:
        parts = ("mesh", "contact", "walls", "second_order")
        largest = max(parts, key=lambda part: errors[f"{part}_relative"])
        lines.append(
            f"tolerance {100 * arguments.tolerance:g} % NOT met: the stated error is "
            f"{100 * stated:.2f} %, most of it of the {largest.replace('_', ' ')}"
        )
    written = f"written: {arguments.output} (checksum {built.checksum[:12]})"
    values = asdict(built.header) | {"checksum": built.checksum}
    return say(arguments, [*lines, written], values)


@command(
    option("step", "STEP file"),
    option(
        "--link", "the link that it draws", required=True, choices=("link_1", "link_2", "link_3")
    ),
    option("--geometry", "of its wrist (default: the shipped one)", "FILE"),
)
def part(arguments: argparse.Namespace) -> int:
    """Stiffness of a link drawn in CAD.

    Mesh a link drawn in CAD and print its 6 x 6 stiffness, to be put under that link in a geometry
    file. The STEP file holds one solid in mm, in the base frame with the wrist at home and O at the
    origin; its faces motor_bore and platform_bore are held.

    example, a forked link_1:
      wrist-stiffness table part fork.step --link link_1 --geometry my_wrist.yaml
    """
    from wrist_stiffness.commands.table import part

    found = part(arguments.step, arguments.geometry or SHIPPED, arguments.link)
    matrix = found.stiffness.tolist()
    rows = [f"    - [{', '.join(f'{value:.9e}' for value in row)}]" for row in matrix]
    lines = [
        f"# {arguments.step}: {found.elements} elements; "
        f"at most {100 * found.coarser:.2f} % stiffer if coarser by a quarter",
        "stiffness:",
        "  matrix_N_mm:",
        *rows,
    ]
    return say(arguments, lines, {"stiffness": {"matrix_N_mm": matrix}})


@command(
    TABLE,
    option("--geometry", "must be the geometry of the table", "FILE"),
    flag("--rebuild", "compute it again and compare"),
)
def check(arguments: argparse.Namespace) -> int:
    """Verify a table.

    Verify a table: complete and undamaged, compliance positive definite, splines as good as stated.
    With --rebuild the whole sweep runs again from the geometry in the table and all numbers are
    compared. The exit code is 1 if a check fails.

    example, is this still the table of that geometry?
      wrist-stiffness table check my_wrist.npz --geometry my_wrist.yaml
    """
    from wrist_stiffness.commands.table import check

    path = arguments.table or shipped_file("precomputed/palmieri2015.npz")
    findings = list(check(path, arguments.geometry, arguments.rebuild, Progress("rebuild")))
    passed = all(finding.passed for finding in findings)
    lines = [f"{'good' if each.passed else 'BAD ':4} {each.name}: {each.text}" for each in findings]
    lines.append(f"{path}: {'good' if passed else 'NOT good'}")
    values = {"passed": passed, "findings": [asdict(finding) for finding in findings]}
    say(arguments, lines, values)
    return EXIT_DONE if passed else EXIT_NO


@command(
    TABLE,
    output("FOLDER", "for the PNG files (default: here)", required=False, default="."),
    option(
        "--load",
        "force [N], or force [N] and moment [N m], in wrist_base (default: the rated load)",
        "N",
        nargs="+",
        type=float,
    ),
    option(
        "--at",
        "where --load acts, in wrist_platform [mm] (default: O)",
        "MM",
        nargs=3,
        type=float,
    ),
    flag("--modes", "natural frequencies and mode shapes"),
    option(
        "--payload",
        "for --modes: mass [kg] and centre of gravity in wrist_platform [mm] (default: none)",
        ("KG", "X", "Y", "Z"),
        nargs=4,
        type=float,
    ),
    option(
        "--payload-inertia",
        "of the payload about its centre of gravity [kg mm^2] (default: a point)",
        ("IXX", "IYY", "IZZ"),
        nargs=3,
        type=float,
    ),
)
def show(arguments: argparse.Namespace) -> int:
    """Draw its maps and error budget.

    Say what a table holds and draw what a load does: maps of the platform's displacement and
    orientation error over both motor angles with the border of the operative workspace, the error
    budget (whose share is it?) and the bent wrist. The default is the rated load, 1 N downward.
    With --modes it draws natural frequencies and mode shapes instead.

    example, 2 N along y at a point of the platform's plate:
      wrist-stiffness table show -o maps --load 0 2 0 --at 20 0 -18

    example, natural frequencies with a gripper of 0.2 kg, 30 mm below O:
      wrist-stiffness table show -o maps --modes --payload 0.2 0 0 -30
    """
    from wrist_stiffness.commands import modes, table
    from wrist_stiffness.commands.budget import Push
    from wrist_stiffness.report.pictures.table import draw_maps, draw_modes
    from wrist_stiffness.report.terminal import fact_lines, load_lines, mode_lines

    if arguments.modes and (arguments.load or arguments.at):
        raise InputError("--load and --at do not go with --modes, which has --payload")
    if not arguments.modes and (arguments.payload or arguments.payload_inertia):
        raise InputError("--payload and --payload-inertia belong to --modes")
    if arguments.at and not arguments.load:
        raise InputError("--at says where --load acts, which is missing")
    shown = table_named(arguments)
    values: Any
    if arguments.modes:
        payload = modes.payload_of(arguments.payload, arguments.payload_inertia)
        found = modes.mode_map(shown, payload)
        pictures = draw_modes(shown, found, arguments.output, payload)
        values = modes.summarise(shown, found)
        lines = mode_lines(values)
    else:
        push = None
        if arguments.load is not None:
            push = Push.of_millimetres(whole_load(arguments.load), arguments.at or (0.0,) * 3)
        pictures = draw_maps(shown, arguments.output, push)
        values = table.summarise(shown)
        lines = [*fact_lines(shown), *load_lines(values)]
    lines += [f"written: {picture}" for picture in pictures]
    return say(arguments, lines, values)


def add_parser(commands: Commands) -> None:
    """Add the parsers of the table commands."""
    parser = commands.add_parser("table", help="build, check or show a lookup table")
    actions = parser.add_subparsers(metavar="ACTION", required=True)
    for each in (build, part, check, show):
        each.add_parser(actions)
