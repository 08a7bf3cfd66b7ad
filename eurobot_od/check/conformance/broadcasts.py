"""Emergencies and SYNC (CiA 301, 7.2.5, 7.2.7, and their objects in 7.5.2).

SYNC is tested with the device as producer and as consumer, with its period and its counter. All nodes that receive SYNC
act on it, so everything but reading is destructive there. Each group ends with a reset of the communication.
"""

from __future__ import annotations

from eurobot_od.check.conformance import step
from eurobot_od.check.conformance.clauses import (
    Chapter,
    Clause,
    DeviceUnderTest,
    Need,
    Tier,
    fresh,
    need,
    or_skipped,
    settable,
)
from eurobot_od.check.conformance.pdo import NO_SYNC, frame_of, having, need_uncounted_sync, sync
from eurobot_od.check.conformance.step import BUSY, OUTSIDE, RESTRICTED_ONES, Data, Steps, codes, hexadecimal, title
from eurobot_od.check.conformance.storage import Kept, kept_over_reset
from eurobot_od.device.broadcasts import COUNTERS
from eurobot_od.od import standard
from eurobot_od.od.objects import address_of, data_type, in_limits
from eurobot_od.od.pdos import Pdo
from eurobot_od.od.standard import ERRORS, SYNC, SYNC_COUNTER, SYNC_PERIOD, ErrorCode
from eurobot_od.od.values import TRANSMISSION_TYPE, Address, PdoDirection
from eurobot_od.sdo.wire import AbortCode

# Emergencies

EMCY_CHAPTER: Chapter[DeviceUnderTest] = Chapter("emcy", "emergencies")

NEWEST: Address = (standard.ERROR_FIELD, 1)

NO_EMCY_FOR, REPORTED_ONCE = "500 ms", "100 ms"
NO_HISTORY = "the file has no error history (0x1003)"


@Clause(EMCY_CHAPTER, "7.5.2.17", "EMCY", Tier.REVERSIBLE, "5.1", name="its COB-ID")
def _identifier_of_emcy(device: DeviceUnderTest) -> Steps:
    """Read the EMCY COB-ID, and compare it with the file's value, not with the usual one."""
    found = need(device.readable(standard.EMCY), "the file has no 0x1014 that can be read")
    content = data_type(found).write(device.number(standard.EMCY))
    name = f"its COB-ID is {content[::-1].hex().upper()}"
    return [step.read(name, standard.EMCY, data=content.hex(" ").upper())]


@Clause(EMCY_CHAPTER, "7.2.7", "EMCY", group="none without an error", needs=[DeviceUnderTest.need_emcy])
def _silence(_: DeviceUnderTest) -> Steps:
    return [step.wait("100 ms"), step.never("silent", {"emcy": "any"}, NO_EMCY_FOR)]


@Clause(EMCY_CHAPTER, "7.5.2.4", "Error history", ctt="5.3", name="its number of errors")
def _remembers(device: DeviceUnderTest) -> Steps:
    """Read the history: the number of errors, and the newest one."""
    need(device.readable(ERRORS), NO_HISTORY)
    yield step.read("its number of errors", ERRORS, data="any")
    if device.readable(NEWEST) is not None:
        # Without an error the entry may be empty or missing (CiA 301, 7.5.2.4); devices differ.
        none_now = codes(AbortCode.NO_DATA, AbortCode.NO_SUBINDEX, AbortCode.GENERAL)
        yield step.read("the newest of them", NEWEST, optional=none_now)


@Clause(EMCY_CHAPTER, "7.5.2.4", "Error history", Tier.DESTRUCTIVE, name="the history")
def _history(device: DeviceUnderTest) -> Steps:
    if not need(device.find(ERRORS), NO_HISTORY).writable:
        yield step.skip("the history is cleared", "the file's error history cannot be written")
        return
    # 0 clears the history, everything else is not allowed (CiA 301, 7.5.2.4).
    refused = codes(AbortCode.VALUE, AbortCode.TOO_HIGH)
    yield step.write("only 0 may be written", ERRORS, value=1, abort=refused)
    yield step.group("0 clears it", *_cleared("0 is written"))


def _cleared(name: str) -> list[Data]:
    return [step.write(name, ERRORS, data="00"), step.read("no error is left", ERRORS, data="00")]


