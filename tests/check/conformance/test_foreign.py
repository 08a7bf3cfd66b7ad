"""Devices as other makers build them: what the standard lets them do is green, and one cause is one red step."""

from __future__ import annotations

import signal
from collections.abc import Iterable, Iterator
from math import inf

import pytest

from eurobot_od.check.conformance.clauses import Tier
from eurobot_od.check.on_bus import NodeUnderTest, run_simulated
from eurobot_od.check.report import Status, StepResult, changed, remarks
from eurobot_od.check.runner import Interrupt, RunOptions
from eurobot_od.check.suite import Report
from eurobot_od.device.faults import Leaving
from eurobot_od.device.nmt import NmtCommand, NmtState, error_control
from eurobot_od.device.node import Node
from eurobot_od.device.simulated import SimulatedDevice
from eurobot_od.frame import Frame
from eurobot_od.od.standard import DEVICE_TYPE, ERROR_REGISTER, VERIFY_CONFIGURATION
from eurobot_od.od.values import NMT_COB_ID, SDO_REQUEST_BASE, SDO_RESPONSE_BASE, Address, Value
from eurobot_od.sdo.wire import ABORT, AbortCode, Initiate
from tests.kit.devices import MODULE, NODE_ID, of_kind, suites
from tests.kit.faults import CONFORMANCE

GENERAL, NOT_TRANSFERRED, NOT_MAPPABLE, TOGGLE_BIT = (
    each.to_bytes(4, "little")
    for each in (AbortCode.GENERAL, AbortCode.NOT_TRANSFERRED, AbortCode.NOT_MAPPABLE, AbortCode.TOGGLE_BIT)
)
RESETS = (NmtCommand.RESET_NODE, NmtCommand.RESET_COMMUNICATION)


class LateReset(SimulatedDevice):
    """Resets 213 ms after the command, and answers until then."""

    LATE = 0.213
    _loses = -1.0

    def receive(self, frame: Frame, now: float) -> list[Frame]:
        if frame.cob_id == NMT_COB_ID and frame.data[0] in RESETS and frame.data[1] == NODE_ID:
            self._command = frame
            self.at(now + self.LATE, lambda _: None)
            self._loses = now + self.LATE
            return []
        return super().receive(frame, now)

    def tick(self, now: float) -> list[Frame]:
        frames = super().tick(now)
        if 0 <= self._loses <= now:
            self._loses = -1.0
            frames += super().receive(self._command, now)
        return frames


class LateHeartbeat(SimulatedDevice):
    """Answers guarding after 110 ms, and sends a heartbeat 150 ms after its time is written, even for 0."""

    def reset(self) -> None:
        super().reset()
        self._later = list[tuple[float, Frame | None]]()

    def _in(self, seconds: float, now: float, frame: Frame | None = None) -> None:
        self._later.append((now + seconds, frame))
        self.at(now + seconds, lambda _: None)

    def receive(self, frame: Frame, now: float) -> list[Frame]:
        if frame.cob_id == SDO_REQUEST_BASE + NODE_ID and frame.data.startswith(b"\x2b\x17\x10"):
            self._in(0.150, now)
        return super().receive(frame, now)

    def requested(self, cob_id: int, now: float) -> list[Frame]:
        for each in super().requested(cob_id, now):
            self._in(0.110, now, each)
        return []

    def tick(self, now: float) -> list[Frame]:
        frames, due = super().tick(now), [frame for at, frame in self._later if at <= now]
        self._later = [each for each in self._later if each[0] > now]
        return frames + [frame or error_control(NODE_ID, self.device.state) for frame in due]


class Answering(SimulatedDevice):
    """Gives another answer to some requests of its SDO server."""

    def receive(self, frame: Frame, now: float) -> list[Frame]:
        frames = super().receive(frame, now)
        if frame.cob_id != SDO_REQUEST_BASE + NODE_ID or len(frame.data) != 8:
            return frames
        return [each for answer in frames for each in self.said(frame.data, answer)]

    def said(self, request: bytes, answer: Frame) -> list[Frame]:
        return [answer]


class GeneralError(Answering):
    """Refuses with 08000000 where CiA's test tool lets it."""

    INSTEAD = (AbortCode.NO_OBJECT, AbortCode.NO_SUBINDEX, AbortCode.READ_ONLY, AbortCode.WRITE_ONLY,
               AbortCode.TOO_LONG, AbortCode.TOO_SHORT, AbortCode.TOO_LOW, AbortCode.TOO_HIGH)  # fmt: skip

    def said(self, request: bytes, answer: Frame) -> list[Frame]:
        # Not for mappings; and what is not there by default, such as an empty history, is another question.
        is_one = answer.data[0] == ABORT and Initiate.of(answer.data).number in self.INSTEAD
        if not is_one or request[2] in (0x16, 0x1A) or request[1:3] == b"\x03\x10":
            return [answer]
        return [Frame(answer.cob_id, answer.data[:4] + GENERAL)]


