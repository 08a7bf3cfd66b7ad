"""Objects bound to an application: read from it under any mapping, written as commands, refused with the reason."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from typing import NamedTuple

import pytest
from canopen import SdoAbortedError

from eurobot_od.device.bound import Application, combined, period, scaled, seconds, setting
from eurobot_od.device.nmt import NmtCommand
from eurobot_od.device.node import Node
from eurobot_od.errors import Cause, NodeClassError, Refused
from eurobot_od.frame import Frame
from eurobot_od.od.dictionary import Dictionary
from eurobot_od.od.values import NOT_VALID
from eurobot_od.pdo.kinds import Message
from eurobot_od.sdo.wire import AbortCode
from tests.device.master import Wire, wired
from tests.eds_text import record
from tests.kit import lift
from tests.kit.lift import Brake, Building, Configure, MoveTo, PlaceResponse, Ride, Sensor, Trouble

PLACE_OBJECT, PLACE_TPDO, MOVE, RESERVED = 0x2011, 0x1802, 0x2000, 5
PLACE = PlaceResponse(1234, 567, 89, Sensor.MAGNET)
UNKNOWN = PlaceResponse(None, None, None, Sensor.BELT)
RAW = {PLACE: [1234, 567, 89, 1], UNKNOWN: [0xFF, 0xFF, 0x3FF, 3]}
DIALECTS = [lift.DIALECT, lift.REVERSED]


def measuring(place: PlaceResponse = PLACE, dialect: str = lift.DIALECT) -> Wire:
    """Return a device that measures a place."""
    return wired("cabin", dialect, application=Application(readers={"Place": lambda: place}))


def place_of(wire: Wire) -> list[int]:
    return [wire.read(PLACE_OBJECT, subindex) for subindex in range(1, 5)]


# Reading


def as_it_is(_: Wire) -> None:
    """The TPDO is as in the file."""


def not_valid(wire: Wire) -> None:
    wire.write(PLACE_TPDO, 1, NOT_VALID | 0x205)


def widened(wire: Wire) -> None:
    wire.map_pdo(PLACE_TPDO, 0x123, 0x20110110, 0x20110210, 0x20110310, 0x20110408)


def restarted(wire: Wire) -> None:
    wire.command(NmtCommand.RESET_NODE)


@pytest.mark.parametrize("dialect", DIALECTS)
@pytest.mark.parametrize("place", RAW)
@pytest.mark.parametrize("change", [as_it_is, not_valid, widened, restarted])
def test_an_object_reads_what_is_measured_whatever_its_pdo_is(
    change: Callable[[Wire], object], place: PlaceResponse, dialect: str
) -> None:
    wire = measuring(place, dialect)
    change(wire)
    assert place_of(wire) == RAW[place]
    assert wire.read(PLACE_OBJECT, 0) == 4


@pytest.mark.parametrize("place", RAW)
@pytest.mark.parametrize(("change", "widths"), [(as_it_is, (12, 12, 10, 4)), (widened, (16, 16, 16, 8))])
def test_a_timed_tpdo_carries_the_same(
    change: Callable[[Wire], object], widths: tuple[int, ...], place: PlaceResponse
) -> None:
    wire = measuring(place)
    change(wire)
    wire.write(PLACE_TPDO, 5, 100, size=2)
    word = int.from_bytes(wire.wait(0.1).frames[0].data, "little")
    assert [word >> sum(widths[:n]) & (1 << width) - 1 for n, width in enumerate(widths)] == RAW[place]


def test_a_measurement_that_no_frame_can_say_is_an_abort_and_0_in_a_pdo() -> None:
    wire = measuring(PLACE._replace(height=-1))
    wire.write(PLACE_TPDO, 5, 100, size=2)
    with pytest.raises(SdoAbortedError) as refusal:
        wire.read(PLACE_OBJECT, 1)
    assert refusal.value.code == AbortCode.INCOMPATIBLE_INSIDE
    assert wire.wait(0.1).frames == [Frame(0x205, bytes(5))]


def test_a_message_that_the_file_has_no_pdo_for_is_no_value() -> None:
    wire = wired("door", application=Application(readers={"Floor": lambda: PLACE}))
    with pytest.raises(SdoAbortedError) as refusal:
        wire.read(0x2010, 1)
    assert refusal.value.code == AbortCode.INCOMPATIBLE_INSIDE


def test_a_sub_index_that_is_no_field_of_the_message_keeps_its_value() -> None:
    wire = wired(application=Application(readers={"State": lambda: PLACE}))
    assert wire.read(0x2002, 1) == 0x0FFFFF


def test_a_name_that_the_file_has_not_is_not_bound() -> None:
    wired("cabin", application=Application({"Weight": lambda: PLACE}, {"Balance": MoveTo}))


def test_an_error_field_without_errors_is_0_in_a_pdo() -> None:
    assert wired().device.objects.raw((0x1003, 1)) == 0


# Writing


class Commanded:
    """A device whose application keeps the messages that it acts on; `refuses` makes it act on none."""

    def __init__(self, dialect: str = lift.DIALECT, refuses: Refused | None = None) -> None:
        self.acts: list[Message] = []
        self._refuses = refuses
        writers = {"Move to": MoveTo, "Brake": Brake, "Configuration": Configure}
        self.wire = wired("cabin", dialect, application=Application(writers=writers, act=self._act))

    def _act(self, message: Message) -> None:
        if self._refuses:
            raise self._refuses
        self.acts.append(message)

    def write(self, index: int, *values: tuple[int, int]) -> None:
        """Write values, each with its size in bytes, to the sub-indices of an object from 1 on."""
        for subindex, (value, size) in enumerate(values, 1):
            self.wire.write(index, subindex, value, size)


MOVE_VALUES = ((1234, 2), (Ride.SERVICE, 1), (75, 2), (600, 2))


def test_the_last_sub_index_is_the_command() -> None:
    commanded = Commanded()
    commanded.write(MOVE, *MOVE_VALUES[:-1])
    assert commanded.acts == []
    commanded.wire.write(MOVE, 4, 0, size=2)
    assert commanded.acts == [MoveTo(1234, Ride.SERVICE, 75)]
    commanded.wire.write(MOVE, 4, 0, size=2)
    assert commanded.acts == [MoveTo(1234, Ride.SERVICE, 75)] * 2


def test_reserved_bits_are_always_0_and_command_nothing() -> None:
    commanded = Commanded()
    commanded.write(MOVE, *MOVE_VALUES[:-1])
    commanded.wire.write(MOVE, RESERVED, 0, size=1)
    assert commanded.wire.refused((MOVE, RESERVED), 1, size=1) == AbortCode.TOO_HIGH
    assert commanded.acts == []


def test_the_last_slice_is_the_command_as_well() -> None:
    commanded = Commanded(lift.REVERSED)
    commanded.write(MOVE, *MOVE_VALUES[:2], (75, 1))
    commanded.wire.write(0x3000, 1, 1000 >> 4, size=1)
    assert commanded.acts == []
    commanded.wire.write(0x3000, 8, 0, size=1)
    assert commanded.acts == [MoveTo(1000 & 0xFF0 | 1234 & 0xF, Ride.SERVICE, 75)]


@pytest.mark.parametrize(
    ("state", "written", "acts", "why"),
    [
        (NmtCommand.ENTER_PRE_OPERATIONAL, Brake, True, "a stop acts in every NMT state"),
        (NmtCommand.ENTER_PRE_OPERATIONAL, Configure, False, "anything else in OPERATIONAL only"),
        (NmtCommand.START, Configure, True, "OPERATIONAL"),
    ],
)
def test_a_command_acts_in_the_states_in_which_its_pdo_does(
    state: NmtCommand, written: type[Message], acts: bool, why: str
) -> None:
    commanded = Commanded()
    commanded.wire.command(state)
    *last, size = (0x2001, 1, 1) if written is Brake else (0x2020, 4, 2)
    if acts:
        commanded.wire.write(last[0], last[1], 0, size)
    else:
        assert commanded.wire.refused((last[0], last[1]), 0, size) == AbortCode.STATE
    assert [type(each) for each in commanded.acts] == [written] * acts, why


@pytest.mark.parametrize(("cause", "code"), [(Cause.STATE, AbortCode.STATE), (Cause.VALUES, AbortCode.INCOMPATIBLE)])
def test_a_refused_write_aborts_and_changes_nothing(cause: Cause, code: AbortCode) -> None:
    commanded = Commanded(refuses=Refused(cause, "not now"))
    commanded.write(MOVE, *MOVE_VALUES[:-1])
    assert commanded.wire.refused((MOVE, 4), 1, size=2) == code
    assert commanded.wire.read(MOVE, 4) == 0


def test_a_value_out_of_range_as_a_whole_is_refused() -> None:
    commanded = Commanded(lift.REVERSED)
    commanded.wire.write(0x3000, 1, 0xFF, size=1)
    assert commanded.wire.refused((0x3000, 8), 0, size=1) == AbortCode.VALUE
    assert commanded.acts == []


def test_a_command_means_the_same_under_another_mapping() -> None:
    commanded = Commanded()
    commanded.wire.write(0x1401, 1, NOT_VALID | 0x102)
    commanded.wire.write(0x2001, 1, Trouble.OBSTACLE, size=1)
    commanded.write(0x2020, (Building.HOSPITAL, 1), (2, 1), (1, 1), (45, 2))
    assert commanded.acts == [Brake(Trouble.OBSTACLE), Configure(Building.HOSPITAL, 2, 1, 45)]


EDS = record(0x2100, "Axis", (1, "UNSIGNED16", "100"), (2, "UNSIGNED16", "250"), (3, "UNSIGNED16", "0"))


class Motion(NamedTuple):
    speed: int
    pause: float


class Axis(Node):
    speed = setting("Axis.Entry 1")
    metres = scaled("Axis.Entry 1", 0.001)
    pause = seconds("Axis.Entry 2")
    step = period("Axis.Entry 3")
    motion = combined(Motion, speed=setting("Axis.Entry 1"), pause=seconds("Axis.Entry 2"))


def dictionary(eds: str = EDS) -> Dictionary:
    return Dictionary.read(eds.encode(), Path("axis.eds"), 1)


def test_a_setting_is_what_the_object_has_in_its_unit() -> None:
    axis = Axis(dictionary())
    assert (axis.speed, axis.metres, axis.pause, axis.step) == (100, 0.1, 0.25, 0.001)
    assert axis.motion == Motion(100, 0.25)


def test_a_written_setting_applies_from_the_next_use() -> None:
    axis = Axis(dictionary())
    assert (axis.speed, axis.motion) == (100, Motion(100, 0.25))
    axis.device.objects.write((0x2100, 1), (7).to_bytes(2, "little"))
    assert (axis.speed, axis.motion) == (7, Motion(7, 0.25))


def test_a_real32_setting_is_a_float_with_the_fraction_of_its_default() -> None:
    class Joint(Node):
        gain = setting("Joint.Entry 1")
        millimetres = scaled("Joint.Entry 1", 1000)

    joint = Joint(dictionary(record(0x2100, "Joint", (1, "REAL32", "1.5"))))
    assert (joint.gain, joint.millimetres) == (1.5, 1500.0)
    joint.device.objects.write((0x2100, 1), bytes.fromhex("00002040"))
    assert joint.gain == 2.5


def test_names_are_looked_up_when_the_node_is_made_and_not_again(monkeypatch: pytest.MonkeyPatch) -> None:
    axis = Axis(dictionary())
    monkeypatch.setattr(Dictionary, "address", None)
    assert axis.motion == Motion(100, 0.25)


def test_a_file_without_a_setting_is_refused_when_the_node_is_made() -> None:
    text = r"test_bound\.py:\d+: Axis names 'Axis\.Entry 1', which is not a value in axis\.eds; did you mean"
    with pytest.raises(NodeClassError, match=text):
        Axis(dictionary(EDS.replace("Entry 1", "Entry 9")))
