"""Who may speak to the page: loopback names only, or whoever has the token."""

from __future__ import annotations

import hmac
from urllib.parse import urlsplit

from starlette.requests import HTTPConnection
from starlette.responses import PlainTextResponse
from starlette.types import ASGIApp, Message, Receive, Scope, Send
from starlette.websockets import WebSocketClose

COOKIE = "wrist_workbench"
LOOPBACK = ("127.0.0.1", "localhost", "[::1]")


class Gate:
    """Refuses strangers, other sites and what is too large, before the page sees it.

    Without a token only the names of this machine are answered, so that no page of another site
    reaches the workbench by a name of its own; a socket is opened for our own page only.

    `app`: what is guarded (ASGI); `token`: secret of the address, empty for none; `largest`: of one
    request [bytes].
    """

    def __init__(self, app: ASGIApp, token: str, largest: int) -> None:
        self._app, self._token, self._largest = app, token, largest

    async def __call__(self, scope: Scope, receive: Receive, send: Send) -> None:
        """Answer one connection."""
        if scope["type"] not in ("http", "websocket"):
            await self._app(scope, receive, send)
            return
        asked = HTTPConnection(scope)
        token = asked.query_params.get("token", "")
        length = asked.headers.get("content-length", "0")
        if not self._may_enter(asked, token):
            reason = "This workbench needs the address with its token."
            http = scope["type"] == "http"
            refused: ASGIApp = PlainTextResponse(reason, 403) if http else WebSocketClose(1008)
            await refused(scope, receive, send)
        elif not length.isdigit() or int(length) > self._largest:
            limit = f"{self._largest // 2**20} MB"
            await PlainTextResponse(f"The file is larger than {limit}.", 413)(scope, receive, send)
        else:
            await self._app(scope, self._limited(receive), self._remembering(token, send))

    def _may_enter(self, asked: HTTPConnection, token: str) -> bool:
        host = asked.headers.get("host", "")
        origin = asked.headers.get("origin", "")
        if origin and urlsplit(origin).netloc != host:
            return False
        if not self._token:
            return host.rsplit(":", 1)[0] in LOOPBACK
        given = token or asked.cookies.get(COOKIE, "")
        return hmac.compare_digest(given.encode(), self._token.encode())

    def _limited(self, receive: Receive) -> Receive:
        """Count what is sent in pieces, of which no header says the size."""
        taken = 0

        async def counted() -> Message:
            nonlocal taken
            message = await receive()
            if message["type"] == "http.request":
                taken += len(message.get("body", b""))
                if taken > self._largest:
                    return {"type": "http.disconnect"}
            return message

        return counted

    def _remembering(self, token: str, send: Send) -> Send:
        async def told(message: Message) -> None:
            if token and message["type"] == "http.response.start":
                cookie = f"{COOKIE}={token}; Path=/; HttpOnly; SameSite=Strict"
                message["headers"] = [*message.get("headers", []), (b"set-cookie", cookie.encode())]
            await send(message)

        return told
