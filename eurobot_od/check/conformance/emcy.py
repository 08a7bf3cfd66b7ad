"""Emergencies: error register, error history, and the frame (CiA 301, 7.2.7, 7.5.2.2, 7.5.2.4, 7.5.2.17)."""

from __future__ import annotations

from collections.abc import Iterator

from eurobot_od.check.conformance.subject import (
    NO_EMCY,
    Chapter,
    Subject,
    Tier,
    codes,
    emcy,
    fresh,
    group,
    never,
    nmt,
    read,
    sent,
    skip,
    wait,
    write,
)
from eurobot_od.check.conformance.writing import Data
from eurobot_od.device.emergency import ErrorCode
from eurobot_od.od.objects import address_of, data_type, in_limits
from eurobot_od.od.standard import EMCY, ERROR_FIELD, ERROR_REGISTER
from eurobot_od.od.values import Address
from eurobot_od.sdo.wire import AbortCode

CHAPTER = Chapter("emcy", "emergencies")

HISTORY: Address = (ERROR_FIELD, 0)

COMMUNICATION_ERROR = 0x11
"""The error register after an error of the communication: generic, and communication (CiA 301, Table 48)."""

QUIET, ONCE = "500 ms", "100 ms"
NO_HISTORY = "the file has no error history (0x1003)"


@CHAPTER.clause("7.5.2.17", "EMCY", Tier.REVERSIBLE, "5.1, 5.2")
def _beforehand(subject: Subject) -> Iterator[Data]:
    """Read where EMCY, error register and error history are, and see that no error is there before one is made."""
    for address, what in ((EMCY, "its COB-ID"), (ERROR_REGISTER, "the error register, before any error")):
        found = subject.find(address)
        if found is None or not found.readable:
            yield skip(what, f"the file has no 0x{address[0]:04X} that can be read")
        else:
            # The file's own value, and not a guess of what is usual: 0x1014 may be anywhere, and 0x1001 may have a bit
            # of the maker's that is always set.
            content = data_type(found).write(subject.number(address))
            yield read(f"{what} is {content[::-1].hex().upper()}", address_of(found), data=content.hex(" ").upper())


@CHAPTER.clause("7.2.7", "EMCY")
def _silence(subject: Subject) -> Iterator[Data]:
    if subject.has_emcy:
        yield group("none without an error", wait("100 ms"), never("silent", {"emcy": "any"}, QUIET))
    else:
        yield skip("none without an error", NO_EMCY)


@CHAPTER.clause("7.5.2.4", "Error history", ctt="5.3")
def _remembers(subject: Subject) -> Iterator[Data]:
    """Read the history: how many errors it has, and the newest if there is one."""
    history, newest = subject.find(HISTORY), subject.find((ERROR_FIELD, 1))
    if history is None or not history.readable:
        yield skip("its number of errors", NO_HISTORY)
        return
    yield read("its number of errors", HISTORY, data="any")
    if newest is not None and newest.readable:
        # While there is no error the entry may be empty, or not there at all (CiA 301, 7.5.2.4): makers differ.
        none_now = codes(AbortCode.NO_DATA, AbortCode.NO_SUBINDEX)
        yield read("the newest of them", (ERROR_FIELD, 1), optional=none_now)


@CHAPTER.clause("7.5.2.4", "Error history", Tier.DESTRUCTIVE)
def _history(subject: Subject) -> Iterator[Data]:
    history = subject.find(HISTORY)
    if history is None:
        yield skip("the history", NO_HISTORY)
        return
    if not history.writable:
        yield skip("the history is cleared", "the file's error history cannot be written")
        return
    # 0 clears the history, everything else is not allowed (CiA 301, 7.5.2.4).
    refused = codes(AbortCode.VALUE, AbortCode.TOO_HIGH)
    yield write("only 0 may be written", HISTORY, value=1, abort=refused)
    yield group("0 clears it", write("0 is written", HISTORY, data="00"), _empty())


def _empty() -> Data:
    return read("no error is left", HISTORY, data="00")


@CHAPTER.clause("7.2.7", "EMCY", Tier.DESTRUCTIVE, "5.4 to 5.6")
def _too_short(subject: Subject) -> Iterator[Data]:
    """Send an RPDO that lacks a byte: the device must not take it, and says so."""
    rpdo = subject.rpdo
    if rpdo is None or not subject.has_emcy:
        yield skip("an RPDO that is too short", NO_EMCY if rpdo else "the file has no valid RPDO with data")
        return
    code, has_register = ErrorCode.PDO_TOO_SHORT, subject.find(ERROR_REGISTER) is not None
    register = read("the error register says so", ERROR_REGISTER, data=f"{COMMUNICATION_ERROR:02X}")
    yield group(
        f"RPDO {rpdo.number}, one byte too short",
        nmt("start"),
        wait("50 ms"),
        # The one error that can be made from outside without doing harm: the device ignores the frame and says 0x8210
        # (CiA 301, 7.2.7).
        sent("the frame", rpdo.cob_id, bytes(rpdo.length - 1)),
        emcy(f"EMCY 0x{code:04X}", code),
        never("it is reported once", {"emcy": f"0x{code:04X}"}, ONCE),
        *([register] if has_register else []),
        *_remembered(subject, code),
        *fresh(subject),
    )


def _remembered(subject: Subject, code: ErrorCode) -> Iterator[Data]:
    history = subject.find(HISTORY)
    if history is not None and history.readable and subject.find((ERROR_FIELD, 1)) is not None:
        # Asked for as a frame: an entry has the error code in its lower half, and whatever the maker adds in the upper
        # one, so that no value can be compared.
        digits = code.to_bytes(2, "little").hex().upper()
        asked = {"name": "the history is asked", **subject.request(bytes.fromhex("4003100100000000"))}
        if in_limits(history, 1):
            yield read("the history has it", HISTORY, expect=">= 1")
        yield asked
        yield {"name": "its newest error is this", "expect": subject.answer(f"43031001{digits}????"), "within": "1 s"}
        if history.writable:
            yield write("the history is cleared", HISTORY, data="00")
            yield _empty()
