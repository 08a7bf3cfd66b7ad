"""Suites are read as they are written, and whatever is wrong in them is reported with its place."""

from __future__ import annotations

import re
from pathlib import Path

import pytest

from eurobot_od.check.actions.frames import Expect, Poll, Send
from eurobot_od.check.actions.nodes import Nmt
from eurobot_od.check.actions.objects import SdoWrite
from eurobot_od.check.suite import HEARTBEAT, FramePattern, Group, MessagePattern, Order, ServicePattern
from eurobot_od.device.nmt import NmtCommand, NmtState
from eurobot_od.errors import YamlError
from eurobot_od.frame import Frame, RemoteFrame
from eurobot_od.od.objects import address_of
from tests.check.suites import HEAD, document, read, reader, suite
from tests.marks import marked
from tests.rows import rows

RANGE = "'3001' is not allowed; allowed: 0..3000 mm; {raw: '202#...'} sends any bits"
MOVE = "{Move To: {x: 1, y: 2, angle: 3, speed: 4}}"

# Each row: a step, with ^ before the place of the problem, and what is said about it.
WRONG_STEPS = {
    # keys
    "no action": ("- ^{name: nothing}", "no action; a step has one of send, answer, expect, await, never"),
    "unknown action": ("- ^snd: Halt Lift", "unknown action 'snd'; did you mean send?"),
    "two actions": ("- {send: Halt Lift, ^wait: 1 s}", "a step has one action, and 'send' is one already"),
    "key of another action": ("- {send: Halt Lift, ^within: 1 s}", "unknown key 'within'; known: send, name"),
    "missing key": ("- ^never: Move Confirm", "key 'for' is missing: how long"),
    "missing key inside": ("- poll: ^{send: Halt Lift}\n  until: Move Confirm", "key 'every' is missing"),
    "key twice": ("- {wait: 1 s, ^wait: 2 s}", "key 'wait' is given twice"),
    "no mapping": ("- ^Halt Lift", "expected a mapping, `key: value`, found 'Halt Lift'"),
    # durations
    "no unit": ("- wait: ^500", "'500' is not a duration; write a number and one of us, ms, s, min"),
    "unknown unit": ("- wait: ^1 h", "'1 h' is not a duration"),
    "base 60": ("- wait: ^12:30", "'12:30' is not a duration"),
    "nothing to send": ("- poll: ^{every: 1 s}\n  until: Move Confirm", "key 'send' is missing"),
    "no period": ("- poll: {send: Halt Lift, every: ^0 s}\n  until: Move Confirm", "this time has to be longer"),
    "negative": ("- wait: ^-1 s", "'-1 s' is not a duration"),
    # messages and fields
    "unknown message": ("- send: ^Halt Lyft", "unknown message 'Halt Lyft'; did you mean Halt Lift?"),
    "unknown expected message": ("- expect: ^Move Confrm", "unknown message 'Move Confrm'; did you mean"),
    "unknown field": ("- expect: {Move State Response: {^tme: 3}}", "unknown field of Move State Response 'tme'"),
    "field twice": ("- expect: {Move State Response: {time: 3, ^time: 4}}", "key 'time' is given twice"),
    "field missing": ("- send: ^{Move To: {x: 1, y: 2}}", "Move To: angle, speed missing"),
    "two messages": ("- send: ^{Halt Lift: {}, Move Confirm: {}}", "expected one message, found 2 keys"),
    "list for fields": ("- send: {Move To: ^[1]}", "expected a mapping, `key: value`, found a list"),
    "list for a value": ("- expect: {Move State Response: {time: ^[1]}}", "expected a single value, found a list"),
    # values
    "over the range": (f"- send: {MOVE.replace('x: 1', 'x: ^3001')}", RANGE),
    "octal": (f"- send: {MOVE.replace('x: 1', 'x: ^010')}", "'010' is not allowed"),
    "no whole number": (f"- send: {MOVE.replace('x: 1', 'x: ^1.5')}", "'1.5' is not allowed"),
    "truth for a colour": ("- expect: {Order Set: {colour: ^off}}", "'off' is not allowed"),
    "expectation to be sent": (f"- send: {MOVE.replace('x: 1', 'x: ^1 +- 3')}", "'1 +- 3' is not allowed"),
    "no tolerance": ("- expect: {Move State Response: {time: ^3 +- x}}", "'x' is not allowed"),
    "unknown variable": ("- expect: {Move State Response: {time: ^'{t}'}}", "unknown variable 't'"),
    "unknown barrier": (f"- send: {MOVE.replace('4}', '4, gates: {^gate 7: locked}}')}", "unknown gate 'gate 7'"),
    "unknown passage": (
        f"- send: {MOVE.replace('4}', '4, gates: {gate 1: ^f}}')}",
        "unknown state 'f'; known: free",
    ),
    "half a place": (
        "- send: ^{Place Response: {x: unknown, y: 3, angle: 4, source: encoder}}",
        "Place Response: x = None is not allowed",
    ),
    # raw frames
    "identifier over 11 bits": ("- send: {raw: ^'900#'}", "expected a frame such as 008#D27423, found '900#'"),
    "remote frame of nine bytes": ("- send: {raw: ^'705#R9'}", "expected a frame such as 008#D27423"),
    "half a byte": ("- send: {raw: ^'202#123'}", "expected a frame such as 008#D27423"),
    "nine bytes": ("- send: {raw: ^'202#112233445566778899'}", "expected a frame such as 008#D27423"),
    "any digit to be sent": ("- send: {raw: ^'202#1?'}", "expected a frame such as 008#D27423"),
    # services
    "unknown state": ("- heartbeat: ^awake", "unknown NMT state 'awake'; known: boot-up"),
    "unknown command": ("- nmt: ^restart", "unknown NMT command 'restart'"),
    "state for a command": ("- nmt: ^operational", "'operational' is a state; the NMT command is start"),
    "abort code without a digit": (
        "- sdo: {read: 0x5000, abort: ^0x0602000}",
        "'0x0602000' is not an abort code of 8 hexadecimal digits; did you mean 0x06020000",
    ),
    "abort code of several": ("- sdo: {read: 0x5000, abort: [0x06020000, ^0x6]}", "'0x6' is not an abort code of 8"),
    "another sign of a tolerance": (
        "- expect: {Move State Response: {time: ^20 +/- 1}}",
        "'20 +/- 1' is not allowed; allowed: 0..1048575 ms, unknown, blocked, not possible; also 20 +- 1, 15..25, >",
    ),
    "unknown unit of an object": (
        "- sdo: {read: 0x1017, expect: ^500 s}",
        "0x1017:0: Producer heartbeat time = '500 s' is not allowed; allowed: an integer without a unit; the unit is",
    ),
    "empty range": ("- expect: {Move State Response: {time: ^25..15}}", "'25..15' has no value: the smaller number"),
    "empty range of an object": ("- sdo: {read: 0x1017, expect: ^25..15}", "'25..15' has no value: the smaller number"),
    "range of names": ("- expect: {Place Response: {source: ^encoder..laser}}", "'encoder..laser' is not a range of"),
    "unknown node": ("- nmt: {command: reset, node: ^wheels}", "unknown node 'wheels'; known: panel, lift, scale"),
    "error code": ("- emcy: ^0x10000", "error code = '0x10000' is not allowed; allowed: whole numbers 0..65535"),
    "unknown object": (
        "- sdo: {read: ^Producer heartbet time}",
        "unknown object 'Producer heartbet time'; did you mean",
    ),
    "a record": (
        "- sdo: {read: ^0x1018}",
        "'0x1018' is not one object but a record of",
    ),
    "sub-index too high": ("- sdo: {read: ^0x1018:256}", "'0x1018:256': sub-index 256 is not in 0..255"),
    "nothing to do": ("- sdo: ^{expect: 3}", "an SDO step has either 'read' or 'write'"),
    "nothing to write": ("- sdo: ^{write: 0x1017}", "an SDO write has either 'value' or 'data'"),
    "refused and read": ("- sdo: ^{read: 0x1017, expect: 3, abort: 0x06020000}", "an SDO read that is refused with"),
    "read with a value": ("- sdo: {read: 0x1017, ^value: 3}", "unknown key 'value'; known: read, expect"),
    "value over the type": (
        "- sdo: {write: 0x1017, value: ^65536}",
        "0x1017:0: Producer heartbeat time = 65536 is not",
    ),
    "object without a type": ("- sdo: {write: 0x5000, value: ^1}", "0x5000:0 is not in the EDS of lift; use 'data'"),
    "no bytes": (
        "- sdo: {write: 0x1017, data: ^12 3}",
        "0x1017:0: Producer heartbeat time = '12 3' is",
    ),
    # counts
    "no times": (
        "- {wait: 1 s, repeat: ^0}",
        "a number of times = '0' is not allowed; allowed: whole numbers 1..100000",
    ),
    "too many times": (
        "- ^repeat: 400\n  steps: [{repeat: 251, wait: 1 s}]",
        "with the repetitions inside it 100400 steps",
    ),
    "more digits than a number has": (f"- {{wait: 1 s, repeat: ^{'9' * 4400}}}", "a number of times = '9999"),
    "longer than a day": ("- wait: ^86401 s", "86401 s is too long: at most 86400 s, a day"),
    "for ever": (f"- wait: ^{'9' * 400} s", "'999"),
    "a value of two lines": ('- expect: {Move To: {x: ^"a\\nb"}}', "'a\\nb' is not allowed"),
    "hexadecimal for ever": (f"- expect: {{Move To: {{x: ^0x{'F' * 5000}}}}}", "'0xFFF"),
    "half a time": ("- {wait: 1 s, repeat: ^1.5}", "a number of times = '1.5' is not allowed"),
    # variables
    "no name": ("- save: {^a-b: Move State Response.time}", "expected a name of letters, digits and _, found 'a-b'"),
    "no field": ("- save: {t: ^Move State Response}", "unknown field of Move State Response"),
    "unknown field to save": ("- save: {t: ^Move State Response.x}", "unknown field of Move State Response 'x'"),
}

