"""SDO transfers frame by frame: expedited, by segments, in blocks, toggle bits, aborts, time-outs (CiA 301, 7.2.4.3).

Rule of this file: an object is given the value that it has after a reset, and gets back what it had before.
"""

from __future__ import annotations

from canopen.objectdictionary import ODVariable

from eurobot_od.check.conformance import step
from eurobot_od.check.conformance.clauses import NO_DEVICE_TYPE, Chapter, Clause, Subject, Tier, awake, fresh, need
from eurobot_od.check.conformance.objects import ACTING, CONFIGURED, FIXED, NO_OBJECT
from eurobot_od.check.conformance.step import NO_BLOCKS, Data, Steps, codes, title
from eurobot_od.check.suite import Blocks
from eurobot_od.od.objects import address_of, data_type, default_bytes
from eurobot_od.od.standard import DEVICE_TYPE, GUARD_TIME, HEARTBEAT_TIME, SDO_ANSWERS, SDO_CLIENTS, SDO_REQUESTS
from eurobot_od.od.values import SDO_REQUEST_BASE, SDO_RESPONSE_BASE, Address
from eurobot_od.sdo import wire
from eurobot_od.sdo.wire import AbortCode, ClientCommand, initiate

CHAPTER: Chapter[Subject] = Chapter("sdo", "SDO transfers")

QUIET = "200 ms"

LEFT_ALONE, LEFT_AT_FIRST = "12 s", "1 s"
"""How long a server is given at most to be ready again after a transfer that was left alone, and until it is first
asked; no clause names a time."""

NOTHING_SHORT = "the file has no number of up to 4 bytes that can be read"
NO_SEGMENTS = "the file has no object of more than 4 bytes whose value is known"
NO_NUMBER = "the file has no number of up to 4 bytes that can be written and whose value is known"

SDO_SERVERS = range(SDO_REQUESTS[0], SDO_CLIENTS[0])
SDO_BASES = {SDO_REQUESTS: SDO_REQUEST_BASE, SDO_ANSWERS: SDO_RESPONSE_BASE}
"""Where the COB-IDs of the first server are, without the node-ID."""


def _known(each: ODVariable) -> bool:
    """Return whether an object is readable, and has the file's value after a reset."""
    steady = each.access_type in CONFIGURED or each.index in FIXED
    return each.readable and steady and default_bytes(each) is not None and each.index not in ACTING


def _content(each: ODVariable) -> bytes:
    """Return the known value of an object."""
    return default_bytes(each) or b""


def _long(subject: Subject) -> ODVariable | None:
    """Return the object with the longest known value over 4 bytes."""
    # Up to 4 bytes go into the first answer: only a longer value shows segments (CiA 301, 7.2.4.3.6).
    found = [each for each in subject.objects if _known(each) and len(_content(each)) > 4]
    return max(found, key=lambda each: len(_content(each)), default=None)


def _number(subject: Subject) -> ODVariable:
    """Return a number that can be written as it is: the heartbeat time, or the first other one without a COB-ID.

    Where nothing is to be written but the heartbeat time there is no other. Raises Lacks without one.
    """
    settable = [each for each in subject.objects if _known(each) and subject.settable(address_of(each))]
    integers = [each for each in settable if data_type(each).is_integer and data_type(each).size <= 4]
    # From 0x1400 on a PDO's record may refuse even the value it has while the PDO is valid, and CiA 302's objects act.
    found = [each for each in integers if not 0x1400 <= each.index < 0x2000]
    if subject.tier is Tier.READING:
        found = [each for each in found if address_of(each) == HEARTBEAT_TIME]
    return need(min(found, key=lambda each: address_of(each) != HEARTBEAT_TIME, default=None), NO_NUMBER)


def _usual(subject: Subject) -> Address:
    """Return the object that frames are about which have to be refused: that of CiA's tool."""
    return DEVICE_TYPE if subject.readable(DEVICE_TYPE) is not None else subject.probe


# Uploads


@Clause(CHAPTER, "7.2.4.3.6", "SDO upload", ctt="2.1, 2.13")
def _expedited_upload(subject: Subject) -> Steps:
    need(subject.find(DEVICE_TYPE), NO_DEVICE_TYPE)
    answer = step.expect("4 bytes", subject.answer("4[23]001000????????"))
    # CiA's tool reads it a second time "by segments": of 4 bytes both are the same frames.
    for name, asked in (("the device type in one answer", "2.1"), ("the device type once more", "2.13")):
        yield step.asking(asked, step.group(name, _asked(subject, DEVICE_TYPE), answer))


