"""SDO transfers frame by frame: expedited, by segments, in blocks, toggle bits, aborts, time-outs (CiA 301, 7.2.4.3).

Rule of this file: what is downloaded is what the object has after a reset, and what it had before is put back.
"""

from __future__ import annotations

from collections.abc import Iterator
from typing import TYPE_CHECKING

from eurobot_od.check.conformance.objects import ACTING, CONFIGURED, FIXED, MAPPINGS
from eurobot_od.check.conformance.subject import (
    Chapter,
    Clause,
    Subject,
    Tier,
    awake,
    codes,
    expect,
    group,
    never,
    put_back,
    read,
    save,
    skip,
    title,
    unchanged,
    wait,
)
from eurobot_od.check.conformance.writing import Data
from eurobot_od.od.objects import address_of, data_type, default_bytes
from eurobot_od.od.standard import DEVICE_TYPE, HEARTBEAT_TIME
from eurobot_od.sdo import wire
from eurobot_od.sdo.wire import AbortCode, ClientCommand, initiate

if TYPE_CHECKING:
    from canopen.objectdictionary import ODVariable

WITHIN = "1 s"
"""How long an SDO server may take for an answer; the standard names no time."""

QUIET = "200 ms"

LEFT_ALONE = "3 s"
"""How long a transfer is left alone: longer than servers wait for the next request."""

NO_SEGMENTS = "the file has no object of more than 4 bytes whose value is known"
NO_NUMBER = "the file has no number of up to 4 bytes that can be written and whose value is known"
NO_BLOCKS = (AbortCode.UNKNOWN_COMMAND, AbortCode.UNSUPPORTED_ACCESS)
"""Aborts of a server that has no block transfer."""


def _known(each: ODVariable) -> bool:
    """Whether an object is readable, and has the file's value after a reset."""
    steady = each.access_type in CONFIGURED or each.index in FIXED
    return each.readable and steady and default_bytes(each) is not None and each.index not in ACTING


def _content(each: ODVariable) -> bytes:
    """Return the known value of an object."""
    return default_bytes(each) or b""


def _long(subject: Subject) -> ODVariable | None:
    """Return the object with the longest known value over 4 bytes."""
    found = [each for each in subject.objects if _known(each) and len(_content(each)) > 4]
    return max(found, key=lambda each: len(_content(each)), default=None)


def _number(subject: Subject) -> ODVariable | None:
    """Return a number that can be written as it is: the heartbeat time, or the first other one without a COB-ID.

    Where nothing is to be written but the heartbeat time there is no other.
    """
    settable = [each for each in subject.objects if _known(each) and subject.settable(address_of(each))]
    found = [each for each in settable if _harmless(each)]
    if subject.tier is Tier.READING:
        found = [each for each in found if address_of(each) == HEARTBEAT_TIME]
    return min(found, key=lambda each: address_of(each) != HEARTBEAT_TIME, default=None)


def _harmless(each: ODVariable) -> bool:
    type_, index = data_type(each), each.index
    return type_.is_integer and type_.size <= 4 and index not in MAPPINGS and not 0x1400 <= index < 0x2000


# Uploads


def _expedited_upload(subject: Subject) -> Iterator[Data]:
    if subject.find(DEVICE_TYPE) is None:
        yield skip("the device type in one answer", "the file has no device type (0x1000)")
        return
    yield group(
        "the device type in one answer",
        _asked(subject, ClientCommand.UPLOAD << 5, DEVICE_TYPE),
        expect("4 bytes", subject.answer("43001000????????"), WITHIN),
    )


def _segmented_upload(subject: Subject) -> Iterator[Data]:
    each = _long(subject)
    if each is None:
        yield skip("by segments", NO_SEGMENTS)
        return
    yield read(f"{title(each)} by segments", address_of(each), data="any")
    yield group(
        "a wrong toggle bit is refused",
        _asked(subject, ClientCommand.UPLOAD << 5, address_of(each)),
        expect("it begins", subject.answer(f"4?{_multiplexer(each)}????????"), WITHIN),
        _sent(subject, "the first segment, asked for with the toggle bit set", wire.plain(0x70)),
        _aborted(subject, AbortCode.TOGGLE_BIT),
    )


def _block_upload(subject: Subject) -> Iterator[Data]:
    each = _long(subject) or subject.find(DEVICE_TYPE)
    if each is not None and default_bytes(each) is not None:
        again = unchanged(each, "in blocks it is the same", transfer="block", optional=codes(*NO_BLOCKS))
        yield group(f"{title(each)} in blocks", save(each), again)


# Downloads


