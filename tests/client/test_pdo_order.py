"""The order of writes that changes PDOs: CiA 301's procedure, and nothing that is there already."""

from __future__ import annotations

import pytest

from eurobot_od.client.configure import in_order, procedure_objects
from eurobot_od.od.dcf import Write
from eurobot_od.od.values import Address, pdo_of

COB_ID = {(0x1403, 1): bytes.fromhex("08000000")}
COUNT = {(0x1603, 0): b"\x02"}


def written(writes: list[Write]) -> list[tuple[str, str]]:
    return [(f"{index:X}:{subindex}", data.hex()) for (index, subindex), data in writes]


@pytest.mark.parametrize(
    ("address", "pdo"),
    [
        ((0x1400, 1), 0x1400),  # first RPDO
        ((0x15FF, 1), 0x15FF),  # last RPDO
        ((0x1600, 0), 0x1400),  # its mapping
        ((0x17FF, 0), 0x15FF),
        ((0x1800, 5), 0x1800),  # first TPDO
        ((0x1BFF, 8), 0x19FF),  # last TPDO's mapping
        ((0x13FF, 1), None),  # below all PDOs
        ((0x1C00, 1), None),  # above them
        ((0x2000, 1), None),  # application
    ],
)
def test_a_pdo_is_its_communication_and_its_mapping_record(address: Address, pdo: int | None) -> None:
    assert pdo_of(address[0]) == pdo


def test_a_mapping_changes_while_its_pdo_is_invalid_and_it_is_empty() -> None:
    order = in_order({(0x1603, 1): bytes.fromhex("10010020")}, COB_ID | COUNT)
    assert written(order) == [
        ("1403:1", "08000080"),  # bit 31: invalid, the identifier stays
        ("1603:0", "00"),
        ("1603:1", "10010020"),
        ("1603:0", "02"),
        ("1403:1", "08000000"),
    ]


def test_a_new_identifier_comes_with_the_last_write() -> None:
    order = in_order({(0x1403, 1): bytes.fromhex("18000000")}, COB_ID)
    assert written(order) == [("1403:1", "08000080"), ("1403:1", "18000000")]


def test_the_rest_of_the_communication_record_changes_while_the_pdo_is_invalid() -> None:
    order = in_order({(0x1403, 3): b"\x05\x00", (0x1403, 2): b"\xff"}, COB_ID)
    assert written(order)[1:-1] == [("1403:2", "ff"), ("1403:3", "0500")]


def test_a_pdo_that_is_invalid_is_not_made_invalid_again() -> None:
    order = in_order({(0x1403, 2): b"\xff"}, {(0x1403, 1): bytes.fromhex("08000080")})
    assert written(order) == [("1403:2", "ff")]


def test_entries_behind_the_last_that_counts_are_left_alone() -> None:
    order = in_order({(0x1603, 2): b"\0\0\0\0", (0x1603, 3): b"\0\0\0\0"}, COB_ID | COUNT)
    assert "1603:3" not in dict(written(order))


def test_other_objects_come_first_and_all_pdos_are_invalid_before_one_is_valid() -> None:
    two = {(0x1403, 1): bytes.fromhex("10000000"), (0x1404, 1): bytes.fromhex("08000000"), (0x2101, 1): b"\1\0"}
    order = in_order(two, {(0x1403, 1): bytes.fromhex("08000000"), (0x1404, 1): bytes.fromhex("10000000")})
    assert [name for name, _ in written(order)] == ["2101:1", "1403:1", "1404:1", "1403:1", "1404:1"]
    assert [data[-2:] for _, data in written(order)[1:]] == ["80", "80", "00", "00"]


def test_nothing_is_written_that_is_there_already() -> None:
    assert in_order({(0x1017, 0): b"\xe8\x03"}, {(0x1017, 0): b"\xe8\x03"}) == []


def test_the_procedure_needs_cob_id_and_count_of_what_changes() -> None:
    addresses = [(0x1603, 1), (0x1A00, 0), (0x1404, 2), (0x2000, 1)]
    assert set(procedure_objects(addresses)) == {(0x1403, 1), (0x1603, 0), (0x1800, 1), (0x1A00, 0), (0x1404, 1)}
