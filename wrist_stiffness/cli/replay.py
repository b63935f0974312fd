"""`wrist-stiffness replay`: the nodes' own code over a recording, without a ROS graph."""

from __future__ import annotations

import argparse
from dataclasses import asdict
from pathlib import Path
from typing import TYPE_CHECKING

from wrist_stiffness.cli.options import add_sensor_names, settings_named
from wrist_stiffness.cli.parser import EXIT_DONE, EXIT_NO, OneLineParser

if TYPE_CHECKING:
    from wrist_stiffness.commands.output_changes import TopicChanges
    from wrist_stiffness.commands.replay_summary import ReplaySummary

DESCRIPTION = """\
Run the very code of the nodes over a recording and write it again with predicted pose errors and
corrected commands added. No ROS graph is needed; the result is the same to the bit every time.
With --against it also says what changed since an earlier replay of the same recording, after a
change of the model, the parameters or this program: exit code 1 if anything did."""

EPILOG = """\
example, a recording with other names:
  wrist-stiffness replay bag -o bag_predicted \\
      --topic /load_estimate:=/ft_sensor/wrench --joint wrist_a --joint wrist_b

example, what another model changes:
  wrist-stiffness replay bag --model old.yaml -o with_old
  wrist-stiffness replay bag --model new.yaml -o with_new --against with_old"""


def add_parser(commands: argparse._SubParsersAction[OneLineParser]) -> None:
    """Add the parser of `replay`."""
    parser = commands.add_parser(
        "replay",
        help="predicted errors and corrected commands for a recording",
        description=DESCRIPTION,
        epilog=EPILOG,
        formatter_class=argparse.RawDescriptionHelpFormatter,
    )
    parser.add_argument("recording", help="rosbag2 folder with MCAP storage, or a .mcap file")
    parser.add_argument("-o", "--output", required=True, metavar="OUT", help="folder or .mcap file")
    parser.add_argument("--model", help="model file (default: the shipped wrist's)")
    add_sensor_names(parser, "sensor frames, objective, contact policy ...")
    parser.add_argument("--overwrite", action="store_true", help="replace an existing OUT")
    parser.add_argument(
        "--against", metavar="OLD_OUT", help="earlier replay to compare with: what changed?"
    )
    parser.add_argument("--json", metavar="FILE", help="write the summary here as well")
    parser.set_defaults(run=_run)


def _run(arguments: argparse.Namespace) -> int:
    from wrist_stiffness.cli.progress import Progress
    from wrist_stiffness.commands.json_file import write_json
    from wrist_stiffness.commands.output_changes import output_changes
    from wrist_stiffness.commands.replay import replay
    from wrist_stiffness.errors import InputError
    from wrist_stiffness.recording.reader import open_recording
    from wrist_stiffness.shipped import shipped_file
    from wrist_stiffness.topics import parse_topic_remaps

    settings = settings_named(arguments)
    if arguments.against is not None:
        # Before the replay, which takes its time, and perhaps its place.
        open_recording(arguments.against)
        if Path(arguments.against).resolve() == Path(arguments.output).resolve():
            raise InputError(f"--against {arguments.against}: is the output itself")
    summary = replay(
        arguments.recording,
        arguments.model or shipped_file("config/palmieri2015_model.yaml"),
        arguments.output,
        settings,
        parse_topic_remaps(arguments.topic),
        arguments.overwrite,
        Progress("replay"),
    )
    _print(summary)
    print(f"written: {arguments.output}")
    changes: tuple[TopicChanges, ...] = ()
    if arguments.against is not None:
        changes = output_changes(arguments.against, arguments.output)
        print(f"against {arguments.against}:")
        for topic in changes:
            print(f"  {_told(topic)}")
    if arguments.json:
        told = {**summary.as_values(), "changes": [asdict(topic) for topic in changes]}
        write_json(arguments.json, told)
    return EXIT_DONE if all(topic.same for topic in changes) else EXIT_NO


def _print(summary: ReplaySummary) -> None:
    print(
        f"{summary.predictions} predictions for {summary.joint_states} joint states, "
        f"{summary.corrections} of {summary.commands} commands corrected"
    )
    if summary.trajectories:
        print(f"{summary.corrected_trajectories} of {summary.trajectories} trajectories corrected")
    if summary.predictions:
        for name, sizes in (("s [um]", summary.shift_um), ("phi [mdeg]", summary.phi_mdeg)):
            print(f"  predicted {name:10} mean {sizes.mean:8.3f}   max {sizes.most:8.3f}")
    if summary.damage:
        print(f"input is damaged: {summary.damage}")
    if summary.replaced:
        print(f"{summary.replaced} outputs of an earlier run in the input left out")
    for warning, count in summary.warnings.most_common():
        print(f"{count} predictions: {warning}")
    for reason, count in summary.refused.most_common():
        print(f"{count} refused, the first: {reason}")


def _told(topic: TopicChanges) -> str:
    """Return what changed on a topic, as one line."""
    text = f"{topic.topic:26} {topic.common} in both, {topic.changed or 'none'} changed"
    if topic.first_ns is not None:
        text += f", first at {1e-9 * topic.first_ns:.6f} s"
    for largest in topic.largest:
        text += f"; {largest.quantity} by {largest.size:.3g} at {1e-9 * largest.stamp_ns:.6f} s"
    for count, where in ((topic.only_old, "old"), (topic.only_new, "new")):
        text += f"; {count} only in the {where} one" if count else ""
    return text