class AnsweredAbort(SimulatedDevice):
    """Answers a client's abort with one of its own."""

    def receive(self, frame: Frame, now: float) -> list[Frame]:
        aborted = frame.cob_id == SDO_REQUEST_BASE + NODE_ID and frame.data[0] == ABORT
        answers = [Frame(SDO_RESPONSE_BASE + NODE_ID, frame.data[:4] + GENERAL)] if aborted else []
        return [*super().receive(frame, now), *answers]


class StaysOpen(SimulatedDevice):
    """Does not answer a segment with a wrong toggle bit, nor anything else until the client aborts the transfer."""

    _is_open = False

    def receive(self, frame: Frame, now: float) -> list[Frame]:
        if frame.cob_id != SDO_REQUEST_BASE + NODE_ID:
            return super().receive(frame, now)
        answers = super().receive(frame, now)
        wrong = TOGGLE_BIT in [each.data[4:] for each in answers]
        self._is_open = wrong or (self._is_open and frame.data[0] != ABORT)
        return [] if self._is_open else answers


class Crashes(SimulatedDevice):
    """Ends when one byte is written to 0x1017, or 128 segments are acknowledged."""

    _is_dead = False

    def receive(self, frame: Frame, now: float) -> list[Frame]:
        self._is_dead = self._is_dead or frame.data.startswith((b"\x2f\x17\x10\0", b"\xa2\x80"))
        return [] if self._is_dead else super().receive(frame, now)

    @property
    def next_wakeup(self) -> float:
        return inf if self._is_dead else super().next_wakeup


class WithoutSize(Answering):
    """Does not say the size of values that fit into one answer (CiA 301, 7.2.4.3.6)."""

    def said(self, request: bytes, answer: Frame) -> list[Frame]:
        is_short = answer.data[0] == 0x43 and Initiate.of(answer.data).address == DEVICE_TYPE
        return [Frame(answer.cob_id, b"\x42" + answer.data[1:])] if is_short else [answer]


class EmptyHistory(Answering):
    """Says of an empty entry of its history that it cannot be transferred (0x08000020)."""

    def said(self, request: bytes, answer: Frame) -> list[Frame]:
        is_empty = answer.data[0] == ABORT and request[1:4] in (b"\x03\x10\x01", b"\x03\x10\x02")
        return [Frame(answer.cob_id, answer.data[:4] + NOT_TRANSFERRED) if is_empty else answer]


class NoEmptyEntries(SimulatedDevice):
    """Refuses an entry of a mapping that maps nothing, wherever it stands."""

    def receive(self, frame: Frame, now: float) -> list[Frame]:
        is_request = frame.cob_id == SDO_REQUEST_BASE + NODE_ID and frame.data[0] == 0x23
        if is_request and frame.data[2] in (0x16, 0x1A) and not any(frame.data[4:]):
            return [Frame(SDO_RESPONSE_BASE + NODE_ID, bytes([ABORT]) + frame.data[1:4] + NOT_MAPPABLE)]
        return super().receive(frame, now)


class Commanding(Leaving, SimulatedDevice):
    """Sends garbage on 0x000 whenever it boots."""

    def outgoing(self, frames: list[Frame]) -> list[Frame]:
        booted = error_control(NODE_ID, NmtState.INITIALISING)
        sent = []
        for frame in frames:
            if frame == booted:
                sent.append(Frame(0, b"\0\0"))
            sent.append(frame)
        return sent


class OwnError(SimulatedDevice):
    """Has an error of its own, and does not become OPERATIONAL with it."""

    def reset(self) -> None:
        super().reset()
        self.raise_error(0x5000, OwnError)

    def receive(self, frame: Frame, now: float) -> list[Frame]:
        started = frame.cob_id == NMT_COB_ID and frame.data == bytes([NmtCommand.START, NODE_ID])
        return [] if started else super().receive(frame, now)


class NoBootUp(Leaving, SimulatedDevice):
    """Sends no boot-up."""

    def outgoing(self, frames: list[Frame]) -> list[Frame]:
        return [frame for frame in frames if frame != error_control(NODE_ID, NmtState.INITIALISING)]


