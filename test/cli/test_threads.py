"""One thread for the linear algebra, unless the user says otherwise."""

import os
import subprocess
import sys

import pytest

WATCHED = """
import os, sys

class Watch:
    "Says what the variable is when numpy is about to be loaded."

    def find_spec(self, name, path=None, target=None):
        if name == "numpy":
            print(os.environ.get("OPENBLAS_NUM_THREADS"), flush=True)

assert "numpy" not in sys.modules
sys.meta_path.insert(0, Watch())
"""

COMMAND = """
sys.argv = ["wrist-stiffness", "predict", "--angles", "0", "0"]
from wrist_stiffness.__main__ import main
sys.exit(main())
"""

PYTHON = """
from wrist_stiffness.analysis import Analysis
print("s and so on")
"""


@pytest.mark.parametrize("code", [COMMAND, PYTHON], ids=["command", "Python"])
@pytest.mark.parametrize(("said", "used"), [(None, "1"), ("3", "3")], ids=["default", "own"])
def test_one_thread_is_set_before_numpy_is_loaded(code, said, used):
    environment = {name: value for name, value in os.environ.items() if "_NUM_THREADS" not in name}
    if said is not None:
        environment["OPENBLAS_NUM_THREADS"] = said
    done = subprocess.run(
        [sys.executable, "-c", WATCHED + code],
        env=environment,
        capture_output=True,
        text=True,
        timeout=60,
    )
    assert done.returncode == 0, done.stderr
    seen, result = done.stdout.split("\n", 1)
    assert seen == used
    assert result.startswith("s ")