@Clause(EMCY_CHAPTER, "7.2.7", "EMCY", Tier.DESTRUCTIVE, name="an RPDO that is too short")
def _too_short(device: DeviceUnderTest) -> Steps:
    """Send an RPDO that lacks one byte: the device must ignore it and send an EMCY."""
    rpdo = device.rpdo
    code = ErrorCode.PDO_TOO_SHORT
    device.need_emcy()
    named = hexadecimal(code)
    emergency = {"name": f"EMCY {named}", "emcy": {"code": named, "save": "register"}, "within": step.ANSWER_TIME}
    said = step.read("the error register says the same", standard.ERROR_REGISTER, expect="{register}")
    yield step.group(
        f"RPDO {rpdo.number}, one byte too short",
        *step.commanded("start"),
        # The only error that can be caused from outside without harm: the device ignores the frame and reports 0x8210
        # (CiA 301, 7.2.7).
        step.sent("the frame", rpdo.cob_id, bytes(rpdo.length - 1)),
        step.asking("5.4", emergency),
        step.never("it is reported once", {"emcy": f"0x{code:04X}"}, REPORTED_ONCE),
        # Compared with the register in the EMCY, as the manufacturer decides whether this error lasts.
        *([step.asking("5.5", said)] if device.readable(standard.ERROR_REGISTER) is not None else []),
        *_remembered(device, code),
        *step.undoing(*fresh()),
    )


def _remembered(device: DeviceUnderTest, code: ErrorCode) -> Steps:
    history = device.readable(ERRORS)
    if history is not None and device.find(NEWEST) is not None:
        if in_limits(history, 1):
            yield step.read("the history has it", ERRORS, expect=">= 1")
        # Read by raw frames: the lower half of the entry is the error code, the upper half is up to the manufacturer.
        digits = code.to_bytes(2, "little").hex().upper()
        yield {"name": "the history is asked", **device.request(bytes.fromhex("4003100100000000"))}
        newest = step.expect("its newest error is this", device.answer(f"4[23]031001{digits}????"))
        yield step.asking("5.6", newest)
        if history.writable:
            yield from _cleared("the history is cleared")


# SYNC

SYNC_CHAPTER: Chapter[DeviceUnderTest] = Chapter("sync", "SYNC", fresh=True, change=(SYNC, SYNC_COUNTER, SYNC_PERIOD))
"""`change` is in the order of restoring: a device that produces SYNC, or has a period, refuses a new counter."""
PRODUCER = SYNC_CHAPTER, "7.5.2.6", "SYNC producer", Tier.DESTRUCTIVE
CONSUMER = SYNC_CHAPTER, "7.5.2.6", "SYNC consumer", Tier.DESTRUCTIVE
OWN_SYNC = SYNC_CHAPTER, "7.2.2.2", "SYNC producer", Tier.DESTRUCTIVE
COUNTER = SYNC_CHAPTER, "7.5.2.22", "SYNC counter", Tier.DESTRUCTIVE
STORED = SYNC_CHAPTER, "7.5.2.13", "SYNC", Tier.DESTRUCTIVE

PERIOD = 100_000
"""Time between two SYNCs of the device, in us."""

COUNTED_SYNCS = 100
"""Number of SYNCs that are counted: ten seconds, as in CiA's tool."""

OVERFLOW = 5
"""Value of the SYNC counter after which it starts again at 1."""

IN_TIME = f"{3 * PERIOD // 1000} ms"

NO_PERIOD = "the file has no period of SYNC (0x1006) that can be written"

NO_MORE = step.write("period 0", SYNC_PERIOD, value=0)
PERIODIC = step.write(f"period {PERIOD} us", SYNC_PERIOD, value=PERIOD)

NO_PRODUCER = (*OUTSIDE, AbortCode.UNSUPPORTED_ACCESS, AbortCode.GENERAL)
"""Aborts of a device that cannot produce SYNC (CiA 301, 7.5.2.5)."""


@Clause(SYNC_CHAPTER, "7.5.2.5", "SYNC", Tier.REVERSIBLE, "6.1", name="its COB-ID")
def _identifier(device: DeviceUnderTest) -> Steps:
    found = need(device.readable(SYNC), "the file has no SYNC (0x1005) that can be read")
    content = data_type(found).write(device.number(SYNC)).hex(" ").upper()
    return [step.read(f"{title(found)} is the default", SYNC, data=content)]


