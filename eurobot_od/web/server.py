"""The server: the page at `/`, its updates at `/live`, recordings and reports at `/recording/NAME`, `/report/NAME`.

Rule of this file: a browser is sent only what it has room for. Nothing in here waits for a browser except its own task.
"""

from __future__ import annotations

import asyncio
import errno
import logging
import secrets
from collections.abc import AsyncIterator, Awaitable, Callable, Coroutine, Mapping
from contextlib import asynccontextmanager, closing, nullcontext, suppress
from functools import partial
from pathlib import Path
from types import MappingProxyType
from typing import Any, ClassVar

from aiohttp import WSMsgType, web

from eurobot_od.errors import LocalError
from eurobot_od.web.access import LONGEST_SILENCE, TOKEN, AccessRules, Connections
from eurobot_od.web.editor import LONGEST_REQUEST as LONGEST_EDIT
from eurobot_od.web.page import NOTHING, policy_of
from eurobot_od.web.requests import Requests
from eurobot_od.web.views import objects, send

PERIOD = 0.05
"""Time between two snapshots, in s."""

LOOK = 0.01
"""Time between two readings of the bus, in s, which delays a node's answer."""

LOOK_OF_JOB = 0.001
"""The same while a job runs, which asks thousands of times."""

MOST_OWED = 2
"""Most snapshots without a confirmation when the next one is due; a browser with more is left out."""

MOST_PENDING = 32
"""Most requests of one browser that may be under way."""

MOST_BROWSERS = 40

LONGEST_BODY = 2.0
"""Longest time for the unread body of an HTTP request, in s."""

OUT_OF_DESCRIPTORS = (errno.EMFILE, errno.ENFILE)

LOGGER = logging.getLogger(__name__)

LONGEST_REQUEST = 1 << 16
"""Most bytes of a page's request, and of the unread body of an HTTP request."""

LONGEST_POSTS = {"/files": LONGEST_EDIT}
"""The same for a POST to a path, where it may be longer."""

LONGEST_UPLOAD = 10.0
"""Longest time for a POST, in s."""

SILENCE = 20.0
"""Time after which a browser that does not answer a ping counts as gone, in s."""

UNFRAMED = "frame-ancestors 'none'"
"""The part of a policy that works only in a header, not in the page itself."""

HEADERS = {
    "Cache-Control": "no-store",
    "Content-Security-Policy": f"{NOTHING}; {UNFRAMED}",
    "Cross-Origin-Opener-Policy": "same-origin",
    "Cross-Origin-Resource-Policy": "same-origin",
    "Referrer-Policy": "no-referrer",
    "X-Content-Type-Options": "nosniff",
    "X-Frame-Options": "DENY",
}
"""No other page may show, embed or read this one, and nothing runs in an answer that is not the page."""

Post = Callable[[str], Awaitable[str]]
"""Answers a text with a text."""

Handler = Callable[[web.Request], Awaitable[web.StreamResponse]]


@asynccontextmanager
async def served(
    page: Callable[[], str],
    access: AccessRules,
    port: int,
    requests: Requests | None = None,
    posts: Mapping[str, Post] = MappingProxyType({}),
) -> AsyncIterator[str]:
    """Serve the page as it is at each request, and the bus if it shows one; yields the address.

    `posts` answer texts that are posted to a path. With `port` 0 it takes any free port. Raises LocalError if the port
    is not available.
    """
    logging.getLogger("aiohttp").addHandler(logging.NullHandler())  # its output may contain the token
    server = _Server(page, access, requests, posts)
    runner = web.AppRunner(
        server.application(),
        access_log=None,
        handle_signals=False,
        shutdown_timeout=1.0,
        keepalive_timeout=LONGEST_SILENCE,
        lingering_time=LONGEST_BODY,
    )
    await runner.setup()
    tasks = [asyncio.create_task(each) for each in server.tasks()]
    for task in tasks:
        task.add_done_callback(partial(_end_with, asyncio.current_task()))
    try:
        loop = asyncio.get_running_loop()
        loop.set_exception_handler(_report_once())
        try:
            listening = await loop.create_server(partial(_handler, runner, server.connections), access.host, port)
        except OSError as error:
            why = f"{error.strerror}; --listen chooses another address"
            raise LocalError(f"cannot listen at {access.host}:{port}: {why}") from error
        with closing(listening):
            # Inside, so that motions are ended while the bus is still read.
            async with requests.running() if requests is not None else nullcontext():
                yield access.address(listening.sockets[0].getsockname())
    finally:
        for task in tasks:
            task.cancel()
        ended = await asyncio.gather(*tasks, return_exceptions=True)
        await runner.cleanup()
        for failure in ended:  # raised once the port is free again
            if isinstance(failure, Exception):
                raise failure


