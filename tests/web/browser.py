"""A headless Chromium that tests drive by its DevTools protocol."""

from __future__ import annotations

import asyncio
import base64
import itertools
import json
import shutil
import subprocess
import tempfile
import time
from collections.abc import Callable, Iterator
from contextlib import ExitStack, contextmanager, suppress
from pathlib import Path
from typing import Any

import aiohttp
from interop_rows.tools import BROWSERS

PATIENCE = 60.0
"""Longest time for which a test waits for the page, in s."""

PROGRAM = next(filter(None, map(shutil.which, BROWSERS)), None)
"""The browser, None on a machine that has none."""

SERVER_IS_GONE = ("ERR_CONNECTION_REFUSED", "ERR_CONNECTION_RESET", "ERR_EMPTY_RESPONSE")
"""What the browser says of a request that meets no server, one that ends with it still waiting, or before its answer.

The page asks again until there is a server.
"""

OPTIONS = (
    "--headless=new", "--no-sandbox", "--disable-gpu", "--disable-dev-shm-usage", "--no-first-run", "--hide-scrollbars",
    "--disable-background-timer-throttling", "--disable-renderer-backgrounding",
    "--disable-backgrounding-occluded-windows",
    "--blink-settings=primaryHoverType=2,availableHoverTypes=2",  # as with a mouse
    "--force-prefers-reduced-motion",  # a match does not play before a test wants it to
    "--enable-precise-memory-info", "--remote-debugging-port=0",
)  # fmt: skip


class Page:
    """One page of the browser."""

    def __init__(self, loop: asyncio.AbstractEventLoop, socket: aiohttp.ClientWebSocketResponse) -> None:
        self._loop, self._socket, self._numbers = loop, socket, itertools.count(1)
        self.complaints: list[str] = []
        self.may_lose_its_server = False
        self._dragged: dict[str, Any] | None = None
        for domain in ("Page", "Runtime", "Log"):
            self.call(f"{domain}.enable")

    def call(self, method: str, **parameters: Any) -> Any:
        """Call a method of the protocol and return its result."""
        return self._loop.run_until_complete(self._call(method, parameters))

    async def _call(self, method: str, parameters: dict[str, Any]) -> Any:
        number = next(self._numbers)
        await self._socket.send_json({"id": number, "method": method, "params": parameters})
        while True:
            said = await self._socket.receive_json(timeout=PATIENCE)
            if said.get("id") == number:
                assert "error" not in said, (method, said["error"])
                return said["result"]
            self._note(said)

    def _note(self, said: dict[str, Any]) -> None:
        """Keep what the page throws, what the browser refuses it, and what is dragged."""
        if said.get("method") == "Input.dragIntercepted":
            self._dragged = said["params"]["data"]
        if said.get("method") == "Runtime.exceptionThrown":
            details = said["params"]["exceptionDetails"]
            self.complaints.append(str(details.get("exception", details).get("description", details)))
        if said.get("method") == "Log.entryAdded" and said["params"]["entry"]["level"] == "error":
            entry = said["params"]["entry"]
            if not (self.may_lose_its_server and any(each in entry["text"] for each in SERVER_IS_GONE)):
                self.complaints.append(f"{entry['text']} ({entry.get('url', '')})")

    def open(self, address: str) -> None:
        """Load a page and wait until it has drawn itself."""
        self.call("Page.navigate", url=address)
        self.wait("document.body && document.body.dataset.time !== undefined")

    def reload(self) -> None:
        """Load the page again, and wait until it has drawn itself."""
        self.run("window.isOld = true")
        self.call("Page.reload")
        end = time.monotonic() + PATIENCE
        while time.monotonic() < end:
            with suppress(AssertionError):  # the old page goes while it is asked
                if self.run("!window.isOld && document.body !== null && document.body.dataset.time !== undefined"):
                    return
        raise AssertionError(f"not loaded again; complaints: {self.complaints}")

    def close(self) -> None:
        """Close the window, and forget what it has kept: all pages that are files share one storage."""
        with suppress(AssertionError):  # about:blank has none
            self.run("localStorage.clear()")
        self.call("Page.close")
        self._loop.run_until_complete(self._socket.close())

    def run(self, expression: str) -> Any:
        """Return what an expression gives in the page; a promise is waited for."""
        found = self.call("Runtime.evaluate", expression=expression, returnByValue=True, awaitPromise=True)
        assert "exceptionDetails" not in found, found["exceptionDetails"]["exception"].get("description")
        return found["result"].get("value")

    def wait(self, expression: str, patience: float = PATIENCE) -> Any:
        """Wait until an expression is true in the page; one that raises is not true yet: its element may still come."""
        end = time.monotonic() + patience
        raised = ""
        while time.monotonic() < end:
            try:
                # An object of the page may lead to all others: that it is there is enough.
                found, raised = self.run(f"(found => found instanceof Object || found)({expression})"), ""
            except AssertionError as error:
                found, raised = None, f"; raised: {error}"
            if found:
                return found
            self.run("new Promise(done => setTimeout(done, 20))")
        raise AssertionError(f"never true: {expression}{raised}; complaints: {self.complaints}")

    def click(self, selector: str) -> None:
        """Click the middle of an element as a person does: once it is seen and stands still; whatever lies upon it."""
        self.release(self.hold(selector))

    def hold(self, selector: str) -> dict[str, float]:
        """Press the mouse's button as `click` does, and return the place for `release`."""
        place: dict[str, float] = self.run(f"""new Promise(done => {{
            const found = document.querySelector({json.dumps(selector)});
            const middle = () => {{
                found.scrollIntoView({{block: "center"}});
                const box = found.getBoundingClientRect();
                return {{x: box.x + box.width / 2, y: box.y + box.height / 2}};
            }};
            const look = before => setTimeout(() => {{
                const now = middle();
                const isSeen = found.getClientRects().length > 0;
                isSeen && now.x === before.x && now.y === before.y ? done(now) : look(now);
            }}, 150);
            look(middle());
        }})""")
        self.call("Input.dispatchMouseEvent", type="mousePressed", button="left", clickCount=1, **place)
        return place

    def release(self, place: dict[str, float]) -> None:
        """Release the mouse's button at a place."""
        self.call("Input.dispatchMouseEvent", type="mouseReleased", button="left", clickCount=1, **place)

    def place(self, selector: str, along: float = 0.5) -> dict[str, float]:
        """Scroll to an element, and return a place in its middle, or elsewhere along its width."""
        found: dict[str, float] = self.run(f"""(found => {{
            found.scrollIntoView({{block: "nearest"}});
            const box = found.getBoundingClientRect();
            return {{x: box.x + box.width * {along}, y: box.y + box.height / 2}};
        }})(document.querySelector({json.dumps(selector)}))""")
        return found

    def drag(self, selector: str, to: str, along: float = 0.5) -> None:
        """Drag an element with the mouse to a place along the width of another one."""
        self.call("Input.setInterceptDrags", enabled=True)
        self._dragged = None
        place = self.hold(selector)
        for step in (4, 8, 12):
            moved = {**place, "x": place["x"] + step}
            self.call("Input.dispatchMouseEvent", type="mouseMoved", button="left", buttons=1, **moved)
        self.wait("true")  # the browser says what is dragged when it is asked something else
        assert self._dragged is not None, f"{selector} is not dragged"
        self.drop(self._dragged, to, along)
        self.release(self.place(to, along))
        self.call("Input.setInterceptDrags", enabled=False)

    def drop(self, data: dict[str, Any], to: str, along: float = 0.5) -> None:
        """Drop what is dragged, such as files of the disk, at a place along the width of an element."""
        for kind in ("dragEnter", "dragOver", "drop"):
            self.call("Input.dispatchDragEvent", type=kind, data=data, **self.place(to, along))

    def press(self, key: str, text: str = "") -> None:
        """Press a key."""
        self.call("Input.dispatchKeyEvent", type="keyDown", key=key, text=text or (key if len(key) == 1 else ""))
        self.call("Input.dispatchKeyEvent", type="keyUp", key=key)

    def text(self, selector: str) -> str:
        """Return the text of an element."""
        return str(self.run(f"document.querySelector({json.dumps(selector)}).textContent"))

    def size(self, width: int, height: int = 900, dark: bool = False) -> None:
        """Make the window so large, and the person who sits before it one who likes it dark."""
        self.call(
            "Emulation.setDeviceMetricsOverride", width=width, height=height, deviceScaleFactor=1, mobile=width < 500
        )
        scheme = [{"name": "prefers-color-scheme", "value": "dark" if dark else "light"}]
        self.call("Emulation.setEmulatedMedia", features=scheme)

    def screenshot(self, file: Path) -> None:
        """Save what is seen."""
        file.write_bytes(base64.b64decode(self.call("Page.captureScreenshot", format="png")["data"]))


