"""`wrist-stiffness table build | check | show`: the offline sweep and its table."""

from __future__ import annotations

import argparse
from dataclasses import asdict
from typing import TYPE_CHECKING

from wrist_stiffness.cli.options import whole_load
from wrist_stiffness.cli.parser import EXIT_DONE, EXIT_NO, OneLineParser

if TYPE_CHECKING:
    from wrist_stiffness.lookup.table import Table

BUILD = """\
Condense the links and bushings of a geometry by solid finite elements and sweep the wrist over its
joint space. The grid is refined until poses that it never saw agree to the tolerance. Takes one to
three minutes."""

BUILD_EPILOG = """\
example, a wrist of one's own:
  wrist-stiffness table build my_wrist.yaml -o my_wrist.npz"""

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


def add_parser(commands: argparse._SubParsersAction[OneLineParser]) -> None:
    """Add the parsers of the three table commands."""
    parser = commands.add_parser("table", help="build, check or show a lookup table")
    actions = parser.add_subparsers(metavar="ACTION", required=True)

    build = _add(actions, "build", "run the finite-element sweep", BUILD, BUILD_EPILOG)
    build.add_argument("geometry", nargs="?", help="geometry file (default: the shipped wrist's)")
    build.add_argument("-o", "--output", required=True, metavar="TABLE", help="ends in .npz")
    build.add_argument(
        "--tolerance",
        type=float,
        default=0.005,
        metavar="FRACTION",
        help="largest relative error of the interpolated s and phi (default 0.005)",
    )
    build.add_argument(
        "--grid", type=int, metavar="N", help="fixed N x N grid; 5 gives the paper's 25 poses"
    )
    build.add_argument(
        "--kernel",
        choices=("thin_plate", "sandwell"),
        default="thin_plate",
        help="of the splines; the paper's is sandwell (default: thin_plate)",
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
    _add_json(build)
    build.set_defaults(run=_build)

    check = _add(actions, "check", "verify a table", CHECK, CHECK_EPILOG)
    check.add_argument("table", nargs="?", help="table file (default: the shipped one)")
    check.add_argument("--geometry", metavar="FILE", help="must be the geometry of the table")
    check.add_argument("--rebuild", action="store_true", help="compute it again and compare")
    _add_json(check)
    check.set_defaults(run=_check)

    show = _add(actions, "show", "draw its maps and error budget", SHOW, SHOW_EPILOG)
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
    show.add_argument("--modes", action="store_true", help="natural frequencies and mode shapes")
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
    _add_json(show)
    show.set_defaults(run=_show)


def _add(
    actions: argparse._SubParsersAction[OneLineParser],
    name: str,
    what: str,
    description: str,
    epilog: str,
) -> OneLineParser:
    return actions.add_parser(
        name,
        help=what,
        description=description,
        epilog=epilog,
        formatter_class=argparse.RawDescriptionHelpFormatter,
    )


def _add_json(parser: argparse.ArgumentParser) -> None:
    parser.add_argument("--json", metavar="FILE", help="write the result here as well")


def _build(arguments: argparse.Namespace) -> int:
    from wrist_stiffness.cli.progress import Progress
    from wrist_stiffness.commands import table
    from wrist_stiffness.commands.json_file import write_json
    from wrist_stiffness.shipped import shipped_file

    geometry = arguments.geometry or shipped_file("config/palmieri2015.yaml")
    built = table.build(
        geometry,
        arguments.output,
        evaluation=arguments.evaluation,
        interface=arguments.interface,
        tolerance=arguments.tolerance,
        per_axis=arguments.grid,
        kernel=arguments.kernel,
        progress=Progress("sweep"),
    )
    _print_facts(built)
    print(f"written: {arguments.output} (checksum {built.checksum[:12]})")
    if arguments.json:
        write_json(arguments.json, asdict(built.header) | {"checksum": built.checksum})
    return EXIT_DONE


def _check(arguments: argparse.Namespace) -> int:
    from wrist_stiffness.cli.progress import Progress
    from wrist_stiffness.commands.json_file import write_json
    from wrist_stiffness.commands.table_check import check
    from wrist_stiffness.shipped import shipped_file

    path = arguments.table or shipped_file("precomputed/palmieri2015.npz")
    findings = check(path, arguments.geometry, arguments.rebuild, Progress("rebuild"))
    for finding in findings:
        print(f"{'good' if finding.passed else 'BAD ':4} {finding.name}: {finding.text}")
    passed = all(finding.passed for finding in findings)
    print(f"{path}: {'good' if passed else 'NOT good'}")
    if arguments.json:
        write_json(
            arguments.json,
            {"passed": passed, "findings": [asdict(finding) for finding in findings]},
        )
    return EXIT_DONE if passed else EXIT_NO


def _show(arguments: argparse.Namespace) -> int:
    from wrist_stiffness.commands import table
    from wrist_stiffness.commands.budget import Push
    from wrist_stiffness.commands.json_file import write_json
    from wrist_stiffness.lookup.table_file import load_table
    from wrist_stiffness.report.table_pictures import draw_maps
    from wrist_stiffness.shipped import shipped_file

    path = arguments.table or shipped_file("precomputed/palmieri2015.npz")
    shown, push = load_table(path), None
    if arguments.modes:
        return _show_modes(shown, arguments)
    if arguments.load is not None:
        push = Push.of_millimetres(whole_load(arguments.load), arguments.at)
    pictures = draw_maps(shown, arguments.output, push)
    _print_facts(shown)
    summary = table.summarise(shown)
    print("rated load (1 N downward, own weight left out), operative workspace:")
    for name, row in summary.operative.items():
        print(
            f"  {name:12} mean {row['mean']:7.2f}   min {row['min']:7.2f}   max {row['max']:7.2f}"
        )
    print(
        f"whole map: s up to {summary.domain_max['s_um']:.3g} um, "
        f"phi up to {summary.domain_max['phi_mdeg']:.3g} mdeg"
    )
    for picture in pictures:
        print(f"written: {picture}")
    if arguments.json:
        write_json(arguments.json, asdict(summary))
    return EXIT_DONE


def _show_modes(shown: Table, arguments: argparse.Namespace) -> int:
    from wrist_stiffness.commands import modes
    from wrist_stiffness.commands.json_file import write_json
    from wrist_stiffness.report.table_pictures import draw_modes

    payload = modes.payload_of(arguments.payload, arguments.payload_inertia)
    found = modes.mode_map(shown, payload)
    pictures = draw_modes(shown, found, arguments.output, payload)
    print("natural frequencies [Hz], motors locked, no damping, operative workspace:")
    summary = {}
    for state in modes.STATES:
        values = found.operative(shown, state)
        summary[state] = {
            name: getattr(values, name)(axis=0).tolist() for name in ("min", "mean", "max")
        }
        for number in range(3):
            lowest, mean, highest = (row[number] for row in summary[state].values())
            label = f"flanges {state}, mode {number + 1}"
            print(f"  {label:26} mean {mean:7.1f}   min {lowest:7.1f}   max {highest:7.1f}")
    slowest = summary["at rest"]["min"][0]
    print(
        f"static corrections are right to 1 % for loads that change below {slowest / 10:.0f} Hz, "
        "a tenth of the lowest frequency at rest"
    )
    for picture in pictures:
        print(f"written: {picture}")
    if arguments.json:
        write_json(arguments.json, summary)
    return EXIT_DONE


def _print_facts(shown: Table) -> None:
    from wrist_stiffness.commands import table

    for name, text in table.facts(shown):
        print(f"{name + ':':26} {text}")
