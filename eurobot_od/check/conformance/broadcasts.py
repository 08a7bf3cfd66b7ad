"""What a device tells all others: emergencies and SYNC (CiA 301, 7.2.5, 7.2.7, and their objects in 7.5.2).

SYNC is looked at with the device as its producer and as its consumer, its period and its counter. Whoever hears SYNC
acts on it, so all but reading is destructive there; a reset of the communication ends each of its groups.
"""

from __future__ import annotations

from eurobot_od.check.conformance import step
from eurobot_od.check.conformance.clauses import Chapter, Clause, Need, Subject, Tier, fresh, need, or_skipped, settable
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

EMCY_CHAPTER: Chapter[Subject] = Chapter("emcy", "emergencies")

NEWEST: Address = (standard.ERROR_FIELD, 1)

NO_EMCY_FOR, REPORTED_ONCE = "500 ms", "100 ms"
NO_HISTORY = "the file has no error history (0x1003)"


@Clause(EMCY_CHAPTER, "7.5.2.17", "EMCY", Tier.REVERSIBLE, "5.1", name="its COB-ID")
def _identifier_of_emcy(subject: Subject) -> Steps:
    """Read where EMCY is: the file's own value, and not a guess of what is usual."""
    found = need(subject.readable(standard.EMCY), "the file has no 0x1014 that can be read")
    content = data_type(found).write(subject.number(standard.EMCY))
    name = f"its COB-ID is {content[::-1].hex().upper()}"
    return [step.read(name, standard.EMCY, data=content.hex(" ").upper())]


@Clause(EMCY_CHAPTER, "7.2.7", "EMCY", group="none without an error", needs=[Subject.need_emcy])
def _silence(_: Subject) -> Steps:
    return [step.wait("100 ms"), step.never("silent", {"emcy": "any"}, NO_EMCY_FOR)]


@Clause(EMCY_CHAPTER, "7.5.2.4", "Error history", ctt="5.3", name="its number of errors")
def _remembers(subject: Subject) -> Steps:
    """Read the history: how many errors it has, and the newest if there is one."""
    need(subject.readable(ERRORS), NO_HISTORY)
    yield step.read("its number of errors", ERRORS, data="any")
    if subject.readable(NEWEST) is not None:
        # While there is no error the entry may be empty, or not there at all (CiA 301, 7.5.2.4): makers differ.
        none_now = codes(AbortCode.NO_DATA, AbortCode.NO_SUBINDEX, AbortCode.GENERAL)
        yield step.read("the newest of them", NEWEST, optional=none_now)


@Clause(EMCY_CHAPTER, "7.5.2.4", "Error history", Tier.DESTRUCTIVE, name="the history")
def _history(subject: Subject) -> Steps:
    if not need(subject.find(ERRORS), NO_HISTORY).writable:
        yield step.skip("the history is cleared", "the file's error history cannot be written")
        return
    # 0 clears the history, everything else is not allowed (CiA 301, 7.5.2.4).
    refused = codes(AbortCode.VALUE, AbortCode.TOO_HIGH)
    yield step.write("only 0 may be written", ERRORS, value=1, abort=refused)
    yield step.group("0 clears it", *_cleared("0 is written"))


def _cleared(name: str) -> list[Data]:
    return [step.write(name, ERRORS, data="00"), step.read("no error is left", ERRORS, data="00")]


