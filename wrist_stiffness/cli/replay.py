"""`wrist-stiffness replay`: the nodes' own code over a recording, without a ROS graph."""

from __future__ import annotations

import argparse
from dataclasses import asdict
from pathlib import Path

from wrist_stiffness.cli.options import (
    MODEL_OPTION,
    RECORDING,
    model_named,
    sensor_names,
    settings_named,
)
from wrist_stiffness.cli.parser import EXIT_DONE, EXIT_NO, command, flag, option, output, say
from wrist_stiffness.cli.progress import Progress
from wrist_stiffness.errors import InputError


@command(
    RECORDING,
    output("OUT", "folder or .mcap file"),
    MODEL_OPTION,
    *sensor_names("sensor frames, objective, contact policy ..."),
    flag("--overwrite", "replace an existing OUT"),
    option("--against", "earlier replay to compare with: what changed?", "OLD_OUT"),
)
def replay(arguments: argparse.Namespace) -> int:
    r"""Predicted errors and corrected commands for a recording.

    Run the very code of the nodes over a recording and write it again with predicted pose errors
    and corrected commands added. No ROS graph is needed; the result is the same to the bit every
    time. With --against it also says what changed since an earlier replay of the same recording,
    after a change of the model, the parameters or this program: exit code 1 if anything did.

    example, a recording with other names:
      wrist-stiffness replay bag -o bag_predicted \
          --topic /load_estimate:=/ft_sensor/wrench --joint wrist_a --joint wrist_b

    example, what another model changes:
      wrist-stiffness replay bag --model old.yaml -o with_old
      wrist-stiffness replay bag --model new.yaml -o with_new --against with_old
    """
    from wrist_stiffness.commands.output_changes import TopicChanges, output_changes
    from wrist_stiffness.commands.replay import replay
    from wrist_stiffness.recording.reader import open_recording
    from wrist_stiffness.report.terminal import change_line, replay_lines
    from wrist_stiffness.topics import parse_topic_remaps

    settings = settings_named(arguments)
    if arguments.against is not None:
        # Before the replay, which takes its time, and perhaps its place.
        open_recording(arguments.against)
        if Path(arguments.against).resolve() == Path(arguments.output).resolve():
            raise InputError(f"--against {arguments.against}: is the output itself")
    summary = replay(
        arguments.recording,
        model_named(arguments),
        arguments.output,
        settings,
        parse_topic_remaps(arguments.topic),
        arguments.overwrite,
        Progress("replay"),
    )
    lines = [*replay_lines(summary), f"written: {arguments.output}"]
    changes: tuple[TopicChanges, ...] = ()
    if arguments.against is not None:
        changes = output_changes(arguments.against, arguments.output)
        lines.append(f"against {arguments.against}:")
        lines += [f"  {change_line(topic)}" for topic in changes]
    say(arguments, lines, {**summary.as_values(), "changes": [asdict(each) for each in changes]})
    return EXIT_DONE if all(topic.same for topic in changes) else EXIT_NO
