"""SDO transfers frame by frame: expedited, by segments, in blocks, toggle bits, aborts, timeouts (CiA 301, 7.2.4.3).

An object is written with its value after a reset, and then gets back its former value.
"""

from __future__ import annotations

from canopen.objectdictionary import ODVariable

from eurobot_od.check.conformance import step
from eurobot_od.check.conformance.clauses import (
    NO_DEVICE_TYPE,
    Chapter,
    Clause,
    DeviceUnderTest,
    Tier,
    awake,
    fresh,
    need,
)
from eurobot_od.check.conformance.objects import ACTING, CONFIGURED, FIXED, NO_OBJECT
from eurobot_od.check.conformance.step import NO_BLOCKS, Data, Steps, codes, title
from eurobot_od.check.suite import Blocks
from eurobot_od.od.objects import address_of, data_type, default_bytes
from eurobot_od.od.standard import DEVICE_TYPE, GUARD_TIME, HEARTBEAT_TIME, SDO_ANSWERS, SDO_CLIENTS, SDO_REQUESTS
from eurobot_od.od.values import SDO_REQUEST_BASE, SDO_RESPONSE_BASE, Address
from eurobot_od.sdo import wire
from eurobot_od.sdo.wire import AbortCode, ClientCommand, initiate

CHAPTER: Chapter[DeviceUnderTest] = Chapter("sdo", "SDO transfers")

QUIET = "200 ms"

LEFT_ALONE, LEFT_AT_FIRST = "12 s", "1 s"
"""Maximum time until a server is ready after an abandoned transfer, and time before the first request.

No clause names a time.
"""

NOTHING_SHORT = "the file has no number of up to 4 bytes that can be read"
NO_SEGMENTS = "the file has no object of more than 4 bytes whose value is known"
NO_NUMBER = "the file has no number of up to 4 bytes that can be written and whose value is known"

SDO_SERVERS = range(SDO_REQUESTS[0], SDO_CLIENTS[0])
SDO_BASES = {SDO_REQUESTS: SDO_REQUEST_BASE, SDO_ANSWERS: SDO_RESPONSE_BASE}
"""COB-IDs of the first server without the node-ID."""


def _known(each: ODVariable) -> bool:
    """Return whether an object can be read and has the file's value after a reset."""
    steady = each.access_type in CONFIGURED or each.index in FIXED
    return each.readable and steady and default_bytes(each) is not None and each.index not in ACTING


def _content(each: ODVariable) -> bytes:
    """Return the known value of an object as bytes."""
    return default_bytes(each) or b""


def _long(device: DeviceUnderTest) -> ODVariable | None:
    """Return the object with the longest known value of more than 4 bytes."""
    # Up to 4 bytes fit the first answer; only longer values need segments (CiA 301, 7.2.4.3.6).
    found = [each for each in device.objects if _known(each) and len(_content(each)) > 4]
    return max(found, key=lambda each: len(_content(each)), default=None)


def _number(device: DeviceUnderTest) -> ODVariable:
    """Return an integer that can be written with its own value: the heartbeat time, otherwise the first one.

    In the reading tier only the heartbeat time may be written. Raises Lacks if there is none.
    """
    settable = [each for each in device.objects if _known(each) and device.settable(address_of(each))]
    integers = [each for each in settable if data_type(each).is_integer and data_type(each).size <= 4]
    # A valid PDO's record may refuse even its own value, and writing CiA 302's objects may be a command.
    found = [each for each in integers if not 0x1400 <= each.index < 0x2000]
    if device.tier is Tier.READING:
        found = [each for each in found if address_of(each) == HEARTBEAT_TIME]
    return need(min(found, key=lambda each: address_of(each) != HEARTBEAT_TIME, default=None), NO_NUMBER)


def _usual(device: DeviceUnderTest) -> Address:
    """Return the object for requests that must be refused: that of CiA's tool."""
    return DEVICE_TYPE if device.readable(DEVICE_TYPE) is not None else device.probe


# Uploads