# Each row: a document, with ^ before the place of the problem, and what is said about it.
WRONG_DOCUMENTS = {
    "nothing": ("^", "the file is empty"),
    "no mapping": ("^- 1\n", "expected a mapping (keys: spec, name, node, dialect, "),
    "tab": ("spec: 1\nsteps:\n^\t- wait: 1 s\n", "a tab; YAML is indented by spaces"),
    "no YAML": ("spec: [1\nname^: x\n", "a list in [ ] lacks a comma, or its ]"),
    "nested deeply": ("^" + "[" * 1000, "the file is nested too deeply"),
    "alias": ("spec: 1\nname: ^&a x\ntags: [*a]\nsteps: [skip: x]\n", "an alias refers to this; write it out"),
    "alias of itself": ("spec: 1\nname: x\nsteps: ^&a [*a]\n", "an alias refers to this; write it out"),
    "version": (HEAD.replace("1", "^2") + "steps: [skip: x]\n", "unknown version '2'; known: 1"),
    "no steps": ("^" + HEAD, "key 'steps' is missing: the steps"),
    "no version": ("^name: x\nsteps: [skip: x]\n", "key 'spec' is missing: version of the format, `spec: 1`"),
    "an expectation without quotes": (
        HEAD + "steps:\n  - expect: {Move State Response: {time: ^> 0}}\n",
        "a text with > or | at its start needs quotes: '> 0'",
    ),
    "empty steps": (HEAD + "steps: ^[]\n", "expected at least one entry"),
    "unknown key": (HEAD + "^step: []\nsteps: [skip: x]\n", "unknown key 'step'; did you mean steps?"),
    "truth for a name": (HEAD.replace("a suite", "^off") + "steps: [skip: x]\n", "expected a text, found 'off'"),
    "unknown node": (HEAD.replace("lift", "^wheels") + "steps: [skip: x]\n", "unknown node 'wheels'"),
    "unknown dialect": (HEAD + "dialect: ^latin\nsteps: [skip: x]\n", "unknown dialect 'latin'"),
    "steps no list": (HEAD + "steps: ^5\n", "expected a list, found '5'"),
    "constant not allowed": (
        HEAD + "variables: {v: 500}\nsteps:\n  - expect: {Move To: {speed: ^'{v}'}}\n",
        "'500' is not allowed; allowed: 0..100 %",
    ),
    "which node": (HEAD.replace("lift", "[lift, panel]") + "steps:\n  - heartbeat: ^any\n", "which node? Write it"),
}


