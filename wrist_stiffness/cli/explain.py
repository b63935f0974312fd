"""`wrist-stiffness explain`: why the platform is off at one pose."""

from __future__ import annotations

import argparse

from wrist_stiffness.cli.parser import EXIT_DONE, OneLineParser, named_numbers
from wrist_stiffness.cli.pose_options import add_pose_options, whole_load

DESCRIPTION = """\
Say why the platform is off at given motor angles under a given load: the error split by component
and by effect.  Each part is given along the whole shift and about the whole rotation axis, so that
the parts add up; a negative part holds the others back."""

EPILOG = """\
examples:
  wrist-stiffness explain --angles 20 -10 --load 0 0 -1
  wrist-stiffness explain --angles 0 0 --load 0 0 -1 --measured 0.001 0 -0.012 0 0 0.0001 1"""

POSE = ("X", "Y", "Z", "QX", "QY", "QZ", "QW")


def add_parser(commands: argparse._SubParsersAction[OneLineParser]) -> None:
    """Add the parser of `explain`."""
    parser = commands.add_parser(
        "explain",
        help="why the platform is off at one pose",
        description=DESCRIPTION,
        epilog=EPILOG,
        formatter_class=argparse.RawDescriptionHelpFormatter,
    )
    add_pose_options(parser)
    parser.add_argument(
        "--measured",
        nargs=7,
        type=float,
        metavar=POSE,
        help="measured pose: the platform's point O in wrist_base [mm] and its quaternion",
    )
    parser.add_argument(
        "--temperature",
        action="append",
        default=[],
        metavar="PART=DEGC",
        help="temperature of a component or of ambient; may be given several times",
    )
    parser.add_argument(
        "--covariate",
        action="append",
        default=[],
        metavar="NAME=VALUE",
        help="value of a covariate that the model's formulas use; may be given several times",
    )
    parser.add_argument("--json", metavar="FILE", help="write the result here as well")
    parser.set_defaults(run=_run)


def _run(arguments: argparse.Namespace) -> int:
    import numpy as np

    from wrist_stiffness.commands.explain import explain
    from wrist_stiffness.commands.json_file import write_json
    from wrist_stiffness.model.block import Load
    from wrist_stiffness.shipped import shipped_file

    load = np.array(whole_load(arguments.load))
    measured = arguments.measured
    if measured is not None:
        measured = [*(1e-3 * value for value in measured[:3]), *measured[3:]]
    explanation = explain(
        arguments.model or shipped_file("config/palmieri2015_model.yaml"),
        np.radians(arguments.angles).tolist(),
        Load(load, arguments.on_platform),
        measured,
        named_numbers(arguments.temperature, "--temperature"),
        named_numbers(arguments.covariate, "--covariate"),
    )
    values = explanation.as_values()
    print(f"{'':34}{'s [um]':>9}          {'phi [mdeg]':>12}")
    for row in values["rows"]:
        numbers = (row[key] for key in ("s_um", "s_sigma_um", "phi_mdeg", "phi_sigma_mdeg"))
        print(_line(row["name"], *numbers), row["meaning"])
    sigma = values["prediction_sigma_um"], values["prediction_sigma_mdeg"]
    if explanation.measured:
        print(_line("measured", values["s_um"], 0.0, values["phi_mdeg"], 0.0))
        print(f"uncertainty of the prediction: {sigma[0]:.3f} um, {sigma[1]:.3f} mdeg")
        print(values["verdict"])
    else:
        print(_line("predicted", values["s_um"], sigma[0], values["phi_mdeg"], sigma[1]))
    for warning in values["warnings"]:
        print(f"note: {warning}")
    if arguments.json:
        write_json(arguments.json, values)
    return EXIT_DONE


def _line(name: str, s: float, s_sigma: float, phi: float, phi_sigma: float) -> str:
    spread = [f"+-{sigma:7.3f}" if sigma else " " * 9 for sigma in (s_sigma, phi_sigma)]
    return f"{name:34}{s:9.3f} {spread[0]} {phi:11.3f} {spread[1]}"