@Clause(CHAPTER, "7.2.4.3.6", "SDO upload", ctt="2.1, 2.13")
def _expedited_upload(device: DeviceUnderTest) -> Steps:
    need(device.find(DEVICE_TYPE), NO_DEVICE_TYPE)
    answer = step.expect("4 bytes", device.answer("4[23]001000????????"))
    # CiA's tool reads it a second time "by segments"; for 4 bytes the frames are the same.
    for name, asked in (("the device type in one answer", "2.1"), ("the device type once more", "2.13")):
        yield step.asking(asked, step.group(name, _asked(device, DEVICE_TYPE), answer))


@Clause(CHAPTER, "7.2.4.3.7", "SDO upload", ctt="2.16, 2.17, 2.18", name="by segments")
def _segmented_upload(device: DeviceUnderTest) -> Steps:
    each = need(_long(device), NO_SEGMENTS)
    yield step.asking("2.16", step.read(f"{title(each)} by segments", address_of(each), data="any"))
    wrong = step.group(
        "a wrong toggle bit is refused",
        _asked(device, address_of(each)),
        step.expect("it begins", device.answer(f"4?{_multiplexer(each)}????????")),
        # The first segment has the toggle bit 0 (CiA 301, 7.2.4.3.7).
        _sent(device, "the first segment, asked for with the toggle bit set", wire.plain(0x70)),
        _aborted(device, AbortCode.TOGGLE_BIT),
    )
    yield step.asking("2.17", wrong)
    yield step.asking("2.18", step.read(f"{title(each)} as a whole", address_of(each), data="any"))


WITH_CRC, WITHOUT_CRC = Blocks.PLAIN.value, Blocks.WITHOUT_CRC.value


@Clause(CHAPTER, "7.2.4.3.12", "SDO block upload")
def _block_upload(device: DeviceUnderTest) -> Steps:
    # Block transfer is optional; a server without it refuses the first request.
    device_type = device.find(DEVICE_TYPE)
    long = _long(device)
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
    """Return the number of CiA's tool for the download of an object, empty if it has none."""
    return {GUARD_TIME: guard, HEARTBEAT_TIME: heartbeat}.get(address_of(each), "")


@Clause(CHAPTER, "7.2.4.3.4", "SDO download", name="by segments")
def _segmented_download(device: DeviceUnderTest) -> Steps:
    each = _number(device)
    yield _by_segments(device, each)
    # The object's own value, in case the server ignores the toggle bit.
    segment = wire.segment(ClientCommand.DOWNLOAD_SEGMENT, wire.TOGGLE, _content(each), last=True)
    wrong = _sent(device, "the only segment, with the toggle bit set", segment)
    refused = wrong, _aborted(device, AbortCode.TOGGLE_BIT), step.unchanged(each)
    yield step.keeping("a wrong toggle bit is refused", each, *_begun(device, each), *refused)


@Clause(CHAPTER, "7.2.4.3.4", "SDO download", Tier.REVERSIBLE, "2.14", name="0x100C by segments")
def _segmented_guard_time(device: DeviceUnderTest) -> Steps:
    each = need(device.settable(GUARD_TIME), NOT_GUARDED)
    yield _by_segments(device, need(each if _known(each) else None, NOT_GUARDED))


def _by_segments(device: DeviceUnderTest, each: ODVariable) -> Data:
    content = _content(each)
    whole = (
        *_begun(device, each),
        _sent(device, "the only segment", wire.segment(ClientCommand.DOWNLOAD_SEGMENT, 0, content, last=True)),
        step.expect("it is taken", device.answer(f"20{'?' * 14}")),
        step.read("it has the value", address_of(each), data=content.hex(" ")),
    )
    return step.asking(_asked_of(each, "2.14", "2.15"), step.keeping(f"{title(each)} by segments", each, *whole))


@Clause(CHAPTER, "7.2.4.3.8", "SDO block download", name="in blocks")
def _block_download(device: DeviceUnderTest) -> Steps:
    return _in_blocks(_number(device))


@Clause(CHAPTER, "7.2.4.3.8", "SDO block download", Tier.REVERSIBLE, "2.20, 2.24", name="0x100C in blocks")
def _block_guard_time(device: DeviceUnderTest) -> Steps:
    return _in_blocks(need(device.settable(GUARD_TIME), NOT_GUARDED))


