"""The catalogue of message types, and the types made for PDOs that nobody has entered."""

from __future__ import annotations

from typing import Annotated, NamedTuple

import pytest
from canopen.objectdictionary import ODVariable

from eurobot_od.errors import MappingError
from eurobot_od.od.pdos import Mapped, Pdo
from eurobot_od.od.values import UNSIGNED8, PdoDirection
from eurobot_od.pdo.kinds import Catalogue, Kind, field_name, made_type
from eurobot_od.pdo.protocol import Protocol
from tests.kit import lift

LAMP = Catalogue()


@LAMP.message("LIGHTS", always=True)
class LampState(NamedTuple):
    """How bright the lamp is."""

    brightness: Annotated[int, Kind("%")]


@LAMP.message()
class Tick(NamedTuple):
    """A message in no group."""


def test_the_decorator_adds_a_class_to_the_catalogue() -> None:
    entry = LAMP.find("lamp-state")
    assert entry == (LampState, "LIGHTS", True)
    assert LAMP.types == (LampState, Tick)
    assert LAMP.groups == ("LIGHTS",)
    assert LAMP.always == {LampState}


def pdo(name: str, cob_id: int, *objects: str, direction: PdoDirection = PdoDirection.TPDO, number: int = 1) -> Pdo:
    """A PDO of objects with 8 bits each."""
    variables = [ODVariable(each, 0x2000, sub) for sub, each in enumerate(objects, 1)]
    for variable in variables:
        variable.data_type = UNSIGNED8.code
    mapping = tuple(Mapped.of(variable, 8, variable) for variable in variables)
    return Pdo(direction, direction.value + number - 1, name, cob_id, True, 254, mapping)


CABIN = lift.dictionary("cabin")
PANEL = lift.dictionary("panel")


def protocol(*pdos: Pdo, other: tuple[Pdo, ...] = ()) -> Protocol:
    return Protocol([(CABIN, pdos), (PANEL, other)], LAMP)


def test_a_pdo_of_the_catalogue_has_its_type() -> None:
    lamp = protocol(pdo("Lamp state", 0x181, "Brightness"))
    assert lamp.decode(0x181, b"\x2a") == LampState(42)
    assert (lamp.binding("Lamp state").group, lamp.binding(LampState).always) == ("LIGHTS", True)


def test_a_pdo_without_a_class_is_a_message_of_plain_numbers() -> None:
    made = protocol(pdo("Battery state", 0x182, "Charge", "Cell 1"))
    message = made.decode(0x182, b"\x2a\x07")
    assert message._asdict() == {"charge": 42, "cell_1": 7}
    assert made.encode(message).data == b"\x2a\x07"
    assert made.binding("battery-state").type is type(message)


# Name of the communication record; the message's name.
NAMES = [
    ("Battery state", "Battery state"),
    ("TPDO communication parameter", "cabin.TPDO3"),
    ("Transmit PDO 1 Parameter", "cabin.TPDO3"),
    ("", "cabin.TPDO3"),
]


@pytest.mark.parametrize(("record", "name"), NAMES)
def test_a_generic_record_name_is_replaced_by_device_direction_and_number(record: str, name: str) -> None:
    assert protocol(pdo(record, 0x182, number=3)).names() == [name]


def test_a_common_cob_id_makes_sender_and_receiver_one_message() -> None:
    received = pdo("RPDO communication parameter", 0x182, "Remote charge", direction=PdoDirection.RPDO)
    both = protocol(pdo("TPDO communication parameter", 0x182, "Charge"), other=(received,))
    (binding,) = both.bindings
    assert (binding.name, binding.senders, binding.receivers) == ("cabin.TPDO1", ["cabin"], ["panel"])
    assert binding.layout.fields == ("charge",)


def test_sender_and_receiver_of_different_lengths_are_refused() -> None:
    received = pdo("RPDO communication parameter", 0x182, "Charge", "More", direction=PdoDirection.RPDO)
    with pytest.raises(MappingError, match=r"mapping differs from that in cabin\.eds 0x1A00"):
        protocol(pdo("TPDO communication parameter", 0x182, "Charge"), other=(received,))


FIELDS = [
    ("X position", "x"),
    ("Status (raw)", "status_raw"),
    ("class", "class_"),  # a keyword
    ("2nd axis", "field_2nd_axis"),
    ("", "field"),
    ("???", "field"),
    ("Größe", "gr_e"),  # ASCII only: an identifier for any tool
    ('x"; import os', "x_import_os"),
    ("_private", "private"),
    ("self", "self"),
    ("x" * 1000, "x" * 60),
]


@pytest.mark.parametrize(("parameter", "field"), FIELDS)
def test_every_parameter_name_makes_a_field_name(parameter: str, field: str) -> None:
    assert field_name(parameter) == field
    assert made_type("x", {field: Kind()})._fields == (field,)


def test_objects_with_the_same_name_get_different_fields() -> None:
    made = protocol(pdo("Inputs", 0x182, "Input", "Input", "Input 2", "Input"))
    assert made.binding("Inputs").layout.fields == ("input", "input_2", "input_2_2", "input_3")


def test_a_message_type_can_have_any_name() -> None:
    assert made_type('cabin.TPDO1"\n', {"a": Kind()}).__name__ == 'cabin.TPDO1"\n'
