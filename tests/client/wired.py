"""A bus in simulated time with devices on it: what a master sends is heard at once, and waiting lets the time pass."""

from __future__ import annotations

from collections import deque
from collections.abc import Callable, Iterable
from math import inf
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any, Protocol

import can

from eurobot_od.client.configure import parameters, settings
from eurobot_od.client.master import Master
from eurobot_od.device.device import Device
from eurobot_od.frame import Frame
from eurobot_od.od.dcf import with_contents
from eurobot_od.od.dictionary import Dictionary
from eurobot_od.od.objects import address_of, data_type
from eurobot_od.od.standard import VERIFY_CONFIGURATION
from eurobot_od.od.values import MAPPINGS, Address


class Station(Protocol):
    """Whatever hears frames and answers."""

    @property
    def next_wakeup(self) -> float:
        """When to call `tick`, infinite if nothing is planned."""

    def receive(self, frame: Frame, now: float) -> list[Frame]: ...

    def tick(self, now: float) -> list[Frame]: ...


class DeviceStation:
    """A device as a station."""

    def __init__(self, device: Device) -> None:
        self.device = device

    @property
    def next_wakeup(self) -> float:
        return self.device.next_wakeup

    def receive(self, frame: Frame, now: float) -> list[Frame]:
        return self.device.receive(frame, now).frames

    def tick(self, now: float) -> list[Frame]:
        return self.device.tick(now).frames


class Answerer:
    """A station that only answers, by a function."""

    next_wakeup = inf

    def __init__(self, answers: Callable[[Frame], Iterable[Frame]]) -> None:
        self._answers = answers

    def receive(self, frame: Frame, now: float) -> list[Frame]:
        return [*self._answers(frame)]

    def tick(self, now: float) -> list[Frame]:
        return []


class WiredBus(can.BusABC):
    """A master's end of the bus; `now` is the time in seconds, `sent` what the master has sent."""

    channel_info = "wired"

    def __init__(self, *stations: Station) -> None:
        self.stations, self.now = stations, 0.0
        self.sent: list[Frame] = []
        self._waiting: deque[Frame] = deque()

    def send(self, msg: can.Message, timeout: float | None = None) -> None:
        if msg.is_remote_frame:
            for station in self.stations:
                self._waiting += getattr(station, "asked", lambda *_: [])(msg.arbitration_id, self.now)
            return
        frame = Frame(msg.arbitration_id, bytes(msg.data))
        self.sent.append(frame)
        for station in self.stations:
            self._waiting += station.receive(frame, self.now)

    def recv(self, timeout: float | None = None) -> can.Message | None:
        end = self.now + (timeout or 0.0)
        while not self._waiting and (due := min((each.next_wakeup for each in self.stations), default=inf)) <= end:
            self.now = max(due, self.now)
            for station in self.stations:
                self._waiting += station.tick(self.now) if station.next_wakeup <= self.now else []
        if not self._waiting:
            self.now = end
            return None
        cob_id, data = self._waiting.popleft()
        return can.Message(arbitration_id=cob_id, data=data, is_extended_id=False, timestamp=self.now)

    def shutdown(self) -> None:
        """There is nothing to let go."""


def started(device: Device) -> DeviceStation:
    """Start a device as a station."""
    device.start(0.0)
    return DeviceStation(device)


def wired(*stations: Station, **options: Any) -> Master:
    """Return a master on a bus with these stations."""
    bus = WiredBus(*stations)
    return Master(bus, clock=lambda: bus.now, **options)


def agree_on_parameters(dictionary: Dictionary) -> None:
    """Check that what a device stores, what is read of it for a DCF, and what that DCF configures are the same."""
    device = Device(dictionary)
    device.objects.values = {each: dictionary.default(each) for each in dictionary.addresses()}
    stored = {each for each in device.objects.configuration() if each not in VERIFY_CONFIGURATION}
    shown = {each for each in stored if dictionary.members[each[0]][each[1]].readable}
    assert {address_of(each) for each in parameters(dictionary)} == shown
    # A text or a file may have no value, and cannot be read then: a DCF is made without it.
    sizes = {each: data_type(dictionary.members[each[0]][each[1]]).size for each in shown}
    has = {each for each in shown if sizes[each] or dictionary.default(each) is not None}
    contents = {address: device.objects.read(address) for address in has}
    made = with_contents(dictionary, contents, dictionary.node_id, "", 500, "any")
    with TemporaryDirectory() as folder:
        for name, content in made.files.items():
            Path(folder, name).write_bytes(content)
        clone = Dictionary.read(made.content, Path(folder, "any.dcf"))
        set_by = settings(clone)
    left = {each for each in shown if is_unused_entry(clone, each) or not contents.get(each)}
    assert {address_of(each) for each, _ in set_by if address_of(each) in shown} == shown - left
    assert {address_of(each) for each, _ in set_by} <= stored


def is_unused_entry(dictionary: Dictionary, address: Address) -> bool:
    """Return whether it is an entry of a mapping beyond their number: a configuration leaves those alone."""
    count = dictionary.number((address[0], 0)) if address[0] in MAPPINGS else None
    return count is not None and address[1] > count
