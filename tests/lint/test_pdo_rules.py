"""The ends of the ranges in the rules for PDOs: what is flagged on one side, and is not on the other."""

from __future__ import annotations

import pytest

from eurobot_od.lint.rules import lint
from tests.eds_text import with_entry
from tests.lint.mutations import BASES, CLEAN, WHOLE, Defect, mutated

WITHOUT_SYNC = mutated(Defect("W624", "no SYNC", "1005", WHOLE, ""))


def found(*values: tuple[str, str], text: str = CLEAN) -> set[str]:
    """Return the codes of the PDO rules that flag a file whose sections have other default values."""
    for section, value in values:
        text = with_entry(text, section, "DefaultValue", value)
    codes = {each.code for each in lint(text.encode(), "clean.eds")}
    return {code for code in codes if code[1] == "6"}


@pytest.mark.parametrize(
    ("cob_id", "codes"),
    [
        ("0x000", {"E606"}),  # NMT
        ("0x001", {"I607"}),
        ("0x07F", {"I607"}),
        ("0x080", {"I608"}),  # SYNC
        ("0x081", {"I608"}),  # EMCY
        ("0x0FF", {"I608"}),
        ("0x100", {"I608"}),  # TIME
        ("0x101", {"I607"}),
        ("0x180", {"I607"}),
        ("0x181", {"I608"}),  # TPDO 1
        ("0x1FF", {"I608"}),
        ("0x200", {"W609"}),  # the base of its own default
        ("0x201", {"I608"}),
        ("0x280", set()),  # the base of another's
        ("0x57F", {"I608"}),  # RPDO 4
        ("0x580", set()),
        ("0x581", {"E606"}),  # SDO
        ("0x5FF", {"E606"}),
        ("0x600", set()),
        ("0x67F", {"E606"}),
        ("0x680", set()),
        ("0x6DF", set()),
        ("0x6E0", {"I607"}),
        ("0x6FF", {"I607"}),
        ("0x700", set()),
        ("0x701", {"E606"}),  # heartbeat
        ("0x77F", {"E606"}),
        ("0x780", {"E606"}),
        ("0x7FF", {"E606"}),
        ("0x800", {"E604", "E606"}),  # NMT's, and bit 11
        ("0x10000280", {"E604"}),  # bit 28
        ("0x20000280", {"W605"}),  # bit 29
        ("0x20000800", {"W605"}),
        ("0x80000601", set()),  # not valid
        ("$NODEID+0x780", {"E606"}),  # up to 0x7FF
        ("$NODEID+0x781", {"E606", "E611"}),
    ],
)
def test_an_identifier_is_checked_by_its_range(cob_id: str, codes: set[str]) -> None:
    assert found(("1400sub1", cob_id)) == codes


NO_RTR, RTR = ("1800sub1", "$NODEID+0x40000180"), ("1800sub1", "$NODEID+0x180")


@pytest.mark.parametrize(
    ("number", "rpdo", "tpdo", "without_rtr"),
    [
        (0, set(), set(), set()),
        (240, set(), set(), set()),
        (241, {"E621"}, {"E620"}, {"E620"}),
        (251, {"E621"}, {"E620"}, {"E620"}),
        (252, {"W622"}, set(), {"E623"}),
        (253, {"W622"}, set(), {"E623"}),
        (254, set(), set(), set()),
        (255, set(), set(), set()),
    ],
)
def test_a_transmission_type_is_checked_by_direction(
    number: int, rpdo: set[str], tpdo: set[str], without_rtr: set[str]
) -> None:
    assert found(("1400sub2", str(number))) == rpdo
    assert found(("1800sub2", str(number)), RTR) == tpdo
    assert found(("1800sub2", str(number)), NO_RTR) == without_rtr


@pytest.mark.parametrize(
    ("number", "codes"),
    [(0, {"W624"}), (240, {"W624"}), (241, {"E620"}), (252, {"W624"}), (253, set()), (254, set())],
)
def test_synchronous_types_need_a_sync(number: int, codes: set[str]) -> None:
    asynchronous = ("1400sub2", "255")
    assert found(asynchronous, RTR, ("1800sub2", str(number)), text=WITHOUT_SYNC) == codes


def test_a_pdo_that_is_not_valid_needs_no_sync() -> None:
    assert found(("1400sub1", "0x80000205"), text=WITHOUT_SYNC) == set()


@pytest.mark.parametrize(("value", "codes"), [(0, set()), (240, set()), (241, {"E627"})])
def test_a_sync_start_value_is_0_to_240(value: int, codes: set[str]) -> None:
    assert found(("1800sub6", str(value))) == codes


