"""SDO steps: objects by name and number, values of every type, in the words of `read` and `write`."""

from __future__ import annotations

from pathlib import Path

import pytest

from eurobot_od.check.format import SuiteReader
from eurobot_od.check.on_bus import NodeUnderTest, run_simulated
from eurobot_od.check.report import Status, StepResult
from eurobot_od.check.runner import RunOptions
from eurobot_od.check.shapes import Networks
from eurobot_od.check.suite import NodeServices, Suite
from eurobot_od.device.simulated import SimulatedDevice
from eurobot_od.errors import YamlError
from eurobot_od.od.dictionary import Dictionary
from tests.eds_text import DEVICE_TYPE, record, variable

LIMITED = "LowLimit=10\nHighLimit=100\n"
TEXT = (
    DEVICE_TYPE
    + variable("2000", "Offset", "INTEGER16", default="-2")
    + variable("2001", "Trim", "INTEGER8", default="50", more=LIMITED)
    + variable("2002", "Label", "VISIBLE_STRING", default="Arm 1..4")
    + variable("2003", "Key", "OCTET_STRING", default="FF8041")
    + variable("2004", "Factor", "REAL32", default="20.1")
    + variable("2005", "Count", "UNSIGNED24", default="0x123456")
    + record(0x2006, "Motion", (0, "UNSIGNED8", "1"), (1, "UNSIGNED8", "7"))
    + variable("2007", "Ratio", "REAL64", default="0.1", more="LowLimit=-1.5\nHighLimit=1.5\n")
    + variable("2008", "Total", "UNSIGNED64", default="0xFFFFFFFFFFFFFFFE")
    + variable("2009", "Balance", "INTEGER40", default="-3")
    + variable("200A", "Name", "UNICODE_STRING", default="")
    + variable("200B", "Since", "TIME_OF_DAY", default="0")
    + variable("200C", "Image", "DOMAIN")
    + variable("200D", "Enabled", "BOOLEAN", default="1")
)


def dictionary(more: str = "", node_id: int = 5) -> Dictionary:
    return Dictionary.read((TEXT + more).encode(), Path("arm.eds"), node_id)


def suite(*steps: str) -> Suite:
    arm = dictionary()
    networks = Networks(lambda _: Path("arm"), load=lambda _: (arm,))
    text = "\n".join(
        ("spec: 1", "name: arm", "variables: {near: 0.5}", "steps:", *(f"- sdo: {{{each}}}" for each in steps))
    )
    (found,) = SuiteReader(networks).read_texts({Path("arm.yaml"): text})
    return found


def run(*steps: str) -> tuple[StepResult, ...]:
    def device(_dictionaries: object, _seed: int, _clock: object) -> list[NodeUnderTest]:
        return [NodeUnderTest(SimulatedDevice(dictionary()))]

    return run_simulated(suite(*steps), RunOptions(keep_going=True), device).steps


FITTING = [
    # numbers of every width
    ("read: 0x2000, expect: -2", "signed"),
    ("read: 0x2000, expect: -10..-1", "a range"),
    ("read: 0x2005, expect: 0x123456", "24 bits"),
    ("read: 0x2009, expect: -3", "40 bits"),
    ("read: 0x2008, expect: 18446744073709551614", "64 bits"),
    ("read: 0x2008, expect: '> 0xFFFFFFFFFFFFFFF0'", "an ordering of 64 bits"),
    ("read: 0x200D, expect: 1", "a BOOLEAN"),
    # REAL
    ("read: 0x2004, expect: 20.1", "as the type holds it"),
    ("read: 0x2004, expect: 20 ± 0.5", "near"),
    ("read: 0x2004, expect: 20.0 +- 0.5", "near, in ASCII"),
    ("read: 0x2004, expect: '20 +- {near}'", "near by a variable"),
    ("read: 0x2004, expect: 19.5..20.5", "between"),
    ("read: 0x2004, expect: '< 20.2'", "less"),
    ("read: 0x2004, expect: not 20", "anything else"),
    ("read: 0x2007, expect: 0.1", "of 64 bits"),
    # a tolerance need not be within the limits
    ("read: 0x2001, expect: 48 +- 3", "a tolerance under the low limit"),
    # texts, as they are
    ("read: 0x2002, expect: Arm 1..4", "no range of texts"),
    ("read: 0x2002, expect: not Arm", "another text"),
    ("read: 0x200A, expect: ''", "an empty text"),
    # bytes and times
    ("read: 0x2003, expect: ff 80 41", "an OCTET_STRING"),
    ("read: 0x2003, data: FF8041", "the same as bytes"),
    ("read: 0x2003, data: not 00", "other bytes"),
    ("read: 0x200B, expect: 1984-01-01", "a time"),
    # names
    ("read: offset, expect: -2", "in any letter case"),
    ("read: 2000, expect: -2", "a number without 0x"),
    ("read: 2006sub1, expect: 7", "as an EDS writes it"),
    ("read: motion.entry 1, expect: 7", "a member by its name"),
]


@pytest.mark.parametrize("step", [row[0] for row in FITTING])
def test_values_of_any_type_are_compared(step: str) -> None:
    (result,) = run(step)
    assert result.status is Status.PASSED, result.reason