@Clause(CHAPTER, "7.2.4.3.7", "SDO upload", ctt="2.16, 2.17, 2.18", name="by segments")
def _segmented_upload(subject: Subject) -> Steps:
    each = need(_long(subject), NO_SEGMENTS)
    yield step.asking("2.16", step.read(f"{title(each)} by segments", address_of(each), data="any"))
    wrong = step.group(
        "a wrong toggle bit is refused",
        _asked(subject, address_of(each)),
        step.expect("it begins", subject.answer(f"4?{_multiplexer(each)}????????")),
        # The first segment has the toggle bit 0 (CiA 301, 7.2.4.3.7).
        _sent(subject, "the first segment, asked for with the toggle bit set", wire.plain(0x70)),
        _aborted(subject, AbortCode.TOGGLE_BIT),
    )
    yield step.asking("2.17", wrong)
    yield step.asking("2.18", step.read(f"{title(each)} as a whole", address_of(each), data="any"))


WITH_CRC, WITHOUT_CRC = Blocks.PLAIN.value, Blocks.WITHOUT_CRC.value


@Clause(CHAPTER, "7.2.4.3.12", "SDO block upload")
def _block_upload(subject: Subject) -> Steps:
    # Block transfer is optional; a server without it refuses the first request, and nothing else is wrong with it.
    device_type, long = subject.find(DEVICE_TYPE), _long(subject)
    for each, transfer, asked in (
        (device_type, WITHOUT_CRC, "2.19"),
        (long, WITHOUT_CRC, "2.22"),
        (long, WITH_CRC, "2.23"),
    ):
        if each is not None and default_bytes(each) is not None:
            again = step.unchanged(each, "in blocks it is the same", transfer=transfer, optional=codes(*NO_BLOCKS))
            yield step.asking(asked, step.group(f"{title(each)}, {transfer}", step.save(each), again))


# Downloads


NOT_GUARDED = "the file has no guard time (0x100C) that can be read, written and put back, and whose value is known"


def _asked_of(each: ODVariable, guard: str, heartbeat: str) -> str:
    """Return the tool's number for an object that is downloaded, if it is one of the tool's."""
    return {GUARD_TIME: guard, HEARTBEAT_TIME: heartbeat}.get(address_of(each), "")


@Clause(CHAPTER, "7.2.4.3.4", "SDO download", name="by segments")
def _segmented_download(subject: Subject) -> Steps:
    each = _number(subject)
    yield _by_segments(subject, each)
    # With its own value: a server that does not look at the bit writes what is there already.
    segment = wire.segment(ClientCommand.DOWNLOAD_SEGMENT, wire.TOGGLE, _content(each), last=True)
    wrong = _sent(subject, "the only segment, with the toggle bit set", segment)
    refused = wrong, _aborted(subject, AbortCode.TOGGLE_BIT), step.unchanged(each)
    yield step.keeping("a wrong toggle bit is refused", each, *_begun(subject, each), *refused)


@Clause(CHAPTER, "7.2.4.3.4", "SDO download", Tier.REVERSIBLE, "2.14", name="0x100C by segments")
def _segmented_guard_time(subject: Subject) -> Steps:
    each = need(subject.settable(GUARD_TIME), NOT_GUARDED)
    yield _by_segments(subject, need(each if _known(each) else None, NOT_GUARDED))


def _by_segments(subject: Subject, each: ODVariable) -> Data:
    content = _content(each)
    whole = (
        *_begun(subject, each),
        _sent(subject, "the only segment", wire.segment(ClientCommand.DOWNLOAD_SEGMENT, 0, content, last=True)),
        step.expect("it is taken", subject.answer(f"20{'?' * 14}")),
        step.read("it has the value", address_of(each), data=content.hex(" ")),
    )
    return step.asking(_asked_of(each, "2.14", "2.15"), step.keeping(f"{title(each)} by segments", each, *whole))


@Clause(CHAPTER, "7.2.4.3.8", "SDO block download", name="in blocks")
def _block_download(subject: Subject) -> Steps:
    return _in_blocks(_number(subject))


