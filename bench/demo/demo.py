"""`make demo`: correct a wrist live, then find and add a hidden fault; said in words."""

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
    from picture import draw_demo
    from run_demo import FAULT, run_demo

    from wrist_stiffness.numerals import percent
    from wrist_stiffness.shipped import shipped_file

    model = shipped_file("config/palmieri2015_model.yaml")
    print(f"Live: predictor, corrector and a virtual wrist as ROS 2 nodes, {seconds:g} s ...")
    result = run_demo(
        output, model, seconds, Progress, lambda line: print(f"{PROG}: {line}", file=sys.stderr)
    )
    millidegrees = 1e3 * 180.0 / np.pi
    before, after = result.before, result.after
    shift = [1e6 * rms(values) for values in (before.shift, after.shift, after.shift_handed_on)]
    print("\n1. Correction under 3 N: true error of the virtual wrist at rest, RMS")
    print(f"  pointing without correction:       {millidegrees * rms(before.pointing):7.2f} mdeg")
    print(f"  pointing with correction:          {millidegrees * rms(after.pointing):7.2f} mdeg")
    print(f"  the encoder step alone:            {millidegrees * before.floor:7.2f} mdeg")
    print(f"  shift s without / with:            {shift[0]:7.2f} / {shift[1]:.2f} um")
    print("  (two motors rotate the platform about O, they cannot shift it)")
    print(f"  shift s if a manipulator takes it: {shift[2]:7.2f} um")

    fault = result.fault
    hidden = f"{FAULT.effect}@{FAULT.component}, {millidegrees * FAULT.magnitude:.0f} mdeg"
    print(f"\n2. A fault was hidden in the wrist ({hidden}). The model does not know it.")
    for finding in fault.diagnosis.findings:
        print(f"  missing: {' or '.join(finding.names)}, {percent(finding.probability)} sure")
    if fault.after is None or fault.after.added is None:
        print(f"  verdict: {fault.diagnosis.verdict}")
    else:
        for name, value in fault.after.added.estimates.items():
            print(f"  fitted: {name} = {value.value:.1f} +- {value.sigma:.1f}")
        print("\n3. Added to the model: error phi on another day, RMS")
        print(f"  without the fault in the model:    {fault.before.held_out['phi_mdeg']:7.2f} mdeg")
        print(f"  with it:                           {fault.after.held_out['phi_mdeg']:7.2f} mdeg")
        print(f"  noise of the instrument:           {fault.noise['phi_mdeg']:7.2f} mdeg")

    live = result.comparison
    print("\nLive against replayed predictions")
    print(f"  equal to the bit:          {live.equal}")
    print(f"  load had not arrived:      {live.late} (live used the load before)")
    print(f"  other differences:         {live.unexplained}")
    print(f"  only live / only replayed: {live.only_live} / {live.only_replay}")
    print(
        f"\nwritten: {output}/live, {output}/replayed, {output}/fault_day_1, {output}/fault_day_2"
    )
    picture = Path(output) / "demo.png"
    draw_demo(result, picture)
    print(f"written: {picture}")
    agreed = live.unexplained == 0 and live.equal > 0
    return EXIT_DONE if agreed else EXIT_NO


if __name__ == "__main__":
    sys.exit(main())
