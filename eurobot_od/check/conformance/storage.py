"""The effect of resets, store and restore on values (CiA 301, 7.3.2.2.3, 7.5.2.13 and 7.5.2.14)."""

from __future__ import annotations

from collections.abc import Sequence
from functools import partial
from itertools import product
from typing import NamedTuple

from canopen.objectdictionary import ODVariable

from eurobot_od.check.conformance import step
from eurobot_od.check.conformance.clauses import Chapter, Clause, DeviceUnderTest, Tier, fresh, need, or_skipped
from eurobot_od.check.conformance.step import BUSY, OUTSIDE, Data, Steps, codes, hexadecimal, title
from eurobot_od.od import standard
from eurobot_od.od.objects import address_of, data_type, default_of, in_limits
from eurobot_od.od.values import NOT_VALID, SDO_REQUEST_BASE, SDO_RESPONSE_BASE, UNSIGNED32, Address, label
from eurobot_od.sdo.wire import AbortCode

CHAPTER: Chapter[DeviceUnderTest] = Chapter("storage", "store and restore")

KEPT: tuple[Address, ...] = (standard.HEARTBEAT_TIME, standard.EMCY_INHIBIT_TIME, standard.SYNC_PERIOD)
"""Parameters that show what is stored: integers on which nothing else of the communication depends."""

WRONG_SIGNATURE = {
    (standard.STORE, 1): "8.1",
    (standard.RESTORE, 1): "8.3",
    (standard.STORE, 2): "8.5",
    (standard.RESTORE, 2): "8.7",
}
RIGHT_SIGNATURE = {1: ("8.2", "8.4"), 2: ("8.6", "8.8")}
"""Numbers of CiA's tool for wrong signatures, and for those that store and restore, by sub-index."""

REFUSED = (AbortCode.NOT_TRANSFERRED, AbortCode.LOCAL_CONTROL, AbortCode.STATE, AbortCode.NO_DATA)
"""Aborts for a wrong signature (CiA 301, 7.5.2.13: 0x0800002x)."""


STANDARD_GROUPS = (1, 2, 3)
"""Sub-indices for all parameters, those of the communication, and those of the application.

Further ones are the manufacturer's, such as calibration or factory defaults: generated suites do not write them.
"""


def _shown_by(device: DeviceUnderTest) -> ODVariable | None:
    """Return the parameter that shows what is stored, None if there is none."""
    found = (device.settable(address) for address in KEPT)
    return next((each for each in found if each is not None and in_limits(each, _other(each))), None)


OFFSETS = (50_000, 1_000, 1, -1)
"""Differences between another value and the default, by preference: a SYNC every us, or a heartbeat every ms, fills the
bus.
"""


def _other(each: ODVariable) -> int:
    """Return a value other than the default."""
    default = default_of(each)
    present = default if isinstance(default, int) else 0
    return next((present + offset for offset in OFFSETS if in_limits(each, present + offset)), present - 1)


@Clause(CHAPTER, "7.3.2.2.3", "Values", Tier.REVERSIBLE, name="a reset")
def _power_on_values(device: DeviceUnderTest) -> Steps:
    """Check that a value that was not stored is lost by a reset."""
    lack = "the file has none of 0x1006, 0x1015 and 0x1017 that can be read, written and put back"
    each = need(_shown_by(device), lack)
    other = step.write("another value", address_of(each), value=_other(each))
    gone = step.unchanged(each, "what was not stored is gone")
    # Both reset the communication objects; only the first also the manufacturer's and the profile's objects
    # (CiA 301, 7.3.2.2.3).
    for command in ("reset", "reset communication"):
        done = step.keeping(f"{title(each)} after {command}", each, other, *fresh(command), gone)
        yield step.asking("9.1" if command == "reset" else "", done)


def _commands(device: DeviceUnderTest, index: int) -> dict[int, ODVariable]:
    """Return the sub-indices of 0x1010 or 0x1011 that the standard defines and that accept a signature."""
    found = (each for each in device.objects if each.index == index and each.subindex in STANDARD_GROUPS)
    return {each.subindex: each for each in found if each.writable and data_type(each) is UNSIGNED32}


def _store_and_restore(device: DeviceUnderTest, sub: int) -> tuple[ODVariable | None, ODVariable | None]:
    """Return the objects that store and restore some parameters; raises Lacks if restoring changes the node-ID."""
    _need_node_id_kept(device)
    return _commands(device, standard.STORE).get(sub), _commands(device, standard.RESTORE).get(sub)


def _need_node_id_kept(device: DeviceUnderTest) -> None:
    """Need a device that keeps its node-ID when everything is restored; raises Lacks."""
    own = device.dictionary.device.node_id_address
    known = own is None or device.dictionary.stock_value(own) is not None
    need(known, f"0x1011 may make the device another node: the file has no default for {own and label(own)}")
    moved = device.dictionary.restored_node_id
    need(moved is None, f"0x1011 would make the device node {moved}, as its file says")


def _signatures(device: DeviceUnderTest, index: int) -> Steps:
    """Write wrong signatures: nothing is stored or restored."""
    commands = need(_commands(device, index), f"the file has no 0x{index:04X} that can be written")
    # Zeros, and the letters in the wrong byte order.
    for each, wrong in product(commands.values(), (bytes(4), standard.SIGNATURES[index][::-1])):
        name = f"{title(each)} wants its signature, not {wrong.hex(' ').upper()}"
        refused = step.write(name, address_of(each), data=wrong.hex(" "), abort=codes(*REFUSED, *OUTSIDE))
        yield step.asking(WRONG_SIGNATURE.get(address_of(each), ""), refused)


