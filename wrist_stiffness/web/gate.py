"""Who may speak to the page: loopback names only, or whoever has the token."""

from __future__ import annotations

import hmac
from collections.abc import Awaitable, Callable, MutableMapping
from http.cookies import SimpleCookie
from typing import Any
from urllib.parse import parse_qs, urlsplit

COOKIE = "wrist_workbench"
LOOPBACK = ("127.0.0.1", "localhost", "[::1]")

Scope = MutableMapping[str, Any]
Receive = Callable[[], Awaitable[Scope]]
Send = Callable[[Scope], Awaitable[None]]
App = Callable[[Scope, Receive, Send], Awaitable[None]]


class Gate:
    """Refuses strangers, other sites and what is too large, before the page sees it.

    Without a token only the names of this machine are answered, so that no page of another site
    reaches the workbench by a name of its own; a socket is opened for our own page only.

    `app`: what is guarded (ASGI); `token`: secret of the address, empty for none; `largest`: of one
    request [bytes].
    """

    def __init__(self, app: App, token: str, largest: int) -> None:
        self._app, self._token, self._largest = app, token, largest

    async def __call__(self, scope: Scope, receive: Receive, send: Send) -> None:
        """Answer one connection."""
        if scope["type"] not in ("http", "websocket"):
            await self._app(scope, receive, send)
            return
        headers = {
            key.decode("latin-1"): value.decode("latin-1") for key, value in scope["headers"]
        }
        asked = parse_qs(scope.get("query_string", b"").decode("latin-1")).get("token", [""])[0]
        if not self._may_enter(headers, asked):
            await _refuse(scope, send, 403, "This workbench needs the address with its token.")
            return
        length = headers.get("content-length", "0")
        if not length.isdigit() or int(length) > self._largest:
            limit = f"{self._largest // 2**20} MB"
            await _refuse(scope, send, 413, f"The file is larger than {limit}.")
            return
        await self._app(scope, self._limited(receive), self._remembering(asked, send))

    def _may_enter(self, headers: dict[str, str], asked: str) -> bool:
        host = headers.get("host", "")
        origin = headers.get("origin", "")
        if origin and urlsplit(origin).netloc != host:
            return False
        if not self._token:
            return host.rsplit(":", 1)[0] in LOOPBACK
        kept = SimpleCookie(headers.get("cookie", "")).get(COOKIE)
        given = asked or (kept.value if kept else "")
        return hmac.compare_digest(given.encode(), self._token.encode())

    def _limited(self, receive: Receive) -> Receive:
        """Count what is sent in pieces, of which no header says the size."""
        taken = 0

        async def counted() -> Scope:
            nonlocal taken
            message = await receive()
            if message["type"] == "http.request":
                taken += len(message.get("body", b""))
                if taken > self._largest:
                    return {"type": "http.disconnect"}
            return message

        return counted

    def _remembering(self, asked: str, send: Send) -> Send:
        async def told(message: Scope) -> None:
            if asked and message["type"] == "http.response.start":
                cookie = f"{COOKIE}={asked}; Path=/; HttpOnly; SameSite=Strict"
                message["headers"] = [*message.get("headers", []), (b"set-cookie", cookie.encode())]
            await send(message)

        return told


async def _refuse(scope: Scope, send: Send, status: int, reason: str) -> None:
    if scope["type"] == "websocket":
        await send({"type": "websocket.close", "code": 1008})
        return
    headers = [(b"content-type", b"text/plain; charset=utf-8")]
    await send({"type": "http.response.start", "status": status, "headers": headers})
    await send({"type": "http.response.body", "body": reason.encode()})