@Clause(CHAPTER, "7.2.4.3.8", "SDO block download", Tier.REVERSIBLE, "2.20, 2.24", name="0x100C in blocks")
def _block_guard_time(subject: Subject) -> Steps:
    return _in_blocks(need(subject.settable(GUARD_TIME), NOT_GUARDED))


def _in_blocks(each: ODVariable) -> Steps:
    for transfer, asked in ((WITHOUT_CRC, ("2.20", "2.21")), (WITH_CRC, ("2.24", "2.25"))):
        written = step.rewritten("its own value", each, transfer=transfer, optional=codes(*NO_BLOCKS))
        same = step.keeping(f"{title(each)}, {transfer}", each, written, step.unchanged(each))
        yield step.asking(_asked_of(each, *asked), same)


# Aborts


@Clause(CHAPTER, "7.2.4.3.17", "SDO abort", ctt="2.7", group="an unknown command is refused")
def _unknown_command(subject: Subject) -> Steps:
    # 0xE0: the one of eight that no request has (CiA 301, 7.2.4.3). It is about an object that there is, so that only
    # the command can be refused.
    sent = _sent(subject, "command specifier 7", initiate(0xE0, _usual(subject)))
    return [sent, _aborted(subject, AbortCode.UNKNOWN_COMMAND, AbortCode.GENERAL)]


@Clause(CHAPTER, "7.2.4.3.17", "SDO abort", group="a client's abort is not answered")
def _client_aborts(subject: Subject) -> Steps:
    yield _sent(subject, "abort", wire.aborted(subject.probe, AbortCode.GENERAL))
    # An abort that is answered by an abort would go to and fro for ever.
    yield step.never("no answer", subject.answer("?" * 16), QUIET)
    yield awake(subject, "the next request is")


@Clause(CHAPTER, "7.2.4.3.17", "SDO abort", name="a transfer that is left alone")
def _unfinished(subject: Subject) -> Steps:
    each = _number(subject)
    begun, same = [*_begun(subject, each)], step.unchanged(each)
    # A device that answers an abort is red for that above; here it is waited out.
    abort = _sent(subject, "abort", wire.aborted(address_of(each), AbortCode.GENERAL)), step.wait("50 ms")
    yield step.keeping("a transfer that the client aborts changes nothing", each, *begun, *abort, same)
    # No clause names a time-out; but a client that went away must not keep all later ones out until the next reset.
    # Asked again after twice the time each time, as each request may begin the server's own time-out anew, and be
    # refused for the old transfer (CiA 301 leaves both open).
    begins = subject.answer(f"4?{_multiplexer(each)}????????")
    asked = {**subject.request(initiate(ClientCommand.UPLOAD << 5, address_of(each))), "every": LEFT_AT_FIRST}
    name = f"it answers within {LEFT_ALONE}, asked after 1 s, 2 s, 4 s and 8 s"
    ready = {"name": name, "poll": {**asked, "factor": 2}, "until": begins, "within": LEFT_ALONE}
    left_alone = step.wait(LEFT_AT_FIRST), ready
    yield step.keeping("a transfer that is left alone does not block the server", each, *begun, *left_alone, same)


# Numbers of blocks


@Clause(CHAPTER, "7.2.4.3.12", "SDO block upload", ctt="2.26", group="a block of 128 segments is refused")
def _block_size(subject: Subject) -> Steps:
    """Ask for blocks of one segment more than there are."""
    need(subject.readable(_usual(subject)), NOTHING_SHORT)
    # 127 is the most that seven bits can number (CiA 301, 7.2.4.3.12).
    size = bytes([wire.BLOCK_SEGMENTS + 1])
    yield _sent(subject, "128 segments", initiate(ClientCommand.BLOCK_UPLOAD << 5, _usual(subject), size))
    yield _aborted(subject, AbortCode.BLOCK_SIZE, AbortCode.GENERAL, *NO_BLOCKS)