@Clause(EMCY_CHAPTER, "7.2.7", "EMCY", Tier.DESTRUCTIVE, name="an RPDO that is too short")
def _too_short(subject: Subject) -> Steps:
    """Send an RPDO that lacks a byte: the device must not take it, and says so."""
    rpdo, code = subject.rpdo, ErrorCode.PDO_TOO_SHORT
    subject.need_emcy()
    named = hexadecimal(code)
    emergency = {"name": f"EMCY {named}", "emcy": {"code": named, "save": "register"}, "within": step.ANSWER_TIME}
    said = step.read("the error register says the same", standard.ERROR_REGISTER, expect="{register}")
    yield step.group(
        f"RPDO {rpdo.number}, one byte too short",
        *step.commanded("start"),
        # The one error that can be made from outside without doing harm: the device ignores the frame and says 0x8210
        # (CiA 301, 7.2.7).
        step.sent("the frame", rpdo.cob_id, bytes(rpdo.length - 1)),
        step.asking("5.4", emergency),
        step.never("it is reported once", {"emcy": f"0x{code:04X}"}, REPORTED_ONCE),
        # What the EMCY said of it: whether the device counts this as an error that lasts, is the maker's.
        *([step.asking("5.5", said)] if subject.readable(standard.ERROR_REGISTER) is not None else []),
        *_remembered(subject, code),
        *step.undoing(*fresh()),
    )


def _remembered(subject: Subject, code: ErrorCode) -> Steps:
    history = subject.readable(ERRORS)
    if history is not None and subject.find(NEWEST) is not None:
        if in_limits(history, 1):
            yield step.read("the history has it", ERRORS, expect=">= 1")
        # Asked for as a frame: an entry has the error code in its lower half, and whatever the maker adds in the upper
        # one, so that no value can be compared.
        digits = code.to_bytes(2, "little").hex().upper()
        yield {"name": "the history is asked", **subject.request(bytes.fromhex("4003100100000000"))}
        newest = step.expect("its newest error is this", subject.answer(f"4[23]031001{digits}????"))
        yield step.asking("5.6", newest)
        if history.writable:
            yield from _cleared("the history is cleared")


# SYNC

SYNC_CHAPTER: Chapter[Subject] = Chapter("sync", "SYNC", fresh=True, change=(SYNC, SYNC_COUNTER, SYNC_PERIOD))
"""The order in which they are put back: a device that sends SYNC, or has a period of it, takes no other counter."""
PRODUCER = SYNC_CHAPTER, "7.5.2.6", "SYNC producer", Tier.DESTRUCTIVE
CONSUMER = SYNC_CHAPTER, "7.5.2.6", "SYNC consumer", Tier.DESTRUCTIVE
OWN_SYNC = SYNC_CHAPTER, "7.2.2.2", "SYNC producer", Tier.DESTRUCTIVE
COUNTER = SYNC_CHAPTER, "7.5.2.22", "SYNC counter", Tier.DESTRUCTIVE
STORED = SYNC_CHAPTER, "7.5.2.13", "SYNC", Tier.DESTRUCTIVE

PERIOD = 100_000
"""Time between two SYNCs of the device, us."""

COUNTED_SYNCS = 100
"""SYNCs that are counted: as CiA's tool does it, those of ten seconds."""

OVERFLOW = 5
"""Up to which number they are counted."""

IN_TIME = f"{3 * PERIOD // 1000} ms"

NO_PERIOD = "the file has no period of SYNC (0x1006) that can be written"

NO_MORE = step.write("period 0", SYNC_PERIOD, value=0)
PERIODIC = step.write(f"period {PERIOD} us", SYNC_PERIOD, value=PERIOD)

NO_PRODUCER = (*OUTSIDE, AbortCode.UNSUPPORTED_ACCESS, AbortCode.GENERAL)
"""Aborts of a device that cannot send SYNC (CiA 301, 7.5.2.5)."""


@Clause(SYNC_CHAPTER, "7.5.2.5", "SYNC", Tier.REVERSIBLE, "6.1", name="its COB-ID")
def _identifier(subject: Subject) -> Steps:
    found = need(subject.readable(SYNC), "the file has no SYNC (0x1005) that can be read")
    content = data_type(found).write(subject.number(SYNC)).hex(" ").upper()
    return [step.read(f"{title(found)} is the default", SYNC, data=content)]


@Clause(SYNC_CHAPTER, "7.3.5", "Identifiers", Tier.DESTRUCTIVE, "8.10", name="SYNC, TIME, EMCY")
def _restricted(subject: Subject) -> Steps:
    found = filter(None, map(subject.settable, (SYNC, standard.TIME, standard.EMCY)))
    for each in need([*found], "the file has none of 0x1005, 0x1012 and 0x1014 that can be written"):
        tried = (step.write(f"0x{one:03X}", address_of(each), value=one, abort="any") for one in RESTRICTED_ONES)
        yield step.keeping(f"{title(each)} takes no restricted identifier", each, *tried)


