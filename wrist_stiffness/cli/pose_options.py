"""Arguments that every command on a single pose shares."""

from __future__ import annotations

import argparse


def add_pose_options(parser: argparse.ArgumentParser) -> None:
    """Add the model, `--angles`, `--load` and `--on-platform`."""
    parser.add_argument("model", nargs="?", help="model file (default: the shipped wrist's)")
    parser.add_argument(
        "--angles", nargs=2, type=float, required=True, metavar="DEG", help="motor angles [deg]"
    )
    parser.add_argument(
        "--load",
        nargs="+",
        type=float,
        default=[0.0] * 6,
        metavar="N",
        help="force [N], or force [N] and moment [N m], on the platform at O (default: none)",
    )
    parser.add_argument(
        "--on-platform", action="store_true", help="the load's axes turn with the platform"
    )


def whole_load(numbers: list[float]) -> list[float]:
    """Return a force and a moment from what `--load` was given.

    Raises
    ------
    InputError
        If there are neither 3 nor 6 numbers.
    """
    from wrist_stiffness.errors import InputError

    if len(numbers) not in (3, 6):
        raise InputError(f"--load takes 3 or 6 numbers, not {len(numbers)}")
    return [*numbers, *[0.0] * (6 - len(numbers))]
