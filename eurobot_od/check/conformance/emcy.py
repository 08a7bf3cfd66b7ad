"""Emergencies: error register, error history, and the frame (CiA 301, 7.2.7, 7.5.2.2, 7.5.2.4, 7.5.2.17)."""

from __future__ import annotations

from eurobot_od.check.conformance import step
from eurobot_od.check.conformance.clauses import Chapter
from eurobot_od.check.conformance.step import Data, Steps, codes
from eurobot_od.check.conformance.subject import Subject, Tier, fresh, need
from eurobot_od.od.objects import data_type, in_limits
from eurobot_od.od.standard import EMCY, ERROR_FIELD, ERROR_REGISTER, ErrorCode
from eurobot_od.od.values import Address
from eurobot_od.sdo.wire import AbortCode

CHAPTER: Chapter[Subject] = Chapter("emcy", "emergencies")

HISTORY: Address = (ERROR_FIELD, 0)
NEWEST: Address = (ERROR_FIELD, 1)

COMMUNICATION_ERROR = 0x11
"""The error register after an error of the communication: generic, and communication (CiA 301, Table 48)."""

QUIET, ONCE = "500 ms", "100 ms"
NO_HISTORY = "the file has no error history (0x1003)"


@CHAPTER.clause("7.5.2.17", "EMCY", Tier.REVERSIBLE, "5.1, 5.2")
def _beforehand(subject: Subject) -> Steps:
    """Read where EMCY, error register and error history are, and see that no error is there before one is made."""
    for address, what in ((EMCY, "its COB-ID"), (ERROR_REGISTER, "the error register, before any error")):
        found = subject.readable(address)
        if found is None:
            yield step.skip(what, f"the file has no 0x{address[0]:04X} that can be read")
        else:
            # The file's own value, and not a guess of what is usual: 0x1014 may be anywhere, and 0x1001 may have a bit
            # of the maker's that is always set.
            content = data_type(found).write(subject.number(address))
            name = f"{what} is {content[::-1].hex().upper()}"
            yield step.read(name, address, data=content.hex(" ").upper())


@CHAPTER.clause("7.2.7", "EMCY", group="none without an error", needs=[Subject.need_emcy])
def _silence(_: Subject) -> Steps:
    return [step.wait("100 ms"), step.never("silent", {"emcy": "any"}, QUIET)]


@CHAPTER.clause("7.5.2.4", "Error history", ctt="5.3", name="its number of errors")
def _remembers(subject: Subject) -> Steps:
    """Read the history: how many errors it has, and the newest if there is one."""
    need(subject.readable(HISTORY), NO_HISTORY)
    yield step.read("its number of errors", HISTORY, data="any")
    if subject.readable(NEWEST) is not None:
        # While there is no error the entry may be empty, or not there at all (CiA 301, 7.5.2.4): makers differ.
        none_now = codes(AbortCode.NO_DATA, AbortCode.NO_SUBINDEX)
        yield step.read("the newest of them", NEWEST, optional=none_now)


@CHAPTER.clause("7.5.2.4", "Error history", Tier.DESTRUCTIVE, name="the history")
def _history(subject: Subject) -> Steps:
    if not need(subject.find(HISTORY), NO_HISTORY).writable:
        yield step.skip("the history is cleared", "the file's error history cannot be written")
        return
    # 0 clears the history, everything else is not allowed (CiA 301, 7.5.2.4).
    refused = codes(AbortCode.VALUE, AbortCode.TOO_HIGH)
    yield step.write("only 0 may be written", HISTORY, value=1, abort=refused)
    yield step.group("0 clears it", *_cleared("0 is written"))


def _cleared(name: str) -> list[Data]:
    return [step.write(name, HISTORY, data="00"), step.read("no error is left", HISTORY, data="00")]


@CHAPTER.clause("7.2.7", "EMCY", Tier.DESTRUCTIVE, "5.4 to 5.6", name="an RPDO that is too short")
def _too_short(subject: Subject) -> Steps:
    """Send an RPDO that lacks a byte: the device must not take it, and says so."""
    rpdo, code = subject.rpdo, ErrorCode.PDO_TOO_SHORT
    subject.need_emcy()
    register = step.read("the error register says so", ERROR_REGISTER, data=f"{COMMUNICATION_ERROR:02X}")
    yield step.group(
        f"RPDO {rpdo.number}, one byte too short",
        step.nmt("start"),
        step.wait("50 ms"),
        # The one error that can be made from outside without doing harm: the device ignores the frame and says 0x8210
        # (CiA 301, 7.2.7).
        step.sent("the frame", rpdo.cob_id, bytes(rpdo.length - 1)),
        step.emcy(f"EMCY 0x{code:04X}", code),
        step.never("it is reported once", {"emcy": f"0x{code:04X}"}, ONCE),
        *([register] if subject.find(ERROR_REGISTER) is not None else []),
        *_remembered(subject, code),
        *fresh(subject),
    )


def _remembered(subject: Subject, code: ErrorCode) -> Steps:
    history = subject.readable(HISTORY)
    if history is not None and subject.find(NEWEST) is not None:
        if in_limits(history, 1):
            yield step.read("the history has it", HISTORY, expect=">= 1")
        # Asked for as a frame: an entry has the error code in its lower half, and whatever the maker adds in the upper
        # one, so that no value can be compared.
        digits = code.to_bytes(2, "little").hex().upper()
        yield {"name": "the history is asked", **subject.request(bytes.fromhex("4003100100000000"))}
        yield step.expect("its newest error is this", subject.answer(f"43031001{digits}????"), "1 s")
        if history.writable:
            yield from _cleared("the history is cleared")
