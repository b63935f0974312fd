"""A workbench in a process of its own, and a browser before it."""

from __future__ import annotations

import os
import shutil
import socket
import subprocess
import sys
import time
from pathlib import Path

import pytest
from replayed import first_seconds

TUTORIAL = Path(__file__).parents[1] / "data" / "tutorial"
CHROMIUM = shutil.which("chromium") or shutil.which("chromium-browser")
PICTURES = "WRIST_WORKBENCH_PICTURES"
"""Folder in which screenshots are kept; the test's own where it is not set."""

DAYS_S = {"monday": 90.0, "wednesday": 120.0}
"""How much of the tutorial's days [s]: enough to show the same."""


@pytest.fixture(scope="session")
def address(tmp_path_factory):
    """Address of a workbench whose folder holds the days of the tutorial."""
    pytest.importorskip("nicegui", reason="the extra `web` is not installed")
    folder = tmp_path_factory.mktemp("workbench")
    for day, seconds in DAYS_S.items():
        first_seconds(TUTORIAL / f"{day}.mcap", seconds, folder / f"{day}.mcap")
    (folder / "broken.mcap").write_bytes(b"no recording")
    with socket.socket() as probe:
        probe.bind(("127.0.0.1", 0))
        port = probe.getsockname()[1]
    command = [sys.executable, "-m", "wrist_stiffness", "workbench", "--no-browser"]
    process = subprocess.Popen(
        [*command, "--folder", str(folder), "--port", str(port)],
        env={k: v for k, v in os.environ.items() if not k.startswith(("NICEGUI", "PYTEST"))},
    )
    url = f"http://127.0.0.1:{port}/"
    for _ in range(1200):
        # No page is asked for: one that is late would be asked for again and again.
        try:
            socket.create_connection(("127.0.0.1", port), timeout=1.0).close()
            break
        except OSError:
            assert process.poll() is None
            time.sleep(0.1)
    yield url, folder
    process.terminate()
    assert process.wait(20) is not None


@pytest.fixture(scope="session")
def browser():
    """Debian's Chromium, which fetches nothing from elsewhere."""
    playwright = pytest.importorskip("playwright.sync_api", reason="playwright is not installed")
    if CHROMIUM is None:
        pytest.skip("no Chromium here: apt-get install chromium")
    rules = "--host-resolver-rules=MAP * ~NOTFOUND, EXCLUDE 127.0.0.1"
    with playwright.sync_playwright() as running:
        found = running.chromium.launch(
            executable_path=CHROMIUM, args=["--no-sandbox", "--disable-gpu", rules]
        )
        yield found
        found.close()


@pytest.fixture(scope="session")
def pictures(tmp_path_factory):
    folder = Path(os.environ.get(PICTURES) or tmp_path_factory.mktemp("pictures"))
    folder.mkdir(parents=True, exist_ok=True)
    return folder
