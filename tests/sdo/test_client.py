"""The SDO client wired to our server, and to answers that no good server gives (CiA 301, 7.2.4.3)."""

from __future__ import annotations

from binascii import crc_hqx
from collections.abc import Callable, Sequence
from functools import partial
from math import inf

import pytest

from eurobot_od.sdo import wire
from eurobot_od.sdo.client import (
    Aborted,
    OddAnswer,
    Room,
    Silence,
    Transfer,
    block_download,
    block_upload,
    download,
    upload,
)
from eurobot_od.sdo.server import SdoServer
from eurobot_od.sdo.wire import BLOCK_SEGMENTS, SEGMENT_SIZE, AbortCode, ClientCommand, ServerCommand
from tests.device.shelf import NUMBER, TEXT, Shelf
from tests.sdo.line import WAIT, Line

SIZES = [0, 1, 4, 5, 7, 8, 13, 14, 15, 888, 889, 890, 4096]
READERS: list[Callable[..., Transfer]] = [upload, block_upload]
WRITERS = [download, block_download]


def content_of(size: int) -> bytes:
    return (bytes(range(251)) * (size // 251 + 1))[:size]


def talk(transfer: Transfer, answers: Sequence[str]) -> list[list[str]]:
    """Feed hexadecimal answers, padded to 8 bytes; return the requests sent at first and after each."""
    received = (transfer.receive(bytes.fromhex(answer).ljust(8, b"\0"), 0.0) for answer in answers)
    return [[request.hex(" ", 4) for request in requests] for requests in (transfer.start(0.0), *received)]


# With our server


@pytest.mark.parametrize("size", SIZES)
@pytest.mark.parametrize("read", READERS)
def test_every_kind_of_upload_returns_the_content(read: Callable[..., Transfer], size: int) -> None:
    shelf = Shelf()
    shelf.objects[TEXT] = content_of(size)
    assert Line(SdoServer(shelf)).run(read(TEXT, WAIT)) == content_of(size)


@pytest.mark.parametrize("size", SIZES)
@pytest.mark.parametrize("write", WRITERS)
def test_every_kind_of_download_writes_the_content(write: Callable[..., Transfer], size: int) -> None:
    shelf = Shelf()
    assert Line(SdoServer(shelf)).run(write(TEXT, content_of(size), WAIT)) == b""
    assert shelf.objects[TEXT] == content_of(size)


@pytest.mark.parametrize("segments", [1, 2, 3, 126, 127])
def test_reads_in_blocks_of_any_size(segments: int) -> None:
    shelf = Shelf()
    shelf.objects[TEXT] = content_of(3000)
    assert Line(SdoServer(shelf)).run(block_upload(TEXT, WAIT, segments)) == content_of(3000)


@pytest.mark.parametrize(
    "lost",
    [
        {2},  # the first segment of the first block; answer 1 is the initiate's
        {4},  # one within
        {1 + BLOCK_SEGMENTS},  # the last of the first block: only the time-out tells
        {3, 4, 5},
        {1 + BLOCK_SEGMENTS + 3},  # within the second block
        {1 + 150},  # the last of all
        {2, 2 + 2 * BLOCK_SEGMENTS},  # the first of both blocks: nothing of either comes, but not twice in a row
        {2, 1 + BLOCK_SEGMENTS},  # the first and the last: the time-out comes with nothing in sequence
    ],
)
def test_lost_segments_of_a_block_upload_are_repeated(lost: set[int]) -> None:
    shelf = Shelf()
    shelf.objects[TEXT] = content_of(150 * SEGMENT_SIZE)
    line = Line(SdoServer(shelf), lost_answers=lost)
    assert line.run(block_upload(TEXT, WAIT)) == content_of(150 * SEGMENT_SIZE)
    assert line.lost == lost


@pytest.mark.parametrize("lost", [{2}, {3}, {126}, {2, 3, 4}, {130}])
def test_lost_segments_of_a_block_download_are_repeated(lost: set[int]) -> None:
    shelf = Shelf()
    line = Line(SdoServer(shelf), lost_requests=lost)
    line.run(block_download(TEXT, content_of(150 * SEGMENT_SIZE), WAIT))
    assert shelf.objects[TEXT] == content_of(150 * SEGMENT_SIZE)
    assert line.lost == lost


@pytest.mark.parametrize("transfer", [*(read((0x5000, 0), WAIT) for read in READERS), download((0x5000, 0), b"", WAIT)])
def test_a_servers_abort_is_raised_with_its_reason(transfer: Transfer) -> None:
    shelf = Shelf()
    shelf.admit = lambda address, _: len(shelf.read(address))  # type: ignore[method-assign, assignment]
    with pytest.raises(Aborted, match=r"^the node aborts: Object does not exist \(0x06020000\)$") as refused:
        Line(SdoServer(shelf)).run(transfer)
    assert refused.value.code == AbortCode.NO_OBJECT


@pytest.mark.parametrize("write", WRITERS)
def test_a_server_may_abort_during_a_transfer(write: Callable[..., Transfer]) -> None:
    shelf = Shelf()
    shelf.room[TEXT] = 5
    shelf.admit = lambda *_: 1000  # type: ignore[method-assign]
    with pytest.raises(Aborted) as refused:
        Line(SdoServer(shelf)).run(write(TEXT, bytes(20), WAIT))
    assert refused.value.code == AbortCode.TOO_SHORT


@pytest.mark.parametrize(
    "make",
    [
        lambda: upload(TEXT, WAIT),
        lambda: block_upload(TEXT, WAIT),
        lambda: download(TEXT, bytes(9), WAIT),
        lambda: block_download(TEXT, bytes(9), WAIT),
    ],
)
@pytest.mark.parametrize("heard", [0, 1, 2])
def test_a_time_out_aborts_the_transfer_at_the_server(make: Callable[[], Transfer], heard: int) -> None:
    server = SdoServer(Shelf())
    line = Line(server, lost_answers=range(heard + 1, 1000))
    with pytest.raises(Silence):
        line.run(make())
    assert server.deadline == inf


LONG = content_of(150 * SEGMENT_SIZE + 3)


@pytest.mark.parametrize(
    ("make", "told"),
    [
        (lambda told: upload(TEXT, WAIT, told), [*range(7, 1053, 7), 1053]),
        (lambda told: download(TEXT, LONG, WAIT, told), [*range(7, 1053, 7), 1053]),
        (lambda told: block_upload(TEXT, WAIT, progress=told), [889, 1053]),  # a block has 127 segments
        (lambda told: block_download(TEXT, LONG, WAIT, told), [889, 1053]),
    ],
)
def test_progress_is_reported_in_bytes(
    make: Callable[[Callable[[int, int | None], None]], Transfer], told: list[int]
) -> None:
    shelf, heard = Shelf(), list[tuple[int, int | None]]()
    shelf.objects[TEXT] = LONG
    Line(SdoServer(shelf)).run(make(lambda done, size: heard.append((done, size))))
    assert heard == [(done, len(LONG)) for done in told]


# What is sent, to the byte

EXCHANGES: dict[str, tuple[Transfer, list[str], list[list[str]]]] = {
    "expedited upload": (upload(NUMBER, WAIT), ["4b002001 3412"], [["40002001 00000000"], []]),
    "expedited upload of 4 bytes without their number": (
        upload(NUMBER, WAIT), ["42002001 01020304"], [["40002001 00000000"], []]
    ),
    "expedited download": (download(NUMBER, b"\1\2", WAIT), ["60002001"], [["2b002001 01020000"], []]),
    "segmented upload": (
        upload(TEXT, WAIT),
        ["41081000 08", "00 41424344454647", "1d 48"],
        [["40081000 00000000"], ["60000000 00000000"], ["70000000 00000000"], []],
    ),
    "segmented upload without a size": (
        upload(TEXT, WAIT), ["40081000", "01 41424344454647"], [["40081000 00000000"], ["60000000 00000000"], []]
    ),
    "segmented download of nothing": (
        download(TEXT, b"", WAIT), ["60081000", "20"], [["21081000 00000000"], ["0f000000 00000000"], []]
    ),
    "block upload": (
        block_upload(TEXT, WAIT),
        ["c6081000 08", "01 41424344454647", "82 48", f"d9 {crc_hqx(b'ABCDEFGH', 0).to_bytes(2, 'little').hex()}"],
        [["a4081000 7f000000"], ["a3000000 00000000"], [], ["a2027f00 00000000"], ["a1000000 00000000"]],
    ),
    "block upload from a server without CRC and size": (
        block_upload(TEXT, WAIT, 1),
        ["c0081000", "81 41", "d9"],
        [["a4081000 01000000"], ["a3000000 00000000"], ["a2010100 00000000"], ["a1000000 00000000"]],
    ),
    "block download": (
        block_download(TEXT, b"ABCDEFGH", WAIT),
        ["a4081000 01", "a20102", "a20101", "a1"],
        [
            ["c6081000 08000000"],
            ["01414243 44454647"],
            ["81480000 00000000"],
            [f"d9{crc_hqx(b'ABCDEFGH', 0).to_bytes(2, 'little').hex()}00 00000000"],
            [],
        ],
    ),
}  # fmt: skip


@pytest.mark.parametrize("name", EXCHANGES)
def test_every_frame_of_a_transfer_is_as_in_cia_301(name: str) -> None:
    transfer, answers, requests = EXCHANGES[name]
    assert talk(transfer, answers) == requests
    transfer.result()
    assert transfer.deadline == inf


# Answers that do not fit

number, writing = partial(upload, NUMBER, WAIT), partial(download, NUMBER, b"\1", WAIT)
segments, no_bytes = partial(upload, TEXT, WAIT), partial(download, TEXT, b"", WAIT)
by_blocks, in_blocks = partial(block_upload, TEXT, WAIT), partial(block_download, TEXT, b"", WAIT)
ODD: dict[str, tuple[Callable[[], Transfer], list[str], AbortCode, str]] = {
    "upload: toggle": (segments, ["41081000 08", "10"], AbortCode.TOGGLE_BIT, "the toggle bit"),
    "upload: too long": (segments, ["41081000 06", "00"], AbortCode.TOO_LONG, "end of 6 bytes: 7 came"),
    "upload: too short": (segments, ["41081000 08", "01"], AbortCode.TOO_SHORT, "end of 8 bytes: 7 came"),
    "download: toggle": (no_bytes, ["60081000", "30"], AbortCode.TOGGLE_BIT, "the toggle bit"),
    "block upload: CRC": (by_blocks, ["c4081000", "81 41", "d9 0000"], AbortCode.CRC, "whose CRC is"),
    "block upload: size": (by_blocks, ["c2081000 09", "81", "c1"], AbortCode.TOO_SHORT, "of 9 bytes"),
    "block download: no blocks": (in_blocks, ["a4081000 00"], AbortCode.BLOCK_SIZE, "1 to 127"),
    "block download: large blocks": (in_blocks, ["a4081000 80"], AbortCode.BLOCK_SIZE, "1 to 127"),
    "block download: more acknowledged than sent": (
        in_blocks,
        ["a4081000 7f", "a2027f"],
        AbortCode.SEQUENCE_NUMBER,
        "1 segments",
    ),
    "block download: never anything acknowledged": (
        in_blocks,
        ["a4081000 7f", "a2007f", "a2007f"],
        AbortCode.SEQUENCE_NUMBER,
        "1 segments",
    ),
}


# Answers to somebody else, before the one to us: another master may ask the same server

OTHERS: dict[str, tuple[Callable[[], Transfer], list[str], str, list[str]]] = {
    "another object": (number, [], "4b012001 3412", ["4b002001 7856"]),
    "a write, while we read": (number, [], "60002001", ["4b002001 7856"]),
    "a read, while we write": (writing, [], "4b002001 3412", ["60002001"]),
    "a command that there is not": (number, [], "ff002001", ["4b002001 7856"]),
    "segments: a write": (segments, ["41081000 02"], "60002001", ["0b 4142"]),
    "blocks: a read": (in_blocks, ["a4081000 7f"], "4b002001 3412", ["a2017f", "a1"]),
    "end of blocks: a read": (by_blocks, ["c0081000", "81 41"], "4b002001 3412", ["d9"]),
}


@pytest.mark.parametrize("name", OTHERS)
def test_an_answer_to_another_client_does_not_extend_the_time_out(name: str) -> None:
    make, before, foreign, rest = OTHERS[name]
    transfer = make()
    talk(transfer, before)
    deadline = transfer.deadline
    skipped = bytes.fromhex(foreign).ljust(8, b"\0")
    assert transfer.receive(skipped, deadline - 0.01) == []
    assert transfer.deadline == deadline
    assert list(transfer.skipped) == [skipped]
    for answer in rest:
        transfer.receive(bytes.fromhex(answer).ljust(8, b"\0"), deadline - 0.005)
    transfer.result()


def test_a_time_out_names_the_skipped_answers() -> None:
    transfer = number()
    talk(transfer, ["4b012001 3412"])
    transfer.tick(transfer.deadline)
    with pytest.raises(Silence, match="1 came that are not to this request, the last 4B01200134120000"):
        transfer.result()


@pytest.mark.parametrize("name", ODD)
def test_an_invalid_answer_aborts_the_transfer(name: str) -> None:
    make, answers, code, what = ODD[name]
    transfer = make()
    *_, last = talk(transfer, answers)
    assert [request[:2] + request[8:] for request in last] == [f"80 {code.to_bytes(4, 'little').hex()}"]
    with pytest.raises(OddAnswer, match=what) as odd:
        transfer.result()
    assert odd.value.code == code


def test_repeated_empty_blocks_end_the_transfer() -> None:
    transfer = block_upload(TEXT, WAIT, 2)
    assert talk(transfer, ["c0081000", "02", "02"])[-1] == ["80081000 03000405"]
    with pytest.raises(OddAnswer, match="of a block that begins with segment 1"):
        transfer.result()


def test_a_lost_acknowledgement_ends_a_block_upload() -> None:
    """The server would send the same block again, and the client could take it for the next one."""
    shelf = Shelf()
    shelf.objects[TEXT] = bytes(2 * BLOCK_SEGMENTS * SEGMENT_SIZE)
    with pytest.raises(Silence):
        Line(SdoServer(shelf), lost_requests={3}).run(block_upload(TEXT, WAIT))


@pytest.mark.parametrize("length", [0, 1, 7, 9, 64])
def test_a_frame_of_another_length_is_ignored(length: int) -> None:
    transfer = upload(NUMBER, WAIT)
    transfer.start(0.0)
    assert transfer.receive(bytes(length), 0.5) == []
    assert transfer.deadline == WAIT
    transfer.receive(bytes.fromhex("4b00200134120000"), 0.5)
    assert transfer.result() == b"\x34\x12"


def test_frames_after_the_end_are_ignored() -> None:
    transfer = upload(NUMBER, WAIT)
    talk(transfer, ["4b002001 3412", "4b002001 5678", "80002001"])
    assert transfer.result() == b"\x34\x12"


MIDWAY = {
    "upload": (upload(TEXT, WAIT), ["41081000 08"], ["00 41424344454647", "1d 48"]),
    "download": (download(TEXT, b"ABCDEFGH", WAIT), ["60081000"], ["20", "30"]),
    "block upload": (
        block_upload(TEXT, WAIT),
        ["c6081000 08", "01 41424344454647"],
        ["82 48", f"d9 {crc_hqx(b'ABCDEFGH', 0).to_bytes(2, 'little').hex()}"],
    ),
    "block download": (block_download(TEXT, b"ABCDEFGH", WAIT), ["a4081000 7f"], ["a2027f", "a1"]),
}  # fmt: skip


@pytest.mark.parametrize("name", MIDWAY)
def test_an_abort_for_another_object_does_not_end_a_transfer(name: str) -> None:
    transfer, before, after = MIDWAY[name]
    talk(transfer, before)
    deadline = transfer.deadline
    for other in ("80002001 00000405", "80081001 00000405"):
        assert transfer.receive(bytes.fromhex(other), deadline - 0.01) == []
        assert transfer.deadline == deadline
    for answer in after:
        transfer.receive(bytes.fromhex(answer).ljust(8, b"\0"), 0.0)
    assert transfer.result() in (b"ABCDEFGH", b"")


@pytest.mark.parametrize(
    "about", ["081000", "000000"], ids=["the object", "no object: the server knows of no transfer"]
)
def test_an_abort_ends_a_transfer(about: str) -> None:
    transfer = upload(TEXT, WAIT)
    talk(transfer, ["41081000 08", f"80{about} 00000405"])
    with pytest.raises(Aborted):
        transfer.result()


@pytest.mark.parametrize(
    ("read", "answer"), [(upload, "41081000 e9030000"), (block_upload, "c6081000 e9030000")], ids=["upload", "block"]
)
def test_an_announced_size_above_the_limit_is_refused(read: Callable[..., Transfer], answer: str) -> None:
    transfer = read(TEXT, WAIT, room=Room(announced=1000))
    assert talk(transfer, [answer])[1] == ["80081000 12000706"]
    with pytest.raises(OddAnswer, match="is not about an object of at most 1000 bytes"):
        transfer.result()


@pytest.mark.parametrize(
    ("read", "answer"), [(upload, "41081000 e8030000"), (block_upload, "c6081000 e8030000")], ids=["upload", "block"]
)
def test_an_object_at_the_limit_is_read(read: Callable[..., Transfer], answer: str) -> None:
    transfer = read(TEXT, WAIT, room=Room(announced=1000))
    talk(transfer, [answer])
    assert not transfer.done


# Time


def test_each_answer_renews_the_time_out() -> None:
    transfer = upload(TEXT, 0.5)
    assert transfer.deadline == inf
    transfer.start(10.0)
    assert transfer.deadline == 10.5
    transfer.receive(bytes.fromhex("4108100008000000"), 10.4)
    assert transfer.deadline == 10.9
    assert transfer.tick(10.8) == []
    assert [request.hex(" ", 4) for request in transfer.tick(10.9)] == ["80081000 00000405"]
    assert transfer.tick(20.0) == []
    with pytest.raises(Silence):
        transfer.result()


class Endless:
    """A server whose object never ends; its segments have `filled` bytes, and it announces no size."""

    deadline = inf

    def __init__(self, filled: int) -> None:
        self.filled, self.toggle, self.sent = filled, 0, 0

    def tick(self, now: float) -> list[bytes]:
        return []

    def receive(self, data: bytes, now: float) -> list[bytes]:
        specifier = data[0] >> 5
        if data[0] == wire.ABORT:
            return []
        if specifier == ClientCommand.UPLOAD:
            return [wire.initiate(ServerCommand.UPLOAD << 5, NUMBER)]
        if specifier == ClientCommand.BLOCK_UPLOAD and not data[0] & 3:
            return [wire.initiate(ServerCommand.BLOCK_UPLOAD << 5, NUMBER)]
        if specifier == ClientCommand.BLOCK_UPLOAD:
            self.sent += 127
            return [bytes([number, *range(7)]) for number in range(1, 128)]
        self.sent += 1
        self.toggle ^= wire.TOGGLE
        return [bytes([self.toggle ^ wire.TOGGLE | 7 - self.filled << 1]) + bytes(7)]


@pytest.mark.parametrize(
    ("read", "filled"),
    [(upload, 7), (upload, 1), (upload, 0), (block_upload, 7)],
    ids=["full", "short", "empty", "block"],
)
def test_an_endless_upload_is_aborted(read: Callable[..., Transfer], filled: int) -> None:
    server = Endless(filled)
    with pytest.raises(OddAnswer, match="is not the end of an object of at most 1000 bytes"):
        Line(server).run(read(NUMBER, WAIT, room=Room(unannounced=1000)))
    assert server.sent <= 1000 + 2
