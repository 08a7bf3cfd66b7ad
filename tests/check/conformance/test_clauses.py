"""Clauses: what a file lacks is one skip with its reason, a tier does what it allows, and names are read as written."""

from __future__ import annotations

from pathlib import Path

import pytest

from eurobot_od.check.conformance import step
from eurobot_od.check.conformance.clauses import Chapter, Clause, DeviceUnderTest, StepName, Tier, has, need, settable
from eurobot_od.check.conformance.nmt import GUARDED
from eurobot_od.check.conformance.objects import CHAPTER as OBJECTS
from eurobot_od.check.conformance.step import Data, Steps
from eurobot_od.od.dictionary import Dictionary
from eurobot_od.od.standard import HEARTBEAT_TIME
from tests.client.servo import SERVO
from tests.eds_text import DEVICE_TYPE, record, variable

CHAPTER = Chapter[DeviceUnderTest]("odd", "odd things", fresh=True)


@Clause(CHAPTER, "7.1", "Nothing needed")
def _alone(_: DeviceUnderTest) -> Steps:
    return [step.wait("2 ms"), step.wait("3 ms")]


@Clause(CHAPTER, "7.2", "A need", ctt="2.1", group="together", needs=[settable(HEARTBEAT_TIME, 5, lack="no 5 ms")])
def _grouped(_: DeviceUnderTest) -> Steps:
    return [step.wait("4 ms")]


@Clause(CHAPTER, "7.3", "Found on the way", name="whatever")
def _found_late(_: DeviceUnderTest) -> Steps:
    yield step.wait("5 ms")
    need(0, "there is none")


@Clause(CHAPTER, "7.4", "Twice", Tier.REVERSIBLE)
@Clause(CHAPTER, "7.4", "Twice", Tier.REVERSIBLE)
def _reversible(_: DeviceUnderTest) -> Steps:
    return [step.wait("6 ms")]


def made(heartbeat: str, tier: Tier = Tier.READING) -> list[Data]:
    text = DEVICE_TYPE + variable("1017", "Producer heartbeat time", "UNSIGNED16", "0", heartbeat)
    dictionary = Dictionary.read(text.encode(), Path("device.eds"), 5)
    steps: list[Data] = CHAPTER.suite(DeviceUnderTest(dictionary, tier), "tag", [], [])["steps"]
    return steps


def test_a_clause_that_the_file_lacks_is_one_skipped_step_with_the_reason() -> None:
    *alone, lacking, late, left_out = made("HighLimit=4\n")
    assert [each["name"] for each in alone] == ["7.1 Nothing needed: wait 2 ms [reading]",
                                                "7.1 Nothing needed: wait 3 ms [reading]"]  # fmt: skip
    assert lacking == {"name": "7.2 A need: together [reading, CTT 2.1]", "skip": "no 5 ms"}
    assert late == {"name": "7.3 Found on the way: whatever [reading]", "skip": "there is none"}
    assert left_out == {"name": "7.4 Twice: not done [reversible]", "skip": "only with --reversible"}


def test_a_device_without_an_error_register_is_asked_for_a_number_and_for_no_text() -> None:
    text = variable("1008", "Device name", "VISIBLE_STRING", "") + variable("1017", "Heartbeat", "UNSIGNED16", "0")
    dictionary = Dictionary.read(text.encode(), Path("device.eds"), 5)
    assert DeviceUnderTest(dictionary).probe == HEARTBEAT_TIME


@pytest.mark.parametrize(("entries", "is_done"), [(1, False), (2, True)])
def test_a_node_is_watched_twice_only_by_two_consumers(entries: int, is_done: bool) -> None:
    subs = ((sub, "UNSIGNED32", "0") for sub in range(1, entries + 1))
    text = DEVICE_TYPE + record(0x1016, "Consumers", (0, "UNSIGNED8", str(entries)), *subs)
    device = DeviceUnderTest(Dictionary.read(text.encode(), Path("device.eds"), 5), Tier.DESTRUCTIVE)
    steps: list[Data] = GUARDED.suite(device, "tag", [], [])["steps"]
    (twice,) = (each for each in steps if "a node is watched once" in each["name"])
    assert ("skip" not in twice) is is_done


