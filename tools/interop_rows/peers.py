"""Stock canopen as the master of our nodes, and as a node of our master.

canopen is used as its documentation says, with a longer timeout.
"""

from __future__ import annotations

import random
from pathlib import Path
from typing import Any

import canmatrix.formats

from eurobot_od.client.master import Master
from eurobot_od.device.nmt import NmtCommand, NmtState
from eurobot_od.od.dictionary import Dictionary
from eurobot_od.od.pdos import RESERVED
from eurobot_od.pdo.protocol import Protocol
from eurobot_od.robot import dialects
from eurobot_od.robot.protocol import EurobotProtocol
from interop_rows.bench import DRIVE, PATIENCE, SHORT_GOTO, Heard, collect, new_channel, open_bus, robot, stock_network
from interop_rows.row import Answer, agree

EDS = dialects.folder(dialects.DEFAULT) / "drive.eds"
STATES = ("STOPPED", "PRE-OPERATIONAL", "OPERATIONAL")
FRAMES = 200
"""Random frames for each message."""


def sdo_by_stock_master(_: Path) -> Answer:
    """Upload the EDS, upload in blocks, read, write and be refused."""
    with robot("drive") as channel, stock_network(open_bus(channel)) as network:
        node: Any = network.add_node(DRIVE, upload_eds=True)
        agree("the number of objects in the uploaded EDS", len(node.object_dictionary), len(_dictionary().objects))
        with node.sdo.open(0x1021, 0, "rb", block_transfer=True) as stream:
            agree("the EDS uploaded in blocks", stream.read(), EDS.read_bytes())
        agree("the device's name", node.sdo[0x1008].raw, _dictionary().default((0x1008, 0)))
        node.sdo[0x1017].raw = 250
        agree("the heartbeat period read back", node.sdo[0x1017].raw, 250)
        agree("the abort code of a write to a constant", _abort_code(node.sdo[0x1000]), 0x06010002)
    return Answer("EDS uploaded from 0x1021 in segments and in blocks; values read, written, read back; an abort")


def _dictionary() -> Dictionary:
    return Dictionary.load(EDS)


def _abort_code(variable: Any) -> int | None:
    from canopen import SdoAbortedError

    try:
        variable.raw = 0
    except SdoAbortedError as error:
        return error.code
    return None


def services_by_stock_master(_: Path) -> Answer:
    """Command NMT states, follow them by the heartbeat, reset, and receive an EMCY."""
    with robot("drive") as channel, stock_network(open_bus(channel)) as network:
        node: Any = network.add_node(DRIVE, str(EDS))
        node.sdo[0x1017].raw = 20
        for state in STATES:
            node.nmt.state = state
            while (heard := node.nmt.wait_for_heartbeat(PATIENCE)) != state:
                agree("the state before the command", heard in STATES, True)
        emergencies, boot_ups = Heard(), Heard()
        node.emcy.add_callback(lambda error: emergencies(error.code))
        network.send_message(*SHORT_GOTO)
        agree("the EMCY heard", emergencies.wait_for(0x8210), True)
        network.subscribe(0x700 + DRIVE, lambda _, data, __: boot_ups(bytes(data)))
        node.nmt.state = "RESET"
        agree("the boot-up heard", boot_ups.wait_for(b"\0"), True)
    return Answer("stop, pre-operational, start and reset followed; heartbeat, boot-up and EMCY 0x8210 understood")


def pdos_by_stock_master(_: Path) -> Answer:
    """Read all PDOs, change an identifier, write all of them back."""
    with robot("drive") as channel, stock_network(open_bus(channel)) as network:
        node: Any = network.add_node(DRIVE, str(EDS))
        indices = Dictionary.load(EDS).objects.indices
        for pdos, first in ((node.rpdo, 0x1400), (node.tpdo, 0x1800)):
            pdos.read()
            agree("the number of PDOs", len(pdos), sum(first <= index < first + 0x200 for index in indices))
        request = next(each for each in node.rpdo.values() if each.cob_id == 0x3C0)
        request.cob_id = 0x3C5
        for pdos in (node.rpdo, node.tpdo):
            pdos.save()
        listener = open_bus(channel)
        network.send_message(0x3C5, b"")
        answers = collect(listener, lambda message: message.arbitration_id == 0x400)
        listener.shutdown()
        agree("an answer under the new identifier", answers[-1].arbitration_id, 0x400)
    return Answer("14 PDOs read and written back; a Check Drive Request under its new identifier is answered")


def export_by_stock_master(folder: Path) -> Answer:
    """Write DBC files of canopen's PDOs through canmatrix, and compare their bits with ours."""
    protocol = EurobotProtocol.load(dialects.DEFAULT)
    with robot("drive") as channel, stock_network(open_bus(channel)) as network:
        node: Any = network.add_node(DRIVE, str(EDS))
        for name, pdos in (("rpdo", node.rpdo), ("tpdo", node.tpdo)):
            pdos.read()
            pdos.export(str(folder / f"{name}.dbc"))
    for file in folder.glob("*.dbc"):
        loaded: Any = canmatrix.formats.loadp(str(file))
        for frame in loaded[""].frames:
            _compare_bits(frame, protocol)
    return Answer(f"2 DBC files; {FRAMES} random frames of each PDO decode to our values")


def _compare_bits(frame: Any, protocol: Protocol) -> None:
    binding = protocol.binding_of(frame.arbitration_id.id)
    chance = random.Random(binding.name)
    if not frame.signals:
        return
    for _ in range(FRAMES):
        data = chance.randbytes(binding.layout.length)
        theirs = [each.raw_value for name, each in frame.decode(data).items() if not name.endswith(RESERVED)]
        agree(f"values of {binding.name} {data.hex()}", theirs, list(binding.unpack(data).values()))


def stock_node_under_our_master(_: Path) -> Answer:
    """Read, write and command canopen's own node, with the drive's EDS, by our master."""
    channel = new_channel()
    with stock_network(open_bus(channel)) as network, Master(open_bus(channel), PATIENCE) as master:
        network.create_node(DRIVE, _dictionary().objects)
        node = master.node(DRIVE)
        agree("the device's name", node.upload((0x1008, 0)).decode(), _dictionary().default((0x1008, 0)))
        node.download((0x1017, 0), (20).to_bytes(2, "little"))
        agree("the heartbeat period read back", node.upload((0x1017, 0)), b"\x14\0")
        node.command(NmtCommand.STOP)
        agree("stopped by its heartbeat", node.wait_for(NmtState.STOPPED, PATIENCE), True)
    return Answer("read, written, read back and stopped by our master, its heartbeat followed")
