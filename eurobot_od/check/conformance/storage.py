"""What power-off, resets, store and restore do to values (CiA 301, 7.3.2.2.3, 7.5.2.13 and 7.5.2.14)."""

from __future__ import annotations

from collections.abc import Sequence
from functools import partial
from itertools import product
from typing import NamedTuple

from canopen.objectdictionary import ODVariable

from eurobot_od.check.conformance import step
from eurobot_od.check.conformance.clauses import Chapter, Clause, Subject, Tier, fresh, need, or_skipped
from eurobot_od.check.conformance.step import BUSY, OUTSIDE, Data, Steps, codes, hexadecimal, title
from eurobot_od.od import standard
from eurobot_od.od.objects import address_of, data_type, default_of, in_limits
from eurobot_od.od.values import NOT_VALID, SDO_REQUEST_BASE, SDO_RESPONSE_BASE, UNSIGNED32, Address, label
from eurobot_od.sdo.wire import AbortCode

CHAPTER: Chapter[Subject] = Chapter("storage", "store and restore")

KEPT: tuple[Address, ...] = (standard.HEARTBEAT_TIME, standard.EMCY_INHIBIT_TIME, standard.SYNC_PERIOD)
"""Parameters that show what is stored: numbers in which nothing else of the communication hangs."""

WRONG_SIGNATURE = {
    (standard.STORE, 1): "8.1",
    (standard.RESTORE, 1): "8.3",
    (standard.STORE, 2): "8.5",
    (standard.RESTORE, 2): "8.7",
}
RIGHT_SIGNATURE = {1: ("8.2", "8.4"), 2: ("8.6", "8.8")}
"""Numbers of CiA's tool for the signatures that are refused, and those that store and that restore."""

REFUSED = (AbortCode.NOT_TRANSFERRED, AbortCode.LOCAL_CONTROL, AbortCode.STATE, AbortCode.NO_DATA)
"""Aborts for a wrong signature (CiA 301, 7.5.2.13: 0x0800002x)."""


STANDARD_GROUPS = (1, 2, 3)
"""Sub-indices for all parameters, those of the communication and those of the application. What a maker has behind them
may be the calibration or the factory default: no suite that is made by itself writes there."""


def _shown_by(subject: Subject) -> ODVariable | None:
    """Return the parameter that shows what is stored."""
    found = (subject.settable(address) for address in KEPT)
    return next((each for each in found if each is not None and in_limits(each, _other(each))), None)


OFFSETS = (50_000, 1_000, 1, -1)
"""What another value differs by. The first that fits is taken: a SYNC every 1 us, or a heartbeat every 1 ms, is a full
bus."""


def _other(each: ODVariable) -> int:
    """Return a value that a parameter does not have by default."""
    default = default_of(each)
    present = default if isinstance(default, int) else 0
    return next((present + offset for offset in OFFSETS if in_limits(each, present + offset)), present - 1)


@Clause(CHAPTER, "7.3.2.2.3", "Values", Tier.REVERSIBLE, name="a reset")
def _power_on_values(subject: Subject) -> Steps:
    """See that what was not stored is gone with a reset."""
    lack = "the file has none of 0x1006, 0x1015 and 0x1017 that can be read, written and put back"
    each = need(_shown_by(subject), lack)
    other = step.write("another value", address_of(each), value=_other(each))
    gone = step.unchanged(each, "what was not stored is gone")
    # Both load the communication profile's values of power-on; only the first also those of the maker's and the
    # profile's objects (CiA 301, 7.3.2.2.3).
    for command in ("reset", "reset communication"):
        done = step.keeping(f"{title(each)} after {command}", each, other, *fresh(command), gone)
        yield step.asking("9.1" if command == "reset" else "", done)


def _commands(subject: Subject, index: int) -> dict[int, ODVariable]:
    """Return the sub-indices of 0x1010 or 0x1011 that are the standard's, and take a signature."""
    found = (each for each in subject.objects if each.index == index and each.subindex in STANDARD_GROUPS)
    return {each.subindex: each for each in found if each.writable and data_type(each) is UNSIGNED32}


def _store_and_restore(subject: Subject, sub: int) -> tuple[ODVariable | None, ODVariable | None]:
    """Return what stores some parameters and restores them; raises Lacks if the device would be another node."""
    _stays(subject)
    return _commands(subject, standard.STORE).get(sub), _commands(subject, standard.RESTORE).get(sub)


def _stays(subject: Subject) -> None:
    """Raise Lacks for a device that would have its file's node-ID once all is restored, where nobody asks it."""
    own = subject.dictionary.device.node_id_address
    known = own is None or subject.dictionary.stock_value(own) is not None
    need(known, f"0x1011 may make the device another node: the file has no default for {own and label(own)}")
    moved = subject.dictionary.restored_node_id
    need(moved is None, f"0x1011 would make the device node {moved}, as its file says")


def _signatures(subject: Subject, index: int) -> Steps:
    """Try other signatures: nothing is stored or restored."""
    commands = need(_commands(subject, index), f"the file has no 0x{index:04X} that can be written")
    # Zeros are what an empty program writes, and the letters backwards what one with the wrong byte order does.
    for each, wrong in product(commands.values(), (bytes(4), standard.SIGNATURES[index][::-1])):
        name = f"{title(each)} wants its signature, not {wrong.hex(' ').upper()}"
        refused = step.write(name, address_of(each), data=wrong.hex(" "), abort=codes(*REFUSED, *OUTSIDE))
        yield step.asking(WRONG_SIGNATURE.get(address_of(each), ""), refused)