@pytest.mark.parametrize(("inhibit", "is_prompt"), [(0, True), (1000, True), (1001, False)])
def test_an_emcy_that_may_come_late_is_not_waited_for(inhibit: int, is_prompt: bool) -> None:
    text = variable("1014", "EMCY", "UNSIGNED32", "0x85") + variable("1015", "Inhibit", "UNSIGNED16", str(inhibit))
    device = DeviceUnderTest(Dictionary.read((DEVICE_TYPE + text).encode(), Path("device.eds"), 5))
    assert has(device.need_prompt_emcy) is is_prompt


def test_a_raw_value_is_not_taken_for_a_physical_one() -> None:
    heartbeat, temperature = SERVO.variable(HEARTBEAT_TIME), SERVO.variable((0x2001, 0))
    assert heartbeat is not None
    assert temperature is not None
    assert (step.raw(heartbeat, 215), step.raw(temperature, 215)) == (215, "raw:215")


def test_another_value_is_written_to_objects_of_the_maker_only() -> None:
    objects = (variable(index, "Speed", "UNSIGNED16", "0") for index in ("1017", "2000", "2001"))
    text = DEVICE_TYPE + "".join(objects).replace("PDOMapping=1", "PDOMapping=0")
    dictionary = Dictionary.read(text.encode(), Path("device.eds"), 5)
    steps: list[Data] = OBJECTS.suite(DeviceUnderTest(dictionary, Tier.DESTRUCTIVE), "tag", [], [])["steps"]
    written = [each["name"] for each in steps if "another value" in each["name"]]
    assert [name.split(": ")[1] for name in written] == ["0x2000:0 Speed", "0x2001:0 Speed"]


def test_a_group_of_a_fresh_chapter_begins_and_ends_with_a_reset() -> None:
    together = made("")[2]
    assert together["name"] == "7.2 A need: together [reading, CTT 2.1]"
    reset = ["NMT reset communication", "boot-up", "NMT pre-operational"]
    assert [each["name"] for each in together["steps"]] == [*reset, "wait 4 ms", *reset]
    assert [each.get("undo", "") for each in together["steps"]] == ["", "", "", "", "yes", "yes", "yes"]


def test_a_clause_of_an_allowed_tier_is_done() -> None:
    assert [each["wait"] for each in made("", Tier.REVERSIBLE)[-1:]] == ["6 ms"]


ALLOWED = {
    Tier.READING: {Tier.READING},
    Tier.REVERSIBLE: {Tier.READING, Tier.REVERSIBLE},
    Tier.DESTRUCTIVE: {Tier.READING, Tier.REVERSIBLE, Tier.DESTRUCTIVE},
    Tier.MOTION: {Tier.READING, Tier.REVERSIBLE, Tier.MOTION},  # who may move it may write as well
    Tier.OUTPUTS: {Tier.READING, Tier.REVERSIBLE, Tier.OUTPUTS},
}


def test_each_tier_allows_itself_and_those_below() -> None:
    assert {tier: {each for each in Tier if tier.allows(each)} for tier in Tier} == ALLOWED


NAMES = [
    "7.5.2.21 Identity: 0x1018:1 Vendor-ID [reading]",
    "7.2.4.3.17 Unknown sub-index: read 0x1000:1 [reading, CTT 2.5]",
    "7.5.2.37 TPDO transmission: TPDO 1 by event timer [reversible, CTT 3.5, 3.11, 3.17]",
    "7.2.2.2 TPDO transmission: TPDO 1 by SYNC in OPERATIONAL [reversible, CTT 3.6]: with each SYNC 1/2: it comes",
    "7.4.5 Writable: 0x2000:1 Speed: left [rpm] [reversible, CTT 4.9]: put back",
]


def test_a_step_name_is_parsed_as_written() -> None:
    assert [str(StepName.of(name)) for name in NAMES] == NAMES
    assert StepName.of("send Check Drive Request") is None


ASKED = {
    # the end of a name, and the numbers that its step asks
    "[reading]": (),
    "[reading, CTT 2.5]: the answer": ("2.5",),
    "[reading, CTT 3.6, 3.12]": ("3.6", "3.12"),
    "[reading]: a remote frame [CTT 7.2]": ("7.2",),
    "[reading, CTT 8.2]: over a reset [CTT 8.4]: restored": ("8.4",),
}


@pytest.mark.parametrize("end", ASKED)
def test_a_step_inside_a_group_may_have_its_own_number(end: str) -> None:
    name = StepName.of(f"7.4 x: y {end}")
    assert name is not None
    assert name.numbers == ASKED[end]