class _Handler(web.RequestHandler):
    """A connection whose errors have our headers, too: a request that is no HTTP never reaches the application."""

    __slots__ = ()
    connections: ClassVar[Connections]

    def connection_made(self, transport: asyncio.BaseTransport) -> None:
        """Add the connection to those of the server."""
        super().connection_made(transport)
        assert isinstance(transport, asyncio.Transport)
        self.connections.add(self, transport, asyncio.get_running_loop().time())

    def handle_error(self, *arguments: Any, **named: Any) -> web.StreamResponse:
        """Return aiohttp's answer to an error, with the headers of all others."""
        answer = super().handle_error(*arguments, **named)
        answer.headers.update(HEADERS)
        return answer


def _handler(runner: web.AppRunner, connections: Connections) -> web.RequestHandler:
    """Return the handler of a new connection. aiohttp makes it, without a choice of its class."""
    assert runner.server is not None
    handler = runner.server()
    handler.__class__ = type(_Handler.__name__, (_Handler,), {"__slots__": (), "connections": connections})
    return handler


def _report_once() -> Callable[[asyncio.AbstractEventLoop, dict[str, Any]], None]:
    """Return a handler of the loop's errors that reports only once that connections cannot be accepted.

    asyncio tries again each second, and would print a traceback for each waiting connection.
    """
    reported: set[int | None] = set()

    def handle(loop: asyncio.AbstractEventLoop, context: dict[str, Any]) -> None:
        error = context.get("exception")
        number = error.errno if isinstance(error, OSError) else None
        if number not in OUT_OF_DESCRIPTORS:
            loop.default_exception_handler(context)
        elif number not in reported:
            reported.add(number)
            LOGGER.warning("connections wait, as there are no more descriptors: %s", error)

    return handle


def _end_with(server: asyncio.Task[Any] | None, task: asyncio.Task[None]) -> None:
    # A page whose task has failed would look like a silent bus.
    if server is not None and not task.cancelled() and task.exception():
        server.cancel()


class _Server:
    def __init__(
        self, page: Callable[[], str], access: AccessRules, requests: Requests | None, posts: Mapping[str, Post]
    ) -> None:
        self._page = page
        self._access = access
        self._requests = requests
        self._posts = posts
        self._name = secrets.token_hex(4)
        """By it a page notices that the server shows another one."""
        self._browsers: set[web.WebSocketResponse] = set()
        self.connections = Connections()

    def application(self) -> web.Application:
        # The guard is asked before any handler, even about paths that do not exist.
        application = web.Application(middlewares=[self._guard], client_max_size=LONGEST_REQUEST)
        application.router.add_get("/", self._show)
        if self._posts:
            application.router.add_get("/shown", self._shown)
        for path in self._posts:
            application.router.add_post(path, self._post)
        if self._requests is not None:
            application.router.add_get("/live", self._live)
            application.router.add_get("/recording/{name}", self._recording)
            application.router.add_get("/report/{name}", self._report)

        async def add_headers(_: web.Request, response: web.StreamResponse) -> None:
            for name, value in HEADERS.items():
                response.headers.setdefault(name, value)

        async def say_goodbye(_: web.Application) -> None:
            # Of a copy, as each one that is closed removes itself.
            await asyncio.gather(*(each.close() for each in set(self._browsers)), return_exceptions=True)

        application.on_response_prepare.append(add_headers)  # for every answer, including refusals and errors
        application.on_shutdown.append(say_goodbye)
        return application

    def tasks(self) -> list[Coroutine[Any, Any, None]]:
        """Return the tasks that run all the time."""
        if self._requests is None:
            return [self._close_silent()]
        desk = self._requests.desk
        session = desk.session

        async def watch() -> None:  # whether or not a browser is connected
            while True:
                is_behind = session.poll()
                is_idle = desk.jobs.running is None and not desk.running_lists
                pause = LOOK if is_idle else LOOK_OF_JOB
                await asyncio.sleep(0 if is_behind else pause)

        return [self._close_silent(), watch(), objects.poll(desk), send.send_lists(desk)]

    async def _close_silent(self) -> None:
        while True:
            await asyncio.sleep(1.0)
            self.connections.close_silent(asyncio.get_running_loop().time())

    @web.middleware
    async def _guard(self, request: web.Request, handler: Handler) -> web.StreamResponse:
        shown = request.query.get(TOKEN) or request.cookies.get(_cookie(request), "")
        refusal = self._access.refusal(request.headers, shown, acts=request.path in ("/live", *self._posts))
        clock = asyncio.get_running_loop().time
        with self.connections.answering(request.protocol, clock, is_known=refusal is None):
            if refusal is not None:
                return web.Response(status=refusal.status, text=f"{refusal.why}\n")
            return await handler(request)

    async def _show(self, request: web.Request) -> web.StreamResponse:
        if TOKEN not in request.query:
            page = self._page()
            policy = {"Content-Security-Policy": f"{policy_of(page)}; {UNFRAMED}"}
            return web.Response(text=page, content_type="text/html", headers=policy)
        # The browser keeps it out of the reach of scripts, and out of its address line and history.
        response = web.Response(status=303, headers={"Location": "/"})
        response.set_cookie(_cookie(request), self._access.token, httponly=True, samesite="Strict")
        return response

    async def _shown(self, _: web.Request) -> web.StreamResponse:
        return web.Response(text=self._name)

    async def _post(self, request: web.Request) -> web.StreamResponse:
        body = await _body(request, LONGEST_POSTS.get(request.path, LONGEST_REQUEST))
        text = await self._posts[request.path](body.decode("utf-8", "replace"))
        return web.Response(text=text, content_type="application/json")

    async def _recording(self, request: web.Request) -> web.StreamResponse:
        assert self._requests is not None
        return _file_of(self._requests.desk.folder, request)

    async def _report(self, request: web.Request) -> web.StreamResponse:
        assert self._requests is not None
        return _file_of(self._requests.desk.reports, request)

    # A browser

    async def _live(self, request: web.Request) -> web.StreamResponse:
        assert self._requests is not None
        if len(self._browsers) >= MOST_BROWSERS:
            raise web.HTTPServiceUnavailable(text=f"{MOST_BROWSERS} browsers watch already\n")
        socket = web.WebSocketResponse(heartbeat=SILENCE, max_msg_size=LONGEST_REQUEST, compress=False)
        await socket.prepare(request)
        browser = _Browser(socket, self._requests)
        self._browsers.add(socket)
        feeding = asyncio.create_task(browser.feed())
        try:
            await browser.listen()
        finally:
            self._browsers.discard(socket)
            self._requests.left(browser)
            feeding.cancel()
            await asyncio.gather(feeding, return_exceptions=True)
        return socket


