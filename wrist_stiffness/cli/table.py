"""`wrist-stiffness table build | part | check | show`: the offline sweep and its table."""

from __future__ import annotations

import argparse
from dataclasses import asdict
from typing import Any

from wrist_stiffness.cli.options import table_named, whole_load
from wrist_stiffness.cli.parser import EXIT_DONE, EXIT_NO, Commands, add_command, say
from wrist_stiffness.shipped import shipped_file

SHIPPED = shipped_file("config/palmieri2015.yaml")

BUILD = """\
Condense the links and bushings of a geometry by solid finite elements and sweep the wrist over its
joint space. Mesh, contact rings and grid are refined until the stated error keeps the tolerance, or
it says what does not. Takes one to three minutes with the default."""

BUILD_EPILOG = """\
example, a wrist of one's own:
  wrist-stiffness table build my_wrist.yaml -o my_wrist.npz"""

PART = """\
Mesh a link drawn in CAD and print its 6 x 6 stiffness, to be put under that link in a geometry
file. The STEP file holds one solid in mm, in the base frame with the wrist at home and O at the
origin; its faces motor_bore and platform_bore are held."""

PART_EPILOG = """\
example, a forked link_1:
  wrist-stiffness table part fork.step --link link_1 --geometry my_wrist.yaml"""

CHECK = """\
Verify a table: complete and undamaged, compliance positive definite, splines as good as stated.
With --rebuild the whole sweep runs again from the geometry in the table and all numbers are
compared. The exit code is 1 if a check fails."""

CHECK_EPILOG = """\
example, is this still the table of that geometry?
  wrist-stiffness table check my_wrist.npz --geometry my_wrist.yaml"""

SHOW = """\
Say what a table holds and draw what a load does: maps of the platform's displacement and
orientation error over both motor angles with the border of the operative workspace, the error
budget (whose share is it?) and the bent wrist. The default is the rated load, 1 N downward.
With --modes it draws natural frequencies and mode shapes instead."""

SHOW_EPILOG = """\
example, 2 N along y at a point of the platform's plate:
  wrist-stiffness table show -o maps --load 0 2 0 --at 20 0 -18

example, natural frequencies with a gripper of 0.2 kg, 30 mm below O:
  wrist-stiffness table show -o maps --modes --payload 0.2 0 0 -30"""


def add_parser(commands: Commands) -> None:
    """Add the parsers of the table commands."""
    parser = commands.add_parser("table", help="build, check or show a lookup table")
    actions = parser.add_subparsers(metavar="ACTION", required=True)

    what = "run the finite-element sweep"
    build = add_command(actions, "build", what, (BUILD, BUILD_EPILOG), _build)
    build.add_argument("geometry", nargs="?", help="geometry file (default: the shipped wrist's)")
    build.add_argument("-o", "--output", required=True, metavar="TABLE", help="ends in .npz")
    build.option("--tolerance", 0.025, "largest error of s and phi to be stated", "FRACTION")
    build.add_argument(
        "--grid", type=int, metavar="N", help="fixed N x N grid; 5 gives the paper's 25 poses"
    )
    build.add_argument(
        "--interface",
        choices=("rigid", "distributing", "sliding"),
        default="rigid",
        help="how a pin or hub holds a wall: every point, in the mean, or a bushing's by pressure "
        "alone (default: rigid)",
    )
    build.add_argument(
        "--evaluation",
        choices=("closed_form", "spline"),
        default="closed_form",
        help="what the nodes use (default: closed_form)",
    )

    what = "stiffness of a link drawn in CAD"
    part = add_command(actions, "part", what, (PART, PART_EPILOG), _part)
    part.add_argument("step", help="STEP file")
    links = ("link_1", "link_2", "link_3")
    part.add_argument("--link", required=True, choices=links, help="the link that it draws")
    part.add_argument("--geometry", metavar="FILE", help="of its wrist (default: the shipped one)")

    check = add_command(actions, "check", "verify a table", (CHECK, CHECK_EPILOG), _check)
    check.add_argument("table", nargs="?", help="table file (default: the shipped one)")
    check.add_argument("--geometry", metavar="FILE", help="must be the geometry of the table")
    check.flag("--rebuild", "compute it again and compare")

    what = "draw its maps and error budget"
    show = add_command(actions, "show", what, (SHOW, SHOW_EPILOG), _show)
    show.add_argument("table", nargs="?", help="table file (default: the shipped one)")
    show.add_argument(
        "-o", "--output", default=".", metavar="FOLDER", help="for the PNG files (default: here)"
    )
    show.add_argument(
        "--load",
        nargs="+",
        type=float,
        metavar="N",
        help="force [N], or force [N] and moment [N m], in wrist_base (default: the rated load)",
    )
    show.add_argument(
        "--at",
        nargs=3,
        type=float,
        default=(0.0, 0.0, 0.0),
        metavar="MM",
        help="where --load acts, in wrist_platform [mm] (default: O)",
    )
    show.flag("--modes", "natural frequencies and mode shapes")
    show.add_argument(
        "--payload",
        nargs=4,
        type=float,
        metavar=("KG", "X", "Y", "Z"),
        help="for --modes: mass [kg] and centre of gravity in wrist_platform [mm] (default: none)",
    )
    show.add_argument(
        "--payload-inertia",
        nargs=3,
        type=float,
        metavar=("IXX", "IYY", "IZZ"),
        help="of the payload about its centre of gravity [kg mm^2] (default: a point)",
    )


def _build(arguments: argparse.Namespace) -> int:
    from wrist_stiffness.cli.progress import Progress
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


def _part(arguments: argparse.Namespace) -> int:
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


def _check(arguments: argparse.Namespace) -> int:
    from wrist_stiffness.cli.progress import Progress
    from wrist_stiffness.commands.table_check import check

    path = arguments.table or shipped_file("precomputed/palmieri2015.npz")
    findings = check(path, arguments.geometry, arguments.rebuild, Progress("rebuild"))
    passed = all(finding.passed for finding in findings)
    lines = [f"{'good' if each.passed else 'BAD ':4} {each.name}: {each.text}" for each in findings]
    lines.append(f"{path}: {'good' if passed else 'NOT good'}")
    values = {"passed": passed, "findings": [asdict(finding) for finding in findings]}
    say(arguments, lines, values)
    return EXIT_DONE if passed else EXIT_NO


def _show(arguments: argparse.Namespace) -> int:
    from wrist_stiffness.commands import modes, table
    from wrist_stiffness.commands.budget import Push
    from wrist_stiffness.report.pictures.table import draw_maps, draw_modes
    from wrist_stiffness.report.terminal import fact_lines, load_lines, mode_lines

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
            push = Push.of_millimetres(whole_load(arguments.load), arguments.at)
        pictures = draw_maps(shown, arguments.output, push)
        values = table.summarise(shown)
        lines = [*fact_lines(shown), *load_lines(values)]
    lines += [f"written: {picture}" for picture in pictures]
    return say(arguments, lines, values)