@Clause(SYNC_CHAPTER, "7.3.5", "Identifiers", Tier.DESTRUCTIVE, "8.10", name="SYNC, TIME, EMCY")
def _restricted(device: DeviceUnderTest) -> Steps:
    found = filter(None, map(device.settable, (SYNC, standard.TIME, standard.EMCY)))
    for each in need([*found], "the file has none of 0x1005, 0x1012 and 0x1014 that can be written"):
        tried = (step.write(f"0x{one:03X}", address_of(each), value=one, abort="any") for one in RESTRICTED_ONES)
        yield step.keeping(f"{title(each)} takes no restricted identifier", each, *tried)


# Producer


def _sending(device: DeviceUnderTest) -> int:
    """Return the value of 0x1005 that makes the device produce SYNC."""
    return device.number(SYNC) | standard.SYNC_PRODUCER


def _producer(overflow: int = 0) -> Need[DeviceUnderTest]:
    """Return a need: the device can be made to produce SYNC with this counter."""

    def producer(device: DeviceUnderTest) -> None:
        need(device.model.pdos.sync_cob_id is not None, NO_SYNC)
        need(device.may_be(SYNC, _sending(device)), "the file's SYNC (0x1005) cannot be written")
        need(device.may_be(SYNC_PERIOD, 0, PERIOD), NO_PERIOD)
        # Without 0x1019 there is no counter, which is the same as an overflow of 0.
        counted = device.number(SYNC_COUNTER) == overflow or device.may_be(SYNC_COUNTER, overflow)
        need(counted, f"the file has no SYNC counter (0x1019) that can be {overflow}")

    return producer


def _configured(device: DeviceUnderTest, overflow: int) -> Steps:
    """Write counter and period; the counter may be changed only while the period is 0."""
    yield NO_MORE
    # Otherwise the device aborts with 0x08000022 (CiA 301, 7.5.2.22).
    if device.find(SYNC_COUNTER) is not None and device.number(SYNC_COUNTER) != overflow:
        yield step.write(f"counter {overflow}", SYNC_COUNTER, value=overflow)
    yield PERIODIC


def _started(device: DeviceUnderTest) -> Data:
    value = hexadecimal(_sending(device), 8)
    # Bit 30 last, so that the first SYNC already has the new period and counter (CiA 301, 7.5.2.5).
    return step.write("the device sends SYNC", SYNC, value=value, optional=codes(*NO_PRODUCER))


def _sync(device: DeviceUnderTest, digits: str = "") -> Data:
    return {"raw": f"{device.model.pdos.sync_cob_id or 0:03X}#{digits}"}


