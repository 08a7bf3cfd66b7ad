#!/usr/bin/env python3
"""Measures how each motion of a drive on the page ends: the worst time to standstill, and the degrees turned meanwhile.

A simulated drive turns by the page's order, in a real browser with a real server on a bus of python-can-remote. Then
something happens: the button is released, the tab is hidden, closed, reloaded, frozen or crashes, the network is cut,
the server gets Ctrl-C, SIGTERM or SIGKILL, or its adapter is lost. Each is measured alone, beside a second master, with
one SDO answer in three lost, and with 32 requests pending in another tab; by velocity, torque and position.

Exit status 1 if a drive goes on, or anything could not be measured.
"""

from __future__ import annotations

import argparse
import asyncio
import json
import multiprocessing
import random
import signal
import socket
import sys
import threading
import time
from collections.abc import Callable, Iterator, Sequence
from contextlib import ExitStack, contextmanager, suppress
from pathlib import Path
from typing import Any, NamedTuple

ROOT = Path(__file__).resolve().parents[1]
sys.path.insert(0, str(ROOT))  # the tests' browser

import aiohttp  # noqa: E402
import can  # noqa: E402
from programs import Program, free_port  # noqa: E402

from eurobot_od.bus.live import Live, open_bus  # noqa: E402
from eurobot_od.bus.live.buses import share  # noqa: E402
from eurobot_od.device.faults import Leaving  # noqa: E402
from eurobot_od.device.profiles import SimulatedDrive  # noqa: E402
from eurobot_od.frame import Frame  # noqa: E402
from eurobot_od.od.cia402 import State  # noqa: E402
from eurobot_od.od.dictionary import Dictionary  # noqa: E402
from eurobot_od.od.values import SDO_RESPONSE_BASE  # noqa: E402
from tests.web.browser import Browser, Page, running  # noqa: E402

EDS = ROOT / "docs" / "servo.eds"
NODE = 5
ABSENT = 9

MOVES_FROM = 0.02
"""Turns after which a drive counts as moving."""

STANDS = 0.01
"""Turns per second below which the drive stands."""

ATTEMPTS = 3
"""How often a motion is tried that does not begin: on a busy machine the page may be late, and its order is refused."""

LONGEST = 8.0
"""Longest wait for a standstill, in s."""

MODES = ("velocity", "torque", "position")
CONDITIONS = ("alone", "master each 20 ms", "master each 100 ms", "1 answer in 3 lost", "32 requests pending")


class Lossy(Leaving, SimulatedDrive):
    """Loses one SDO answer in three while `loses` is set."""

    loses = False
    chance = random.Random(1)

    def outgoing(self, frames: list[Frame]) -> list[Frame]:
        """Return the frames that are not lost."""
        kept = super().outgoing(frames)
        if not self.loses:
            return kept
        return [each for each in kept if each.cob_id != SDO_RESPONSE_BASE + NODE or self.chance.random() >= 1 / 3]


class Proxy:
    """A TCP connection that can be cut: nothing passes any more, and neither end is told."""

    def __init__(self, target: int) -> None:
        self.port = free_port()
        self._target = target
        self._is_cut = False
        self._listening = socket.create_server(("127.0.0.1", self.port))
        self._sockets: list[socket.socket] = []
        threading.Thread(target=self._accept, daemon=True).start()

    def _accept(self) -> None:
        with suppress(OSError):
            while True:
                near, _ = self._listening.accept()
                if self._is_cut:
                    near.close()
                    continue
                far = socket.create_connection(("127.0.0.1", self._target))
                self._sockets += [near, far]
                for one, other in ((near, far), (far, near)):
                    threading.Thread(target=self._pass, args=(one, other), daemon=True).start()

    def _pass(self, one: socket.socket, other: socket.socket) -> None:
        with suppress(OSError):
            while data := one.recv(65536):
                if not self._is_cut:
                    other.sendall(data)
            if not self._is_cut:
                other.shutdown(socket.SHUT_WR)

    def cut(self, closes: bool = False) -> None:
        """Stop passing data; with `closes` also close the connections, as a lost adapter does."""
        self._is_cut = True
        if not closes:
            return
        for each in self._sockets:
            with suppress(OSError):
                each.shutdown(socket.SHUT_RDWR)

    def close(self) -> None:
        """Close it."""
        self._listening.close()
        for each in self._sockets:
            each.close()