# Producer


def _sending(subject: Subject) -> int:
    """Return the value of 0x1005 that makes the device send SYNC."""
    return subject.number(SYNC) | standard.SYNC_PRODUCER


def _producer(overflow: int = 0) -> Need[Subject]:
    """Need a device that can be made to send SYNC with a counter."""

    def producer(subject: Subject) -> None:
        need(subject.model.pdos.sync_cob_id is not None, NO_SYNC)
        need(subject.may_be(SYNC, _sending(subject)), "the file's SYNC (0x1005) cannot be written")
        need(subject.may_be(SYNC_PERIOD, 0, PERIOD), NO_PERIOD)
        # Without 0x1019 there is no counter, which is the same as an overflow of 0.
        counted = subject.number(SYNC_COUNTER) == overflow or subject.may_be(SYNC_COUNTER, overflow)
        need(counted, f"the file has no SYNC counter (0x1019) that can be {overflow}")

    return producer


def _configured(subject: Subject, overflow: int) -> Steps:
    """Write period and counter, which may be changed only while the period is 0."""
    yield NO_MORE
    # 0x1019 may be written only while 0x1006 is 0, else 0x08000022 (CiA 301, 7.5.2.22).
    if subject.find(SYNC_COUNTER) is not None and subject.number(SYNC_COUNTER) != overflow:
        yield step.write(f"counter {overflow}", SYNC_COUNTER, value=overflow)
    yield PERIODIC


def _started(subject: Subject) -> Data:
    value = hexadecimal(_sending(subject), 8)
    # Bit 30, last of all: the first SYNC is to come with the period and the counter that were just written (CiA 301,
    # 7.5.2.5).
    return step.write("the device sends SYNC", SYNC, value=value, optional=codes(*NO_PRODUCER))


def _sync(subject: Subject, digits: str = "") -> Data:
    return {"raw": f"{subject.model.pdos.sync_cob_id or 0:03X}#{digits}"}


