"""`python -m wrist_stiffness` is the command `wrist-stiffness`."""

import sys

from wrist_stiffness.cli.main import main

if __name__ == "__main__":
    sys.exit(main())
