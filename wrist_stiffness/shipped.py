"""Finds the default geometry, table and model that come with the package."""

import os
import sys
from pathlib import Path

import wrist_stiffness
from wrist_stiffness.errors import InputError

PACKAGE = "wrist_stiffness"


def shipped_file(relative: str) -> Path:
    """Return the path of a file that came with the package.

    `relative`: below the project folder, for example "config/palmieri2015.yaml".  Gives an existing
    file: of the source tree, else of the installation (pip or colcon) that holds the running
    package, else of the interpreter's, else of a folder in AMENT_PREFIX_PATH.  Raises `InputError`
    if there is none; it lists the folders where it was looked for.
    """
    folders = _folders()
    for folder in folders:
        if (folder / relative).is_file():
            return folder / relative
    looked = ", ".join(map(str, folders))
    raise InputError(f"shipped file {relative} is in none of: {looked}")


def _folders() -> list[Path]:
    package = Path(wrist_stiffness.__file__).parent
    # PREFIX/lib/pythonX.Y/site-packages/wrist_stiffness: the installation of the running code
    # comes before all others, so that code and data are of one version.
    prefixes = [*package.parents[3:4], Path(sys.prefix)]
    ament = os.environ.get("AMENT_PREFIX_PATH", "").split(os.pathsep)
    prefixes += [Path(prefix) for prefix in ament if prefix]
    shares = dict.fromkeys(prefix / "share" / PACKAGE for prefix in prefixes)
    return [package.parent, *shares]
