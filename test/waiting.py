"""Wait for what another process does."""

import subprocess
import time

import pytest


def wait_until(condition, process, deadline_s=60.0):
    """Return what a condition gives as soon as it holds, while a process runs.

    In steps: whoever asks without a pause takes the core on which the process would do it.
    """
    end_s = time.monotonic() + deadline_s
    while not (found := condition()):
        assert time.monotonic() < end_s
        with pytest.raises(subprocess.TimeoutExpired):
            process.wait(0.02)
    return found
