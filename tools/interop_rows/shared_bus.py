"""Our nodes and other programs on a bus that processes share: python-can-remote, and SocketCAN with can-utils.

The other side is a process of its own, started as its documentation says.
"""

from __future__ import annotations

import contextlib
import subprocess
import sys
import threading
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import can

from eurobot_od.robot import dialects
from interop_rows.bench import DRIVE, PATIENCE, collect, live, stock_network
from interop_rows.row import Answer, agree
from interop_rows.tools import run

CHECK = (0x3C0, 0x400)
"""Identifiers of Check Drive Request and Response."""


# python-can-remote


@contextmanager
def served_bus() -> Iterator[str]:
    """Serve an in-process bus to other processes on this machine; yields its channel."""
    from can_remote.server import RemoteServer

    server = RemoteServer("127.0.0.1", 0, interface="virtual", channel="interop")
    thread = threading.Thread(target=server.serve_forever, args=(0.05,), daemon=True)
    thread.start()
    try:
        yield f"ws://127.0.0.1:{server.server_port}/"
    finally:
        server.shutdown()
        server.server_close()
        thread.join(PATIENCE)


def remote(channel: str) -> can.BusABC:
    """Join a served bus."""
    return can.Bus(interface="remote", channel=channel)


def remote_bus(_: Path) -> Answer:
    """Send requests of a master to our drive over a bus that python-can-remote serves."""
    eds = dialects.load("drive", dialects.DEFAULT)
    with served_bus() as channel, live("drive", remote(channel)), stock_network(remote(channel)) as network:
        node: Any = network.add_node(DRIVE, str(eds.file))
        agree("the heartbeat period", node.sdo[0x1017].raw, 1000)
        with node.sdo.open(0x1021, 0, "rb", block_transfer=True) as stream:
            agree("the EDS in blocks", stream.read(), eds.content)
    return Answer("SDO read and an EDS in blocks between a master and our drive over `ws://127.0.0.1`")


def played_log(folder: Path) -> Answer:
    """Play a log to our drive with `can_player` over a served bus."""
    file = folder / "asked.log"
    file.write_text(f"(0.000000) can0 {CHECK[0]:03X}# R\n")
    with served_bus() as channel, live("drive", remote(channel)), remote(channel) as listener:
        player = run(sys.executable, "-m", "can.player", "-i", "remote", "-c", channel, file)
        agree("can_player's status", player.returncode, 0)
        answers = collect(listener, lambda message: message.arbitration_id == CHECK[1])
    agree("the last identifier", answers[-1].arbitration_id, CHECK[1])
    return Answer("a played Check Drive Request is answered by our drive in another process")


# can-utils


def candump_and_cansend(_: Path) -> Answer:
    """Ask our drive with cansend on vcan0, and read the answer with candump."""
    command = ["candump", "-L", "-n", "1", "-T", str(int(PATIENCE * 1000)), f"vcan0,{CHECK[1]:03X}:7FF"]
    vcan = can.Bus(interface="socketcan", channel="vcan0")
    with live("drive", vcan), subprocess.Popen(command, stdout=subprocess.PIPE, text=True) as candump:
        seen = _ask_until_seen(candump)
    agree("candump's line", seen.split()[1:3], ["vcan0", f"{CHECK[1]:03X}#"])
    return Answer("`cansend vcan0 3C0#` is answered by our drive; `candump -L` prints it as we log it")


def _ask_until_seen(candump: subprocess.Popen[str]) -> str:
    """Send the question again until candump, which does not report when it listens, ends; return its output."""
    while True:
        subprocess.run(["cansend", "vcan0", f"{CHECK[0]:03X}#"], check=True)
        with contextlib.suppress(subprocess.TimeoutExpired):
            return candump.communicate(timeout=0.2)[0]
