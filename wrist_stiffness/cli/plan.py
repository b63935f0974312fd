"""`wrist-stiffness plan`: the first experiment, or the next one between rivals."""

from __future__ import annotations

import argparse

from wrist_stiffness.cli.options import MODEL, SENSOR_NAMES, model_named, recordings_named
from wrist_stiffness.cli.parser import (
    EXIT_DONE,
    EXIT_NO,
    command,
    flag,
    one_of,
    option,
    output,
    repeated,
    say,
    value,
)
from wrist_stiffness.cli.progress import Progress
from wrist_stiffness.errors import InputError


@command(
    MODEL,
    one_of(
        flag("--commissioning", "the first experiment"),
        option("--diagnosis", "result of diagnose --json", "FILE"),
        required=True,
    ),
    repeated(
        "--recording", "FILE", "recording that the diagnosis read, so that the plan adds to it"
    ),
    option("--loads", "loads you can apply", "FILE", required=True),
    output("PLAN", "folder to make"),
    option(
        "--minutes",
        "duration, which --commissioning needs (default with --diagnosis: as long as it takes, up "
        "to 60)",
        type=float,
    ),
    value("--speed", 30.0, "fastest motor speed", "DEG_S"),
    value("--dwell", 2.0, "time for one measurement at rest, settling included", "S"),
    flag("--static", "the pose sensor measures at rest only (a CMM)"),
    option(
        "--noise",
        "scatter of each component of a measured pose, with --commissioning (1 um, 1 mdeg)",
        ("UM", "MDEG"),
        nargs=2,
        type=float,
        default=[1.0, 1.0],
    ),
    value("--seed", 0, "another one, another plan"),
    *SENSOR_NAMES,
)
def plan(arguments: argparse.Namespace) -> int:
    """Plan the first or the next experiment.

    Plan an experiment: which poses, approached from where, under which of your loads, how long.
    With --commissioning it is the first one on a wrist: it calibrates it, shows every effect that
    poses and loads can show, and keeps those apart that look alike. With --diagnosis it is the next
    one: it separates the effects that 'diagnose --json' could not tell apart. LOADS.yaml lists the
    loads that you can apply; nothing else is proposed.

    PLAN is a folder: plan.csv (a row for each measurement at rest), path.csv (the way between them
    too, a table for 'import' to be filled in), trajectory (a recording with the motors' motion as
    one message on /motor_trajectory), plan.png and summary.txt. Loads that hands put on are due at
    the times of plan.csv. Drive near the first pose before you start.

    for example:
      wrist-stiffness plan --commissioning --loads loads.yaml --minutes 30 -o first_plan
      wrist-stiffness plan worn.yaml --diagnosis why.json --recording day --loads loads.yaml -o next
      ros2 bag play first_plan/trajectory     # with /motor_trajectory remapped to your controller

    loads.yaml:
      schema: 1
      loads:
        - {kind: weight, name: brass 100 g, mass_kg: 0.1, point_mm: [20, 0, -18], change_s: 15}

    Exit code 1: no experiment with these loads would settle any of the questions.
    """
    if arguments.commissioning and arguments.minutes is None:
        raise InputError("give --minutes: how long the commissioning may take")
    from wrist_stiffness.commands.plan import Options, plan_experiment
    from wrist_stiffness.report.plan import plan_summary, require_new_folder, write_plan

    require_new_folder(arguments.output)
    options = Options(
        arguments.minutes,
        speed_deg_per_s=arguments.speed,
        dwell_s=arguments.dwell,
        in_motion=not arguments.static,
        noise_um=arguments.noise[0],
        noise_mdeg=arguments.noise[1],
        seed=arguments.seed,
    )
    recordings = None
    if arguments.recording:
        if arguments.commissioning:
            raise InputError("--recording belongs to --diagnosis: a commissioning is the first one")
        recordings = recordings_named(arguments.recording, arguments)
    planned = plan_experiment(
        model_named(arguments),
        arguments.loads,
        options,
        arguments.diagnosis,
        recordings,
        Progress("plan"),
    )
    text = "\n".join([*planned.remarks, plan_summary(planned.plan, arguments.commissioning)])
    say(arguments, [text], planned.as_values())
    timeline = planned.plan.timeline
    if timeline is None:
        return EXIT_NO
    write_plan(planned.model.table, timeline, text, arguments.output)
    print(f"written: {arguments.output}")
    return EXIT_DONE
