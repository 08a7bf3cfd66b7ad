"""Drives of CiA 402 on the page: what the page knows of them, and what it may command.

Rule of this file: a browser that holds down a jog's button has to say so again and again. A page that is closed, or
whose connection hangs, does not, and the drive is halted. This is not a safety function: it takes a server, a bus and a
drive that work.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator, Mapping
from types import MappingProxyType
from typing import Any, NamedTuple, TypeAlias

from eurobot_od.client.drive402 import Drive402
from eurobot_od.client.master import Master
from eurobot_od.errors import EurobotError, LocalError, look_up
from eurobot_od.frame import Frame
from eurobot_od.od import cia402
from eurobot_od.od.cia402 import MODE_WORDS, TRANSITIONS, State
from eurobot_od.od.dictionary import Dictionary
from eurobot_od.od.objects import Range, limits
from eurobot_od.od.values import DATA_TYPES, UNSIGNED16, Address, label
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
    "torque": cia402.TORQUE,
    "following error": cia402.FOLLOWING_ERROR,
    "error": cia402.ERROR_CODE,
}
"""The objects that the page shows of an axis; it polls those that come in no PDO."""

Numbers: TypeAlias = Mapping[str, int]

COMMANDS: Mapping[str, Callable[[Drive402, Numbers], None]] = {
    "enable": lambda drive, _: drive.enable(),
    "disable": lambda drive, _: drive.disable(),
    "fault reset": lambda drive, _: drive.fault_reset(),
    "quick stop": lambda drive, _: drive.quick_stop(),
    "halt": lambda drive, _: drive.halt(),
    # None of them waits for the end of the motion: whoever wants to halt it must not wait for that, either.
    "home": lambda drive, said: drive.begin_home(said.get("method")),
    "move": lambda drive, said: drive.begin_move(said["position"], said.get("velocity")),
    "move by": lambda drive, said: drive.begin_move(said["distance"], said.get("velocity"), relative=True),
}

JOGS: Mapping[str, Callable[[Drive402, int], None]] = {
    "velocity": lambda drive, value: setattr(drive, "velocity", value),
    "torque": Drive402.begin_torque,
}
"""What a held button has a drive do, by what is given."""

LARGEST: Mapping[str, tuple[int, Address | None]] = {
    "velocity": (cia402.TARGET_VELOCITY, (cia402.MAX_PROFILE_VELOCITY, 0)),
    "torque": (cia402.TARGET_TORQUE, (cia402.MAX_TORQUE, 0)),
    "position": (cia402.TARGET_POSITION, None),
}
"""The object of each target, and the one with the most that it may be."""


UNBOUNDED = DATA_TYPES[0x04]
"""INTEGER32: the type of a target, where no file says less."""

MOVING = (
    *(cia402.CONTROLWORD, cia402.TARGET_VL_VELOCITY, cia402.TARGET_TORQUE, cia402.TARGET_POSITION),
    *(cia402.TARGET_VELOCITY, cia402.INTERPOLATION_DATA, cia402.MODE),
    *(cia402.POSITION_OFFSET, cia402.VELOCITY_OFFSET, cia402.TORQUE_OFFSET),
)
"""Objects of the first axis of which a new value may move something."""


def moves(address: Address) -> bool:
    """Tell whether a new value of an object may move a drive."""
    above = address[0] - cia402.FIRST_AXIS.start
    return above >= 0 and cia402.FIRST_AXIS.start + above % cia402.AXIS_STEP in MOVING


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
    velocity = (suggested and suggested.default) or 100
    return {"axes": [_axis_data(dictionary, each) for each in axes], "velocity": velocity}


def _axis_data(dictionary: Dictionary, axis: AxisAddress) -> dict[str, Any]:
    places = {name: (index + axis.offset, 0) for name, index in SHOWN.items()}
    shown = {name: label(place) for name, place in places.items() if dictionary.variable(place)}
    allowed = {name: bounds(dictionary, axis, name) for name in LARGEST}
    return {"objects": shown, "bounds": allowed, "units": units(dictionary, axis)}


def bounds(dictionary: Dictionary, axis: AxisAddress, target: str) -> Range:
    """Return what a target may be: the limits of its object, and the most that the file gives it."""
    index, most = LARGEST[target]
    variable = dictionary.variable((index + axis.offset, 0))
    known = variable and limits(variable)
    low, high = known or Range(UNBOUNDED.low, UNBOUNDED.high)
    largest = most and dictionary.number((most[0] + axis.offset, most[1]))
    return Range(max(low, -largest), min(high, largest)) if largest else Range(low, high)


def units(dictionary: Dictionary, axis: AxisAddress) -> Mapping[str, float]:
    """Return what one unit of position is in turns of the motor, and of velocity in turns a minute, if the file says.

    That is in 0x608F, 0x6091 and 0x6092 for the position; a unit of velocity is one of position per second, or as
    0x6096 or 0x60A9 say.
    """
    from eurobot_od.device.profiles.motion import AxisValues, Units, ratio_of  # and YAML: not for --help

    values = AxisValues(dictionary, axis.offset)
    if {ratio_of(values, each) for each in (cia402.ENCODER_RESOLUTION, cia402.FEED_CONSTANT)} <= {0, 1}:
        return {}  # 1 is what a file has if nobody has set one
    turn, velocity = Units.of(values)
    return {"position": 1 / turn, "velocity": 60 * velocity / turn}


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

    def command(self, axis: AxisAddress, name: str, numbers: Numbers = MappingProxyType({})) -> None:
        """Carry out a command; raises UnknownName, LocalError for a target out of bounds, DriveError, and of SDO."""
        act = look_up("command of a drive", name, COMMANDS)
        for target in LARGEST.keys() & numbers.keys():
            self._check(axis, target, numbers[target])
        self._jogs.pop(axis, None)
        self._unless_stopped(axis, lambda drive: act(drive, numbers))

    def _check(self, axis: AxisAddress, target: str, value: int) -> None:
        low, high = bounds(self._dictionaries[axis.node_id], axis, target)
        if not low <= value <= high:
            raise LocalError(f"{target} = {value} is not allowed; allowed: {low}..{high}")

    def jog(self, axis: AxisAddress, value: int, target: str = "velocity") -> None:
        """Turn with a velocity or torque in the drive's units while `hold` is called; LocalError if not enabled."""
        self._check(axis, target, value)
        drive = self._drive(axis)
        if (state := drive.state) is not State.ENABLED:
            raise LocalError(f"enable the drive first: it is in {state.words if state else 'an unknown state'}")
        # Entered before it turns: even if an answer is lost, it will be halted.
        self._jogs[axis] = self._clock() + HELD
        self._unless_stopped(axis, lambda each: JOGS[target](each, value))

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
