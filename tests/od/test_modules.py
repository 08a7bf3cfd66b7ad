"""Modules of a bus coupler: which objects the connected ones bring, and what is said of those that cannot be there."""

from __future__ import annotations

import time
from pathlib import Path

import canopen
import pytest

from eurobot_od.device.simulated import SimulatedDevice
from eurobot_od.errors import DictionaryError
from eurobot_od.od.dictionary import Dictionary
from eurobot_od.od.formats import read
from eurobot_od.od.modules import with_modules
from eurobot_od.od.normal import in_normal_form
from eurobot_od.od.values import Address, Value

FILE = Path(__file__).parent / "samples" / "coupler.eds"
TEXT = FILE.read_text()
OWN: dict[Address, Value] = {(0x6401, 0): 1, (0x6401, 1): 240}
"""What the coupler has itself of the objects that modules extend."""

# Modules in their positions, and the application's objects that the device then has.
CONNECTED: list[tuple[list[str], dict[Address, Value]]] = [
    ([], OWN),
    (["0"], OWN),  # an empty slot
    (["1"], OWN | {(0x6000, 0): 1, (0x6000, 1): 0}),
    (["DI8", "8 inputs", "0x1"], OWN | {(0x6000, 0): 3, (0x6000, 1): 0, (0x6000, 2): 0, (0x6000, 3): 0}),
    # 4 bits each: two modules share a sub-index
    (["2"], OWN | {(0x6000, 0): 1, (0x6000, 1): 0}),
    (["2", "2"], OWN | {(0x6000, 0): 1, (0x6000, 1): 0}),
    (["2", "2", "2"], OWN | {(0x6000, 0): 2, (0x6000, 1): 0, (0x6000, 2): 0}),
    (["2", "1", "2"], OWN | {(0x6000, 0): 3, (0x6000, 1): 0, (0x6000, 2): 0, (0x6000, 3): 0}),
    # it extends an array of the coupler, and brings objects of its own, once
    (
        ["3", "3"],
        OWN
        | {(0x6401, 0): 5, **{(0x6401, sub): 0 for sub in range(2, 6)}}
        | {(0x2300, 0): 1, (0x2300, 1): 50, (0x6423, 0): 0},
    ),
    # ObjExtend=2: the third goes on in the next object
    (["4", "4", "4"], OWN | {(0x3000, 0): 2, (0x3000, 1): 0, (0x3000, 2): 0, (0x3001, 0): 1, (0x3001, 1): 0}),
]


def application(dictionary: Dictionary) -> dict[Address, Value]:
    return {address: dictionary.default(address) for address in dictionary.addresses() if address[0] >= 0x2000}


@pytest.mark.parametrize(("modules", "objects"), CONNECTED)
def test_connected_modules_bring_their_objects(modules: list[str], objects: dict[Address, Value]) -> None:
    dictionary = Dictionary.load(FILE, 5, modules=modules)
    assert application(dictionary) == objects
    assert not dictionary.normal.deviations
    assert not dictionary.normal.refusals


@pytest.mark.parametrize(("modules", "objects"), CONNECTED[2:])
def test_a_dcf_says_which_modules_are_connected(modules: list[str], objects: dict[Address, Value]) -> None:
    listed = "".join(f"{number}={each}\n" for number, each in enumerate(modules, start=1))
    text = f"{TEXT}\n[ConnectedModules]\nNrOfEntries={len(modules)}\n{listed}"
    assert application(Dictionary.read(text.encode(), FILE, 5)) == objects
    written, _ = in_normal_form(text.encode())
    assert in_normal_form(written) == (written, [])
    assert application(Dictionary.read(written, FILE, 5)) == objects


def test_other_tools_find_the_objects_in_the_normal_form(tmp_path: Path) -> None:
    text = f"{TEXT}\n[ConnectedModules]\nNrOfEntries=2\n1=1\n2=1\n"
    file = tmp_path / "coupler.eds"
    file.write_bytes(in_normal_form(text.encode())[0])
    objects = canopen.import_od(str(file), node_id=5)
    found = [objects.get_variable(0x6000, sub) for sub in (0, 1, 2)]
    assert [(each.name, each.data_type) for each in found if each] == [
        ("Highest sub-index supported", canopen.objectdictionary.UNSIGNED8),
        ("Inputs 1", canopen.objectdictionary.UNSIGNED8),
        ("Inputs 2", canopen.objectdictionary.UNSIGNED8),
    ]


