"""A short run of the live fuzzer: no input ends a node."""

import subprocess
import sys
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[2]


@pytest.mark.slow
def test_nodes_outlive_wrong_input_and_come_back():
    command = [sys.executable, ROOT / "bench/ros_fuzz.py", "--messages", "3000", "--round", "1500"]
    ran = subprocess.run(command, capture_output=True, text=True, timeout=300, cwd=ROOT)
    assert ran.returncode == 0, ran.stdout + ran.stderr
    assert "LOST" not in ran.stdout
