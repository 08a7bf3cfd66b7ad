"""Conformance suites: green on a device that does what its file says, with a reason for all that is left out."""

from __future__ import annotations

import re
from collections import Counter
from collections.abc import Iterator, Mapping
from pathlib import Path

import pytest
import yaml

from eurobot_od.check.actions.nodes import Nmt
from eurobot_od.check.actions.objects import SdoRead, SdoWrite
from eurobot_od.check.conformance import suite
from eurobot_od.check.conformance.clauses import Tier
from eurobot_od.check.conformance.sdo import NO_NUMBER
from eurobot_od.check.conformance.step import Data, documents
from eurobot_od.check.on_bus import NodeUnderTest, run_simulated
from eurobot_od.check.report import Status, SuitePart
from eurobot_od.check.runner import RunOptions
from eurobot_od.check.suite import Step, Suite
from eurobot_od.check.tester import LATEST
from eurobot_od.device.faults import Leaving
from eurobot_od.device.nmt import NmtCommand
from eurobot_od.device.simulated import SimulatedDevice
from eurobot_od.frame import Frame
from eurobot_od.od.dictionary import Dictionary
from eurobot_od.od.objects import address_of
from eurobot_od.od.values import SDO_REQUEST_BASE, SDO_RESPONSE_BASE, Address, Value
from eurobot_od.support import texts
from tests.eds_text import DEVICE_TYPE, pdo, record, variable
from tests.kit import plant
from tests.kit.devices import (
    AXIS_DRIVE,
    IO_MODULE,
    MAKERS,
    MODULE,
    NODE_ID,
    SAMPLES,
    asked_for_everything,
    read,
    red,
    steps,
    suites,
    suites_of,
)

LONG = ("clean.eds", "compact_drive.eds", "configured.dcf", "editor_with_comments.eds", "generated.eds")
FILES = [
    pytest.param(each, marks=pytest.mark.long) if each.name in LONG else each
    for each in sorted(SAMPLES.iterdir())
    if not each.name.startswith("broken_by_hand")
]
MADE = sorted(MAKERS.glob("*.eds"))
CLAUSE = re.compile(r"7\.\d(\.\d+)* [A-Z]")


@pytest.mark.parametrize("file", FILES, ids=lambda file: file.name)
def test_no_step_is_red_on_a_device_made_from_its_file(file: Path) -> None:
    assert red(asked_for_everything(file, Tier.REVERSIBLE).steps) == []


@pytest.mark.long
@pytest.mark.parametrize("file", MADE, ids=lambda file: file.stem)
def test_no_step_is_red_on_a_manufacturers_device_in_all_tiers(file: Path) -> None:
    assert red(asked_for_everything(file).steps) == []


@pytest.mark.long
def test_no_step_is_red_on_a_node_that_acts_on_written_values() -> None:
    assert red(steps(suites(plant.load("lift").file))) == []


@pytest.mark.long
def test_each_step_begins_with_its_clause_and_says_why_it_is_skipped() -> None:
    for each in steps(suites(MODULE)):
        assert CLAUSE.match(each.name)
        assert each.status is Status.PASSED or (each.reason and each.reason.what)


ASKED = [
    "7.4.5 Writable: 0x2001:1 Output: the value it has [reversible, CTT 4.9]: it is written",
    "7.2.4.3.8 SDO block download: 0x1017:0 Producer heartbeat time, block [reading, CTT 2.25]: its own value",
    "7.5.2.4 Error history: 0 clears it [destructive]: 0 is written",
    "7.3.2.2.3 Values: 0x1017:0 Producer heartbeat time after reset [reversible, CTT 9.1]: what was not stored is gone",
    "7.5.2.4 Error history: 0 clears it [destructive]: no error is left",
    "7.5.2.37 TPDO transmission: TPDO 1 by event timer in STOPPED [reversible, CTT 3.11]: none comes",
    "7.5.2.21 Identity: 0x1018:1 Vendor-ID [reading]",
    "7.5.2.35 RPDO communication: RPDO 2 keeps its identifier [reversible]: another identifier while it is valid",
    "7.5.2.37 TPDO communication: TPDO 1 keeps its inhibit time [reversible]: nothing has changed",
]


@pytest.mark.long
def test_a_device_with_every_service_has_every_step() -> None:
    passed = [each.name for each in asked_for_everything(MODULE).steps if each.status is Status.PASSED]
    assert [each for each in ASKED if each not in passed] == []
    assert sum("changed in order, and not otherwise [" in each for each in passed) >= 4