@rows("step, what", WRONG_STEPS.values())
def test_an_error_in_a_step_has_place_and_reason(step: str, what: str) -> None:
    text, place = marked(document(step))
    (problem,) = read(text)[1]
    assert problem.startswith(f"{place}: {what}")


@pytest.mark.parametrize(("text", "what"), WRONG_DOCUMENTS.values())
def test_an_error_in_a_document_has_place_and_reason(text: str, what: str) -> None:
    text, place = marked(text)
    (problem,) = read(text)[1]
    assert problem.startswith(f"{place}: {what}")


def test_one_error_lists_the_problems_of_all_files(tmp_path: Path) -> None:
    one, other, missing, latin = (tmp_path / name for name in ("one.yaml", "other.yaml", "missing.yaml", "latin.yaml"))
    one.write_text(document("- wait: 1\n- send: Halt Lft\n- {send: Halt Lift, for: 1 s, wthin: x}"))
    other.write_text("a: [")
    latin.write_bytes("spec: 1 # Zürich".encode("latin-1"))
    with pytest.raises(YamlError) as error:
        reader(None).read_files([one, other, missing, latin])
    places = [line.split(": ")[0] for line in str(error.value).splitlines()]
    assert places == [
        *(f"{one}:{place}" for place in ("5:11", "6:11", "7:23", "7:33")),
        f"{other}:1:5",
        f"{missing}:1:1",
        f"{latin}:1:1",
    ]


