"""Drives of CiA 402 on the page: what the page knows of them, and what it may command.

Rule of this file: a browser that holds down a jog's button has to say so again and again. A page that is closed, or
whose connection hangs, does not, and the drive is halted. This is not a safety function: it takes a server, a bus and a
drive that work.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator, Mapping
from typing import Any, NamedTuple

from eurobot_od.client.drive402 import Drive402
from eurobot_od.client.master import Master
from eurobot_od.errors import EurobotError, LocalError, UnknownName
from eurobot_od.frame import Frame
from eurobot_od.od import cia402
from eurobot_od.od.cia402 import MODE_WORDS, TRANSITIONS, State
from eurobot_od.od.dictionary import Dictionary
from eurobot_od.od.values import UNSIGNED16
from eurobot_od.od.words import profile_of
from eurobot_od.sdo.wire import ClientCommand, carrying

HELD = 0.6
"""Seconds that a jog goes on after its button was last reported as held."""

LOOK = 0.1
"""Seconds between two checks of that."""

SHOWN: Mapping[str, int] = {
    "statusword": cia402.STATUSWORD,
    "mode": cia402.MODE_DISPLAY,
    "position": cia402.POSITION,
    "velocity": cia402.VELOCITY,
    "error": cia402.ERROR_CODE,
}
"""The objects that the page polls for the axis that it shows."""

COMMANDS: Mapping[str, Callable[[Drive402], None]] = {
    "enable": Drive402.enable,
    "disable": Drive402.disable,
    "fault reset": Drive402.fault_reset,
    "quick stop": Drive402.quick_stop,
    "halt": Drive402.halt,
}


class AxisAddress(NamedTuple):
    """An axis of a drive, by its node-ID and its number from 1 on."""

    node_id: int
    number: int

    @property
    def offset(self) -> int:
        """The difference of its objects' indices from those of the first axis."""
        return (self.number - 1) * cia402.AXIS_STEP


def axes_of(dictionary: Dictionary) -> list[AxisAddress]:
    """Return the axes of a device that is a drive by its 0x1000; an empty list for any other device."""
    if profile_of(dictionary.objects) != cia402.PROFILE:
        return []
    all_of_them = (AxisAddress(dictionary.node_id, number) for number in range(1, cia402.MOST_AXES + 1))
    return [each for each in all_of_them if dictionary.variable((cia402.STATUSWORD + each.offset, 0))]


def drive_data(dictionary: Dictionary) -> dict[str, Any] | None:
    """Return what the page knows of a drive before the first answer, None if the device is not a drive."""
    axes = axes_of(dictionary)
    if not axes:
        return None
    suggested = dictionary.variable((cia402.PROFILE_VELOCITY, 0))
    objects = [{name: f"0x{index + axis.offset:04X}" for name, index in SHOWN.items()} for axis in axes]
    return {"axes": objects, "velocity": (suggested and suggested.default) or 100}


def machine_data() -> dict[str, Any]:
    """Return the state machine and the modes of operation as data."""
    arrows = {(each.number, each.before, each.after): None for each in TRANSITIONS}
    return {
        "states": [{"name": each.words, "mask": each.mask, "bits": each.bits} for each in State],
        "arrows": [{"number": number, "before": one.words, "after": two.words} for number, one, two in arrows],
        "modes": MODE_WORDS,
    }


def quick_stops(master: Master, axes: Iterable[AxisAddress]) -> Iterator[Frame]:
    """Yield the frames that write Quick stop into controlwords, for a caller that does not wait for transfers."""
    content = UNSIGNED16.write(cia402.DriveCommand.QUICK_STOP.bits)
    for each in axes:
        data = carrying(ClientCommand.DOWNLOAD, (cia402.CONTROLWORD + each.offset, 0), content)
        yield Frame(master.sdo_server(each.node_id).requests, data)


class Drives:
    """The drives of a network as the page commands them; `clock` gives the time in seconds.

    All methods but `hold` and `stopped` wait for the drive, and must be called one after the other.
    """

    def __init__(self, master: Master, dictionaries: Iterable[Dictionary], clock: Callable[[], float]) -> None:
        self._master, self._clock = master, clock
        self._dictionaries = {each.node_id: each for each in dictionaries}
        self.axes = [axis for each in self._dictionaries.values() for axis in axes_of(each)]
        self._jogs: dict[AxisAddress, float] = {}
        self._stops = 0

    def axis(self, node_id: int, number: object) -> AxisAddress:
        """Return an axis; raises LocalError if there is none."""
        found = next((each for each in self.axes if (each.node_id, each.number) == (node_id, number)), None)
        if found is None:
            raise LocalError(f"node {node_id} has no axis {number} of CiA 402")
        return found

    def _drive(self, axis: AxisAddress) -> Drive402:
        node = self._master.node(axis.node_id)
        return Drive402(node, self._dictionaries[axis.node_id], axis.number)

    def command(self, axis: AxisAddress, name: str) -> None:
        """Carry out a command; raises UnknownName, DriveError, and the errors of SDO transfers."""
        if name not in COMMANDS:
            raise UnknownName("command of a drive", name, COMMANDS)
        self._jogs.pop(axis, None)
        self._unless_stopped(axis, COMMANDS[name])

    def jog(self, axis: AxisAddress, velocity: int) -> None:
        """Turn at a velocity in the drive's units while `hold` is called; raises LocalError if it is not enabled."""
        drive = self._drive(axis)
        if (state := drive.state) is not State.ENABLED:
            raise LocalError(f"enable the drive first: it is in {state.words if state else 'an unknown state'}")
        # Entered before it turns: even if an answer is lost, it will be halted.
        self._jogs[axis] = self._clock() + HELD
        self._unless_stopped(axis, lambda each: setattr(each, "velocity", velocity))

    def _unless_stopped(self, axis: AxisAddress, act: Callable[[Drive402], None]) -> None:
        before, drive = self._stops, self._drive(axis)
        try:
            act(drive)
        finally:
            if self._stops != before:  # somebody has stopped the drive meanwhile
                drive.quick_stop()

    def hold(self, axis: AxisAddress) -> None:
        """Let a jog go on for a while; one that has ended is not resumed."""
        if axis in self._jogs:
            self._jogs[axis] = self._clock() + HELD

    def stopped(self) -> None:
        """Note that everything was stopped, past whatever is waiting."""
        self._stops += 1
        self._jogs.clear()

    def overdue(self) -> bool:
        """Tell whether a jog's button is no longer held."""
        return any(end <= self._clock() for end in list(self._jogs.values()))

    def end_overdue(self) -> None:
        """Halt the axes whose button is no longer held; one that does not answer is asked again the next time."""
        for axis, end in list(self._jogs.items()):
            if end <= self._clock():
                try:
                    self._drive(axis).halt()
                except EurobotError:
                    continue
                self._jogs.pop(axis, None)