ASKED_OF_MAKERS = {
    # a file, and steps that only such a device can be asked
    IO_MODULE: [
        "TPDO 2 by remote frame in OPERATIONAL [reversible, CTT 3.3]: it comes",
        "TPDO 2 by event timer in STOPPED [reversible, CTT 3.11]: none comes",
        "0x2000:0 Password [reading, CTT 2.4]",
    ],
    AXIS_DRIVE: [
        "TPDO 2 from SYNC 3 on in OPERATIONAL [destructive, CTT 3.8]: it comes",
        "further servers after reset communication [reversible, CTT 2.29]: 0x1201:1 COB-ID client to server",
        "0x1280 [destructive, CTT 2.30]: over a reset: 0x1280:1 is kept",
    ],
}


@pytest.mark.parametrize("file", ASKED_OF_MAKERS)
def test_a_manufacturers_device_has_the_steps_for_its_objects(file: Path) -> None:
    passed = [each.name for each in asked_for_everything(file).steps if each.status is Status.PASSED]
    assert [step for step in ASKED_OF_MAKERS[file] if not any(each.endswith(step) for each in passed)] == []


LACKING = [
    # a file, a chapter's clause, and why its steps are skipped
    ("old.eds", "7.5.2.20", "the file has no producer heartbeat time (0x1017) that can be read, written, put back"),
    ("old.eds", "7.2.4.3.7", "the file has no object of more than 4 bytes whose value is known"),
    ("old.eds", "7.5.2.36", "the file has no RPDO"),
    ("old.eds", "7.2.7", "the file has no valid EMCY (0x1014)"),
    ("sloppy_sensor.eds", "7.2.2.2", "the file has no SYNC (0x1005)"),
    ("old.eds", "7.4.5", "only with --destructive"),
]


@pytest.mark.parametrize(("name", "clause", "reason"), LACKING)
def test_a_step_for_something_that_the_file_lacks_is_skipped_with_the_reason(
    name: str, clause: str, reason: str
) -> None:
    done = asked_for_everything(SAMPLES / name, Tier.REVERSIBLE).steps
    skipped = [each for each in done if each.status is Status.SKIPPED]
    reasons = [each.reason.what for each in skipped if each.reason and each.name.startswith(f"{clause} ")]
    assert any(each.startswith(reason) for each in reasons), reasons


HEARTBEAT_LIMITS = {
    # of 0x1017, its default, and whether its states can be watched
    "": ("0", True),
    "LowLimit=150": ("200", True),
    "LowLimit=0xFFFF": ("0xFFFF", False),  # none comes while a step looks
    "HighLimit=0": ("0", False),  # none ever comes
}


@pytest.mark.parametrize("limits", HEARTBEAT_LIMITS)
def test_states_are_followed_by_fast_heartbeats_or_skipped(limits: str) -> None:
    default, watched = HEARTBEAT_LIMITS[limits]
    text = DEVICE_TYPE + variable("1017", "Producer heartbeat time", "UNSIGNED16", default, limits)
    dictionary = Dictionary.read(text.encode(), Path("device.eds"), NODE_ID)
    (asked,) = [each for each in suites_of(dictionary, Tier.DESTRUCTIVE) if "nmt" in each.tags]
    done = list(steps([asked]))
    assert red(done) == []
    assert any(each.status is Status.PASSED and "heartbeat says stopped" in each.name for each in done) is watched


def made(*records: str) -> str:
    """Return the suite of a device with a device type and little else."""
    text = DEVICE_TYPE + "".join(records)
    return suite.text(Dictionary.read(text.encode(), Path("device.eds"), NODE_ID))


GUARDED = variable("100C", "Guard time", "UNSIGNED16", "0") + variable("100D", "Life time factor", "UNSIGNED8", "0")
NO_ACCESS = variable("2000", "Value", "UNSIGNED16", "7").replace("AccessType=rw", "AccessType=UNKNOWN")
NARROW = record(0x1018, "Identity", (0, "UNSIGNED8", "2"), (1, "UNSIGNED16", None), (2, "UNSIGNED16", "7"))


@pytest.mark.parametrize(
    "text",
    [
        variable("2000", "Name", "VISIBLE_STRING", None),  # no number to ask for, and no 0x1000
        DEVICE_TYPE + variable("100C", "Guard time", "UNSIGNED16", None),  # whose value nobody knows
        DEVICE_TYPE + GUARDED + variable("1F80", "NMT startup", "UNSIGNED32", "0"),  # it starts itself
        DEVICE_TYPE + pdo(0x1400, "0x20000010", cob_id="0x205") + NO_ACCESS,
        "[DeviceInfo]\nVendorNumber=84078612\nProductNumber=84078612\n" + DEVICE_TYPE + NARROW,
    ],
)
def test_a_device_of_few_objects_is_green(text: str) -> None:
    dictionary = Dictionary.read(text.encode(), Path("little.eds"), NODE_ID)
    assert red(steps(suites_of(dictionary, Tier.DESTRUCTIVE))) == []


