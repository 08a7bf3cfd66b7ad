"""The SDO server: each form of transfer to the byte, and what a client does wrong (CiA 301, 7.2.4.3)."""

from __future__ import annotations

from binascii import crc_hqx
from math import inf

import pytest

from eurobot_od.od.values import Address
from eurobot_od.sdo.server import TIMEOUT, SdoServer
from eurobot_od.sdo.wire import AbortCode
from tests.device.shelf import NUMBER, TEXT, Shelf


def talk(server: SdoServer, *requests: str) -> list[str]:
    """Send requests written in hexadecimal, filled up to 8 bytes; return all answers."""
    sent = (bytes.fromhex(request).ljust(8, b"\0") for request in requests)
    return [answer.hex(" ", 4) for request in sent for answer in server.receive(request, 0.0)]


def abort(address: Address, code: AbortCode) -> str:
    return f"80{address[0].to_bytes(2, 'little').hex()}{address[1]:02x} {code.to_bytes(4, 'little').hex()}"


def text_crc(text: bytes) -> str:
    return crc_hqx(text, 0).to_bytes(2, "little").hex()


EXCHANGES: list[tuple[list[str], list[str], str]] = [
    (["40002001"], ["4b002001 34120000"], "expedited upload: 2 of 4 bytes"),
    (["2b002001 7856"], ["60002001 00000000"], "expedited download with its size"),
    (["22002001 78560000"], ["60002001 00000000"], "expedited download without size: as many as the object has"),
    (
        ["40081000", "60", "70"],
        ["41081000 0c000000", "00457572 6f626f74", "15203230 31340000"],
        "segmented upload: 7 and 5 bytes, toggled",
    ),
    (["40091000", "60"], ["41091000 00000000", "0f000000 00000000"], "an empty object: one segment of no bytes"),
    (
        ["21081000 08000000", "00 41424344454647", "1d 48"],
        ["60081000 00000000", "20000000 00000000", "30000000 00000000"],
        "segmented download",
    ),
    (
        ["20081000", "01 41424344454647"],
        ["60081000 00000000", "20000000 00000000"],
        "segmented download without size",
    ),
    (
        ["a4081000 7f", "a3", "a2027f", "a1"],
        ["c6081000 0c000000", "01457572 6f626f74", "82203230 31340000", f"c9{text_crc(b'Eurobot 2014')}00 00000000"],
        "block upload: two segments, the rest of the last one unused, CRC",
    ),
    (
        ["a4081000 01", "a3", "a20101", "a20101", "a1"],
        ["c6081000 0c000000", "01457572 6f626f74", "81203230 31340000", f"c9{text_crc(b'Eurobot 2014')}00 00000000"],
        "block upload in blocks of one",
    ),
    (
        ["a4081000 7f", "a3", "a2017f"],
        ["c6081000 0c000000", "01457572 6f626f74", "82203230 31340000", "81203230 31340000"],
        "block upload: only the first segment arrived, the second is sent again",
    ),
    (
        ["c6081000 08000000", "01 41424344454647", "82 48", f"d9 {text_crc(b'ABCDEFGH')}"],
        ["a4081000 7f000000", "a2027f00 00000000", "a1000000 00000000"],
        "block download",
    ),
    (
        ["c6081000 08000000", "82 48", "01 41424344454647", "82 48", f"d9 {text_crc(b'ABCDEFGH')}"],
        ["a4081000 7f000000", "a2007f00 00000000", "a2027f00 00000000", "a1000000 00000000"],
        "block download: the first segment was lost, all are sent again",
    ),
    (["c2081000 01000000", "81 41", "d9"], ["a4081000 7f000000", "a2017f00 00000000", "a1000000 00000000"], "no CRC"),
    (["40081000", "40002001"], ["41081000 0c000000", "4b002001 34120000"], "a new transfer replaces the one under way"),
    (["40081000", "80081000", "40002001"], ["41081000 0c000000", "4b002001 34120000"], "the client aborts"),
    (
        ["c4081000", "80081000", "40002001"],
        ["a4081000 7f000000", "4b002001 34120000"],
        "the client aborts a block download: what follows is no segment of it",
    ),
]


@pytest.mark.parametrize(("requests", "answers", "why"), EXCHANGES)
def test_every_frame_of_a_transfer_is_as_in_cia_301(requests: list[str], answers: list[str], why: str) -> None:
    assert talk(SdoServer(Shelf()), *requests) == answers, why