class Elsewhere(SimulatedDevice):
    """Comes back with another node-ID, where nobody asks it."""

    _moved = False

    def receive(self, frame: Frame, now: float) -> list[Frame]:
        if self._moved:
            return []
        frames = super().receive(frame, now)
        if frame.cob_id == NMT_COB_ID and frame.data[0] in RESETS:
            self._moved = True
            return [Frame(0x700 + NODE_ID + 1, b"\0")]
        return frames

    @property
    def next_wakeup(self) -> float:
        return inf if self._moved else super().next_wakeup


def done(kind: type[Node], tier: Tier = Tier.REVERSIBLE, *chapters: str) -> Iterator[StepResult]:
    """Run the suites of a tier, as one run does."""
    reported = set[Report]()
    for each in suites(MODULE, tier):
        if not chapters or each.tags[-1] in chapters:
            result = run_simulated(each, RunOptions(keep_going=True, reported=reported), of_kind(kind))
            yield from result.steps
            if result.ended:
                return


def red(steps: Iterable[StepResult]) -> list[str]:
    return [each.name for each in steps if each.status is Status.FAILED]


def test_a_first_heartbeat_is_not_taken_for_an_answer_to_guarding() -> None:
    asked = [each for each in suites(MODULE, Tier.REVERSIBLE) if {"nmt", "error-control"} & {*each.tags}]
    found = [step for each in asked for step in run_simulated(each, RunOptions(True), of_kind(LateHeartbeat)).steps]
    assert [each for each in found if "Node guarding" in each.name and each.status is Status.PASSED]
    assert not [each for each in red(found) if "Node guarding" in each]


@pytest.mark.long
@pytest.mark.parametrize("kind", [LateReset, GeneralError])
def test_optional_behaviour_of_the_standard_is_green(kind: type[Node]) -> None:
    assert red(done(kind, Tier.DESTRUCTIVE)) == []


def test_an_answer_without_a_size_is_green() -> None:
    assert red(done(WithoutSize, Tier.READING, "sdo")) == []


def test_a_reset_that_takes_its_time_is_green() -> None:
    assert red(done(LateReset, Tier.REVERSIBLE, "nmt", "storage")) == []


def test_a_device_may_refuse_a_mapping_entry_of_0() -> None:
    assert red(done(NoEmptyEntries, Tier.REVERSIBLE, "pdo")) == []


NO_BOOT_UP = "7.2.8.3.3 Boot-up: boot-up after reset [reversible]"
ONE_CAUSE: dict[type[Node], str] = {
    OwnError: "7.5.2.2 Error register: the device reports no error itself [reading, CTT 5.2]",
    Elsewhere: NO_BOOT_UP,
    NoBootUp: NO_BOOT_UP,
    Commanding: "7.2.8.2.1 NMT: nobody else commands [reversible]",
}


def test_an_abort_that_is_answered_is_red_once() -> None:
    answered = "7.2.4.3.17 SDO abort: a client's abort is not answered [reading]: no answer"
    assert red(done(AnsweredAbort, Tier.READING, "sdo")) == [answered]


def test_a_transfer_that_a_red_step_leaves_open_makes_no_other_step_red() -> None:
    assert red(done(StaysOpen, Tier.READING, "sdo")) == [
        "7.2.4.3.7 SDO upload: a wrong toggle bit is refused [reading, CTT 2.17]: abort",
        "7.2.4.3.4 SDO download: a wrong toggle bit is refused [reading]: abort",
    ]


def test_a_crash_in_a_transfer_makes_one_step_red() -> None:
    crash = "7.2.4.3.13 SDO block upload: an acknowledgement of 128 segments is refused [reading, CTT 2.27]: abort"
    assert red(done(Crashes, Tier.READING, "sdo")) == [crash]


def test_a_crash_makes_the_step_and_the_missing_boot_up_red() -> None:
    crash = "7.2.4.3.17 Wrong length: 0x1017:0 Producer heartbeat time [reversible]: 1 byte, too few [CTT 2.9]"
    assert red(done(Crashes, Tier.REVERSIBLE, "objects")) == [crash, NO_BOOT_UP]


def test_the_aborts_of_an_empty_history_are_tested_once() -> None:
    newest = "7.5.2.4 Error history: the newest of them [reading, CTT 5.3]"
    assert red(done(EmptyHistory, Tier.READING, "objects", "emcy")) == [newest]


def test_an_inhibit_time_that_a_valid_pdo_accepts_is_red_once_per_pdo() -> None:
    fault = CONFORMANCE["inhibit-time-changed-while-valid"].given_to(SimulatedDevice)
    seen = red(done(fault, Tier.REVERSIBLE, "pdo"))
    assert seen
    assert all(each.endswith("another time while it is valid") for each in seen)