def test_an_identity_without_a_default_is_that_of_the_device_info() -> None:
    identity = record(0x1018, "Identity", (0, "UNSIGNED8", "1"), (1, "UNSIGNED32", None))
    step = 'Identity: 0x1018:1 Entry 1 [reading]", sdo: {read: "0x1018:1", data: "42 00 00 00"}'
    assert step in made(identity, "[DeviceInfo]\nVendorNumber=0x42\n")
    assert "the file does not say it" in made(identity)


def test_a_number_of_the_device_info_that_its_object_cannot_have_is_skipped() -> None:
    identity = record(0x1018, "Identity", (0, "UNSIGNED8", "2"), (1, "UNSIGNED16", None), (2, "VISIBLE_STRING", None))
    text = made(identity, "[DeviceInfo]\nVendorNumber=84078612\nProductNumber=7\n")
    assert "[DeviceInfo] of the file: 84078612 is not UNSIGNED16" in text
    assert "[DeviceInfo] of the file: 7 is not VISIBLE_STRING" in text


def test_without_a_writable_integer_none_is_written() -> None:
    assert NO_NUMBER in made()


def test_objects_excluded_by_their_objflags_are_not_used() -> None:
    done = [step.action for each in suites(AXIS_DRIVE, Tier.DESTRUCTIVE) for step in all_steps(each)]
    touched = {address_of(each.variable) for each in done if isinstance(each, (SdoRead, SdoWrite))}
    assert (0x2100, 0) in touched
    assert (0x2101, 0) not in touched


def test_a_device_whose_node_id_the_defaults_would_move_is_not_restored() -> None:
    commands = (record(index, name, (0, "UNSIGNED8", "1"), (1, "UNSIGNED32", "1")) for index, name in
                ((0x1010, "Store"), (0x1011, "Restore")))  # fmt: skip
    heartbeat = variable("1017", "Producer heartbeat time", "UNSIGNED16", "0")
    node_id = variable("5900", "Node-ID", "UNSIGNED8", "1", "LowLimit=1\nHighLimit=127\n")
    text = DEVICE_TYPE + "".join(commands) + heartbeat + node_id
    done = list(steps(suites_of(Dictionary.read(text.encode(), Path("moved.eds"), NODE_ID), Tier.DESTRUCTIVE)))
    assert red(done) == []
    assert "0x1011 would make the device node 1, as its file says" in {each.reason.what for each in done if each.reason}


def test_manufacturer_defaults_are_never_restored() -> None:
    written = suite.text(Dictionary.load(AXIS_DRIVE, NODE_ID), Tier.DESTRUCTIVE)
    assert 'write: "0x1011:1", data: "6c 6f 61 64"' in written
    assert 'write: "0x1011:4"' not in written


@pytest.mark.long
def test_a_step_is_named_once_within_its_suite() -> None:
    for each in suites(MODULE):
        names = Counter(step.name for step in each.steps)
        assert [name for name, count in names.items() if count > 1] == []


# What is put back


def values(device: SimulatedDevice) -> dict[Address, Value]:
    return {address: device.device.objects.kept(address) for address in device.device.dictionary.addresses()}


SLOW = ("error-control", "storage")


@pytest.mark.parametrize(
    "chapter", [pytest.param(each.word, marks=pytest.mark.long if each.word in SLOW else ()) for each in suite.CHAPTERS]
)
def test_all_values_are_put_back(chapter: str) -> None:
    """Without the reset at the end, which would hide what is not."""
    made: list[SimulatedDevice] = []

    def make(dictionaries: Mapping[str, Dictionary], _seed: int, _clock: object) -> list[NodeUnderTest]:
        made.extend(map(SimulatedDevice, dictionaries.values()))
        return list(map(NodeUnderTest, made))

    before = values(SimulatedDevice.load(MODULE, NODE_ID))
    (asked,) = suites(MODULE, chapter=chapter)
    run_simulated(asked._replace(teardown=()), RunOptions(keep_going=True), make)
    assert values(made[0]) == before


def written(several: tuple[Step, ...]) -> Iterator[Address]:
    for each in several:
        yield from written(getattr(each.action, "steps", ()))
        if isinstance(each.action, SdoWrite) and each.action.abort is None:
            yield address_of(each.action.variable)