class Server:
    """`serve --control` in a process of its own, with its adapter and its network behind proxies."""

    def __init__(self, bus_port: int) -> None:
        self.adapter = Proxy(bus_port)
        port = free_port()
        ready = threading.Event()
        self.said: list[str] = []

        def took(line: str) -> None:
            self.said.append(line)
            if "http://" in line:
                ready.set()

        words = [
            "-i",
            "remote",
            "-c",
            f"ws://127.0.0.1:{self.adapter.port}/",
            "--eds",
            f"{NODE}={EDS}",
            "--robot",
            "none",
        ]
        command = [sys.executable, "-m", "eurobot_od", "serve", "--control", "--listen", f"127.0.0.1:{port}", *words]
        self.program = Program(*command, took=took)
        assert ready.wait(60), self.said
        self.network = Proxy(port)
        self.address = f"http://127.0.0.1:{self.network.port}/"
        self.direct = f"ws://127.0.0.1:{port}/live"

    def close(self) -> None:
        """End it."""
        self.program.kill()
        self.adapter.close()
        self.network.close()


class Scene(NamedTuple):
    """The parts of one measurement."""

    drive: Lossy
    server: Server
    page: Page

    @property
    def place(self) -> float:
        """The motor's position, in turns."""
        motor = self.drive.axes[0].motor
        return motor.position / motor.turn

    def press(self, name: str) -> None:
        """Press a button of the drive by its text, twice if it asks."""
        self.page.run(f"""(() => {{
            const all = [...document.querySelectorAll('.drive button')], name = {json.dumps(name)};
            const found = () => all.find(each => each.textContent.startsWith(name));
            found().click();
            if (found().classList.contains('armed')) found().click();
        }})()""")


# Ends


def send_only(page: Page, method: str, **parameters: Any) -> None:
    """Call a method of the browser that may never answer."""
    page._loop.run_until_complete(page._socket.send_json({"id": 10**6, "method": method, "params": parameters}))


def release(scene: Scene, mode: str) -> None:
    """Release the button; a move is halted."""
    if mode == "position":
        scene.press("Halt")
    else:
        scene.page.call("Input.dispatchMouseEvent", type="mouseReleased", button="left", clickCount=1, x=5, y=5)


def hide(scene: Scene, _: str) -> None:
    """Hide the page."""
    scene.page.run("""(() => {
        Object.defineProperty(document, 'hidden', {get: () => true, configurable: true});
        document.dispatchEvent(new Event('visibilitychange'));
    })()""")


ENDS: dict[str, Callable[[Scene, str], object]] = {
    "release": release,
    "hidden": hide,
    "closed": lambda scene, _: send_only(scene.page, "Page.close"),
    "reload": lambda scene, _: send_only(scene.page, "Page.reload"),
    "frozen": lambda scene, _: send_only(scene.page, "Page.setWebLifecycleState", state="frozen"),
    "crashed tab": lambda scene, _: send_only(scene.page, "Page.crash"),
    "cut network": lambda scene, _: scene.server.network.cut(),
    "Ctrl-C": lambda scene, _: scene.server.program.signal(signal.SIGINT),
    "SIGTERM": lambda scene, _: scene.server.program.signal(signal.SIGTERM),
    "SIGKILL": lambda scene, _: scene.server.program.signal(signal.SIGKILL),
    "adapter lost": lambda scene, _: scene.server.adapter.cut(closes=True),
}
SERVER_ENDS = ("cut network", "Ctrl-C", "SIGTERM", "SIGKILL", "adapter lost")


# Conditions


@contextmanager
def second_master(channel: str, period: float) -> Iterator[None]:
    """Run another master that reads the position each `period` seconds."""
    ended = threading.Event()
    message = can.Message(arbitration_id=0x605, data=bytes.fromhex("4064600000000000"), is_extended_id=False)

    def ask() -> None:
        with open_bus("virtual", channel) as bus:
            while not ended.wait(period):
                bus.send(message)
                while bus.recv(0):
                    pass

    thread = threading.Thread(target=ask, daemon=True)
    thread.start()
    try:
        yield
    finally:
        ended.set()
        thread.join()