@Clause(*PRODUCER, "6.2", group="SYNC at its time, without data", needs=[_producer()])
def _produced(subject: Subject) -> Steps:
    return [*_configured(subject, 0), _started(subject), step.every(_sync(subject), PERIOD // 1000, COUNTED_SYNCS)]


@Clause(*PRODUCER, "6.6", group="SYNC without a counter", needs=[_producer()])
def _uncounted(subject: Subject) -> Steps:
    counter = subject.settable(SYNC_COUNTER)
    none = [] if counter is None else [step.write("counter 0", SYNC_COUNTER, value=0)]
    comes = step.expect("SYNC without data", _sync(subject), IN_TIME)
    return [NO_MORE, *none, PERIODIC, _started(subject), comes]


# PDOs


def _following(subject: Subject, type_: int) -> Pdo:
    """Return the first TPDO that may follow SYNC; raises Lacks without one."""
    seen = subject.seen(PdoDirection.TPDO)
    found = next((each for each in seen if subject.may_be((each.index, TRANSMISSION_TYPE), type_)), None)
    return need(found, f"the file has no valid TPDO whose transmission type can be {type_}")


@Clause(*OWN_SYNC, "6.3", group="a TPDO with every second SYNC of its own", needs=[_producer()])
def _every_second(subject: Subject) -> Steps:
    """Have a TPDO follow the device's own SYNC: with every second one of them."""
    tpdo = _following(subject, 2)
    yield from _configured(subject, 0)
    looks = _started(subject), step.nmt("start"), step.every(frame_of(tpdo), 2 * PERIOD // 1000, 3)
    yield from having(subject, tpdo, {TRANSMISSION_TYPE: 2}, *looks)


NO_NEED_OF_PERIOD = settable(SYNC_PERIOD, 0, lack="the file has no period of SYNC (0x1006) that can be 0")
WITHOUT = [need_uncounted_sync, NO_NEED_OF_PERIOD]


@Clause(*CONSUMER, "6.4", group="a TPDO with each SYNC though the period is 0", needs=WITHOUT)
def _without_period(subject: Subject) -> Steps:
    """Send SYNC to a device that has no period of it: it is a consumer all the same."""
    tpdo = _following(subject, 1)
    # 0x1006 is the producer's period and the consumer's watch; a consumer without one follows each SYNC all the same.
    with_each = step.group("with each SYNC", sync(subject), step.expect("it comes", frame_of(tpdo)))
    looks = step.nmt("start"), {**with_each, "repeat": 3}
    return [NO_MORE, *having(subject, tpdo, {TRANSMISSION_TYPE: 1}, *looks)]


# Counter


@Clause(*COUNTER, name="its values")
def _numbers(subject: Subject) -> Steps:
    """Write what the counter cannot be, and change it while SYNC has a period (CiA 301, 7.5.2.22)."""
    need(subject.settable(SYNC_COUNTER), "the file has no SYNC counter (0x1019) that can be written")
    steps = [NO_MORE] if subject.may_be(SYNC_PERIOD, 0) else []
    refused = codes(*OUTSIDE, *(BUSY if subject.number(SYNC_PERIOD) and not steps else ()))
    # 1 would be the same number in each SYNC, and 241 to 255 are reserved (CiA 301, 7.5.2.22).
    for value in (1, COUNTERS[-1] + 1):
        if subject.number(SYNC_COUNTER) != value:
            steps.append(step.write(f"{value} is refused", SYNC_COUNTER, value=value, abort=refused))
    yield step.asking("6.5", SYNC_CHAPTER.group(subject, "only 0 and 2 to 240", steps))
    yield from or_skipped("not while SYNC has a period", _changed_in_use, subject)


def _changed_in_use(subject: Subject) -> Steps:
    other = OVERFLOW + (subject.number(SYNC_COUNTER) == OVERFLOW)
    need(subject.may_be(SYNC_PERIOD, 0, PERIOD) and subject.may_be(SYNC_COUNTER, other), NO_PERIOD)
    refused = codes(AbortCode.STATE, AbortCode.GENERAL)
    changed = step.write(f"counter {other}", SYNC_COUNTER, value=other, abort=refused)
    yield step.asking("6.9", SYNC_CHAPTER.group(subject, "not while SYNC has a period", [PERIODIC, changed]))


@Clause(*COUNTER, "6.7", group=f"a counter up to {OVERFLOW}", needs=[_producer(OVERFLOW)])
def _counted(subject: Subject) -> Steps:
    yield from _configured(subject, OVERFLOW)
    yield _started(subject)
    # It begins with 1 and goes back to 1, never through 0 (CiA 301, 7.2.5): one more than the overflow is needed to see
    # it.
    for number in (*range(1, OVERFLOW + 1), 1):
        yield step.expect(f"SYNC {number}", _sync(subject, f"{number:02X}"), IN_TIME)


# Stored

COUNTED = (Kept(SYNC_PERIOD, 0), Kept(SYNC_COUNTER, OVERFLOW, 2))


@Clause(*STORED, "6.8")
def _counter_stored(subject: Subject) -> Steps:
    return [kept_over_reset(subject, "the counter is stored", COUNTED)]


@Clause(*STORED, "6.10", name="all of it is stored")
def _stored(subject: Subject) -> Steps:
    """Store all of SYNC: after a reset the device sends it by itself."""
    need(subject.model.pdos.sync_cob_id is not None, NO_SYNC)
    values = [*COUNTED, Kept(SYNC_PERIOD, PERIOD), Kept(SYNC, _sending(subject))]
    # Any number: how many SYNCs came between the reset and the first look, nobody can say.
    goes_on = step.every(_sync(subject, "??"), PERIOD // 1000, 3)
    return [kept_over_reset(subject, "all of it is stored", values, goes_on)]