def test_nothing_is_stored_unless_it_is_asked_for() -> None:
    commands = {(0x1010, 1), (0x1011, 1)}
    for tier in (Tier.READING, Tier.REVERSIBLE, Tier.DESTRUCTIVE):
        found = {address for each in suites(MODULE, tier) for address in written(each.steps)}
        assert found & commands == (commands if tier is Tier.DESTRUCTIVE else set())


@pytest.mark.long
def test_reading_writes_nothing_but_the_heartbeat_time_and_commands_nobody() -> None:
    device = SimulatedDevice.load(MODULE, NODE_ID)
    asked = []
    device.device.objects.write = lambda *written: asked.append(written)  # type: ignore[method-assign]
    for each in suites(MODULE, Tier.READING):
        before = {*device.device.objects.values}
        run_simulated(each, RunOptions(keep_going=True), lambda *_: [NodeUnderTest(device)])
        assert {*device.device.objects.values} == before
        assert not [step for step in all_steps(each) if isinstance(step.action, Nmt)]
    assert {address for address, _ in asked} == {(0x1017, 0)}


def all_steps(each: Suite) -> Iterator[Step]:
    left = [*each.setup, *each.steps, *each.teardown]
    while left:
        step = left.pop()
        left += getattr(step.action, "steps", ())
        yield step


@pytest.mark.long
@pytest.mark.parametrize("tier", [Tier.READING, Tier.REVERSIBLE])
def test_a_run_compares_all_values_at_its_end(tier: Tier) -> None:
    """The device sets another object whenever its heartbeat time is written, and keeps that over resets."""
    kept: dict[Address, Value] = {}

    class Stubborn(SimulatedDevice):
        def receive(self, frame: Frame, now: float) -> list[Frame]:
            answers = super().receive(frame, now)
            if frame.cob_id == SDO_REQUEST_BASE + NODE_ID and frame.data[:3] == b"\x2b\x17\x10":
                kept[0x2006, 0] = 0
                self.device.objects.values |= kept
            return answers

        def reset(self) -> None:
            super().reset()
            self.device.objects.values |= kept

    done = steps(suites(MODULE, tier, "nmt"), Stubborn)  # its heartbeat clause writes that time
    proofs = [each for each in done if "as they were" in each.name]
    assert Status.FAILED in {each.status for each in proofs}


def test_a_destructive_suite_is_green_and_leaves_the_defaults() -> None:
    done = asked_for_everything(MODULE).steps
    assert red(done) == []
    assert any("stored and restored" in each.name and ": the default is back [CTT 8.4]" in each.name for each in done)
    assert any(each.name.startswith("7.4.5 Writable: 0x2006:0 Enabled: another value") for each in done)


@pytest.mark.long
@pytest.mark.parametrize(
    ("requests", "answers"),
    [
        ("0x601", "0x581"),  # copied from node 1: the server is at the device's own identifiers
        ("0x80000605", "0x80000585"),  # not valid: the server is there all the same
        ("0x650", "0x5D5"),  # moved
    ],
)
def test_a_device_is_green_wherever_its_file_has_the_sdo_server(requests: str, answers: str) -> None:
    # rw: it is asked for its default, too
    channel = (0, "UNSIGNED8", "2"), (1, "UNSIGNED32", requests), (2, "UNSIGNED32", answers)
    heartbeat = variable("1017", "Producer heartbeat time", "UNSIGNED16", "0")
    text = DEVICE_TYPE + heartbeat + record(0x1200, "SDO server", *channel)
    done = list(steps(suites_of(Dictionary.read(text.encode(), Path("moved.eds"), NODE_ID))))
    assert red(done) == []
    assert any("0x1017" in each.name for each in done if each.status is Status.PASSED)


def test_each_suite_that_may_reset_begins_and_ends_with_it() -> None:
    for each in suites(MODULE):
        first, last = each.setup[0].action, each.teardown[0].action
        assert isinstance(first, Nmt)
        assert isinstance(last, Nmt)
        assert first.command is last.command is NmtCommand.RESET_NODE


def only_says(address: bytes) -> type[SimulatedDevice]:
    """A device that confirms what is written to an object, and does nothing."""

    class OnlySays(SimulatedDevice):
        def receive(self, frame: Frame, now: float) -> list[Frame]:
            if frame.cob_id == SDO_REQUEST_BASE + NODE_ID and frame.data[0] >> 5 == 1 and frame.data[1:4] == address:
                return [Frame(SDO_RESPONSE_BASE + NODE_ID, b"\x60" + address + bytes(4))]
            return super().receive(frame, now)

    return OnlySays