def action(step: str, head: str = HEAD) -> object:
    return suite(document(step, head)).steps[0].action


@pytest.mark.parametrize(
    ("step", "frame"),
    [
        ("- send: Halt Lift", Frame(0x381)),
        ("- send: {Halt Lift: }", Frame(0x381)),
        ("- send: halt lift", Frame(0x381)),  # case does not matter
        ("- send: {raw: 202#d274}", Frame(0x202, b"\xd2\x74")),
        ("- send: {raw: '705#R1'}", RemoteFrame(0x705, b"\0")),
        ("- send: {raw: '185#R'}", RemoteFrame(0x185)),
        (
            "- send: {Move To: {x: 1234, Y position: 567 mm, angle: 89, Speed: 75, gates: 0xA5C3}}",
            Frame(0x202, bytes.fromhex("D27423592C01C3A5")),
        ),
        (
            "- send: {Order Set: {colour: blue, boxes: 12, Rows: 2}}",
            Frame(0x481, bytes.fromhex("1901")),
        ),
    ],
)
def test_sent_frames_are_read(step: str, frame: Frame) -> None:
    sent = action(step)
    assert isinstance(sent, Send)
    assert sent.sent.frame({}) == frame
    assert sent.sent.frame({}).is_remote == frame.is_remote


def test_keyed_values_are_read_by_name() -> None:
    by_name = action("- send: {Move To: {x: 1, y: 1, angle: 0, speed: 1, gates: {gate 2: locked, gate 4: shut}}}")
    by_number = action("- send: {Move To: {x: 1, y: 1, angle: 0, speed: 1, gates: 0x48}}")
    assert isinstance(by_name, Send)
    assert isinstance(by_number, Send)
    assert by_name.sent.frame({}) == by_number.sent.frame({})


@pytest.mark.parametrize(
    ("step", "order", "kinds"),
    [
        ("- expect: Move Confirm", Order.IN_ORDER, [MessagePattern]),
        ("- expect: {raw: '701#??'}", Order.IN_ORDER, [FramePattern]),
        ("- expect: [Move Confirm, {emcy: any}]", Order.IN_ORDER, [MessagePattern, ServicePattern]),
        ("- expect: {all: [Move Confirm, {heartbeat: stopped}]}", Order.ALL, [MessagePattern, ServicePattern]),
        ("- expect: {any: [Move Confirm]}", Order.ANY, [MessagePattern]),
        ("- heartbeat: operational", Order.IN_ORDER, [ServicePattern]),
        ("- emcy: {code: 0x8210, node: panel}", Order.IN_ORDER, [ServicePattern]),
    ],
)
def test_expected_frames_are_read(step: str, order: Order, kinds: list[type]) -> None:
    expect = action(step)
    assert isinstance(expect, Expect)
    assert expect.expected.order is order
    assert [type(each) for each in expect.expected.patterns] == kinds