@contextmanager
def pending(server: Server) -> Iterator[None]:
    """Keep 32 reads of an absent node under way, as another tab would."""
    loop = asyncio.new_event_loop()
    ended = threading.Event()
    origin = server.direct.replace("ws:", "http:").removesuffix("/live")

    async def ask() -> None:
        with suppress(aiohttp.ClientError, ConnectionError):
            async with aiohttp.ClientSession() as http, http.ws_connect(server.direct, origin=origin) as opened:
                text = json.dumps({"do": "read", "node": f"node {ABSENT}", "object": "0x1000", "id": 1})
                for _ in range(32):
                    await opened.send_str(text)
                while not ended.is_set() and not opened.closed:
                    with suppress(asyncio.TimeoutError):
                        said = await opened.receive(0.1)
                        if said.type is aiohttp.WSMsgType.TEXT:
                            data = json.loads(said.data)
                            await opened.send_str(text if "re" in data else str(data["turn"]))

    thread = threading.Thread(target=lambda: loop.run_until_complete(ask()), daemon=True)
    thread.start()
    time.sleep(0.3)
    try:
        yield
    finally:
        ended.set()
        thread.join()
        loop.close()


@contextmanager
def under(condition: str, scene: Scene, channel: str) -> Iterator[None]:
    """Keep a condition meanwhile."""
    with ExitStack() as stack:
        if condition.startswith("master"):
            stack.enter_context(second_master(channel, 0.02 if "20" in condition else 0.1))
        elif condition.startswith("32"):
            stack.enter_context(pending(scene.server))
        yield


# Measuring


class Measured(NamedTuple):
    """How a motion ended: `seconds` to standstill, `degrees` turned meanwhile, `trouble` if it was not measured."""

    seconds: float
    degrees: float
    trouble: str = ""


def begin(scene: Scene, mode: str) -> None:
    """Enable the drive and make it turn; raises AssertionError if it does not."""
    page = scene.page
    page.wait(
        "!document.querySelector('.status.is-wrong') && connection.control && document.querySelector('.machine .now')"
    )
    scene.press("Enable")
    end = time.monotonic() + 20
    while scene.drive.axes[0].state is not State.ENABLED:
        assert time.monotonic() < end, f"it is not enabled: {page.text('#toast')}"
        time.sleep(0.01)
    start = scene.place
    if mode == "position":
        page.run("""[...document.querySelectorAll('.drive label')].find(each => each.textContent === 'position')
            .querySelector('input').value = '100000000'""")
        scene.press("Move to")
    else:
        page.run("[1000, 100].forEach((value, row) => { document.querySelectorAll('.jog input')[row].value = value; })")
        row = 0 if mode == "velocity" else 1
        place = page.run(f"""(found => {{
            found.scrollIntoView({{block: 'center'}});
            const box = found.getBoundingClientRect();
            return {{x: box.x + box.width / 2, y: box.y + box.height / 2}};
        }})(document.querySelectorAll('.jog')[{row}].querySelectorAll('button')[1])""")
        page.call("Input.dispatchMouseEvent", type="mousePressed", button="left", clickCount=1, **place)
    end = time.monotonic() + 10
    while abs(scene.place - start) < MOVES_FROM:
        assert time.monotonic() < end, f"it does not begin to turn: {page.text('#toast')}"
        time.sleep(0.005)
    time.sleep(0.3)
    before = scene.place
    time.sleep(0.05)
    assert abs(scene.place - before) >= MOVES_FROM, f"it has stopped before: {page.text('#toast')}"


def standstill(scene: Scene) -> Measured:
    """Wait until the drive has stood for a second."""
    begun = time.monotonic()
    start = scene.place
    last = begun
    before = start
    while time.monotonic() - last < 1.5:
        time.sleep(0.01)
        now = scene.place
        if abs(now - before) > STANDS * 0.01:
            last = time.monotonic()
            before = now
        if last - begun > LONGEST:
            return Measured(last - begun, 360 * abs(now - start), "it goes on")
    return Measured(last - begun, 360 * abs(scene.place - start))


def measured(scene: Scene, end: str, condition: str, mode: str, channel: str) -> Measured:
    """Measure one end of a motion."""
    try:
        with under(condition, scene, channel):
            begin(scene, mode)
            scene.drive.loses = condition.startswith("1 answer")
            ENDS[end](scene, mode)
            return standstill(scene)
    except (AssertionError, OSError, TimeoutError) as error:
        return Measured(0.0, 0.0, f"not measured: {str(error)[:200]}")
    finally:
        scene.drive.loses = False


