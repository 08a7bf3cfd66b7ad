"""SDO transfers put together: what our client and our server say to each other, as a log has it, and parts of that."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator

import pytest

from eurobot_od.frame import Frame
from eurobot_od.sdo.client import Transfer, block_download, block_upload, download, upload
from eurobot_od.sdo.server import SdoServer
from eurobot_od.sdo.wire import BLOCK_CRC, SEGMENT_SIZE
from eurobot_od.support.texts import text as duration
from eurobot_od.traffic.decoding import TrackingDecoder
from eurobot_od.traffic.entries import Damage
from eurobot_od.traffic.meaning import Decoder, Meaning
from eurobot_od.traffic.transfers import LssConfiguration
from tests.device.shelf import Shelf
from tests.kit import plant
from tests.sdo.line import WAIT, Line

READ: list[Callable[..., Transfer]] = [upload, block_upload]
WRITE = [download, block_download]
SIZES = [5, 7, 8, 14, 889, 890, 2000, 5000]
REQUESTS, ANSWERS = 0x602, 0x582
OBJECT = 0x3000, 1
"""No file describes it."""


class Tapped(SdoServer):
    """A server whose frames, and those that it gets, are written down."""

    def __init__(self, shelf: Shelf) -> None:
        super().__init__(shelf)
        self.frames: list[Frame] = []

    def receive(self, data: bytes, now: float) -> list[bytes]:
        answers = super().receive(data, now)
        self.frames += [Frame(REQUESTS, data), *(Frame(ANSWERS, each) for each in answers)]
        return answers


def content_of(size: int) -> bytes:
    return (bytes(range(1, 252)) * (size // 251 + 1))[:size]


def recorded(transfer: Callable[[], Transfer], content: bytes = b"", **lost: Iterable[int]) -> list[Frame]:
    """Return the frames of a transfer."""
    shelf = Shelf()
    shelf.objects[OBJECT] = content
    server = Tapped(shelf)
    Line(server, **{name: list(numbers) for name, numbers in lost.items()}).run(transfer())
    return server.frames


@pytest.fixture(scope="module")
def decoder() -> Decoder:
    return plant.decoder()


def decoded(decoder: Decoder, frames: Iterable[Frame]) -> list[Meaning]:
    """Decode frames that come a millisecond apart."""
    following = TrackingDecoder(decoder)
    return [following(number / 1000, "can0", frame) for number, frame in enumerate(frames)]


@pytest.mark.parametrize("size", SIZES)
@pytest.mark.parametrize("read", READ)
def test_the_last_line_of_a_read(decoder: Decoder, read: Callable[..., Transfer], size: int) -> None:
    meanings = decoded(decoder, recorded(lambda: read(OBJECT, WAIT), content_of(size)))
    assert not any(each.defects for each in meanings)
    assert [each.transfer is not None for each in meanings] == [False] * (len(meanings) - 1) + [True]
    last = meanings[-1]
    assert last.text.startswith("lift, value of 0x3000:01")
    assert f", {size} bytes, in {duration((len(meanings) - 1) / 1000)}" in last.text
    assert ("CRC 0x" in last.text, "is right" in last.text) == (read is block_upload,) * 2
    assert (content_of(size)[:10].hex(" ") in last.text) is (size <= 4096)
    assert last.transfer is not None
    assert (last.transfer.is_upload, last.transfer.size, last.transfer.lost) == (True, size, 0)


@pytest.mark.parametrize("size", SIZES)
@pytest.mark.parametrize("write", WRITE)
def test_the_last_line_of_a_write(decoder: Decoder, write: Callable[..., Transfer], size: int) -> None:
    meanings = decoded(decoder, recorded(lambda: write(OBJECT, content_of(size), WAIT)))
    assert not any(each.defects for each in meanings)
    assert [each.transfer is not None for each in meanings] == [False] * (len(meanings) - 1) + [True]
    assert meanings[-1].text.startswith("lift, written 0x3000:01")
    assert f", {size} bytes, in {duration((len(meanings) - 1) / 1000)}" in meanings[-1].text
    assert ("is right" in meanings[-1].text) is (write is block_download)


def test_segments_of_a_block_are_no_commands(decoder: Decoder) -> None:
    texts = [each.text for each in decoded(decoder, recorded(lambda: block_download(OBJECT, content_of(900), WAIT)))]
    assert texts[2:5] == [f"lift, block segment {number}" for number in (1, 2, 3)]
    assert texts[2 + 127] == "lift, block taken up to segment 127"
    assert texts[2 + 129] == "lift, block segment 2, the last"
    assert texts[-2].startswith("lift, end of blocks, CRC 0x")


def test_a_value_has_its_objects_name_and_type(decoder: Decoder) -> None:
    data = (
        "4008100000000000", "410810000A000000", "6000000000000000", "0044726976652075", "7000000000000000",
        "196E697400000000",
    )  # fmt: skip
    frames = [Frame(ANSWERS if number % 2 else REQUESTS, bytes.fromhex(each)) for number, each in enumerate(data)]
    assert decoded(decoder, frames)[-1].text == (
        "lift, value of 0x1008:00 Manufacturer device name = Drive unit, 10 bytes, in 5 ms"
    )


@pytest.mark.parametrize(
    ("transfer", "content", "lost"),
    [
        (lambda: block_upload(OBJECT, WAIT), content_of(2000), {"lost_answers": [5]}),
        (lambda: block_upload(OBJECT, WAIT), content_of(2000), {"lost_answers": [128]}),
        (lambda: block_download(OBJECT, content_of(2000), WAIT), b"", {"lost_requests": [7]}),
    ],
)
def test_segments_that_are_sent_again(
    decoder: Decoder, transfer: Callable[[], Transfer], content: bytes, lost: dict[str, list[int]]
) -> None:
    """What the receiver did not get is sent again; the log, which has both or one of them, is whole all the same."""
    meanings = decoded(decoder, recorded(transfer, content, **lost))
    assert not any(each.defects for each in meanings)
    assert "2000 bytes" in meanings[-1].text
    assert "is right" in meanings[-1].text


def test_blocks_without_a_crc_are_not_compared(decoder: Decoder) -> None:
    asked, answer, *rest = recorded(lambda: block_download(OBJECT, content_of(20), WAIT))
    without = Frame(answer.cob_id, bytes([answer.data[0] & ~BLOCK_CRC]) + answer.data[1:])
    assert decoded(decoder, [asked, without, *rest])[-1].text.endswith(", no CRC")


def test_a_wrong_crc_is_said(decoder: Decoder) -> None:
    frames = recorded(lambda: block_download(OBJECT, content_of(20), WAIT))
    *begin, end, taken = frames
    broken = Frame(end.cob_id, end.data[:1] + bytes([end.data[1] ^ 1]) + end.data[2:])
    assert "is wrong: it is 0x" in decoded(decoder, [*begin, broken, taken])[-1].text


def without_one(frames: list[Frame]) -> Iterator[tuple[int, list[Frame]]]:
    for number in range(len(frames)):
        yield number, frames[:number] + frames[number + 1 :]


@pytest.mark.parametrize("make", [
    lambda: recorded(lambda: upload(OBJECT, WAIT), content_of(60)),
    lambda: recorded(lambda: download(OBJECT, content_of(60), WAIT)),
    lambda: recorded(lambda: block_upload(OBJECT, WAIT), content_of(900)),
    lambda: recorded(lambda: block_download(OBJECT, content_of(900), WAIT)),
])  # fmt: skip
def test_a_frame_that_the_log_lacks_is_said_and_costs_no_other_transfer(
    decoder: Decoder, make: Callable[[], list[Frame]]
) -> None:
    frames = make()
    data = [
        number
        for number, each in enumerate(decoded(decoder, frames))
        if "segment" in each.text and not ("next" in each.text or "taken" in each.text)
    ]
    assert len(data) > 7
    for number, rest in without_one(frames):
        meanings = decoded(decoder, [*rest, *frames])
        said = [each for each in meanings if each.defects]
        # The last segment of a read is its end: without it the next transfer says that this one had none.
        if number in data:
            assert {defect.damage for each in said for defect in each.defects} == {Damage.INCOMPLETE}, number
        assert meanings[-1].transfer is not None, number
        assert (meanings[-1].transfer.lost, meanings[-1].defects) == (0, ()), number


@pytest.mark.parametrize("make", [
    lambda: recorded(lambda: block_upload(OBJECT, WAIT), content_of(900)),
    lambda: recorded(lambda: block_download(OBJECT, content_of(900), WAIT)),
])  # fmt: skip
def test_a_log_that_begins_in_a_block_is_read_right_from_the_second_segment_on(
    decoder: Decoder, make: Callable[[], list[Frame]]
) -> None:
    frames = make()
    whole = [each.text for each in decoded(decoder, frames)]
    segments = [number for number, text in enumerate(whole) if "block segment" in text]
    for begin in segments:
        meanings = decoded(decoder, [*frames[begin:], *frames])
        rest = [each.text for each in meanings[: -len(frames)]]
        # The first may be any command, and so may the only one that is left of a block.
        alone = whole[begin].endswith("the last") or begin + 1 not in segments
        assert alone or rest[1:-2] == [*whole[begin + 1 : -2]], begin
        assert alone or rest[-1].startswith(("lift, value of an object", "lift, written an object")), rest[-1]
        assert [each.text for each in meanings[-len(frames) :]][:-1] == whole[:-1], begin
        assert meanings[-1].defects == ()


def test_missing_segments_at_the_start_are_reported(decoder: Decoder) -> None:
    frames = recorded(lambda: block_upload(OBJECT, WAIT), content_of(900))
    last = decoded(decoder, frames[-5:])[-1]  # two segments, which are acknowledged, and the end
    assert "value of an object" in last.text
    assert last.transfer is not None
    assert (last.transfer.size, last.transfer.is_whole) == (900 - 127 * SEGMENT_SIZE, False)


def test_aborts_say_how_far_it_had_come(decoder: Decoder) -> None:
    frames = recorded(lambda: download(OBJECT, content_of(60), WAIT))[:6]
    abort = Frame(ANSWERS, bytes.fromhex("8000300122000008"))
    last = decoded(decoder, [*frames, abort])[-1]
    assert last.text == (
        "lift, abort 0x3000:01: 0x08000022 Data cannot be transferred or stored to the application because of the "
        "present device state, by the server after 14 bytes in 6 ms"
    )
    assert last.transfer is not None
    assert (last.transfer.aborted, last.transfer.size) == (0x08000022, 14)


def test_an_abort_in_a_block_counts_the_segments_of_that_block(decoder: Decoder) -> None:
    frames = recorded(lambda: block_upload(OBJECT, WAIT), content_of(60))[:6]  # the third segment is the last of them
    abort = Frame(REQUESTS, bytes.fromhex("8000300104000405"))
    meaning = decoded(decoder, [*frames, abort])[-1]
    assert meaning.text.endswith("0x05040004 CRC error, by the client after 21 bytes in 6 ms")
    assert meaning.transfer is not None
    assert meaning.transfer.size == 21


def test_a_read_in_blocks_that_does_not_end_counts_the_segments_of_its_last_block(decoder: Decoder) -> None:
    frames = recorded(lambda: block_upload(OBJECT, WAIT), content_of(60))
    again = decoded(decoder, [*frames[:6], frames[0]])[-1]
    assert [defect.text.partition(": ")[2] for defect in again.defects] == [
        "the read of 0x3000:01 before did not end; 21 of 60 bytes came"
    ]


def test_the_crc_of_a_read_that_lacks_segments_is_not_called_wrong(decoder: Decoder) -> None:
    """Without the acknowledgement only the size that was announced tells that segments are missing."""
    frames = recorded(lambda: block_upload(OBJECT, WAIT), content_of(60))
    acknowledged = next(number for number, each in enumerate(frames) if each.data[0] == 0xA2)
    lacking = [each for number, each in enumerate(frames) if number not in (5, 6, acknowledged)]
    last = decoded(decoder, lacking)[-1]
    assert "which cannot be checked" in last.text
    assert [defect.text.partition(": ")[2] for defect in last.defects] == ["2 segments of it not in the log"]


def test_an_abort_without_an_object_is_of_the_one_that_is_transferred(decoder: Decoder) -> None:
    frames = recorded(lambda: upload(OBJECT, WAIT), content_of(60))[:4]
    last = decoded(decoder, [*frames, Frame(REQUESTS, bytes.fromhex("8000000000000405"))])[-1]
    assert last.text == (
        "lift, abort 0x3000:01: 0x05040000 Timeout of transfer communication detected, by the client after 7 bytes "
        "in 4 ms"
    )


def test_channels_of_a_log_and_nodes_do_not_mix(decoder: Decoder) -> None:
    frames = recorded(lambda: upload(OBJECT, WAIT), content_of(20))
    others = [Frame(each.cob_id + 1, each.data) for each in frames]
    following = TrackingDecoder(decoder)
    meanings = [
        following(0.0, channel, each)
        for row in zip(frames, frames, others)
        for channel, each in zip(("can0", "can1", "can0"), row)
    ]
    assert [each.transfer.size for each in meanings if each.transfer] == [20, 20, 20]
    assert not any(each.defects for each in meanings)


@pytest.mark.parametrize(
    ("transfer", "text"),
    [
        (lambda: upload(OBJECT, WAIT), "lift, value of 0x3000:01 = 31 32 33 34"),
        (lambda: download(OBJECT, b"1234", WAIT), "lift, written 0x3000:01"),
    ],
)
def test_an_expedited_transfer_has_its_words_and_is_counted(
    decoder: Decoder, transfer: Callable[[], Transfer], text: str
) -> None:
    last = decoded(decoder, recorded(transfer, b"1234"))[-1]
    assert last.text == text
    assert last.transfer is not None
    assert (last.transfer.how, last.transfer.content) == ("expedited", b"1234")


def test_a_question_without_an_answer_is_no_damage(decoder: Decoder) -> None:
    question = Frame(REQUESTS, bytes.fromhex("4000100000000000"))
    first, second = decoded(decoder, [question, question])
    assert (first.defects, second.defects) == ((), ())
    assert second.transfer is not None
    assert not second.transfer.is_whole


# What a master leaves behind that is killed in a block: motor's object is written, and three segments have come


KILLED = "C6001F01E8030000 A4001F017F000000 0101020304050607 0201020304050607 0301020304050607"
READ_IT, VALUE = "4018100100000000", "4318100192010000"
CUT = "the write of 0x1F00:01 before did not end; 21 of 1000 bytes came"


def frames_of(text: str, boot: Frame | None = None) -> list[Frame]:
    """Return requests and answers, each to the end that its place in the conversation asks for."""
    answers = ("A4", "A2", "A1", "43", "60")
    data = [Frame(ANSWERS if each.startswith(answers) else REQUESTS, bytes.fromhex(each)) for each in text.split()]
    return [*data[:5], *([boot] if boot else []), *data[5:]]


@pytest.mark.parametrize(
    ("frames", "wait", "words"),
    [
        (frames_of(f"{KILLED} {READ_IT} {VALUE}", Frame(0x702, b"\0")), 0.0, "boot-up"),
        (frames_of(f"{KILLED} {READ_IT} {VALUE}"), 4.0, "read 0x1018:01"),  # a gap in the numbers, and a silence
        (frames_of(f"{KILLED} {READ_IT} {VALUE}"), 0.0, "value of 0x1018:01"),  # no answer of a block
        (frames_of(f"{KILLED} 2B17100000000000 6017100000000000 {READ_IT} {VALUE}"), 0.0, "written 0x1017:00"),
        (frames_of(f"{KILLED} 0001020304050607 {READ_IT} {VALUE}"), 0.0, "segment"),  # a number that no block has
    ],
)
def test_a_block_that_its_master_left_poisons_nothing_after_it(
    decoder: Decoder, frames: list[Frame], wait: float, words: str
) -> None:
    following = TrackingDecoder(decoder)
    meanings = [
        following(number / 1000 + wait * (number > 4), f"can{0 * number}", each)  # each line has its own text
        for number, each in enumerate(frames)
    ]
    (said,) = [each for each in meanings if each.defects]
    assert words in said.text
    assert [defect.text.partition(": ")[2] for defect in said.defects] == [CUT]
    assert said.transfer is not None
    assert (said.transfer.is_whole, said.transfer.size) == (False, 21)
    assert "value of 0x1018:01" in meanings[-1].text
    assert said is meanings[-1] or meanings[-1].transfer is not None


SHORT = "C6001F010A000000 A4001F017F000000 0101020304050607 8201020300000000"


SIZE_UNSAID = SHORT.replace("C6001F010A", "C4001F0100")
TAKEN, END_TAKEN = "A2027F0000000000", "A100000000000000"


@pytest.mark.parametrize(
    ("frames", "wrong"),
    [
        (f"{SHORT} {TAKEN}", "the write of 0x1F00:01 before did not end; 10 of 10 bytes came"),
        (f"{SIZE_UNSAID} {TAKEN}", "the write of 0x1F00:01 before did not end; 14 bytes came"),
        (f"{SHORT} {TAKEN} {END_TAKEN}", "the end of its blocks is not in the log"),
    ],
)
def test_a_block_without_its_end_or_the_answer_to_it(decoder: Decoder, frames: str, wrong: str) -> None:
    meanings = decoded(decoder, frames_of(f"{frames} {READ_IT} {VALUE}"))
    assert [defect.text.partition(": ")[2] for each in meanings for defect in each.defects] == [wrong]
    assert "value of 0x1018:01" in meanings[-1].text


def test_a_size_that_the_object_cannot_have_is_said(decoder: Decoder) -> None:
    frames = frames_of(KILLED.replace("001F01", "181001"), Frame(0x702, b"\0"))
    (said,) = [each for each in decoded(decoder, frames) if each.defects]
    assert said.defects[0].text.endswith("did not end; 21 of 1000 bytes came; the object has 4")


@pytest.mark.parametrize(("error", "taken"), [("00", {10: {0: 0x123, 1: 4}}), ("01", {})])
def test_lss_assigns_node_ids_by_selected_identity(error: str, taken: object) -> None:
    configuration = LssConfiguration()
    for asked in ("4023010000", "4104000000", "110A"):
        configuration.take(False, bytes.fromhex(asked).ljust(8, b"\0"))
    configuration.take(True, bytes.fromhex(f"11{error}").ljust(8, b"\0"))
    assert configuration.taken == taken
