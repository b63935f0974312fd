"""`wrist-stiffness plan`: the first experiment, or the next one between rivals."""

from __future__ import annotations

import argparse

from wrist_stiffness.cli.options import add_model, add_sensor_names, model_named, recordings_named
from wrist_stiffness.cli.parser import EXIT_DONE, EXIT_NO, Commands, add_command, say
from wrist_stiffness.errors import InputError

DESCRIPTION = """\
Plan an experiment: which poses, approached from where, under which of your loads, how long. With
--commissioning it is the first one on a wrist: it calibrates it, shows every effect that poses and
loads can show, and keeps those apart that look alike. With --diagnosis it is the next one: it
separates the effects that 'diagnose --json' could not tell apart. LOADS.yaml lists the loads that
you can apply; nothing else is proposed.

PLAN is a folder: plan.csv (a row for each measurement at rest), trajectory (a recording with the
motors' motion as one message on /motor_trajectory), plan.png and summary.txt. Loads that hands put
on are due at the times of the table. Drive near the first pose before you start."""

EPILOG = """\
examples:
  wrist-stiffness plan --commissioning --loads loads.yaml --minutes 30 -o first_plan
  wrist-stiffness plan --diagnosis found.json --recording day_1 --loads loads.yaml -o next_plan
  ros2 bag play first_plan/trajectory     # with /motor_trajectory remapped to your controller

loads.yaml:
  schema: 1
  loads:
    - {kind: weight, name: brass 100 g, mass_kg: 0.1, point_mm: [20, 0, -18], change_s: 15}

Exit code 1: no experiment with these loads would settle any of the questions."""


def add_parser(commands: Commands) -> None:
    """Add the parser of `plan`."""
    what = "plan the first or the next experiment"
    parser = add_command(commands, "plan", what, (DESCRIPTION, EPILOG), _run)
    add_model(parser)
    which = parser.add_mutually_exclusive_group(required=True)
    which.add_argument("--commissioning", action="store_true", help="the first experiment")
    which.add_argument("--diagnosis", metavar="FILE", help="result of diagnose --json")
    earlier = "recording that the diagnosis read, so that the plan adds to it"
    parser.repeated("--recording", "FILE", earlier)
    parser.add_argument("--loads", metavar="FILE", required=True, help="loads you can apply")
    parser.add_argument("-o", "--output", metavar="PLAN", required=True, help="folder to make")
    parser.add_argument(
        "--minutes",
        type=float,
        help="duration (default with --diagnosis: as long as it takes, up to 60)",
    )
    parser.option("--speed", 30.0, "fastest motor speed", "DEG_S")
    parser.option("--dwell", 2.0, "time for one measurement at rest, settling included", "S")
    parser.flag("--static", "the pose sensor measures at rest only (a CMM)")
    parser.add_argument(
        "--noise",
        nargs=2,
        type=float,
        default=[1.0, 1.0],
        metavar=("UM", "MDEG"),
        help="scatter of each component of a measured pose, with --commissioning (1 um, 1 mdeg)",
    )
    parser.option("--seed", 0, "another one, another plan")
    add_sensor_names(parser)


def _run(arguments: argparse.Namespace) -> int:
    from wrist_stiffness.cli.progress import Progress
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
    text = plan_summary(planned.plan, arguments.commissioning)
    say(arguments, [text], planned.as_values())
    timeline = planned.plan.timeline
    if timeline is None:
        return EXIT_NO
    write_plan(planned.model.table, timeline, text, arguments.output)
    print(f"written: {arguments.output}")
    return EXIT_DONE
