"""What every command of `wrist-stiffness` shares: its name, exit codes and one-line errors."""

import argparse
import re
from typing import Any, NoReturn

PROG = "wrist-stiffness"

EXIT_DONE = 0
EXIT_NO = 1
EXIT_BAD_INPUT = 2
EXIT_INTERRUPTED = 130
EXIT_PIPE_CLOSED = 141


class OneLineParser(argparse.ArgumentParser):
    """An argument parser whose errors are one line, without the usage text before it.

    Negative numbers may have an exponent: Python 3.11 and 3.12 take -1e-6 for an option.
    """

    def __init__(self, *arguments: Any, **options: Any) -> None:
        super().__init__(*arguments, **options)
        self._negative_number_matcher = re.compile(r"-(\d+\.?\d*|\.\d+)(e[-+]?\d+)?$", re.I)

    def error(self, message: str) -> NoReturn:
        """Exit with code 2 and one line on stderr."""
        self.exit(EXIT_BAD_INPUT, f"{PROG}: error: {message} (see '{self.prog} --help')\n")