@Clause(CHAPTER, "7.2.4.3.13", "SDO block upload", ctt="2.27", group="an acknowledgement of 128 segments is refused")
def _sequence_number(subject: Subject) -> Steps:
    """Acknowledge more segments than a block can have."""
    need(subject.readable(_usual(subject)), NOTHING_SHORT)
    upload, most = ClientCommand.BLOCK_UPLOAD << 5, wire.BLOCK_SEGMENTS
    # Kept, so that without blocks, refused or not, nothing further is asked.
    blocks = {"data": "any", "transfer": "block", "save": "blocks", "optional": codes(*NO_BLOCKS)}
    yield step.read("blocks are there", _usual(subject), **blocks)
    yield _sent(subject, "the first request", initiate(upload, _usual(subject), bytes([most])))
    yield step.expect("it begins", subject.answer(f"C?{'?' * 14}"))
    yield _sent(subject, "start", wire.plain(upload | wire.Block.START))
    yield step.expect("the first segment", subject.answer(f"?1{'?' * 14}"))
    beyond = wire.plain(upload | wire.Block.ACKNOWLEDGE, bytes([most + 1, most]))
    yield _sent(subject, "128 segments acknowledged", beyond)
    yield _aborted(subject, AbortCode.SEQUENCE_NUMBER, AbortCode.GENERAL, AbortCode.UNKNOWN_COMMAND)
    yield step.wait("50 ms")  # what a server without blocks still has to say is not an answer to the next request


# Servers


@Clause(CHAPTER, "7.5.2.33", "SDO server")
def _servers(subject: Subject) -> Steps:
    """Read where each server is; the first has the identifiers of the predefined connection set."""
    for index in subject.dictionary.members:
        for found in filter(None, (subject.find((index, sub)) for sub in (1, 2) if index in SDO_SERVERS)):
            # 0x600 and 0x580 plus the node-ID: a master that knows nothing else of a device must be able to ask it.
            base = SDO_BASES.get(address_of(found))
            usual = None if base is None else base + subject.dictionary.node_id
            if usual is not None and subject.number(address_of(found)) != usual:
                yield step.skip(title(found), f"the file itself has another one than 0x{usual:X}")
            elif found.readable:
                data = "any" if usual is None else data_type(found).write(usual).hex(" ").upper()
                asked = "2.28" if base is None else "2.12"
                yield step.asking(asked, step.read(title(found), address_of(found), data=data))
    second = SDO_SERVERS[1]
    if second not in subject.dictionary.members:
        absent = step.read(f"0x{second:04X} is not there", (second, 1), abort=codes(*NO_OBJECT))
        yield step.asking("2.28", absent)
    if SDO_REQUESTS[0] not in subject.dictionary.members:
        yield step.skip("0x1200", "the file has no SDO server (0x1200)")


@Clause(CHAPTER, "7.5.2.33", "SDO server", Tier.REVERSIBLE, "2.29", name="further servers")
def _further_servers(subject: Subject) -> Steps:
    """See that further servers have their defaults after a reset of the communication."""
    further = [each for each in subject.objects if each.index in SDO_SERVERS[1:] and _known(each)]
    need(further, "the file has no further SDO server (0x1201) with defaults")
    seen = (step.read(title(each), address_of(each), data=_content(each).hex(" ").upper()) for each in further)
    yield step.group("further servers after reset communication", *fresh(), *seen)


# Frames


def _begun(subject: Subject, each: ODVariable) -> Steps:
    """Begin a download by segments."""
    size = len(_content(each)).to_bytes(4, "little")
    begin = initiate(ClientCommand.DOWNLOAD << 5 | wire.SIZE_GIVEN, address_of(each), size)
    yield _sent(subject, "the first request", begin)
    yield step.expect("it begins", subject.answer(f"60{_multiplexer(each)}????????"))


def _asked(subject: Subject, address: Address) -> Data:
    return _sent(subject, "the first request", initiate(ClientCommand.UPLOAD << 5, address))


def _sent(subject: Subject, name: str, data: bytes) -> Data:
    return {"name": name, **subject.request(data)}


def _aborted(subject: Subject, *aborts: AbortCode) -> Data:
    """Expect one of some aborts; which object it names is open where the request did not name one."""
    answers = [subject.answer(f"80??????{code.to_bytes(4, 'little').hex().upper()}") for code in aborts]
    # CiA 301 names codes, but leaves it to a server how exactly it knows what is wrong.
    return step.expect("abort", {"any": answers} if len(answers) > 1 else answers[0])


def _multiplexer(each: ODVariable) -> str:
    return f"{each.index & 0xFF:02X}{each.index >> 8:02X}{each.subindex:02X}"
