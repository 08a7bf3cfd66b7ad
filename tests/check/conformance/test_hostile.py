"""Devices that mean no good: whatever they say, a run by CiA 301 ends, with a result for every step."""

from __future__ import annotations

import random
from collections.abc import Callable
from itertools import count

import pytest

from eurobot_od.check.conformance.clauses import Tier
from eurobot_od.check.report import Status
from eurobot_od.device.simulated import SimulatedDevice
from eurobot_od.frame import Frame
from eurobot_od.od.values import EMCY_BASE, ERROR_CONTROL_BASE, SDO_REQUEST_BASE, SDO_RESPONSE_BASE
from tests.kit.devices import MOTOR, NODE_ID, results, suites

Answers = Callable[[bytes, list[bytes]], list[bytes]]
"""What a device says in place of its answers to a request."""

DICE = random.Random(74)
UPLOAD, SEGMENT, BLOCK = 2, 3, 5
"""Client command specifiers of SDO (CiA 301, 7.2.4.3)."""


def endless(request: bytes, answers: list[bytes]) -> list[bytes]:
    if request[0] >> 5 == UPLOAD:
        return [b"\x40" + request[1:4] + bytes(4)]
    return [bytes([request[0] & 0x10]) + b"endless"] if request[0] >> 5 == SEGMENT else answers


def endless_blocks(request: bytes, answers: list[bytes]) -> list[bytes]:
    if request[0] >> 5 != BLOCK:
        return answers
    if request[0] & 3 == 0:
        return [b"\xc0" + request[1:4] + bytes(4)]
    return [bytes([number]) + b"endless" for number in range(1, 128)]


HOSTILE: dict[str, Answers] = {
    "an upload that never ends": endless,
    "a block upload that never ends": endless_blocks,
    "four gigabytes announced": lambda request, answers: (
        [b"\x41" + request[1:4] + b"\xff\xff\xff\xff"] if request[0] >> 5 == UPLOAD else answers
    ),
    "the same toggle bit always": lambda request, answers: (
        [b"\x00" + b"again. "] if request[0] >> 5 == SEGMENT else endless(request, answers)
    ),
    "everything twice": lambda _, answers: answers * 2,
    "a hundred answers": lambda _, answers: answers * 100,
    "answers about another object": lambda _, answers: [each[:1] + b"\x99\x99\x99" + each[4:] for each in answers],
    "bytes by chance": lambda _, answers: [DICE.randbytes(8) for _ in answers],
    "frames of any length": lambda _, answers: [DICE.randbytes(DICE.randrange(9)) for _ in answers],
    "frames of no length": lambda _, answers: [b"" for _ in answers],
    "an abort without an end": lambda request, _: [b"\x80" + request[1:4] + b"\xff\xff\xff\xff"] * 3,
    "our own requests": lambda request, _: [request],
    "a command that there is not": lambda request, _: [b"\xff" + request[1:]],
    "nothing, ever": lambda _, __: [],
}


def hostile(said: Answers) -> type[SimulatedDevice]:
    """Return a device that changes what its SDO server says."""

    class Hostile(SimulatedDevice):
        def receive(self, frame: Frame, now: float) -> list[Frame]:
            frames = super().receive(frame, now)
            if frame.cob_id != SDO_REQUEST_BASE + NODE_ID or len(frame.data) != 8:
                return frames
            answers = [each.data for each in frames if each.cob_id == SDO_RESPONSE_BASE + NODE_ID]
            return [Frame(SDO_RESPONSE_BASE + NODE_ID, each) for each in said(frame.data, answers)]

    return Hostile


class Shouting(SimulatedDevice):
    """Boots, reports errors and says impossible states after each frame that it hears."""

    COUNT = count()

    def receive(self, frame: Frame, now: float) -> list[Frame]:
        others = (
            Frame(ERROR_CONTROL_BASE + NODE_ID, b"\0"),
            Frame(ERROR_CONTROL_BASE + NODE_ID, b"\x33\x44"),
            Frame(EMCY_BASE + NODE_ID, next(self.COUNT).to_bytes(8, "little")),
        )
        return [*super().receive(frame, now), *others]


KINDS = {name: hostile(said) for name, said in HOSTILE.items()} | {"boots and errors all the time": Shouting}


SLOW = ("an upload that never ends", "a hundred answers")
"""Kinds that take seconds of the processor."""


@pytest.mark.parametrize("name", [pytest.param(each, marks=pytest.mark.long if each in SLOW else ()) for each in KINDS])
def test_a_run_against_a_hostile_device_ends_and_says_so(name: str) -> None:
    asked = suites(MOTOR, Tier.READING, "sdo")
    done = list(results(asked, KINDS[name]))
    assert len(done) == len(asked)
    assert not [each.error for each in done if each.error]
    found = {step.status for each in done for step in each.steps}
    assert found <= {Status.PASSED, Status.FAILED, Status.SKIPPED}
    assert (Status.FAILED in found) is (name in HOSTILE)