def _in_blocks(each: ODVariable) -> Steps:
    for transfer, asked in ((WITHOUT_CRC, ("2.20", "2.21")), (WITH_CRC, ("2.24", "2.25"))):
        written = step.rewritten("its own value", each, transfer=transfer, optional=codes(*NO_BLOCKS))
        same = step.keeping(f"{title(each)}, {transfer}", each, written, step.unchanged(each))
        yield step.asking(_asked_of(each, *asked), same)


# Aborts


@Clause(CHAPTER, "7.2.4.3.17", "SDO abort", ctt="2.7", group="an unknown command is refused")
def _unknown_command(device: DeviceUnderTest) -> Steps:
    # 0xE0 is the only command specifier without a meaning (CiA 301, 7.2.4.3). The object exists, so only the command
    # can be refused.
    sent = _sent(device, "command specifier 7", initiate(0xE0, _usual(device)))
    return [sent, _aborted(device, AbortCode.UNKNOWN_COMMAND, AbortCode.GENERAL)]


@Clause(CHAPTER, "7.2.4.3.17", "SDO abort", group="a client's abort is not answered")
def _client_aborts(device: DeviceUnderTest) -> Steps:
    yield _sent(device, "abort", wire.aborted(device.probe, AbortCode.GENERAL))
    # Two sides that answer aborts by aborts would never stop.
    yield step.never("no answer", device.answer("?" * 16), QUIET)
    yield awake(device, "the next request is")


@Clause(CHAPTER, "7.2.4.3.17", "SDO abort", name="a transfer that is left alone")
def _unfinished(device: DeviceUnderTest) -> Steps:
    each = _number(device)
    begun = [*_begun(device, each)]
    same = step.unchanged(each)
    # A device that answers an abort is red for that above; here the answer is ignored.
    abort = _sent(device, "abort", wire.aborted(address_of(each), AbortCode.GENERAL)), step.wait("50 ms")
    yield step.keeping("a transfer that the client aborts changes nothing", each, *begun, *abort, same)
    # No clause names a timeout, but a lost client must not block all others until the next reset. The time between
    # requests doubles, as each may restart the server's timeout and be refused because of the old transfer (CiA 301
    # leaves both open).
    begins = device.answer(f"4?{_multiplexer(each)}????????")
    asked = {**device.request(initiate(ClientCommand.UPLOAD << 5, address_of(each))), "every": LEFT_AT_FIRST}
    name = f"it answers within {LEFT_ALONE}, asked after 1 s, 2 s, 4 s and 8 s"
    ready = {"name": name, "poll": {**asked, "factor": 2}, "until": begins, "within": LEFT_ALONE}
    left_alone = step.wait(LEFT_AT_FIRST), ready
    yield step.keeping("a transfer that is left alone does not block the server", each, *begun, *left_alone, same)


# Block sizes


@Clause(CHAPTER, "7.2.4.3.12", "SDO block upload", ctt="2.26", group="a block of 128 segments is refused")
def _block_size(device: DeviceUnderTest) -> Steps:
    """Request blocks of one segment more than allowed."""
    need(device.readable(_usual(device)), NOTHING_SHORT)
    # 127 is the maximum (CiA 301, 7.2.4.3.12).
    size = bytes([wire.BLOCK_SEGMENTS + 1])
    yield _sent(device, "128 segments", initiate(ClientCommand.BLOCK_UPLOAD << 5, _usual(device), size))
    yield _aborted(device, AbortCode.BLOCK_SIZE, AbortCode.GENERAL, *NO_BLOCKS)