async def _body(request: web.Request, longest: int) -> bytes:
    """Return the posted bytes; raises the HTTP error for a body that is too long or too slow."""
    body = bytearray()
    try:
        async with asyncio.timeout(LONGEST_UPLOAD):
            async for part in request.content.iter_any():
                body += part
                if len(body) > longest:
                    raise web.HTTPRequestEntityTooLarge(longest, len(body), text=f"more than {longest} bytes\n")
    except TimeoutError:
        raise web.HTTPRequestTimeout(text="the request did not come in time\n") from None
    return bytes(body)


def _file_of(folder: Path, request: web.Request) -> web.StreamResponse:
    # Looked up, not joined to the folder's path, so that no name leads out of the folder.
    known = {each.name: each for each in folder.iterdir() if each.is_file()}
    file = known.get(request.match_info["name"])
    if file is None:
        raise web.HTTPNotFound
    return web.FileResponse(file, headers={"Content-Disposition": f'attachment; filename="{file.name}"'})


def _cookie(request: web.Request) -> str:
    """Return the name of the cookie with the token; browsers keep one for all ports of a host."""
    assert request.transport is not None
    return f"{TOKEN}-{request.transport.get_extra_info('sockname')[1]}"


class _Browser:
    """One browser: the snapshots sent and not yet confirmed, and its requests."""

    def __init__(self, socket: web.WebSocketResponse, requests: Requests) -> None:
        self._socket = socket
        self._requests = requests
        self._session = requests.desk.session
        self._turn = -1
        self._shown = 0
        self._owed: list[int] = []
        self._pending: set[asyncio.Task[None]] = set()

    async def feed(self) -> None:
        """Send snapshots as long as the browser is connected."""
        loop = asyncio.get_running_loop()
        due = loop.time()
        with suppress(ConnectionError):
            while not self._socket.closed:
                if len(self._owed) <= MOST_OWED and self._session.turn > self._turn:
                    await self._socket.send_str(self._next())
                due = max(due + PERIOD, loop.time())  # later, if the connection was full for so long
                await asyncio.sleep(due - loop.time())

    def _next(self) -> str:
        """Return the next snapshot, with all frames since the last one."""
        since, self._turn = self._turn, self._session.turn
        stretch = self._session.history.since(self._shown)
        self._shown = stretch.next
        self._owed.append(self._turn)
        return self._session.snapshot(since, stretch, **self._requests.snapshot_data(since))

    async def listen(self) -> None:
        """Process confirmations and requests until the browser leaves."""
        async for message in self._socket:
            if message.type is not WSMsgType.TEXT:
                continue
            self._requests.desk.drives.hear_page(self)
            text: str = message.data
            if text.isdecimal():  # the turn of a snapshot; cut, as int() refuses more than 4300 digits
                self._owed = [each for each in self._owed if each > int(text[:12])]
            elif len(self._pending) < MOST_PENDING:
                task = asyncio.create_task(self._answer(text))
                self._pending.add(task)  # asyncio itself does not keep a task alive
                task.add_done_callback(self._pending.discard)

    async def _answer(self, text: str) -> None:
        answer = await self._requests.answer(text, self)
        with suppress(ConnectionError):
            await self._socket.send_str(answer)