@Clause(*PRODUCER, "6.2", group="SYNC at its time, without data", needs=[_producer()])
def _produced(device: DeviceUnderTest) -> Steps:
    return [*_configured(device, 0), _started(device), step.every(_sync(device), PERIOD // 1000, COUNTED_SYNCS)]


@Clause(*PRODUCER, "6.6", group="SYNC without a counter", needs=[_producer()])
def _uncounted(device: DeviceUnderTest) -> Steps:
    counter = device.settable(SYNC_COUNTER)
    none = [] if counter is None else [step.write("counter 0", SYNC_COUNTER, value=0)]
    comes = step.expect("SYNC without data", _sync(device), IN_TIME)
    return [NO_MORE, *none, PERIODIC, _started(device), comes]


# PDOs


def _following(device: DeviceUnderTest, type_: int) -> Pdo:
    """Return the first TPDO that may have this SYNC transmission type; raises Lacks if there is none."""
    seen = device.seen(PdoDirection.TPDO)
    found = next((each for each in seen if device.may_be((each.index, TRANSMISSION_TYPE), type_)), None)
    return need(found, f"the file has no valid TPDO whose transmission type can be {type_}")


@Clause(*OWN_SYNC, "6.3", group="a TPDO with every second SYNC of its own", needs=[_producer()])
def _every_second(device: DeviceUnderTest) -> Steps:
    """Make a TPDO follow every second SYNC that the device produces."""
    tpdo = _following(device, 2)
    yield from _configured(device, 0)
    looks = _started(device), step.nmt("start"), step.every(frame_of(tpdo), 2 * PERIOD // 1000, 3)
    yield from having(device, tpdo, {TRANSMISSION_TYPE: 2}, *looks)


NO_NEED_OF_PERIOD = settable(SYNC_PERIOD, 0, lack="the file has no period of SYNC (0x1006) that can be 0")
WITHOUT = [need_uncounted_sync, NO_NEED_OF_PERIOD]


@Clause(*CONSUMER, "6.4", group="a TPDO with each SYNC though the period is 0", needs=WITHOUT)
def _without_period(device: DeviceUnderTest) -> Steps:
    """Send SYNC to a device whose SYNC period is 0: it must still consume it."""
    tpdo = _following(device, 1)
    # 0x1006 is the producer's period, and the consumer's timeout; a consumer without it still follows each SYNC.
    with_each = step.group("with each SYNC", sync(device), step.expect("it comes", frame_of(tpdo)))
    looks = step.nmt("start"), {**with_each, "repeat": 3}
    return [NO_MORE, *having(device, tpdo, {TRANSMISSION_TYPE: 1}, *looks)]


# Counter


@Clause(*COUNTER, name="its values")
def _numbers(device: DeviceUnderTest) -> Steps:
    """Write forbidden values of the counter, and change it while SYNC has a period (CiA 301, 7.5.2.22)."""
    need(device.settable(SYNC_COUNTER), "the file has no SYNC counter (0x1019) that can be written")
    steps = [NO_MORE] if device.may_be(SYNC_PERIOD, 0) else []
    refused = codes(*OUTSIDE, *(BUSY if device.number(SYNC_PERIOD) and not steps else ()))
    # 1 would be the same number in each SYNC, and 241 to 255 are reserved (CiA 301, 7.5.2.22).
    for value in (1, COUNTERS[-1] + 1):
        if device.number(SYNC_COUNTER) != value:
            steps.append(step.write(f"{value} is refused", SYNC_COUNTER, value=value, abort=refused))
    yield step.asking("6.5", SYNC_CHAPTER.group(device, "only 0 and 2 to 240", steps))
    yield from or_skipped("not while SYNC has a period", _changed_in_use, device)


def _changed_in_use(device: DeviceUnderTest) -> Steps:
    other = OVERFLOW + (device.number(SYNC_COUNTER) == OVERFLOW)
    need(device.may_be(SYNC_PERIOD, 0, PERIOD) and device.may_be(SYNC_COUNTER, other), NO_PERIOD)
    refused = codes(AbortCode.STATE, AbortCode.GENERAL)
    changed = step.write(f"counter {other}", SYNC_COUNTER, value=other, abort=refused)
    yield step.asking("6.9", SYNC_CHAPTER.group(device, "not while SYNC has a period", [PERIODIC, changed]))


@Clause(*COUNTER, "6.7", group=f"a counter up to {OVERFLOW}", needs=[_producer(OVERFLOW)])
def _counted(device: DeviceUnderTest) -> Steps:
    yield from _configured(device, OVERFLOW)
    yield _started(device)
    # It starts at 1 and returns to 1, never 0 (CiA 301, 7.2.5), so one SYNC more than the overflow is needed.
    for number in (*range(1, OVERFLOW + 1), 1):
        yield step.expect(f"SYNC {number}", _sync(device, f"{number:02X}"), IN_TIME)


# Stored

COUNTED = (Kept(SYNC_PERIOD, 0), Kept(SYNC_COUNTER, OVERFLOW, 2))


@Clause(*STORED, "6.8")
def _counter_stored(device: DeviceUnderTest) -> Steps:
    return [kept_over_reset(device, "the counter is stored", COUNTED)]


@Clause(*STORED, "6.10", name="all of it is stored")
def _stored(device: DeviceUnderTest) -> Steps:
    """Store SYNC as producer: after a reset the device sends it by itself."""
    need(device.model.pdos.sync_cob_id is not None, NO_SYNC)
    values = [*COUNTED, Kept(SYNC_PERIOD, PERIOD), Kept(SYNC, _sending(device))]
    # Any number, as SYNCs may come between the reset and the first look.
    goes_on = step.every(_sync(device, "??"), PERIOD // 1000, 3)
    return [kept_over_reset(device, "all of it is stored", values, goes_on)]