UNFIT = [
    # (step, what was expected, what came)
    ("read: 0x2004, expect: 21.0 ± 0.5", "21.0 +- 0.5", "20.1"),
    ("read: Factor, expect: '> 20.1'", "> 20.1", "20.1"),
    ("read: 0x2008, expect: 1", "0x0000000000000001", "0xFFFFFFFFFFFFFFFE"),
    ("read: 0x2002, expect: Arm", "'Arm'", "'Arm 1..4'"),
    ("read: 0x2003, expect: FF 80", "FF 80", "FF 80 41"),
    ("read: 0x200B, expect: 1984-01-02", "'1984-01-02 00:00:00.000'", "'1984-01-01 00:00:00.000'"),
]


@pytest.mark.parametrize(("step", "wanted", "came"), UNFIT)
def test_a_different_value_is_reported_with_its_object(step: str, wanted: str, came: str) -> None:
    (result,) = run(step)
    assert result.reason
    assert (result.reason.expected, result.reason.came) == (wanted, came)
    assert result.reason.what.startswith("0x20")
    assert result.reason.what.endswith(" is not as expected")


WRITTEN = [
    ("0x2000", "-300"),
    ("0x2004", "21.3"),
    ("Ratio", "-0.25"),
    ("0x2008", "0xFFFFFFFFFFFFFFFF"),
    ("0x2009", "-549755813888"),
    ("label", "Arm 2"),
    ("0x200A", "Zürich"),
    ("0x2003", "01 02"),
    ("0x200B", "2014-05-28 12:00:00.500"),
    ("Image", "00 FF"),
]


@pytest.mark.parametrize(("name", "value"), WRITTEN)
def test_a_written_value_is_read_back(name: str, value: str) -> None:
    steps = (
        f"write: {name}, value: '{value}'",
        f"read: {name}, expect: '{value}', save: x",
        f"write: {name}, value: '{{x}}'",
        f"read: {name}, expect: '{{x}}'",
        f"read: {name}, data: any, save: y",
        f"write: {name}, data: '{{y}}'",
        f"read: {name}, data: '{{y}}'",
    )
    assert [each.status for each in run(*steps)] == [Status.PASSED] * len(steps)


REFUSED = [
    ("read: 0x2001, expect: 101", "0x2001:0: Trim = 101 is not allowed; allowed: 10..100"),
    ("write: 0x2001, value: 9", "0x2001:0: Trim = 9 is not allowed; allowed: 10..100"),
    ("write: 0x2007, value: 1.6", "0x2007:0: Ratio = 1.6 is not allowed; allowed: -1.5..1.5"),
    ("write: 0x2004, value: warm", "0x2004:0: Factor = 'warm' is not allowed; allowed: a number"),
    (
        "read: 0x2004, expect: 1 +- -1",
        "0x2004:0: Factor = -1.0 is not allowed; allowed: 0..inf; also 20 +- 1, 15..25, > 15, not 3, any",
    ),
    ("write: 0x2003, value: 1", "0x2003:0: Key = '1' is not allowed; allowed: bytes in hexadecimal digits"),
    ("write: 0x2002, value: Zürich", "0x2002:0: Label = 'Zürich' is not allowed; allowed: ASCII text"),
    ("write: 0x2001, value: 128, abort: any", "0x2001:0: Trim = 128 is not allowed; allowed: -128..127"),
    ("read: 0x3000, expect: 1", "0x3000:0 is not in the EDS of arm; use 'data'"),
    ("read: Ofset", "unknown object 'Ofset'; did you mean Offset?"),
    ("read: Motion", "'Motion' is not one object but a record of 0x2006:0 Motion.Entry 0, 0x2006:1 Motion.Entry 1"),
]


@pytest.mark.parametrize(("step", "what"), REFUSED)
def test_a_forbidden_value_of_an_object_is_reported_with_its_place(step: str, what: str) -> None:
    with pytest.raises(YamlError) as told:
        suite(step)
    (line,) = str(told.value).splitlines()
    assert line.startswith("arm.yaml:5:")
    assert line.endswith(f": {what}")


def test_a_value_to_be_refused_may_exceed_the_limits() -> None:
    (result,) = run("write: 0x2001, value: 101, abort: 0x06090031")
    assert result.status is Status.PASSED


def test_a_variable_of_another_type_is_red() -> None:
    read, written = run("read: Label, save: t", "write: Offset, value: '{t}'")
    assert (read.status, written.status) == (Status.PASSED, Status.FAILED)
    assert written.reason
    assert written.reason.what == "0x2000:0: Offset = 'Arm 1..4' is not allowed; allowed: an integer"


def server(request: str, answer: str) -> str:
    return record(0x1200, "SDO", (0, "UNSIGNED8", "2"), (1, "UNSIGNED32", request), (2, "UNSIGNED32", answer))


@pytest.mark.parametrize(
    ("more", "request_id", "answer_id"),
    [
        ("", 0x605, 0x585),
        (server("0x640", "0x5C1"), 0x640, 0x5C1),
        (server("0x640", "0x5C0"), 0x605, 0x585),  # a file that was written for node 64
        (server("$NODEID+0x600", "$NODEID+0x580"), 0x605, 0x585),
        (server("0x80000640", "0x800005C0"), 0x605, 0x585),  # the default server is there whatever is said
    ],
)
def test_sdo_cob_ids_come_from_the_file(more: str, request_id: int, answer_id: int) -> None:
    assert NodeServices.of(dictionary(more)) == ("arm", 5, request_id, answer_id)
