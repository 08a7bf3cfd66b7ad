"""A bus with devices of several makers, and everything that CANopen has on it: for us, and for others to decode.

The devices are simulated from their files; the master is a script, with our SDO client and a slave of LSS.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable
from pathlib import Path

from eurobot_od.device.simulated import SimulatedDevice
from eurobot_od.frame import Frame, RemoteFrame
from eurobot_od.od.dictionary import Dictionary
from eurobot_od.od.identity import Identity
from eurobot_od.od.standard import ErrorCode
from eurobot_od.sdo.client import Transfer, block_download, block_upload, download, upload
from tests.client.lss_slave import LssStation

HERE = Path(__file__).resolve().parents[1]
FILES = {
    5: HERE.parent / "docs" / "servo.eds",
    6: HERE.parent / "docs" / "motor.eds",
    7: HERE / "lint" / "samples" / "crlf_io_module.eds",
    8: HERE / "lint" / "samples" / "old.eds",
    9: HERE / "lint" / "samples" / "clean.eds",
}
"""A drive each by CiA 402, an I/O module by CiA 401, and two others."""

STEP = 0.0005
"""Time between two frames, in s."""

TICK = 0.005
"""Interval in which due frames of the devices are sent, in s."""

BLOCK = bytes(range(256)) * 8


def dictionaries() -> list[Dictionary]:
    """The devices' files as the bus has them."""
    return [Dictionary.load(file, node_id, f"{file.stem}_{node_id}") for node_id, file in FILES.items()]


class MixedBus:
    """All devices on one bus; `frames` are those that were on it, with their times in s."""

    def __init__(self) -> None:
        self.now = 0.0
        self.frames: list[tuple[float, Frame]] = []
        self.devices = {each.node_id: SimulatedDevice(each) for each in dictionaries()}
        self.slave = LssStation(Identity(0x123, 0x456, 1, 7))
        for each in self.devices.values():
            self._spread(each.start(self.now))

    def send(self, frame: Frame) -> list[Frame]:
        """Put a frame on the bus; return what follows."""
        return self._spread([frame])

    def wait(self, seconds: float) -> None:
        """Advance the time, and send what the devices have due."""
        end = self.now + seconds
        while self.now < end:
            self.now += TICK
            for each in self.devices.values():
                self._spread(each.tick(self.now))

    def transfer(self, node_id: int, transfer: Transfer) -> None:
        """Do an SDO transfer; one that is refused, or that nobody answers, ends as it does."""
        requests = transfer.start(self.now)
        while not transfer.done:
            came = [each for request in requests for each in self.send(Frame(0x600 + node_id, request))]
            answers = [each.data for each in came if each.cob_id == 0x580 + node_id]
            if not answers:
                self.now = transfer.deadline
            requests = [each for data in answers for each in transfer.receive(data, self.now)] or transfer.tick(
                self.now
            )
        for request in requests:  # the end of a block upload, or an abort
            self.send(Frame(0x600 + node_id, request))

    def _spread(self, frames: Iterable[Frame]) -> list[Frame]:
        """Deliver frames and the answers to them to all other nodes; return all these frames."""
        waiting, seen = list(frames), list[Frame]()
        while waiting:
            assert len(seen) < 1000, "the devices never fall silent"
            frame = waiting.pop(0)
            self.now += STEP
            self.frames.append((self.now, frame))
            seen.append(frame)
            waiting += self.slave.receive(frame, self.now)
            for each in self.devices.values():
                waiting += each.requested(frame.cob_id, self.now) if frame.is_remote else each.receive(frame, self.now)
        return seen


def lss(bus: MixedBus) -> None:
    """Find a device without a node-ID, give it one and a bit rate, have it store them, and look for all."""
    for data in (
        "0400", "510000000080", "4023010000", "4156040000", "4201000000", "4307000000", "5A", "5B", "5C", "5D", "5E",
        "110A", "11C8", "130002", "15E803", "17", "0400", "4623010000", "4C",
    ):  # fmt: skip
        bus.send(Frame(0x7E5, bytes.fromhex(data).ljust(8, b"\0")))


def guarding(bus: MixedBus) -> None:
    """Guard the devices that send no heartbeat."""
    for _ in range(3):
        for node_id in FILES:
            bus.send(RemoteFrame(0x700 + node_id, bytes(1)))


def transfers(bus: MixedBus) -> None:
    """Read and write by each kind of transfer; ask for what is not there, and for what may not be written."""
    for node_id in FILES:
        bus.transfer(node_id, upload((0x1000, 0), 0.1))
        bus.transfer(node_id, upload((0x1008, 0), 0.1))
        bus.transfer(node_id, block_upload((0x1008, 0), 0.1))
        bus.transfer(node_id, upload((0x5FFF, 0), 0.1))
        bus.transfer(node_id, download((0x1000, 0), b"1234", 0.1))
        bus.transfer(node_id, download((0x1017, 0), b"\x64\x00", 0.1))
        bus.transfer(node_id, block_download((0x1008, 0), BLOCK, 0.1))
    bus.transfer(9, block_download((0x1F22, 1), BLOCK, 0.1))
    bus.transfer(9, block_upload((0x1F22, 1), 0.1))
    bus.transfer(9, download((0x1F22, 1), BLOCK[:100], 0.1))
    bus.transfer(99, upload((0x1000, 0), 0.1))  # nobody


def process_data(bus: MixedBus) -> None:
    """Start all devices, and send SYNC with and without a counter, and TIME."""
    bus.send(Frame(0x000, b"\x01\x00"))
    for number in range(1, 20):
        bus.send(Frame(0x080, bytes([number]) if number > 10 else b""))
        bus.wait(0.01)
    bus.send(Frame(0x100, bytes.fromhex("005C2602C83C")))


def errors(bus: MixedBus) -> None:
    """Make the devices report and clear errors of the bus, of a drive and of an I/O module."""
    for device in bus.devices.values():
        device.bus_error(ErrorCode.OVERRUN, bus.now)
    bus.wait(1.5)
    bus.send(Frame(0x085, bytes.fromhex("1073020000000000")))
    bus.send(Frame(0x087, bytes.fromhex("3023020000000000")))


def masters(bus: MixedBus) -> None:
    """Play the negotiation of CiA 302-2 masters, and the switch to safe states (CiA 304)."""
    for cob_id, data in ((0x073, b""), (0x071, b"\1\5"), (0x075, b""), (0x074, b""), (0x076, b""), (0x072, b"")):
        bus.send(Frame(cob_id, data))
    bus.send(Frame(0x001))


SCENES: tuple[Callable[[MixedBus], None], ...] = (lss, guarding, transfers, process_data, errors, masters)


def recorded() -> list[tuple[float, Frame]]:
    """Return all frames of a session, with their times in s."""
    bus = MixedBus()
    for scene in SCENES:
        scene(bus)
        bus.wait(0.05)
    return bus.frames


def log_text(frames: Iterable[tuple[float, Frame]]) -> str:
    """Return frames as candump's log."""
    return "".join(f"({time:.6f}) can0 {frame}\n" for time, frame in frames)