def measure_all(
    browser: Browser, names: Sequence[str], conditions: Sequence[str], modes: Sequence[str]
) -> Iterator[tuple[tuple[str, str, str], Measured]]:
    """Measure each combination, each with a drive of its own, and with a new server where the last one was ended."""
    port = free_port()
    channel = share(port)
    dictionary = Dictionary.load(EDS, NODE, "servo")
    with ExitStack() as servers:
        server: Server | None = None
        for key in ((end, condition, mode) for end in names for condition in conditions for mode in modes):
            for _ in range(ATTEMPTS):
                drive = Lossy(dictionary)
                with Live.node(open_bus("virtual", channel), drive):
                    if server is None:
                        server = Server(port)
                        servers.callback(server.close)
                    page = browser.page()
                    page.size(1600)
                    page.open(server.address + "#drives")
                    found = measured(Scene(drive, server, page), *key, channel)
                    send_only(page, "Page.close")
                # A server that was ended, or that still stops a drive that is gone, does not meet the next one.
                if key[0] in SERVER_ENDS or found.trouble:
                    servers.close()
                    server = None
                if not found.trouble.startswith("not measured"):
                    break
            yield key, found


def busy() -> None:
    """Load a core as long as the tool runs."""
    signal.signal(signal.SIGINT, signal.SIG_IGN)
    parent = multiprocessing.parent_process()
    while parent is not None and parent.is_alive():
        sum(range(10000))


@contextmanager
def load(cores: int) -> Iterator[None]:
    """Keep some cores busy."""
    workers = [multiprocessing.Process(target=busy, daemon=True) for _ in range(cores)]
    for each in workers:
        each.start()
    try:
        yield
    finally:
        for each in workers:
            each.kill()
            each.join()


def table(results: dict[tuple[str, str, str], Measured]) -> list[str]:
    """Return the worst of each end and condition as a table in Markdown."""
    conditions = [each for each in CONDITIONS if any(key[1] == each for key in results)]
    lines = [f"| end | {' | '.join(conditions)} |", f"|---{'|---' * len(conditions)}|"]
    for end in dict.fromkeys(key[0] for key in results):
        cells = []
        for condition in conditions:
            found = [each for key, each in results.items() if key[:2] == (end, condition)]
            bad = [each.trouble for each in found if each.trouble]
            worst = (
                f"{max(each.seconds for each in found):.2f} s, {max(each.degrees for each in found):.0f}°"
                if found
                else ""
            )
            cells.append(bad[0] if bad else worst)
        lines.append(f"| {end} | {' | '.join(cells)} |")
    return lines


def main() -> int:
    """Measure the wanted combinations."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("ends", nargs="*", default=list(ENDS), help=f"of {', '.join(ENDS)} (default: all)")
    parser.add_argument("--condition", action="append", choices=CONDITIONS, help="(default: all)")
    parser.add_argument("--mode", action="append", choices=MODES, help="(default: all)")
    parser.add_argument("--load", type=int, default=0, metavar="CORES", help="busy processes beside (0)")
    parser.add_argument("--json", type=Path, metavar="FILE", help="where each measurement is written")
    asked = parser.parse_args()
    # A shell has a program in the background ignore Ctrl-C, and the server would inherit that.
    signal.signal(signal.SIGINT, signal.default_int_handler)
    signal.signal(signal.SIGTERM, lambda *_: sys.exit("ended"))  # with browser, server and load
    results: dict[tuple[str, str, str], Measured] = {}
    with load(asked.load), running() as browser:
        for key, found in measure_all(browser, asked.ends, asked.condition or CONDITIONS, asked.mode or MODES):
            results[key] = found
            print(
                f"{', '.join(key)}: {found.trouble or f'{found.seconds:.2f} s, {found.degrees:.0f} degrees'}",
                flush=True,
            )
            if asked.json:
                asked.json.write_text(json.dumps([[*key, *each] for key, each in results.items()]))
    print("\n".join(table(results)))
    return int(any(each.trouble for each in results.values()))


if __name__ == "__main__":
    sys.exit(main())