Clause(CHAPTER, "7.5.2.13", "Store", Tier.DESTRUCTIVE, name="the signature")(partial(_signatures, index=standard.STORE))
Clause(CHAPTER, "7.5.2.14", "Restore", Tier.DESTRUCTIVE, name="the signature")(
    partial(_signatures, index=standard.RESTORE)
)


@Clause(CHAPTER, "7.5.2.13", "Store", Tier.DESTRUCTIVE, name="store and restore")
def _stored(subject: Subject) -> Steps:
    """Store another value, see that it survives a reset, and restore the file's: all parameters, and by themselves."""
    for sub, asked in RIGHT_SIGNATURE.items():
        lack = f"the file lacks 0x1010:{sub}, 0x1011:{sub} or a parameter to be stored"
        name = "store and restore" if sub == 1 else "store and restore of the communication"
        done = or_skipped(name, _stored_by, subject, sub, lack)
        yield from (step.asking(", ".join(asked), each) for each in done)


def _stored_by(subject: Subject, sub: int, lack: str) -> Steps:
    stored, restored = RIGHT_SIGNATURE[sub]
    signed = _store_and_restore(subject, sub)
    each, store, restore = (need(found, lack) for found in (_shown_by(subject), *signed))
    at = address_of(each)
    over_a_reset = step.group(
        "over a reset",
        step.asking(stored, _signed(store, "stored")),
        *fresh("reset"),
        step.asking(stored, step.read("it is kept", at, expect=_other(each))),
        *step.undoing(step.asking(restored, _signed(restore, "restored")), *fresh("reset")),
        step.asking(restored, step.read("the default is back", at, expect=subject.number(at))),
    )
    other = step.write("another value", at, value=_other(each))
    yield step.keeping(f"{title(each)} stored and restored by sub-index {sub}", each, other, over_a_reset)


# What is kept over a reset


class Kept(NamedTuple):
    """An object, and the value that it is given to be kept."""

    address: Address
    value: int
    digits: int = 8

    def written(self, **more: object) -> Data:
        """Write it."""
        value = hexadecimal(self.value, self.digits)
        return step.write(f"{label(self.address)} is {value}", self.address, value=value, **more)


def kept_over_reset(
    subject: Subject, name: str, values: Sequence[Kept], *looks: Data, change: Sequence[Address] = ()
) -> Data:
    """Give objects values in their order, store them, see after a reset what the last of each was, and restore.

    Of a device whose restoring does nothing they are put back one by one, as are those that `looks` change.
    """
    store, restore = _store_and_restore(subject, standard.ALL_PARAMETERS)
    lacking = [label(each.address) for each in values if not subject.may_be(each.address, each.value)]
    if store is None or restore is None or lacking:
        lack = lacking[0] if lacking else "0x1010:1 or 0x1011:1"
        return step.skip(name, f"the file lacks {lack} that can be written as this wants")
    last = {each.address: each.value for each in values}
    # The last first, for what may only be changed while another is 0, or off.
    kept = subject.kept([*change, *reversed(last)])
    refused = codes(*BUSY, *OUTSIDE, AbortCode.GENERAL, AbortCode.UNSUPPORTED_ACCESS)
    return step.group(
        name,
        *fresh(),
        *(step.save(*each) for each in kept),
        *(each.written(optional=refused) for each in values),
        step.group(
            "over a reset",
            _signed(store, "stored"),
            *fresh(),
            *(step.read(f"{label(at)} is kept", at, expect=value) for at, value in last.items()),
            *looks,
            # As near to a power cycle as the bus can bring it: every value of power-on is loaded again (CiA 301,
            # 7.3.2.2.3).
            *step.undoing(_signed(restore, "restored"), *fresh("reset")),
            *(step.read(f"{label(at)} has its default", at, expect=subject.number(at)) for at in last),
        ),
        *step.undoing(*fresh()),
        *(step.put_back(*each) for each in kept),
    )


@Clause(CHAPTER, "7.5.2.13", "Store", Tier.DESTRUCTIVE, "2.30", name="SDO client")
def _clients(subject: Subject) -> Steps:
    """Store the identifiers of the first SDO client, not valid ones."""
    there = (each for each in standard.SDO_CLIENTS if each in subject.dictionary.members)
    index = need(next(there, None), "the file has no SDO client (0x1280)")
    # Not valid while it is stored: an SDO client that becomes active would talk to a node that is not there.
    bases = (SDO_REQUEST_BASE, SDO_RESPONSE_BASE)
    values = [Kept((index, sub), NOT_VALID | base + subject.another) for sub, base in enumerate(bases, start=1)]
    return [kept_over_reset(subject, f"0x{index:04X}", values)]


@Clause(CHAPTER, "7.5.2.23", "Verify configuration", Tier.DESTRUCTIVE, "8.9")
def _verified(subject: Subject) -> Steps:
    """Store the date of the configuration, and see that a change of the configuration clears it (7.5.2.23)."""
    date, time = standard.VERIFY_CONFIGURATION
    # 0x1020 tells a master that it need not compare each object: a device that keeps it after a change makes the master
    # believe an old configuration.
    shown, looks, changes = _shown_by(subject), [], []
    if shown is not None:
        changes = [address_of(shown)]
        changed = step.write(f"{title(shown)} is changed", address_of(shown), value=_other(shown))
        looks = [changed, *(step.read(f"{label(each)} is 0 again", each, data="00 00 00 00") for each in (date, time))]
    values = [Kept(date, 9000), Kept(time, 36_000_000)]
    return [kept_over_reset(subject, "date and time of the configuration", values, *looks, change=changes)]


def _signed(each: ODVariable, name: str) -> Data:
    # As bytes: the limits that a file may give a command say nothing of its signature.
    return {**step.write(name, address_of(each), data=standard.SIGNATURES[each.index].hex(" ")), "within": "10 s"}