@pytest.mark.long
@pytest.mark.parametrize(("address", "step"), [(b"\x10\x10\1", "it is kept"), (b"\x11\x10\1", "the default is back")])
def test_a_device_that_confirms_but_does_not_store_or_restore_is_red(address: bytes, step: str) -> None:
    done = steps(suites(MODULE, Tier.DESTRUCTIVE, "storage"), only_says(address))
    failed = [each.name for each in done if each.status is Status.FAILED]
    assert any("stored and restored" in each and f": {step} [CTT" in each for each in failed), failed


# Devices that are no help


class Mute(Leaving, SimulatedDevice):
    """A device whose plug is out."""

    def outgoing(self, frames: list[Frame]) -> list[Frame]:
        return []


def test_without_an_answer_the_first_step_is_red_and_the_rest_skipped() -> None:
    statuses = Counter(each.status for each in steps(suites(MODULE), Mute) if each.section is not SuitePart.TEARDOWN)
    assert statuses[Status.FAILED] == len(suite.CHAPTERS)
    assert statuses[Status.PASSED] == len(suite.CHAPTERS)  # the NMT command before


STEPS: list[tuple[Data, str]] = [
    # a step, and its line
    (
        {"name": "read", "sdo": {"read": "0x1017:0", "expect": 500}},
        '- {name: "read", sdo: {read: "0x1017:0", expect: 500}}',
    ),
    ({"name": "on", "nmt": "reset communication"}, '- {name: "on", nmt: reset communication}'),
    (
        {"name": "x", "sdo": {"write": "0x1000:0", "data": "00", "abort": ["0x06010002"]}},
        '- {name: "x", sdo: {write: "0x1000:0", data: "00", abort: [0x06010002]}}',
    ),
    ({"name": "wait", "wait": "50 ms"}, '- {name: "wait", wait: 50 ms}'),
]


TIMED = {
    "again and again, 100 ms apart at most": "7.5.2.37: the event timer",
    "a heartbeat after the new time": "7.5.2.20: the heartbeat time",
    "a heartbeat, its toggle bit always 0": "7.5.2.20: the heartbeat time",
    "SYNC": "7.5.2.6: the period of SYNC",
}
"""Steps whose time a clause names, by the beginning of their name: all others may take as long as a late answer."""


def test_only_steps_with_a_time_from_a_clause_wait_less_than_for_a_late_answer() -> None:
    short = set()
    for each in yaml.safe_load_all(suite.text(Dictionary.load(MODULE, NODE_ID), Tier.DESTRUCTIVE)):
        left = [*each["setup"], *each["steps"], *each["teardown"]]
        while left:
            step = left.pop()
            left += step.get("steps", [])
            if texts.seconds(step.get("within", "1 min")) < LATEST:
                short.add(step["name"].split(" [")[0])
    assert {each for each in short if not each.startswith(tuple(TIMED))} == set()


def test_a_step_is_one_line() -> None:
    lines = "".join(f"  {line}\n" for _, line in STEPS)
    assert documents([{"steps": [step for step, _ in STEPS]}]) == f"---\nsteps:\n{lines}"


NAMES = [
    "Motor speed",
    'with "quotes" and \\backslashes\\',
    "[brackets], {braces}: and # more",
    "no",
    "012",
    "Größe µm",
    "tab\tand \x07 bell \x9f",
    "x" * 1000,
    "- dash",
    "{present}",
    "%s",
]


RENAMED = ["Measured value", "Output", "Output mode", "Input", "Channel 1", "Channel 2", "Channel 3", "Factor", "Key",
           "Enabled", "Set value", "Unit"]  # fmt: skip
"""Names in the sample, one for each of those above, and more."""


def test_any_parametername_is_read_back_from_the_suite(tmp_path: Path) -> None:
    text = MODULE.read_text()
    for before, name in zip(RENAMED, NAMES, strict=False):
        assert text.count(f"ParameterName={before}\n") == 1
        text = text.replace(f"ParameterName={before}\n", f"ParameterName={name}\n")
    assert len(NAMES) <= len(RENAMED)
    file = tmp_path / "odd name [1].eds"
    file.write_text(text, encoding="latin-1", errors="replace")
    dictionary = Dictionary.load(file, NODE_ID)
    suites = suite.text(dictionary)
    assert len(list(yaml.safe_load_all(suites))) == len(suite.CHAPTERS)
    assert len(read(dictionary, suites)) == len(suite.CHAPTERS)
