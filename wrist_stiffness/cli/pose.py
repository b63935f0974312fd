"""`wrist-stiffness predict` and `explain`: the error at one pose."""

from __future__ import annotations

import argparse

from wrist_stiffness.cli.options import POSE, model_named, whole_load
from wrist_stiffness.cli.parser import command, flag, named_numbers, option, repeated, say


@command(*POSE, flag("--both", "by the table's closed form and by its spline"))
def predict(arguments: argparse.Namespace) -> int:
    """Predict the pose error at one pose.

    Predict how far the platform is off at given motor angles under a given load, own weight
    included: s is the shift of the platform's point at O, phi the angle by which it is turned.

    example:
      wrist-stiffness predict --angles 20 -10 --load 0 0 -1
    """
    import numpy as np

    from wrist_stiffness.commands.predict import predict
    from wrist_stiffness.report.terminal import prediction_lines

    load, theta = whole_load(arguments.load), np.radians(arguments.angles).tolist()
    found = predict(model_named(arguments), theta, load, arguments.on_platform, arguments.both)
    return say(arguments, prediction_lines(found, any(load)), found)


@command(
    *POSE,
    option(
        "--measured",
        "measured pose: the platform's point O in wrist_base [mm] and its quaternion",
        ("X", "Y", "Z", "QX", "QY", "QZ", "QW"),
        nargs=7,
        type=float,
    ),
    repeated("--temperature", "PART=DEGC", "temperature of a component or of ambient"),
    repeated("--covariate", "NAME=VALUE", "value of a covariate that the model's formulas use"),
)
def explain(arguments: argparse.Namespace) -> int:
    """Why the platform is off at one pose.

    Say why the platform is off at given motor angles under a given load: the error split by
    component and by effect.  Each part is given along the whole shift and about the whole rotation
    axis, so that the parts add up; a negative part holds the others back.

    for example:
      wrist-stiffness explain --angles 20 -10 --load 0 0 -1
      wrist-stiffness explain --angles 0 0 --load 0 0 -1 --measured 0.001 0 -0.012 0 0 0.0001 1
    """
    import numpy as np

    from wrist_stiffness.commands.explain import explain
    from wrist_stiffness.model.block import Load
    from wrist_stiffness.report.terminal import explanation_lines

    measured = arguments.measured
    if measured is not None:
        measured = [*(1e-3 * value for value in measured[:3]), *measured[3:]]
    found = explain(
        model_named(arguments),
        np.radians(arguments.angles).tolist(),
        Load(np.array(whole_load(arguments.load)), arguments.on_platform),
        measured,
        named_numbers(arguments.temperature, "--temperature"),
        named_numbers(arguments.covariate, "--covariate"),
    )
    return say(arguments, explanation_lines(found), found.as_values())
