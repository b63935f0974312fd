"""`make demo`: the main job from end to end, said in words."""

from __future__ import annotations

import argparse
import sys
from pathlib import Path

from wrist_stiffness.cli.parser import EXIT_BAD_INPUT, EXIT_DONE, EXIT_NO, PROG
from wrist_stiffness.cli.progress import Progress
from wrist_stiffness.errors import WristError

SECONDS = 60.0


def main() -> int:
    """Run the demo and say what it showed.

    Returns
    -------
    int
        0 done, 1 live and replayed predictions do not agree, 2 a step failed.
    """
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("-o", "--output", default="demo", help="folder (default: demo)")
    parser.add_argument("--seconds", type=float, default=SECONDS, help="of the live run")
    arguments = parser.parse_args()
    try:
        return _run(arguments.output, arguments.seconds)
    except WristError as error:
        print(f"{PROG}: error: {error}", file=sys.stderr)
        return EXIT_BAD_INPUT


def _run(output: str, seconds: float) -> int:
    import numpy as np
    from before_after import rms
    from picture import draw_before_after
    from run_demo import beyond, run_demo

    from wrist_stiffness.report.table_lines import facts
    from wrist_stiffness.report.table_pictures import draw_maps
    from wrist_stiffness.shipped import shipped_file

    model = shipped_file("config/palmieri2015_model.yaml")
    print(f"Live: predictor, corrector and a virtual wrist as ROS 2 nodes, {seconds:g} s ...")
    result = run_demo(
        output, model, seconds, Progress, lambda line: print(f"{PROG}: {line}", file=sys.stderr)
    )

    print("\nThe table")
    for name, text in facts(result.table):
        print(f"  {name + ':':26} {text}")

    live = result.comparison
    print("\nLive against replayed")
    print(f"  equal to the bit:          {live.equal} predictions")
    print(f"  load had not arrived:      {live.late} (live used the load before)")
    print(f"  other differences:         {live.unexplained}")
    print(f"  only live / only replayed: {live.only_live} / {live.only_replay}")

    before, after = result.before, result.after
    millidegrees = 1e3 * 180.0 / np.pi
    pointing = [millidegrees * value for value in (rms(before.pointing), rms(after.pointing))]
    floor = millidegrees * before.floor
    elastic = [beyond(value, floor) for value in pointing]
    shift = [1e6 * rms(values) for values in (before.shift, after.shift, after.shift_handed_on)]
    print("\nTrue error of the virtual wrist at rest, RMS (it shares the model's elastic table)")
    print(f"  pointing, without correction:      {pointing[0]:7.2f} mdeg")
    print(f"  pointing, with correction:         {pointing[1]:7.2f} mdeg")
    print(f"  the encoder step alone makes:      {floor:7.2f} mdeg")
    print(f"  beyond the step, without / with:   {elastic[0]:7.2f} / {elastic[1]:.2f} mdeg")
    print(f"  shift s, without / with:           {shift[0]:7.2f} / {shift[1]:.2f} um")
    print("  (two motors turn the platform about O, they cannot shift it)")
    print(f"  shift s, if a manipulator takes it:{shift[2]:7.2f} um")
    print(f"\nwritten: {output}/live, {output}/replayed")
    motion = Path(output) / "before_after.png"
    draw_before_after(before, after, motion)
    for picture in (*draw_maps(result.table, output), motion):
        print(f"written: {picture}")
    agreed = live.unexplained == 0 and live.equal > 0
    return EXIT_DONE if agreed else EXIT_NO


if __name__ == "__main__":
    sys.exit(main())
