"""One page of results: `make bench`, or `python bench/page.py [-o FOLDER] [--quick]`.

Runs the other files one after the other, each with the baseline that its row of the README names,
and writes what they print, with machine and versions, to FOLDER/speed.md.  Nothing is asserted:
another machine gives other figures; compare ratios.
"""

from __future__ import annotations

import argparse
import os
import platform
import subprocess
import sys
import time
from importlib.metadata import PackageNotFoundError, version
from pathlib import Path

BENCH = Path(__file__).parent
PACKAGES = ("numpy", "scipy", "mcap", "zstandard", "rosbags", "ros-jazzy-rclpy", "scikit-fem")

RUNS = (
    ("One sample: prediction and correction", ["ros_core_path.py"], []),
    ("Nodes against a bare echo node", ["ros_round_trip.py"], ["--blocks", "5"]),
    ("A steady stream at 1 kHz", ["ros_endurance.py", "--seconds", "20"], ["--seconds", "5"]),
    ("Replay against mcap's own copy", ["replay_speed.py"], ["--seconds", "10"]),
    ("Recordings against rosbags and mcap", ["recording_speed.py"], ["5000"]),
    ("One pose and stacks of poses", ["mechanism_speed.py"], []),
    ("Effects, one sample and a recording", ["model_speed.py"], []),
    (
        "Many wrists at once",
        ["scale.py"],
        ["--wrists", "200", "--recordings", "2", "--processes", "1"],
    ),
    ("Compare, ten minutes at 1 kHz", ["compare_speed.py"], None),
    ("A pose condensed against the whole wrist by finite elements", ["fem_speed.py"], None),
)
"""Title, command, and what a quick run adds to it; None where it leaves the run out."""

LONGEST_S = 1800.0


def machine() -> list[str]:
    """Return what the figures depend on."""
    model = next(
        (
            line.split(":", 1)[1].strip()
            for line in Path("/proc/cpuinfo").read_text().splitlines()
            if line.startswith(("model name", "Model"))
        ),
        platform.processor(),
    )
    git = ["git", "-C", str(BENCH), "describe", "--always", "--dirty"]
    revision = subprocess.run(git, capture_output=True, text=True, check=False).stdout.strip()
    versions = []
    for name in PACKAGES:
        try:
            versions.append(f"{name} {version(name)}")
        except PackageNotFoundError:
            versions.append(f"{name} absent")
    native = (
        "from wrist_stiffness.mechanism.compiled import native;"
        "print('no' if native is None else 'yes')"
    )
    compiled = subprocess.run([sys.executable, "-c", native], capture_output=True, text=True)
    load = os.getloadavg()[0] if hasattr(os, "getloadavg") else float("nan")
    return [
        f"- {model}, {os.cpu_count()} processors, {platform.machine()}, {platform.system()}",
        f"- load average at the start {load:.1f}: above {os.cpu_count()} the times are others'",
        f"- revision {revision or 'unknown'}, compiled core: {compiled.stdout.strip()}",
        f"- Python {platform.python_version()}, {', '.join(versions)}",
    ]


def section(title: str, command: list[str]) -> list[str]:
    """Run one file and return its part of the page."""
    print(f"{title}: python bench/{' '.join(command)}", flush=True)
    start = time.monotonic()
    try:
        run = subprocess.run(
            [sys.executable, str(BENCH / command[0]), *command[1:]],
            capture_output=True,
            text=True,
            timeout=LONGEST_S,
        )
        said = run.stdout.rstrip()
        if run.returncode:
            lines = run.stderr.strip().splitlines() or ["no message"]
            said += f"\nfailed with code {run.returncode}: {lines[-1]}"
    except subprocess.TimeoutExpired:
        said = f"not finished after {LONGEST_S:.0f} s"
    took = time.monotonic() - start
    return ["", f"## {title}", "", f"`python bench/{' '.join(command)}`, {took:.0f} s", ""] + [
        "```text",
        said.strip("\n"),
        "```",
    ]


def main() -> None:
    """Write the page."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("-o", "--output", type=Path, default=Path("bench-results"))
    parser.add_argument("--quick", action="store_true", help="short runs, no finite elements")
    options = parser.parse_args()
    options.output.mkdir(parents=True, exist_ok=True)
    lines = ["# Speed", "", *machine()]
    page = options.output / "speed.md"
    for title, command, quick in RUNS:
        if options.quick and quick is None:
            continue
        lines += section(title, command + (quick or [] if options.quick else []))
        page.write_text("\n".join(lines) + "\n", encoding="utf-8")
    print(f"written: {page}")


if __name__ == "__main__":
    main()
