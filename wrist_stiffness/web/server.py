"""Serves the page on one address of this machine."""

from __future__ import annotations

import secrets
import socket
from multiprocessing.forkserver import ensure_running, set_forkserver_preload
from typing import Any

from wrist_stiffness.errors import InputError
from wrist_stiffness.web.workspace import Workspace

TITLE = "Wrist workbench"

PATIENCE_S = 60.0
"""A tab that says nothing for so long is gone, and its process with it: laptops doze."""


def serve(folder: str, host: str, port: int, largest_mb: int, browser: bool) -> None:
    """Serve a workspace until somebody ends it.

    `host`: beyond this machine it needs a token, which is drawn; `largest_mb`: of an upload [MB].
    Raises `InputError` if a number is out of range, the folder cannot be made, or the address is
    not to be had.
    """
    if not 0 < port < 65536:
        raise InputError(f"--port {port} is not 1 to 65535")
    if largest_mb < 1:
        raise InputError(f"--largest-upload {largest_mb} is below 1 MB")
    _require_address(host, port)
    # One process imports what the work needs, which takes seconds, and forks for each tab.
    set_forkserver_preload(["wrist_stiffness.web.bench"])
    ensure_running()
    from nicegui import app, ui

    from wrist_stiffness.web.gate import LOOPBACK, Gate
    from wrist_stiffness.web.page import build_page

    workspace = Workspace(folder)
    token = "" if host in LOOPBACK else secrets.token_urlsafe(24)
    largest = largest_mb * 2**20
    guarded: Any = Gate
    app.add_middleware(guarded, token=token, largest=largest)

    @ui.page("/", title=TITLE)
    def page() -> None:
        build_page(workspace, largest)

    address = f"http://{host}:{port}/" + (f"?token={token}" if token else "")
    print(f"{TITLE}: {address}\nworkspace {workspace.folder}; end it with Ctrl-C", flush=True)
    ui.run(
        host=host,
        port=port,
        title=TITLE,
        reload=False,
        reconnect_timeout=PATIENCE_S,
        show=browser and not token,
        show_welcome_message=False,
        favicon="📐",
    )


def _require_address(host: str, port: int) -> None:
    try:
        found = socket.getaddrinfo(host, port, type=socket.SOCK_STREAM)
        with socket.socket(found[0][0], socket.SOCK_STREAM) as probe:
            probe.setsockopt(socket.SOL_SOCKET, socket.SO_REUSEADDR, 1)
            probe.bind(found[0][4])
    except OSError as error:
        raise InputError(
            f"{host}:{port} cannot be served: {error.strerror}; another --port?"
        ) from error