@Clause(CHAPTER, "7.2.4.3.13", "SDO block upload", ctt="2.27", group="an acknowledgement of 128 segments is refused")
def _sequence_number(device: DeviceUnderTest) -> Steps:
    """Acknowledge more segments than a block can have."""
    need(device.readable(_usual(device)), NOTHING_SHORT)
    upload = ClientCommand.BLOCK_UPLOAD << 5
    most = wire.BLOCK_SEGMENTS
    # With `save`, so that the rest of the group is skipped for a server without blocks.
    blocks = {"data": "any", "transfer": "block", "save": "blocks", "optional": codes(*NO_BLOCKS)}
    yield step.read("blocks are there", _usual(device), **blocks)
    yield _sent(device, "the first request", initiate(upload, _usual(device), bytes([most])))
    yield step.expect("it begins", device.answer(f"C?{'?' * 14}"))
    yield _sent(device, "start", wire.plain(upload | wire.Block.START))
    yield step.expect("the first segment", device.answer(f"?1{'?' * 14}"))
    beyond = wire.plain(upload | wire.Block.ACKNOWLEDGE, bytes([most + 1, most]))
    yield _sent(device, "128 segments acknowledged", beyond)
    yield _aborted(device, AbortCode.SEQUENCE_NUMBER, AbortCode.GENERAL, AbortCode.UNKNOWN_COMMAND)
    yield step.wait("50 ms")  # so that late frames of the server are not taken for answers to the next request


# Servers


@Clause(CHAPTER, "7.5.2.33", "SDO server")
def _servers(device: DeviceUnderTest) -> Steps:
    """Read the COB-IDs of each server; the first has those of the predefined connection set."""
    for index in device.dictionary.members:
        for found in filter(None, (device.find((index, sub)) for sub in (1, 2) if index in SDO_SERVERS)):
            # 0x600 and 0x580 plus the node-ID, as a master knows nothing else of the device at first.
            base = SDO_BASES.get(address_of(found))
            usual = None if base is None else base + device.dictionary.node_id
            if usual is not None and device.number(address_of(found)) != usual:
                yield step.skip(title(found), f"the file itself has another one than 0x{usual:X}")
            elif found.readable:
                data = "any" if usual is None else data_type(found).write(usual).hex(" ").upper()
                asked = "2.28" if base is None else "2.12"
                yield step.asking(asked, step.read(title(found), address_of(found), data=data))
    second = SDO_SERVERS[1]
    if second not in device.dictionary.members:
        absent = step.read(f"0x{second:04X} is not there", (second, 1), abort=codes(*NO_OBJECT))
        yield step.asking("2.28", absent)
    if SDO_REQUESTS[0] not in device.dictionary.members:
        yield step.skip("0x1200", "the file has no SDO server (0x1200)")


@Clause(CHAPTER, "7.5.2.33", "SDO server", Tier.REVERSIBLE, "2.29", name="further servers")
def _further_servers(device: DeviceUnderTest) -> Steps:
    """Check that further servers have their defaults after a reset of the communication."""
    further = [each for each in device.objects if each.index in SDO_SERVERS[1:] and _known(each)]
    need(further, "the file has no further SDO server (0x1201) with defaults")
    seen = (step.read(title(each), address_of(each), data=_content(each).hex(" ").upper()) for each in further)
    yield step.group("further servers after reset communication", *fresh(), *seen)


# Frames


def _begun(device: DeviceUnderTest, each: ODVariable) -> Steps:
    """Begin a download by segments."""
    size = len(_content(each)).to_bytes(4, "little")
    begin = initiate(ClientCommand.DOWNLOAD << 5 | wire.SIZE_GIVEN, address_of(each), size)
    yield _sent(device, "the first request", begin)
    yield step.expect("it begins", device.answer(f"60{_multiplexer(each)}????????"))


def _asked(device: DeviceUnderTest, address: Address) -> Data:
    return _sent(device, "the first request", initiate(ClientCommand.UPLOAD << 5, address))


def _sent(device: DeviceUnderTest, name: str, data: bytes) -> Data:
    return {"name": name, **device.request(data)}


def _aborted(device: DeviceUnderTest, *aborts: AbortCode) -> Data:
    """Expect one of these aborts, for any object, as the request may name none."""
    answers = [device.answer(f"80??????{code.to_bytes(4, 'little').hex().upper()}") for code in aborts]
    # CiA 301 names the codes, but a server may give a more general one.
    return step.expect("abort", {"any": answers} if len(answers) > 1 else answers[0])


def _multiplexer(each: ODVariable) -> str:
    return f"{each.index & 0xFF:02X}{each.index >> 8:02X}{each.subindex:02X}"