@pytest.mark.parametrize("kind", ONE_CAUSE)
def test_one_cause_is_one_red_step(kind: type[Node]) -> None:
    assert red(done(kind, Tier.REVERSIBLE, "nmt", "storage", "emcy")) == [ONE_CAUSE[kind]]


def test_without_a_boot_up_all_other_steps_are_done() -> None:
    assert sum(each.status is Status.PASSED for each in done(NoBootUp, Tier.REVERSIBLE, "nmt")) > 60


def test_a_boot_up_with_another_node_id_is_reported() -> None:
    (failed,) = [each for each in done(Elsewhere, Tier.REVERSIBLE, "nmt") if each.status is Status.FAILED]
    assert failed.reason is not None
    assert failed.reason.what == (
        "no boot-up 705#00 in 10 s after a reset (node 6 booted instead), and no answer to an SDO request as long again"
    )


def test_steps_skipped_for_the_nodes_own_error_have_that_reason() -> None:
    skipped = [each for each in done(OwnError, Tier.REVERSIBLE, "nmt") if each.status is Status.SKIPPED]
    reasons = [each.reason.what for each in skipped if each.reason]
    assert any("the node has an error of its own (0x1001), which is red" in each for each in reasons)


# Put back


def kept(device: SimulatedDevice) -> dict[Address, Value]:
    changing = {ERROR_REGISTER, (0x1003, 0)}
    return {at: device.device.objects.kept(at) for at in device.device.dictionary.addresses() if at not in changing}


def stubborn(fault: type[SimulatedDevice]) -> type[SimulatedDevice]:
    """Return a device whose resets restore nothing, and which takes what a fault has it take."""

    class Stubborn(fault):  # type: ignore[misc, valid-type]
        def receive(self, frame: Frame, now: float) -> list[Frame]:
            before = dict(self.device.objects.values)
            history = self.device.emergencies.history
            frames: list[Frame] = super().receive(frame, now)
            if frame.cob_id == NMT_COB_ID and frame.data[0] in RESETS:
                self.device.objects.values |= before
                self.device.emergencies.history = history
            return frames

    return Stubborn


TAKEN = {
    # what it takes, and the chapter that tries it
    "too-long-taken": "objects",
    "too-short-taken": "objects",
    "inhibit-time-changed-while-valid": "pdo",
    "identifier-changed-while-valid": "pdo",
    "restricted-identifier-taken": "pdo",
    "mapping-changed-while-valid": "pdo",
}


@pytest.mark.parametrize(
    "name", [each if each.startswith("mapping") else pytest.param(each, marks=pytest.mark.long) for each in TAKEN]
)
def test_a_device_that_accepts_and_keeps_wrong_values_is_restored(name: str) -> None:
    device = stubborn(CONFORMANCE[name].given_to(SimulatedDevice)).load(MODULE, NODE_ID)
    (asked,) = suites(MODULE, Tier.REVERSIBLE, TAKEN[name])
    before = kept(device)
    assert run_simulated(asked, RunOptions(keep_going=True), lambda *_: [NodeUnderTest(device)]).failed
    assert kept(device) == before


@pytest.mark.parametrize("chapter", ["storage", pytest.param("sync", marks=pytest.mark.long)])
def test_a_device_whose_0x1011_does_nothing_is_restored(chapter: str) -> None:
    device = stubborn(SimulatedDevice).load(MODULE, NODE_ID)
    (asked,) = suites(MODULE, Tier.DESTRUCTIVE, chapter)
    before = kept(device)
    run_simulated(asked, RunOptions(keep_going=True), lambda *_: [NodeUnderTest(device)])
    assert kept(device) == before


@pytest.mark.parametrize("chapter", ["nmt", "pdo"])
@pytest.mark.parametrize(
    "number", [40, 201, *(pytest.param(each, marks=pytest.mark.long) for each in (*range(41, 46), *range(202, 207)))]
)
def test_an_interrupt_at_any_frame_restores_all_values(chapter: str, number: int) -> None:
    """The device keeps all over resets: only what is written back is as it was."""
    (asked,) = suites(MODULE, Tier.REVERSIBLE, chapter)
    device = stubborn(SimulatedDevice).load(MODULE, NODE_ID)
    interrupt = Interrupt()
    before = kept(device)
    seen = list[StepResult]()

    def show(step: StepResult) -> None:
        seen.append(step)
        if len(seen) == number:
            interrupt.request()

    options = RunOptions(keep_going=True, interrupt=interrupt, show=show)
    run_simulated(asked, options, lambda *_: [NodeUnderTest(device)])
    assert kept(device) == before, seen[-12:]