@pytest.mark.parametrize(
    ("milliseconds", "inhibit", "codes"),
    [
        (5, 50, set()),  # equal: 5 ms are 50 times 100 us
        (5, 51, {"W628"}),
        (1, 11, {"W628"}),
        (0, 50, set()),  # no event timer
        (1, 0, set()),  # no inhibit time
    ],
)
def test_an_event_timer_is_compared_with_the_inhibit_time(milliseconds: int, inhibit: int, codes: set[str]) -> None:
    assert found(("1800sub5", str(milliseconds)), ("1800sub3", str(inhibit))) == codes
    assert found(("1400sub5", str(milliseconds)), ("1400sub3", str(inhibit))) == ({"W626"} if inhibit else set())


@pytest.mark.parametrize(
    ("count", "codes"),
    [
        (0, {"I633", "W634"}),
        (1, {"W634"}),
        (2, set()),
        (4, {"E632"}),
        (5, {"E631", "E632"}),
        (64, {"E631", "E632"}),
        (65, {"E630", "E631", "E632"}),
        (253, {"E630", "E631", "E632"}),
        (254, set()),  # multiplexed, by source and destination
        (255, set()),
    ],
)
def test_the_number_of_mapped_objects_is_checked(count: int, codes: set[str]) -> None:
    assert found(("1600sub0", str(count))) == codes


def test_a_pdo_that_is_not_valid_may_be_without_data() -> None:
    assert found(("1600sub0", "0"), ("1400sub1", "0x80000205")) == {"W634"}


@pytest.mark.parametrize(
    ("last", "codes"), [("0x20020210", set()), ("0x20010208", {"E642"}), ("0x20020211", {"E635", "E638"})]
)
def test_a_pdo_has_up_to_64_bits(last: str, codes: set[str]) -> None:
    assert found(("1A01sub1", "0x20000020"), ("1A01sub2", "0x20020110"), ("1A01sub3", last)) == codes


@pytest.mark.parametrize(
    ("entry", "codes"),
    [
        ("0x00050007", {"E645"}),
        ("0x00050008", set()),
        ("0x00050009", {"E645"}),
        ("0x00010001", {"E644"}),
        ("0x001F0020", {"E644"}),  # the last index of data types of the standard
        ("0x00200020", {"E636"}),  # no dummy
    ],
)
def test_a_dummy_is_an_index_below_20h_with_its_length(entry: str, codes: set[str]) -> None:
    assert found(("1601sub1", entry)) == codes


@pytest.mark.parametrize(
    ("bits", "codes"),
    [(0x00, {"E646"}), (0x01, {"W639"}), (0x09, {"W639"}), (0x0A, {"I640"}), (0x0F, {"I640"}), (0x10, set()),
     (0x11, {"E638"})],
)  # fmt: skip
def test_a_mapped_length_is_checked_by_type_and_limits(bits: int, codes: set[str]) -> None:
    assert found(("1600sub1", f"0x200101{bits:02X}")) == codes  # UNSIGNED16, 0 to 1000


@pytest.mark.parametrize(
    ("low", "high", "bits", "is_cut"),
    [
        ("-128", "127", 8, False),
        ("-129", "127", 8, True),
        ("-128", "128", 8, True),
        ("-64", "63", 7, False),
        ("-65", "63", 7, True),
        ("-64", "64", 7, True),
        ("0", "128", 8, True),  # its bits would be -128
        (None, "127", 8, True),  # down to the type's limit
        ("-128", None, 8, True),
    ],
)
def test_signed_limits_beyond_the_mapped_bits_are_reported(
    low: str | None, high: str | None, bits: int, is_cut: bool
) -> None:
    text = with_entry(with_entry(CLEAN, "2007", "LowLimit", low), "2007", "HighLimit", high)
    assert found(("1601sub2", f"0x200700{bits:02X}"), text=text) == ({"W639"} if is_cut else {"I640"})


@pytest.mark.parametrize(
    ("low", "high", "bits", "is_cut"),
    [("0", "255", 8, False), ("0", "256", 8, True), ("0", "1", 1, False), ("0", "2", 1, True), (None, "255", 8, False),
     ("0", None, 8, True)],
)  # fmt: skip
def test_unsigned_limits_beyond_the_mapped_bits_are_reported(
    low: str | None, high: str | None, bits: int, is_cut: bool
) -> None:
    text = with_entry(with_entry(CLEAN, "2001sub1", "LowLimit", low), "2001sub1", "HighLimit", high)
    assert found(("1600sub1", f"0x200101{bits:02X}"), text=text) == ({"W639"} if is_cut else {"I640"})


@pytest.mark.parametrize(
    ("entry", "codes"),
    [("0xFFFFFFFF", {"E635", "E636"}), ("0x100000000", {"E644", "E646", "E650"})],  # the second's 32 bits are all 0
)
def test_a_mapping_entry_has_32_bits(entry: str, codes: set[str]) -> None:
    assert found(("1600sub1", entry)) == codes


def test_fixed_mappings_may_have_a_fixed_cob_id() -> None:
    text = with_entry(BASES["fixed"][1], "1400sub1", "AccessType", "ro")
    assert found(text=text) == set()
