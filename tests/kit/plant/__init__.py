"""A packaging line of three nodes, made up: for what a network says, with a catalogue of messages and two dialects.

Its EDS files are made from its table as anybody's are, once, into the system's folder for temporary files.
"""

from __future__ import annotations

import getpass
import shutil
from functools import cache, partial
from hashlib import sha256
from pathlib import Path
from tempfile import gettempdir, mkdtemp

from eurobot_od.bus.simulated.network import Simulation
from eurobot_od.device.faults import generated
from eurobot_od.device.nmt import NmtCommand
from eurobot_od.frame import Frame
from eurobot_od.od import Dialects, meanings
from eurobot_od.od.make import read_table, text
from eurobot_od.pdo.kinds import Message
from eurobot_od.pdo.protocol import Protocol
from eurobot_od.plugin import Faults, Plugin, Plugins
from eurobot_od.traffic.entries import Timed
from eurobot_od.traffic.meaning import Decoder
from tests.eds_text import with_entry
from tests.kit.plant import messages as m
from tests.kit.plant import nodes

HERE = Path(__file__).parent
TABLE = HERE / "protocol.yaml"


def _made() -> Path:
    """Return the folder of the EDS files; several test processes may make it at once."""
    table = TABLE.read_text("utf-8")
    code = b"".join(Path(each.__file__ or "").read_bytes() for each in (text, meanings))
    folder = Path(gettempdir(), f"plant-{getpass.getuser()}-{sha256(code + table.encode()).hexdigest()[:16]}")
    if not folder.is_dir():
        fresh = Path(mkdtemp(dir=folder.parent))
        text.write_files(text.make_files(read_table(table, TABLE)), fresh)
        try:
            fresh.rename(folder)
        except OSError:
            shutil.rmtree(fresh)  # another process was first
    return folder


CATALOGUE = m.CATALOGUE

FILES = Dialects(_made(), "plain")
DIALECTS = FILES.names()
"""`plain` has the bits in CiA 301's order, `packed` others, and more fields."""

NODES = {"panel": nodes.Panel, "lift": nodes.Lift, "scale": nodes.Scale}

load, load_all = FILES.load, FILES.load_all


def protocol(dialect: str | None = None) -> Protocol:
    """Return the messages of the plant in a dialect."""
    return Protocol.of_devices(load_all(dialect), CATALOGUE)


def decoder(dialect: str | None = None) -> Decoder:
    """Return the decoder of the plant's frames in a dialect."""
    return Decoder(load_all(dialect), CATALOGUE)


def spoiled(folder: Path, *changes: tuple[str, str, str, str | None]) -> Path:
    """Copy the files and change entries: node, section, key, value (None: no such line); return their new folder."""
    copy = folder / "spoiled"
    shutil.copytree(FILES.folder(), copy)
    for node, section, key, value in changes:
        file = copy / f"{node}.eds"
        file.write_text(with_entry(file.read_text(), section, key, value))
    return copy


def _faults() -> Faults:
    bindings = protocol().bindings
    return {kind: {k: v for each in bindings for k, v in generated(each, role).items()} for role, kind in NODES.items()}


PLANT = Plugin(
    name="Packaging line",
    dialects=FILES,
    catalogue=lambda: CATALOGUE,
    nodes={role: (lambda kind=kind: kind) for role, kind in NODES.items()},  # type: ignore[misc]
    faults=_faults,
    table=TABLE,
    folder=HERE,
)
"""What a plug-in can say of it."""

PLUGINS = Plugins(PLANT)
"""It, and no device package."""


SHIFT = 20.0
"""Duration of a recorded shift, in s."""

POLLED = (m.MoveStateRequest(), m.PlaceRequest(), m.WeightRequest())
"""What the panel asks for ten times in a second."""


@cache
def shift(dialect: str | None = None, duration: float = SHIFT) -> list[Timed]:
    """Return what is on the bus in a shift: boot-up, an order, moves, polling, heartbeats; each time the same."""
    simulation, found = Simulation(), list[Timed]()
    simulation.observers.append(lambda now, frame: found.append((now, frame)))
    stations = [simulation.attach(NODES[each.name](each), 0.01 * each.node_id) for each in load_all(dialect)]
    panel = stations[0].node

    def start() -> None:
        everybody = Frame(0x000, bytes((NmtCommand.START, 0)))
        panel.put(everybody)
        panel.receive(everybody, simulation.now)  # who sends a frame does not hear it

    simulation.plan(0.1, start)
    planned: list[tuple[float, Message]] = [(0.2, m.OrderSet(m.Colour.BLUE, 12, 2))]
    planned += [(1 + 4.0 * number, m.MoveTo(600 * (number % 5), 250 * number, 30 * number, 75)) for number in range(5)]
    planned += [(0.5 + number / 10, each) for number in range(int(duration * 10) - 5) for each in POLLED]
    for time, message in planned:
        simulation.plan(time, partial(panel.offer, message))
    simulation.run(duration)
    return found