class Browser:
    """A running browser."""

    def __init__(self, loop: asyncio.AbstractEventLoop, http: aiohttp.ClientSession, address: str) -> None:
        self._loop, self._http, self._address = loop, http, address

    def page(self) -> Page:
        """Open a new window."""

        async def opened() -> aiohttp.ClientWebSocketResponse:
            async with self._http.put(f"{self._address}/json/new?about:blank") as answer:
                target = await answer.json()
            return await self._http.ws_connect(target["webSocketDebuggerUrl"], max_msg_size=0)

        return Page(self._loop, self._loop.run_until_complete(opened()))


@contextmanager
def running() -> Iterator[Browser]:
    """Start the browser, with nothing of what it knew before; on a busy machine it may hang, and is started again."""
    with ExitStack() as stack:
        try:
            browser = stack.enter_context(_started())
        except AssertionError:
            browser = stack.enter_context(_started())
        yield browser


@contextmanager
def _started() -> Iterator[Browser]:
    assert PROGRAM is not None
    with tempfile.TemporaryDirectory(ignore_cleanup_errors=True) as folder:
        command = [PROGRAM, *OPTIONS, f"--user-data-dir={folder}", "about:blank"]
        with subprocess.Popen(command, stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL) as process:
            loop = asyncio.new_event_loop()
            http = loop.run_until_complete(_client())
            try:
                port = _port(Path(folder) / "DevToolsActivePort", process.poll)
                yield Browser(loop, http, f"http://127.0.0.1:{port}")
            finally:
                loop.run_until_complete(http.close())
                process.terminate()
                process.wait()
                loop.close()


async def _client() -> aiohttp.ClientSession:
    return aiohttp.ClientSession()


def _port(file: Path, ended: Callable[[], int | None]) -> int:
    end = time.monotonic() + PATIENCE
    while time.monotonic() < end and ended() is None:
        if file.exists() and (lines := file.read_text().split()):
            return int(lines[0])
        time.sleep(0.02)
    raise AssertionError("the browser did not start")