def test_sub_indices_that_a_dcf_has_written_out_are_not_added_again() -> None:
    written, _ = in_normal_form(f"{TEXT}\n[ConnectedModules]\nNrOfEntries=1\n1=1\n".encode())
    again = written.replace(
        b"\n;[ConnectedModules]\n;NrOfEntries=1\n;1=1\n", b"\n[ConnectedModules]\nNrOfEntries=1\n1=1\n"
    )
    again = again.replace(b"ParameterName=Inputs 1\n", b"ParameterName=Inputs 1\nParameterValue=7\n")
    assert again.count(b"[ConnectedModules]") == 1
    assert b";[ConnectedModules]" not in again
    found = application(Dictionary.read(again, FILE, 5))
    assert found == OWN | {(0x6000, 0): 1, (0x6000, 1): 7}


def test_the_module_list_has_the_numbers_of_the_modules() -> None:
    dictionary = Dictionary.load(FILE, 5, modules=["DI4"])
    assert [dictionary.default((0x1027, sub)) for sub in (0, 1)] == [1, 2]


def test_a_pdo_maps_what_modules_bring() -> None:
    (sent,) = SimulatedDevice(Dictionary.load(FILE, 5, modules=["1", "1"])).dictionary.pdos
    assert [each.name for each in sent.mapping] == ["Inputs 1", "Inputs 2"]


UNFIT = [
    (
        TEXT,
        ["9"],
        "module 9 is not supported; supported: 1 (8 inputs), 2 (4 inputs), 3 (2 analogue inputs), 4 (Counter)",
    ),
    (
        TEXT.replace("[M1SubExt6000]", "[M1Sub6000]"),
        ["1"],
        "module 1 (8 inputs): no [M1SubExt...] with a Count describes",
    ),
    (TEXT.replace("Count=1\nObjExtend=0", "Count=one"), ["1"], "module 1 (8 inputs): no [M1SubExt...] with a Count"),
    (TEXT.replace("Count=1\nObjExtend=0", "Count=200"), ["1", "1"], "module 1 (8 inputs): 0x6000 has no room for a"),
    ("[1000]\nParameterName=Type\nDataType=7\nAccessType=ro\n", ["1"], "module 1 is not supported; supported: none"),
]


@pytest.mark.parametrize(("text", "modules", "words"), UNFIT)
def test_modules_that_cannot_be_there_are_refused(text: str, modules: list[str], words: str) -> None:
    with pytest.raises(DictionaryError) as error:
        Dictionary.read(text.encode(), FILE, 5, modules=modules)
    assert words in str(error.value)


def test_a_module_that_a_dcf_wrongly_connects_is_left_out_with_its_line() -> None:
    text = f"{TEXT}\n[ConnectedModules]\nNrOfEntries=2\n1=1\n2=9\n"
    dictionary = Dictionary.read(text.encode(), FILE, 5)
    assert application(dictionary) == OWN | {(0x6000, 0): 1, (0x6000, 1): 0}
    (said,) = dictionary.normal.refusals
    assert str(said).startswith(f"line {text.count(chr(10))}: module 9 is not supported")


def test_a_coupler_without_modules_says_which_it_takes() -> None:
    assert [each.name for each in Dictionary.load(FILE, 5).idle_modules] == [
        *("8 inputs", "4 inputs", "2 analogue inputs", "Counter")
    ]
    assert Dictionary.load(FILE, 5, modules=["1"]).idle_modules == ()


@pytest.mark.parametrize("module", [1, 2, 3, 4])
def test_the_time_for_modules_is_proportional_to_their_number(module: int) -> None:
    entries = "".join(f"{number}={module}\n" for number in range(1, 8001))
    document = read(f"{TEXT}\n[ConnectedModules]\nNrOfEntries=8000\n{entries}".encode())
    began = time.process_time()
    with_modules(document)
    assert time.process_time() - began < 1.0  # 3 to 8 s when each module looked at all before it


@pytest.mark.parametrize("digits", ["9" * 5000, "0" * 5000 + "1"])
def test_a_number_of_thousands_of_digits_is_not_an_error(digits: str) -> None:
    text = TEXT.replace("Count=1\n", f"Count=0;1{digits}\n") + f"\n[ConnectedModules]\nNrOfEntries=1\n{digits}=1\n"
    with_modules(read(text.encode()))