def _segmented_download(subject: Subject) -> Iterator[Data]:
    each = _number(subject)
    if each is None:
        yield skip("by segments", NO_NUMBER)
        return
    content = _content(each)
    yield group(
        f"{title(each)} by segments",
        save(each),
        *_begun(subject, each),
        _sent(subject, "the only segment", wire.segment(ClientCommand.DOWNLOAD_SEGMENT, 0, content, last=True)),
        expect("it is taken", subject.answer(f"20{'?' * 14}"), WITHIN),
        read("it has the value", address_of(each), data=content.hex(" ")),
        put_back(each),
    )
    wrong = wire.segment(ClientCommand.DOWNLOAD_SEGMENT, wire.TOGGLE, content, last=True)
    yield group(
        "a wrong toggle bit is refused",
        save(each),
        *_begun(subject, each),
        _sent(subject, "the only segment, with the toggle bit set", wrong),
        _aborted(subject, AbortCode.TOGGLE_BIT),
        unchanged(each),
    )


def _block_download(subject: Subject) -> Iterator[Data]:
    each = _number(subject)
    if each is None:
        yield skip("in blocks", NO_NUMBER)
        return
    written = {**put_back(each, transfer="block", optional=codes(*NO_BLOCKS)), "name": "its own value"}
    yield group(f"{title(each)} in blocks", save(each), written, unchanged(each))


# Aborts


def _unknown_command(subject: Subject) -> Iterator[Data]:
    yield group(
        "an unknown command is refused",
        _sent(subject, "command specifier 7", initiate(0xE0, subject.probe)),
        _aborted(subject, AbortCode.UNKNOWN_COMMAND),
    )


def _unfinished(subject: Subject) -> Iterator[Data]:
    yield group(
        "a client's abort is not answered",
        _sent(subject, "abort", wire.aborted(subject.probe, AbortCode.GENERAL)),
        never("no answer", subject.answer("?" * 16), QUIET),
        awake(subject, "the next request is"),
    )
    each = _number(subject)
    if each is None:
        yield skip("a transfer that is left alone", NO_NUMBER)
        return
    yield group(
        "a transfer that the client aborts changes nothing",
        save(each),
        *_begun(subject, each),
        _sent(subject, "abort", wire.aborted(address_of(each), AbortCode.GENERAL)),
        unchanged(each),
    )
    yield group(
        "a transfer that is left alone does not block the server",
        save(each),
        *_begun(subject, each),
        wait(LEFT_ALONE),
        unchanged(each),
    )


# Frames


def _begun(subject: Subject, each: ODVariable) -> tuple[Data, Data]:
    """Begin a download by segments."""
    size = len(_content(each))
    begin = initiate(ClientCommand.DOWNLOAD << 5 | wire.SIZE_GIVEN, address_of(each), size.to_bytes(4, "little"))
    begun = expect("it begins", subject.answer(f"60{_multiplexer(each)}????????"), WITHIN)
    return _sent(subject, "the first request", begin), begun


def _asked(subject: Subject, command: int, address: tuple[int, int]) -> Data:
    return _sent(subject, "the first request", initiate(command, address))


def _sent(subject: Subject, name: str, data: bytes) -> Data:
    return {"name": name, **subject.request(data)}


def _aborted(subject: Subject, code: AbortCode) -> Data:
    """Expect an abort; which object it names is open where the request did not name one."""
    return expect("abort", subject.answer(f"80??????{code.to_bytes(4, 'little').hex().upper()}"), WITHIN)


def _multiplexer(each: ODVariable) -> str:
    return f"{each.index & 0xFF:02X}{each.index >> 8:02X}{each.subindex:02X}"


def _as_before(each: ODVariable) -> Data:
    return read("it has its value", address_of(each), data=_content(each).hex(" "))


CHAPTER = Chapter(
    "sdo",
    "SDO transfers",
    (
        Clause("7.2.4.3.6", "SDO upload", _expedited_upload, ctt="2.1"),
        Clause("7.2.4.3.7", "SDO upload", _segmented_upload, ctt="2.13, 2.15 to 2.18"),
        Clause("7.2.4.3.12", "SDO block upload", _block_upload, ctt="2.19 to 2.25"),
        Clause("7.2.4.3.4", "SDO download", _segmented_download, ctt="2.14, 2.17"),
        Clause("7.2.4.3.8", "SDO block download", _block_download, ctt="2.19 to 2.25"),
        Clause("7.2.4.3.17", "SDO abort", _unknown_command, ctt="2.7"),
        Clause("7.2.4.3.17", "SDO abort", _unfinished),
    ),
)