Clause(CHAPTER, "7.5.2.13", "Store", Tier.DESTRUCTIVE, name="the signature")(partial(_signatures, index=standard.STORE))
Clause(CHAPTER, "7.5.2.14", "Restore", Tier.DESTRUCTIVE, name="the signature")(
    partial(_signatures, index=standard.RESTORE)
)


@Clause(CHAPTER, "7.5.2.13", "Store", Tier.DESTRUCTIVE, name="store and restore")
def _stored(device: DeviceUnderTest) -> Steps:
    """Store another value, check it after a reset, and restore the default.

    This is done for all parameters, then for those of communication.
    """
    for sub, asked in RIGHT_SIGNATURE.items():
        lack = f"the file lacks 0x1010:{sub}, 0x1011:{sub} or a parameter to be stored"
        name = "store and restore" if sub == 1 else "store and restore of the communication"
        done = or_skipped(name, _stored_by, device, sub, lack)
        yield from (step.asking(", ".join(asked), each) for each in done)


def _stored_by(device: DeviceUnderTest, sub: int, lack: str) -> Steps:
    stored, restored = RIGHT_SIGNATURE[sub]
    signed = _store_and_restore(device, sub)
    each, store, restore = (need(found, lack) for found in (_shown_by(device), *signed))
    at = address_of(each)
    over_a_reset = step.group(
        "over a reset",
        step.asking(stored, _signed(store, "stored")),
        *fresh("reset"),
        step.asking(stored, step.read("it is kept", at, expect=_other(each))),
        *step.undoing(step.asking(restored, _signed(restore, "restored")), *fresh("reset")),
        step.asking(restored, step.read("the default is back", at, expect=device.number(at))),
    )
    other = step.write("another value", at, value=_other(each))
    yield step.keeping(f"{title(each)} stored and restored by sub-index {sub}", each, other, over_a_reset)


# Values kept over a reset


class Kept(NamedTuple):
    """An object, and the value to be stored."""

    address: Address
    value: int
    digits: int = 8

    def written(self, **more: object) -> Data:
        """Return the step that writes it."""
        value = hexadecimal(self.value, self.digits)
        return step.write(f"{label(self.address)} is {value}", self.address, value=value, **more)


def kept_over_reset(
    device: DeviceUnderTest, name: str, values: Sequence[Kept], *looks: Data, change: Sequence[Address] = ()
) -> Data:
    """Return a group that writes objects in order, stores them, checks their last values after a reset, and restores.

    Objects are also restored one by one, in case 0x1011 does nothing, as are those that `looks` change (`change`).
    """
    store, restore = _store_and_restore(device, standard.ALL_PARAMETERS)
    lacking = [label(each.address) for each in values if not device.may_be(each.address, each.value)]
    if store is None or restore is None or lacking:
        lack = lacking[0] if lacking else "0x1010:1 or 0x1011:1"
        return step.skip(name, f"the file lacks {lack} that can be written as this wants")
    last = {each.address: each.value for each in values}
    # In reverse order, as some objects may be changed only while another is 0 or off.
    kept = device.kept([*change, *reversed(last)])
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
            # The nearest to a power cycle over the bus: all power-on values are loaded (CiA 301, 7.3.2.2.3).
            *step.undoing(_signed(restore, "restored"), *fresh("reset")),
            *(step.read(f"{label(at)} has its default", at, expect=device.number(at)) for at in last),
        ),
        *step.undoing(*fresh()),
        *(step.put_back(*each) for each in kept),
    )


@Clause(CHAPTER, "7.5.2.13", "Store", Tier.DESTRUCTIVE, "2.30", name="SDO client")
def _clients(device: DeviceUnderTest) -> Steps:
    """Store the COB-IDs of the first SDO client, as not valid."""
    there = (each for each in standard.SDO_CLIENTS if each in device.dictionary.members)
    index = need(next(there, None), "the file has no SDO client (0x1280)")
    # Not valid, as an active SDO client would talk to a missing node.
    bases = (SDO_REQUEST_BASE, SDO_RESPONSE_BASE)
    values = [Kept((index, sub), NOT_VALID | base + device.another) for sub, base in enumerate(bases, start=1)]
    return [kept_over_reset(device, f"0x{index:04X}", values)]


@Clause(CHAPTER, "7.5.2.23", "Verify configuration", Tier.DESTRUCTIVE, "8.9")
def _verified(device: DeviceUnderTest) -> Steps:
    """Store the date of the configuration, and check that a change of the configuration clears it (7.5.2.23)."""
    date, time = standard.VERIFY_CONFIGURATION
    # Masters rely on 0x1020 instead of comparing each object, so a device must clear it after a change.
    shown = _shown_by(device)
    looks = []
    changes = []
    if shown is not None:
        changes = [address_of(shown)]
        changed = step.write(f"{title(shown)} is changed", address_of(shown), value=_other(shown))
        looks = [changed, *(step.read(f"{label(each)} is 0 again", each, data="00 00 00 00") for each in (date, time))]
    values = [Kept(date, 9000), Kept(time, 36_000_000)]
    return [kept_over_reset(device, "date and time of the configuration", values, *looks, change=changes)]


def _signed(each: ODVariable, name: str) -> Data:
    # As bytes, because the file's limits of a command may exclude the signature.
    return {**step.write(name, address_of(each), data=standard.SIGNATURES[each.index].hex(" ")), "within": "10 s"}