@pytest.mark.parametrize("end", [signal.SIGINT, signal.SIGTERM])
def test_a_signal_restores_all_values(end: signal.Signals) -> None:
    (asked,) = suites(MODULE, Tier.REVERSIBLE, "pdo")
    device = stubborn(SimulatedDevice).load(MODULE, NODE_ID)
    interrupt = Interrupt()
    before = kept(device)
    differs = list[bool]()

    def show(_: StepResult) -> None:
        differs.append(kept(device) != before)
        if sum(differs) == 5:  # once, in the middle of a group
            signal.raise_signal(end)

    with interrupt.by_ctrl_c():
        options = RunOptions(keep_going=True, interrupt=interrupt, show=show)
        run_simulated(asked, options, lambda *_: [NodeUnderTest(device)])
    assert (interrupt.requested, kept(device)) == (True, before)


class Touchy(SimulatedDevice):
    """Remembers each request for what it does not have as an error."""

    def receive(self, frame: Frame, now: float) -> list[Frame]:
        frames = super().receive(frame, now)
        if any(each.cob_id == SDO_RESPONSE_BASE + NODE_ID and each.data[0] == ABORT for each in frames):
            self.device.emergencies.happened(0x6100, now)
        return frames


def test_an_entry_in_the_error_history_is_named_with_how_to_clear_it() -> None:
    device = Touchy.load(MODULE, NODE_ID)
    (asked,) = suites(MODULE, Tier.READING, "sdo")
    result = run_simulated(asked, RunOptions(keep_going=True), lambda *_: [NodeUnderTest(device)])
    (line,) = changed([result])
    assert "0x1003:0 Pre-defined error field.Number of errors was 00, is 02." in line
    assert "`emcy --clear`" in line


def test_a_domain_is_read_in_blocks() -> None:
    """The device keeps its EDS: a request for each 7 bytes of it, or for each 889."""
    requests = list[int]()

    class Listening(SimulatedDevice):
        def receive(self, frame: Frame, now: float) -> list[Frame]:
            requests.extend([frame.data[0]] * (frame.cob_id == SDO_REQUEST_BASE + NODE_ID))
            return super().receive(frame, now)

    (asked,) = suites(MODULE, Tier.READING, "objects")
    assert not run_simulated(asked, RunOptions(keep_going=True), of_kind(Listening)).failed
    blocks = MODULE.stat().st_size / 889
    assert blocks <= requests.count(0xA2) <= blocks + 2
    assert requests.count(0x60) < 100


@pytest.mark.parametrize("chapter", ["nmt", "sdo"])
def test_a_check_after_a_configuration_restores_0x1020(chapter: str) -> None:
    """The device clears 0x1020 with each change of 0x1017, as CiA 301, 7.5.2.23, has it."""
    marks = dict(zip(VERIFY_CONFIGURATION, (9000, 36_000_000), strict=True))
    device = SimulatedDevice.load(MODULE, NODE_ID)
    (asked,) = suites(MODULE, Tier.READING, chapter)

    def configured(*_: object) -> list[NodeUnderTest]:
        device.device.objects.values |= marks
        return [NodeUnderTest(device)]

    result = run_simulated(asked, RunOptions(keep_going=True), configured)
    assert not result.failed
    assert result.count(Status.PASSED) > 10
    assert {at: device.device.objects.raw(at) for at in marks} == marks


def test_errors_that_the_suite_caused_are_cleared() -> None:
    device = stubborn(SimulatedDevice).load(MODULE, NODE_ID)
    (asked,) = suites(MODULE, Tier.DESTRUCTIVE, "error-control")
    result = run_simulated(asked, RunOptions(keep_going=True), lambda *_: [NodeUnderTest(device)])
    assert any("EMCY" in each.name and each.status is Status.PASSED for each in result.steps)
    assert device.device.emergencies.history == []


class Application(SimulatedDevice):
    """Changes an object of its own whenever it is asked for it."""

    written: Address = (0x2006, 0)

    def receive(self, frame: Frame, now: float) -> list[Frame]:
        if frame.cob_id == SDO_REQUEST_BASE + NODE_ID and frame.data[:3] == b"\x40\x06\x20":
            self.device.objects.values[self.written] = 1 - self.device.objects.raw(self.written)
        return super().receive(frame, now)


def test_process_data_is_not_compared_and_this_is_reported() -> None:
    (asked,) = suites(MODULE, Tier.READING, "emcy")
    result = run_simulated(asked, RunOptions(keep_going=True), of_kind(Application))
    assert not result.failed
    (line,) = remarks([result])
    assert line.endswith("but process data, which is not compared: 0x2006:0 Enabled")
