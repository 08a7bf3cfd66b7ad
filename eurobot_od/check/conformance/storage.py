"""What power-off, resets, store and restore do to values (CiA 301, 7.3.2.2.3, 7.5.2.13 and 7.5.2.14)."""

from __future__ import annotations

from collections.abc import Callable, Iterator

from eurobot_od.check.conformance.subject import (
    HEARTBEAT_TIME,
    Chapter,
    Clause,
    Object,
    Subject,
    awake,
    codes,
    group,
    nmt,
    put_back,
    read,
    save,
    skip,
    write,
)
from eurobot_od.check.conformance.writing import Data, hexadecimal
from eurobot_od.od.values import Address
from eurobot_od.sdo.wire import AbortCode

STORE, RESTORE = 0x1010, 0x1011
SIGNATURES = {STORE: b"save", RESTORE: b"load"}
"""What has to be written to each."""

KEPT: tuple[Address, ...] = (HEARTBEAT_TIME, (0x1015, 0), (0x1006, 0))
"""Parameters that show what is stored: numbers in which nothing else of the communication hangs."""

REFUSED = (AbortCode.NOT_TRANSFERRED, AbortCode.LOCAL_CONTROL, AbortCode.STATE, AbortCode.NO_DATA)
"""Aborts for a wrong signature (CiA 301, 7.5.2.13: 0x0800002x)."""


def _shown_by(subject: Subject) -> Object | None:
    """Return the parameter that shows what is stored."""
    found = (subject.find(address) for address in KEPT)
    return next((each for each in found if each is not None and each.writable), None)


def _other(each: Object) -> int:
    """Return a value that a parameter does not have by default."""
    present = each.default if isinstance(each.default, int) else 0
    return present - 1 if each.high is not None and present >= each.high else present + 1


def _power_on_values(subject: Subject) -> Iterator[Data]:
    """See that what was not stored is gone with a reset."""
    each = _shown_by(subject)
    if each is None:
        yield skip("a reset", "the file has none of 0x1006, 0x1015 and 0x1017 that can be written")
        return
    for command in ("reset", "reset communication"):
        yield group(
            f"{each} after {command}",
            save(each),
            write("another value", each.address, value=_other(each)),
            nmt(command),
            awake(subject),
            nmt("pre-operational"),
            read("what was not stored is gone", each.address, expect="{present}"),
        )


def _signatures(index: int) -> Callable[[Subject], Iterator[Data]]:
    """Make the steps that try other signatures: nothing is stored or restored."""

    def steps(subject: Subject) -> Iterator[Data]:
        writable = [each for each in subject.objects.values() if each.address[0] == index and each.writable]
        if not writable:
            yield skip("the signature", f"the file has no 0x{index:04X}")
        for each in writable:
            for wrong in (bytes(4), SIGNATURES[index][::-1]):
                name = f"{each} wants its signature, not {wrong.hex(' ').upper()}"
                yield write(name, each.address, data=wrong.hex(" "), abort=codes(*REFUSED))

    return steps


def _stored(subject: Subject) -> Iterator[Data]:
    """Store another value, see that it survives a reset, and restore the file's."""
    each = _shown_by(subject)
    store, restore = (subject.find((index, 1)) for index in (STORE, RESTORE))
    if not subject.destructive:
        yield skip("store and restore", "only with --destructive")
    elif each is None or store is None or restore is None:
        yield skip("store and restore", "the file has not both 0x1010 and 0x1011, and a parameter to be stored")
    else:
        yield group(
            f"{each} stored and restored",
            save(each),
            write("another value", each.address, value=_other(each)),
            _signed(store, "stored"),
            *_power_cycle(subject),
            read("it is kept", each.address, expect=_other(each)),
            _signed(restore, "restored"),
            *_power_cycle(subject),
            read("the default is back", each.address, expect=subject.number(each.address)),
            put_back(each),
        )


def _signed(each: Object, name: str) -> Data:
    signature = int.from_bytes(SIGNATURES[each.address[0]], "little")
    return {**write(name, each.address, value=hexadecimal(signature, 8)), "within": "10 s"}


def _power_cycle(subject: Subject) -> Iterator[Data]:
    yield nmt("reset")
    yield awake(subject)
    yield nmt("pre-operational")


CHAPTER = Chapter(
    "storage",
    "store and restore",
    (
        Clause("7.3.2.2.3", "Values", _power_on_values),
        Clause("7.5.2.13", "Store", _signatures(STORE)),
        Clause("7.5.2.14", "Restore", _signatures(RESTORE)),
        Clause("7.5.2.13", "Store", _stored),
    ),
)
