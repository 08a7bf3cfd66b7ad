"""SDO transfers with a live device, and by a master, beside stock canopen's LocalNode and its client.

All use one object of one EDS on one in-process bus; both devices are asked by the same client, and both clients ask the
same device. Stock canopen's LocalNode has no block transfers.
"""

from __future__ import annotations

import tempfile
import time
from collections.abc import Callable, Iterator, Mapping
from contextlib import ExitStack, contextmanager
from functools import partial
from itertools import product
from pathlib import Path

import canopen

from bench.measure import Claim, Contender, Figures, Quantity, Scale, Series, Way, Wrong
from bench.shared import new_bus, new_channel
from eurobot_od.bus.live import Live
from eurobot_od.client.master import Master
from eurobot_od.device.node import Node
from eurobot_od.od.dictionary import Dictionary
from eurobot_od.sdo.client import Transfer, block_download, block_upload, download

NODE = 5
NUMBER, FILE = (0x2000, 0), (0x2001, 0)
REPEATED = 200
"""How many times a transfer of one exchange is repeated."""

EDS = """\
[DeviceInfo]
NrOfRXPDO=0
NrOfTXPDO=0
[MandatoryObjects]
SupportedObjects=1
1=0x1000
[1000]
ParameterName=Device type
DataType=0x0007
AccessType=ro
DefaultValue=0
[ManufacturerObjects]
SupportedObjects=2
1=0x2000
2=0x2001
[2000]
ParameterName=Number
DataType=0x0007
AccessType=rw
DefaultValue=0
[2001]
ParameterName=File
ObjectType=0x2
DataType=0x000F
AccessType=rw
"""

Read = Callable[[], bytes]
Write = Callable[[bytes], object]


@contextmanager
def our_device(channel: str, eds: Path) -> Iterator[None]:
    """Run our device."""
    with Live.node(new_bus(channel), Node(Dictionary.load(eds, NODE))):
        yield


@contextmanager
def stock_device(channel: str, eds: Path) -> Iterator[None]:
    """Run a LocalNode."""
    with stock_network(channel) as network:
        network.add_node(canopen.LocalNode(NODE, str(eds)))
        yield


@contextmanager
def stock_network(channel: str) -> Iterator[canopen.Network]:
    """Connect stock canopen."""
    network = canopen.Network(new_bus(channel))
    network.connect()
    try:
        yield network
    finally:
        network.disconnect()


@contextmanager
def our_client(channel: str) -> Iterator[Mapping[str, tuple[Read, Write]]]:
    """Yield the functions that read and write by each kind of transfer."""
    with Master(new_bus(channel)) as master:
        node = master.node(NODE)

        def run(transfer: Transfer) -> bytes:
            node.run(transfer)
            return transfer.result()

        yield {
            "expedited": (lambda: node.upload(NUMBER), partial(node.download, NUMBER)),
            "segmented": (lambda: node.upload(FILE), lambda data: run(download(FILE, data, master.answer_wait))),
            "block": (
                lambda: run(block_upload(FILE, master.answer_wait)),
                lambda data: run(block_download(FILE, data, master.answer_wait)),
            ),
        }


@contextmanager
def stock_client(channel: str) -> Iterator[Mapping[str, tuple[Read, Write]]]:
    """Yield the functions that read and write by each kind of transfer."""
    with stock_network(channel) as network:
        sdo = network.add_node(NODE, canopen.ObjectDictionary()).sdo  # type: ignore[no-untyped-call]

        def read_blocks() -> bytes:
            with sdo.open(*FILE, "rb", block_transfer=True) as file:
                return bytes(file.read())

        def write_blocks(data: bytes) -> None:
            with sdo.open(*FILE, "wb", size=len(data), block_transfer=True) as file:
                file.write(data)

        yield {
            "expedited": (lambda: sdo.upload(*NUMBER), lambda data: sdo.download(*NUMBER, data)),
            "segmented": (lambda: sdo.upload(*FILE), lambda data: sdo.download(*FILE, data)),
            "block": (read_blocks, write_blocks),
        }


DEVICES = {"our device": our_device, "LocalNode": stock_device}
CLIENTS = {"our client": our_client, "canopen's client": stock_client}


def timed(moved: Callable[[], object], wanted: bytes, read: Read) -> Figures:
    """Time the transfers of an object, and check that it arrived."""
    begin = time.perf_counter()
    moved()
    seconds = time.perf_counter() - begin
    if read() != wanted:
        raise Wrong("the object does not hold what was written")
    return {Quantity.TIME: seconds}


@contextmanager
def opened(kind: str, scale: Scale) -> Iterator[Mapping[str, Contender]]:
    """Run both devices, each on a bus of its own, and yield each client's transfers with each."""
    size = scale.of({"segmented": 7_000, "block": 70_000}.get(kind, 4), 28 if kind != "expedited" else 4)
    content = bytes(range(256)) * (size // 256) + bytes(range(size % 256))
    times = 1 if size > 4 else REPEATED
    found: dict[str, Contender] = {}
    with ExitStack() as stack:
        eds = Path(stack.enter_context(tempfile.TemporaryDirectory())) / "device.eds"
        eds.write_text(EDS)
        for device, client in product(DEVICES, CLIENTS):
            if kind == "block" and device == "LocalNode":
                continue
            channel = new_channel()  # of their own: stock's client takes another client's answers for its own
            stack.enter_context(DEVICES[device](channel, eds))
            read, write = stack.enter_context(CLIENTS[client](channel))[kind]

            def reading(read: Read = read) -> Figures:
                return timed(lambda: [read() for _ in range(times)], content, read)

            def writing(read: Read = read, write: Write = write) -> Figures:
                return timed(lambda: [write(content) for _ in range(times)], content, read)

            write(content)
            found |= {f"{device}, {client}, read": reading, f"{device}, {client}, write": writing}
        yield found


def _claims(kind: str) -> Iterator[Claim]:
    for direction in ("read", "write"):
        ours, stock = (f"our device, {client}, {direction}" for client in CLIENTS)
        yield Claim(f"{kind} {direction}, our device: canopen's client", ours, stock, Way.RATIO, 1.0)
        if kind != "block":
            ours, peer = (f"{device}, canopen's client, {direction}" for device in DEVICES)
            yield Claim(f"{kind} {direction}, canopen's client: LocalNode", ours, peer, Way.RATIO, 1.0)
            ours, peer = (f"{device}, our client, {direction}" for device in DEVICES)
            yield Claim(f"{kind} {direction}, our client: LocalNode", ours, peer, Way.RATIO, 1.0)


SERIES = tuple(
    Series("sdo", f"SDO {kind}", partial(opened, kind), tuple(_claims(kind)))
    for kind in ("expedited", "segmented", "block")
)