def test_services_have_the_cob_ids_of_the_nodes_eds() -> None:
    assert action("- nmt: reset") == Nmt(NmtCommand.RESET_NODE, 2)
    assert action("- nmt: {command: stop, node: scale}") == Nmt(NmtCommand.STOP, 3)
    assert action("- nmt: start", HEAD.replace("node: lift\n", "")) == Nmt(NmtCommand.START, 0)
    heartbeat = action("- heartbeat: {state: pre-operational, node: panel}")
    assert isinstance(heartbeat, Expect)
    assert heartbeat.expected.patterns == (ServicePattern(HEARTBEAT, "panel", 0x701, NmtState.PRE_OPERATIONAL),)


@pytest.mark.parametrize(
    ("step", "address", "content"),
    [
        ("{write: 0x1017, value: 500}", (0x1017, 0), b"\xf4\x01"),
        ("{write: Producer heartbeat time, value: 500}", (0x1017, 0), b"\xf4\x01"),
        ("{write: 0x2100:1, value: 5}", (0x2100, 1), b"\x05"),
        ("{write: Node.Node-ID, value: 200, abort: 0x06090031}", (0x2100, 1), b"\xc8"),  # over its limit, to be refused
        ("{write: 0x5000, data: 'E8 03 00'}", (0x5000, 0), b"\xe8\x03\x00"),
    ],
)
def test_objects_and_their_values_are_read(step: str, address: tuple[int, int], content: bytes) -> None:
    write = action(f"- sdo: {step}")
    assert isinstance(write, SdoWrite)
    assert (address_of(write.variable), write.content({})) == (address, content)


def test_a_group_is_read() -> None:
    group = suite(document("- repeat: 3\n  steps:\n    - wait: 1 s\n    - send: Halt Lift")).steps[0]
    assert group.repeat == 3
    assert isinstance(group.action, Group)
    assert [step.name for step in group.action.steps] == ["wait 1 s", "send Halt Lift"]


def test_times_are_read_in_seconds() -> None:
    poll = action("- poll: {send: Move State Request, every: 100 ms}\n  until: Move State Response\n  within: 2 min")
    assert isinstance(poll, Poll)
    assert poll.every == pytest.approx(0.1)
    assert poll.within == pytest.approx(120)


def test_several_documents_of_one_file_are_read() -> None:
    first, second = document("- wait: 1 s"), document("- wait: 2 s", HEAD.replace("a suite", "Zürich"))
    suites, problems = read(f"{first}---\n{second}")
    assert [each.name for each in suites] == ["a suite", "Zürich"]
    assert problems == []


def test_a_suite_is_read_by_its_own_dialect() -> None:
    text = document("- send: {Move To: {x: 1, y: 1, angle: 0, speed: 1, route: direct}}")
    assert "unknown field of Move To 'route'" in read(text)[1][0]
    assert read(text, "packed")[1] == []
    assert read(text.replace("node:", "dialect: packed\nnode:"))[1] == []


@pytest.mark.parametrize("text", ["a" + " " * 80_000 + "b", "{" + " " * 80_000, "x" * 80_000, "1" + ".." * 40_000])
def test_a_long_text_is_refused_in_a_time_that_does_not_grow_with_its_square(text: str) -> None:
    """It took 83 s; a whole suite of tests would notice."""
    for step in (f"- expect: {{Move To: {{x: '{text}'}}}}", f"- sdo: {{read: '{text}'}}", f"- expect: '{text}'"):
        assert len(read(document(step))[1]) == 1


GUIDE = (Path(__file__).parents[2] / "docs" / "checks.md").read_text()


def known(text: str) -> set[str]:
    """The keys or actions that the one problem of a text says are known."""
    (problem,) = read(text)[1]
    return set(re.findall(r"[a-z-]+", problem.partition("known: ")[2]))


def keys_of_the_format() -> set[str]:
    """All keys of suites and steps, as the reader names them."""
    keys = known(HEAD + "steps: [skip: x]\nzzz: 1\n")
    return keys | known(document("- zzz: 1")) | known(document("- {expect: Move Confirm, zzz: 1}"))


def test_the_guide_explains_every_key() -> None:
    keys = keys_of_the_format()
    assert {"teardown", "boot-up", "undo", "within"} < keys
    assert {each for each in keys if not re.search(rf"`{each}[`:]", GUIDE)} == set()
