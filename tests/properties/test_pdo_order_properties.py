"""Whatever changes in PDOs, a device that insists on CiA 301's procedure takes every write and ends as wanted."""

from __future__ import annotations

from hypothesis import given, settings
from hypothesis import strategies as st

from eurobot_od.client.configure import ChangedObject, ChangePlan, in_order, procedure_objects
from eurobot_od.od.dcf import Write
from eurobot_od.od.objects import undescribed
from eurobot_od.od.values import MAPPING_OFFSET, NOT_VALID, Address, pdo_of
from tests.kit import lift

PDOS = (0x1400, 0x1401, 0x1800)
ENTRIES = 3
CABIN = lift.dictionary("cabin")


class StrictDevice:
    """A device with three PDOs that refuses every write out of the order of CiA 301, 7.5.2.36 and 7.5.2.38."""

    def __init__(self, objects: dict[Address, bytes]) -> None:
        self.objects = dict(objects)

    def valid(self, pdo: int) -> bool:
        return not int.from_bytes(self.objects[pdo, 1], "little") & NOT_VALID

    def write(self, write: Write) -> None:
        address, data = write
        pdo = pdo_of(address[0])
        if pdo is not None:
            self.check(pdo, address, int.from_bytes(data, "little"))
        self.objects[address] = data

    def check(self, pdo: int, address: Address, value: int) -> None:
        identifier = int.from_bytes(self.objects[pdo, 1], "little") % NOT_VALID
        if address == (pdo, 1):
            assert not self.valid(pdo) or value % NOT_VALID == identifier, "identifier changed while valid"
        else:
            assert not self.valid(pdo), "changed while valid"
        if address[0] != pdo and address[1] > 0:
            assert self.objects[address[0], 0] == b"\0", "entry changed while it counts"


def number(size: int, least: int = 0) -> st.SearchStrategy[bytes]:
    return st.integers(least, 256**size - 1).map(lambda value: value.to_bytes(size, "little"))


def cob_id() -> st.SearchStrategy[bytes]:
    return st.tuples(st.integers(1, 0x7FF), st.sampled_from([0, NOT_VALID])).map(
        lambda parts: (parts[0] | parts[1]).to_bytes(4, "little")
    )


def objects() -> st.SearchStrategy[dict[Address, bytes]]:
    contents: dict[Address, st.SearchStrategy[bytes]] = {(0x2100, 1): number(1)}
    for pdo in PDOS:
        contents |= {(pdo, 1): cob_id(), (pdo, 2): number(1), (pdo, 5): number(2)}
        contents[pdo + MAPPING_OFFSET, 0] = st.integers(0, ENTRIES).map(lambda count: bytes([count]))
        contents |= {(pdo + MAPPING_OFFSET, entry): number(4) for entry in range(1, ENTRIES + 1)}
    return st.fixed_dictionaries(contents)


def counting(contents: dict[Address, bytes]) -> dict[Address, bytes]:
    """Leave out mapping entries that do not count."""
    mappings = {pdo + MAPPING_OFFSET for pdo in PDOS}
    return {a: d for a, d in contents.items() if a[0] not in mappings or a[1] <= contents[a[0], 0][0]}


@settings(deadline=None)
@given(before=objects(), after=objects())
def test_a_strict_device_takes_every_write_and_ends_as_wanted(
    before: dict[Address, bytes], after: dict[Address, bytes]
) -> None:
    device = StrictDevice(before)
    wanted = {address: data for address, data in counting(after).items() if before[address] != data}
    for write in in_order(wanted, before):
        device.write(write)
    assert {address: device.objects[address] for address in counting(after)} == counting(after)


@settings(deadline=None)
@given(before=objects(), after=objects(), share=st.floats(0, 1))
def test_from_wherever_the_writing_ends_there_is_a_way_back(
    before: dict[Address, bytes], after: dict[Address, bytes], share: float
) -> None:
    device = StrictDevice(before)
    wanted = {address: data for address, data in counting(after).items() if before[address] != data}
    changes = tuple(ChangedObject(undescribed(address), before[address], data) for address, data in wanted.items())
    plan = ChangePlan(CABIN, changes, {address: before[address] for address in procedure_objects(wanted)})
    done = plan.writes()[: round(share * len(plan.writes()))]
    for write in [*done, *plan.way_back(done)]:
        device.write(write)
    assert {address: device.objects[address] for address in counting(before)} == counting(before)
