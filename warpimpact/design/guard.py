"""Whom the server of the page answers: this machine's own page, and nobody else or for ever."""

from __future__ import annotations

import asyncio
import hmac
from collections.abc import Awaitable, Callable, Mapping, MutableMapping
from typing import Any, cast

import h11
from starlette.responses import PlainTextResponse, Response
from uvicorn.protocols.http.h11_impl import H11Protocol

Scope = MutableMapping[str, Any]
Receive = Callable[[], Awaitable[MutableMapping[str, Any]]]
Send = Callable[[MutableMapping[str, Any]], Awaitable[None]]

_HEADERS = {
    "content-security-policy": "default-src 'none'; script-src 'self'; style-src 'self' 'unsafe-inline'; "
    "img-src 'self' data: blob:; connect-src 'self'; base-uri 'none'; form-action 'none'; frame-ancestors 'none'",
    "cross-origin-resource-policy": "same-origin",
    "cross-origin-opener-policy": "same-origin",
    "referrer-policy": "no-referrer",
    "x-content-type-options": "nosniff",
    "cache-control": "no-store",
}

REQUEST_SECONDS = 10.0
"""Seconds for a request to arrive, from the opening of its connection or from its first byte on. Between two requests
uvicorn itself closes a connection (`timeout_keep_alive`)."""


class Guard:
    """Answers this machine's own page alone. It checks the host that a request names, its origin, and the token in its
    path.

    Another page in the same browser can send requests to this machine, and a name server can give this machine another
    name. Neither knows the token, and neither has this origin.

    Args:
        token: first part of every path.
    """

    def __init__(self, app: Any, token: str, port: int) -> None:
        self._app, self._token = app, token
        self._hosts = {f"127.0.0.1:{port}", f"localhost:{port}"}

    async def __call__(self, scope: Scope, receive: Receive, send: Send) -> None:
        if scope["type"] != "http":
            return
        headers = {name.decode("latin-1"): value.decode("latin-1") for name, value in scope["headers"]}
        refusal = self._refusal(str(scope["path"]), str(scope["method"]), headers)
        if refusal is not None:
            await refusal(scope, receive, _with_headers(send))
            return
        await self._app(scope, receive, _with_headers(send))

    def _refusal(self, path: str, method: str, headers: Mapping[str, str]) -> Response | None:
        host, token = headers.get("host", ""), path.split("/")[1] if "/" in path else ""
        if host not in self._hosts:
            return PlainTextResponse("This page is for this machine: http://127.0.0.1.", status_code=403)
        if not hmac.compare_digest(token.encode(), self._token.encode()):
            return PlainTextResponse(
                "This address has not the token of this start. warpimpact design prints the address when it starts; "
                "warpimpact design 'ADDRESS' opens the design of an old one.",
                status_code=403,
            )
        origin = headers.get("origin")
        if method not in ("GET", "HEAD") and (origin is None or origin.removeprefix("http://") != host):
            return PlainTextResponse("Only the page itself may ask this.", status_code=403)
        return None


def _with_headers(send: Send) -> Send:
    async def sending(message: MutableMapping[str, Any]) -> None:
        if message["type"] == "http.response.start":
            ours = [(name.encode(), value.encode()) for name, value in _HEADERS.items()]
            message = {**message, "headers": [*message.get("headers", []), *ours]}
        await send(message)

    return sending


class TimedProtocol(H11Protocol):
    """A connection that is closed if no whole request comes in time.

    uvicorn has a limit only between two requests; a silent connection would stay open for ever.
    """

    _closing: asyncio.TimerHandle | None = None

    def connection_made(self, transport: asyncio.BaseTransport) -> None:
        super().connection_made(cast("asyncio.Transport", transport))
        self._watch()

    def data_received(self, data: bytes) -> None:
        super().data_received(data)
        self._watch()

    def connection_lost(self, exc: Exception | None) -> None:
        self._forget()
        super().connection_lost(exc)

    def _watch(self) -> None:
        """Start the clock for the rest of a request; further bytes do not restart it."""
        if self.conn.their_state not in (h11.IDLE, h11.SEND_BODY):
            self._forget()
        elif self._closing is None:
            self._closing = self.loop.call_later(REQUEST_SECONDS, self.transport.close)

    def _forget(self) -> None:
        if self._closing is not None:
            self._closing.cancel()
            self._closing = None
