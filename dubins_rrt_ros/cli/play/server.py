"""The server of the page: it answers this machine alone, and only those who know its token.

A page of another site can make the browser send requests here. It cannot read the token, and the browser tells where a socket is
opened from (Origin) and under which name the server was found (Host); both must be ours.
"""

import asyncio
import secrets
from collections.abc import Awaitable, Callable
from importlib import resources
from typing import Protocol

from aiohttp import WSMsgType, web

HOST = "127.0.0.1"
#: The port that browsers leave out of an address, and so of Host and Origin.
HTTP_PORT = 80
#: Maximum length of a message of the page [bytes].
MAX_MESSAGE = 1 << 20
#: Maximum time between two signs of life of a page [s].
HEARTBEAT = 20.0
#: The files of the page by their addresses, with their types.
FILES = {"/": ("page.html", "text/html"), "/page.css": ("page.css", "text/css"), "/page.js": ("page.js", "text/javascript"),
         "/canvas.js": ("canvas.js", "text/javascript")}
HEADERS = {
    "Content-Security-Policy": "default-src 'none'; script-src 'self'; style-src 'self'; img-src 'self' data:; "
                               "connect-src 'self'; base-uri 'none'; form-action 'none'; frame-ancestors 'none'",
    "Referrer-Policy": "no-referrer", "X-Content-Type-Options": "nosniff", "Cache-Control": "no-store",
}
Handler = Callable[[web.Request], Awaitable[web.StreamResponse]]


class PageSession(Protocol):
    """The server's side of one page."""

    def take(self, text: str) -> None:
        """Take a message of the page."""

    async def close(self) -> None:
        """End, as the page has gone."""


#: Takes a function that sends a text or bytes to a page, from any thread, and returns what serves the page.
MakeSession = Callable[[Callable[[str | bytes], None]], PageSession]


class PlayServer:
    """A server on 127.0.0.1.

    Attributes:
        port: the port that it listens on, once it is started.
        token: what a page must know to be served.
    """

    def __init__(self, make_session: MakeSession, token: str = ""):
        self.port = 0
        self.token = token or secrets.token_urlsafe(24)
        self._make_session = make_session
        self._runner: web.AppRunner | None = None
        self._pages: set[web.WebSocketResponse] = set()

    @property
    def url(self) -> str:
        """The address of the page, with the token."""
        return f"http://{HOST}:{self.port}/?token={self.token}"

    async def start(self, port: int = 0) -> None:
        """Listen on a port; 0 is any that is free.

        Raises:
            OSError: the port is in use.
        """
        application = web.Application(middlewares=[self._guard])
        application.router.add_get("/socket", self._serve_page)
        for address in FILES:
            application.router.add_get(address, _send_file)
        self._runner = web.AppRunner(application, access_log=None)
        await self._runner.setup()
        await web.TCPSite(self._runner, HOST, port).start()
        self.port = self._runner.addresses[0][1]

    async def stop(self) -> None:
        """Close all pages' sockets and the port."""
        for page in set(self._pages):
            await page.close()
        if self._runner:
            await self._runner.cleanup()

    @web.middleware
    async def _guard(self, request: web.Request, handler: Handler) -> web.StreamResponse:
        """Refuse what does not come from our own page on this machine."""
        port = "" if self.port == HTTP_PORT else f":{self.port}"
        if request.host not in {f"{name}{port}" for name in (HOST, "localhost")}:
            raise web.HTTPForbidden(text="This server is reached as 127.0.0.1 or localhost alone.\n")
        if request.path in ("/", "/socket") and not secrets.compare_digest(
                request.query.get("token", "").encode(), self.token.encode()):
            raise web.HTTPForbidden(text="The token is missing or wrong; use the address that dubins_rrt play printed.\n")
        if request.path == "/socket" and request.headers.get("Origin") != f"http://{request.host}":
            raise web.HTTPForbidden(text="Only its own page may open the socket.\n")
        return await handler(request)

    async def _serve_page(self, request: web.Request) -> web.WebSocketResponse:
        page = web.WebSocketResponse(max_msg_size=MAX_MESSAGE, heartbeat=HEARTBEAT)
        await page.prepare(request)
        self._pages.add(page)
        outbox: asyncio.Queue[str | bytes] = asyncio.Queue()
        loop = asyncio.get_running_loop()
        session = self._make_session(lambda message: _put(loop, outbox, message))
        sender = asyncio.create_task(_send_all(page, outbox))
        try:
            async for message in page:
                if message.type == WSMsgType.TEXT:
                    session.take(message.data)
        finally:
            self._pages.discard(page)
            try:
                await session.close()
            finally:
                sender.cancel()
        return page


def _put(loop: asyncio.AbstractEventLoop, outbox: "asyncio.Queue[str | bytes]", message: str | bytes) -> None:
    """Queue a message for a page; from any thread, and in vain where the server has ended."""
    if not loop.is_closed():
        loop.call_soon_threadsafe(outbox.put_nowait, message)


async def _send_all(page: web.WebSocketResponse, outbox: "asyncio.Queue[str | bytes]") -> None:
    while True:
        message = await outbox.get()
        try:
            await (page.send_str(message) if isinstance(message, str) else page.send_bytes(message))
        except ConnectionError:  # the page has gone; its session ends by itself
            return


async def _send_file(request: web.Request) -> web.Response:
    name, kind = FILES[request.path]
    text = resources.files(__package__).joinpath(name).read_text(encoding="utf-8")
    return web.Response(text=text, content_type=kind, headers=HEADERS)
