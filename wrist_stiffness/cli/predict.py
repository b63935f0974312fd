"""`wrist-stiffness predict`: the pose error at one pose."""

from __future__ import annotations

import argparse

from wrist_stiffness.cli.parser import EXIT_DONE, OneLineParser
from wrist_stiffness.cli.pose_options import add_pose_options, whole_load

DESCRIPTION = """\
Predict how far the platform is off at given motor angles under a given load, own weight included:
s is the shift of the platform's point at O, phi the angle by which it is turned."""

EPILOG = """\
example:
  wrist-stiffness predict --angles 20 -10 --load 0 0 -1"""


def add_parser(commands: argparse._SubParsersAction[OneLineParser]) -> None:
    """Add the parser of `predict`."""
    parser = commands.add_parser(
        "predict",
        help="the pose error at one pose",
        description=DESCRIPTION,
        epilog=EPILOG,
        formatter_class=argparse.RawDescriptionHelpFormatter,
    )
    add_pose_options(parser)
    parser.add_argument(
        "--both", action="store_true", help="by the table's closed form and by its spline"
    )
    parser.add_argument("--json", metavar="FILE", help="write the result here as well")
    parser.set_defaults(run=_run)


def _run(arguments: argparse.Namespace) -> int:
    import numpy as np

    from wrist_stiffness.commands.json_file import write_json
    from wrist_stiffness.commands.predict import predict
    from wrist_stiffness.shipped import shipped_file

    load = whole_load(arguments.load)
    model = arguments.model or shipped_file("config/palmieri2015_model.yaml")
    theta = np.radians(arguments.angles).tolist()
    values = predict(model, theta, load, arguments.on_platform, arguments.both).as_values()
    x, y, z = values["shift_um"]
    print(f"s    {values['s_um']:8.3f} um    ({x:.3f}, {y:.3f}, {z:.3f})")
    x, y, z = values["rotation_mdeg"]
    print(f"phi  {values['phi_mdeg']:8.3f} mdeg  ({x:.3f}, {y:.3f}, {z:.3f})")
    if other := values["other_evaluation"]:
        way = "spline" if values["evaluation"] == "closed_form" else "closed form"
        print(f"by the table's {way}: s {other['s_um']:.3f} um, phi {other['phi_mdeg']:.3f} mdeg")
    if exact := values["exact"]:
        print(
            "past first order (2 mrad); with finite rotations: "
            f"s {exact['s_um']:.3f} um, phi {exact['phi_mdeg']:.3f} mdeg"
        )
    elif values["past_first_order"]:
        print("past first order (2 mrad), in which the model's effects are carried")
    inside = "inside" if values["in_operative_workspace"] else "outside"
    print(
        f"tilt {values['tilt_deg']:.2f} deg, {inside} the operative workspace, "
        f"{values['sectors_in_contact']} flange sectors in contact"
    )
    if any(load):
        print("share of the load's strain energy with free slides:")
        for name, share in sorted(values["energy_share"].items(), key=lambda item: -item[1]):
            print(f"  {name}  {100 * share:5.1f} %")
    if arguments.json:
        write_json(arguments.json, values)
    return EXIT_DONE