WRONG: list[tuple[list[str], Address, AbortCode, str]] = [
    (["40ffff00"], (0xFFFF, 0), AbortCode.NO_OBJECT, "an object that is not there"),
    (["e0002001"], (0, 0), AbortCode.UNKNOWN_COMMAND, "a command that is none"),
    (["60"], (0, 0), AbortCode.UNKNOWN_COMMAND, "a segment without a transfer"),
    (["a1"], (0, 0), AbortCode.UNKNOWN_COMMAND, "the end of a block upload that never began"),
    (["40081000", "00"], TEXT, AbortCode.UNKNOWN_COMMAND, "a download segment in an upload"),
    (["40081000", "70"], TEXT, AbortCode.TOGGLE_BIT, "upload: the toggle bit starts with 0"),
    (["40081000", "60", "60"], TEXT, AbortCode.TOGGLE_BIT, "upload: the toggle bit alternates"),
    (["21081000 08", "10 41"], TEXT, AbortCode.TOGGLE_BIT, "download: the toggle bit starts with 0"),
    (["21002001 03"], NUMBER, AbortCode.TOO_LONG, "download: more announced than the object takes"),
    (["20002001", "00 01020304050607"], NUMBER, AbortCode.TOO_LONG, "download: more sent than the object takes"),
    (["20002001", "0d 01"], NUMBER, AbortCode.TOO_SHORT, "download: less sent than the object needs"),
    (["21081000 02", "01 41424344454647"], TEXT, AbortCode.TOO_LONG, "download: more sent than announced"),
    (["21081000 09", "01 41424344454647"], TEXT, AbortCode.TOO_SHORT, "download: less sent than announced"),
    (["2f002001 01"], NUMBER, AbortCode.TOO_SHORT, "expedited: too short"),
    (["a4081000 00"], TEXT, AbortCode.BLOCK_SIZE, "blocks of no segments"),
    (["a4081000 80"], TEXT, AbortCode.BLOCK_SIZE, "blocks of 128 segments"),
    (["a4081000 7f", "a2017f"], TEXT, AbortCode.UNKNOWN_COMMAND, "acknowledged before the start"),
    (["a4081000 7f", "a3", "a2037f"], TEXT, AbortCode.SEQUENCE_NUMBER, "more acknowledged than was sent"),
    (["a4081000 7f", "a3", "a20200"], TEXT, AbortCode.BLOCK_SIZE, "no segments in the next block"),
    (["c6081000 08", "00 41"], TEXT, AbortCode.SEQUENCE_NUMBER, "segment number 0"),
    (["c6002001 02", "01", "82"], NUMBER, AbortCode.TOO_LONG, "block download: more sent than announced"),
    (["c2081000 02", "81 41424344454647", "c1"], TEXT, AbortCode.TOO_LONG, "block download: all of a segment counts"),
    (["c4081000", "81 41", "d9 0000"], TEXT, AbortCode.CRC, "block download: the CRC is another one"),
    (["c6081000 08", "81 41", "c1"], TEXT, AbortCode.CRC, "block download: cut off"),
    (["c2081000 09", "81 41424344454647", "c1"], TEXT, AbortCode.TOO_SHORT, "block download: less than announced"),
]


@pytest.mark.parametrize(("requests", "address", "code", "why"), WRONG)
def test_wrong_requests_abort_with_the_reason(requests: list[str], address: Address, code: AbortCode, why: str) -> None:
    shelf = Shelf()
    before = dict(shelf.objects)
    assert talk(SdoServer(shelf), *requests)[-1] == abort(address, code), why
    assert shelf.objects == before


@pytest.mark.parametrize("requests", [requests for requests, *_ in WRONG])
def test_after_an_abort_the_next_transfer_works(requests: list[str]) -> None:
    assert talk(SdoServer(Shelf()), *requests, "40002001")[-1] == "4b002001 34120000"


@pytest.mark.parametrize("length", [0, 1, 7, 9, 64])
def test_a_request_of_another_length_is_ignored(length: int) -> None:
    assert SdoServer(Shelf()).receive(bytes(length), 0.0) == []


def test_a_silent_client_gets_a_time_out_abort() -> None:
    server = SdoServer(Shelf())
    talk(server, "40081000")
    assert server.deadline == TIMEOUT
    assert server.tick(TIMEOUT - 0.001) == []
    assert [answer.hex(" ", 4) for answer in server.tick(TIMEOUT)] == [abort(TEXT, AbortCode.TIMEOUT)]
    assert server.deadline == inf
    assert server.tick(2 * TIMEOUT) == []


def test_each_request_renews_the_time_out() -> None:
    server = SdoServer(Shelf())
    talk(server, "40081000")
    server.receive(bytes.fromhex("60").ljust(8, b"\0"), 0.5)
    assert server.deadline == 0.5 + TIMEOUT
