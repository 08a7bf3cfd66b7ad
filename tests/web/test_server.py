"""What the real server answers to whom: attacks one by one, and what a browser is owed."""

from __future__ import annotations

import asyncio
import errno
import http.client
import json
import logging
import resource
import socket
from collections.abc import Callable, Iterator
from contextlib import AsyncExitStack, closing, suppress
from email.message import Message
from functools import partial
from pathlib import Path
from typing import Any, NamedTuple
from urllib.parse import urlsplit

import aiohttp
import pytest

from eurobot_od.bus.live import Driver, open_bus
from eurobot_od.check.sending import read_list
from eurobot_od.frame import Frame
from eurobot_od.web import server
from eurobot_od.web.access import AccessRules, is_local
from eurobot_od.web.server import HEADERS, MOST_BROWSERS, MOST_OWED
from tests.kit import plant
from tests.web.scene import LONG, Served, channel, line, live_page

TOKEN = "a-token-that-nobody-guesses"
MUCH = 100_000_000
"""Bytes of a body that nobody asked for."""


@pytest.fixture(scope="module")
def local(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Served]:
    with live_page(channel(), tmp_path_factory.mktemp("recordings")) as served:
        yield served


@pytest.fixture(scope="module")
def guarded(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Served]:
    """A page as it is served to other machines."""
    with live_page(channel(), tmp_path_factory.mktemp("recordings"), access=AccessRules("127.0.0.1", TOKEN)) as served:
        yield served


class Answer(NamedTuple):
    status: int
    headers: Message
    text: str


def ask(served: Served, path: str = "/", method: str = "GET", **headers: str) -> Answer:
    """Send a request as it is written, with any Host."""
    address = urlsplit(served.address)
    with closing(http.client.HTTPConnection(address.hostname or "", address.port or 0, timeout=LONG)) as connection:
        connection.putrequest(method, path, skip_host=True)
        for name, value in ({"Host": address.netloc} | headers).items():
            connection.putheader(name.replace("_", "-"), value)
        connection.endheaders()
        with connection.getresponse() as answer:
            return Answer(answer.status, answer.headers, answer.read().decode())


UPGRADE = {
    "Upgrade": "websocket",
    "Connection": "Upgrade",
    "Sec_WebSocket_Version": "13",
    "Sec_WebSocket_Key": "AAAAAAAAAAAAAAAAAAAAAA==",
}

ASKED = {name.replace("_", "-"): value for name, value in UPGRADE.items()}

ATTACKS: list[tuple[str, str, str, dict[str, str], int]] = [
    ("a name that points here", "GET", "/", {"Host": "evil.example"}, 403),
    ("no name", "GET", "/", {"Host": ""}, 403),
    ("an address with a zone", "GET", "/", {"Host": "[fe80::1%25evil]"}, 403),
    ("a name behind an address", "GET", "/", {"Host": "127.0.0.1@evil.example"}, 403),
    ("an address without brackets", "GET", "/", {"Host": "::1"}, 403),
    ("a page elsewhere that reads", "GET", "/", {"Origin": "http://evil.example"}, 403),
    ("a page elsewhere that listens", "GET", "/live", {**UPGRADE, "Origin": "http://evil.example"}, 403),
    ("a page on another port", "GET", "/live", {**UPGRADE, "Origin": "http://127.0.0.1:1"}, 403),
    ("a file on the disk", "GET", "/live", {**UPGRADE, "Origin": "null"}, 403),
    ("a name that points here, listening", "GET", "/live", {**UPGRADE, "Host": "evil.example"}, 403),
    ("up and away", "GET", "/../../../../etc/passwd", {}, 404),
    ("up, written otherwise", "GET", "/%2e%2e/%2e%2e/etc/passwd", {}, 404),
    ("up from the recordings", "GET", "/recording/../../../etc/passwd", {}, 404),
    ("up from the recordings, written otherwise", "GET", "/recording/..%2f..%2fetc%2fpasswd", {}, 404),
    ("a recording that is none", "GET", "/recording/x.log", {}, 404),
    ("a file of the package", "GET", "/files/page.js", {}, 404),
    ("another method", "POST", "/", {"Content_Length": "0"}, 405),
    ("asking for leave to come from elsewhere", "OPTIONS", "/", {"Origin": "http://evil.example"}, 403),
    ("more body than there is memory", "POST", "/", {"Content_Length": str(MUCH)}, 405),
]


@pytest.mark.parametrize(("what", "method", "path", "headers", "status"), ATTACKS)
def test_attacks_on_the_server_are_refused(
    local: Served, what: str, method: str, path: str, headers: dict[str, str], status: int
) -> None:
    answer = ask(local, path, method, **headers)
    assert (what, answer.status) == (what, status)
    assert "root:" not in answer.text
    assert "Access-Control-Allow-Origin" not in answer.headers
    assert len(answer.text) < 200


@pytest.mark.parametrize(
    ("path", "headers", "status"),
    [
        ("/", {}, 401),
        ("/?token=wrong", {}, 401),
        ("/?token=", {}, 401),
        ("/", {"Cookie": "token=wrong"}, 401),
        ("/live", {**UPGRADE}, 401),
        (f"/?token={TOKEN}", {}, 303),
        ("/", {"Cookie": f"token-{{port}}={TOKEN}"}, 200),
        ("/", {"Cookie": f"token-1={TOKEN}"}, 401),  # of the page on another port of this host
        (f"/?token={TOKEN}", {"Host": "evil.example"}, 403),
    ],
)
def test_requests_need_the_token(guarded: Served, path: str, headers: dict[str, str], status: int) -> None:
    if "Upgrade" in headers:
        headers = {**headers, "Origin": guarded.address.split("/?")[0]}
    port = str(urlsplit(guarded.address).port)
    assert ask(guarded, path, **{name: text.replace("{port}", port) for name, text in headers.items()}).status == status


def test_the_token_leaves_the_address_and_no_script_gets_at_it(guarded: Served) -> None:
    answer = ask(guarded, f"/?token={TOKEN}")
    assert answer.headers["Location"] == "/"
    cookie = f"token-{urlsplit(guarded.address).port}={TOKEN}"  # a browser keeps one for all ports of a host
    assert answer.headers["Set-Cookie"] == f"{cookie}; HttpOnly; Path=/; SameSite=Strict"


def test_the_token_is_in_no_log(
    guarded: Served, caplog: pytest.LogCaptureFixture, capfd: pytest.CaptureFixture[str]
) -> None:
    caplog.set_level(logging.DEBUG)
    ask(guarded, f"/?token={TOKEN}")
    ask(guarded, f"/nothing?token={TOKEN}")
    assert TOKEN not in caplog.text + "".join(capfd.readouterr())


def test_every_answer_says_that_no_other_page_may_have_it(local: Served) -> None:
    for path in ("/", "/nothing"):
        headers = ask(local, path).headers
        assert headers["X-Frame-Options"] == "DENY"
        assert "frame-ancestors 'none'" in headers["Content-Security-Policy"]
        assert headers["X-Content-Type-Options"] == "nosniff"
        assert headers["Referrer-Policy"] == "no-referrer"
        assert headers["Cross-Origin-Resource-Policy"] == "same-origin"


@pytest.mark.parametrize(
    ("asked", "status"),
    [
        (b"nonsense\r\n\r\n", b"400"),
        (b"GET / HTTP/9.9.9\r\n\r\n", b"400"),
        (b"GET / HTTP/1.1\r\nno colon\r\n\r\n", b"400"),
        (b"GET / HTTP/1.1\r\nHost: x\r\nX: " + b"a" * 70_000 + b"\r\n\r\n", b"400"),
        (b"POST / HTTP/1.1\r\nTransfer-Encoding: chunked\r\nContent-Length: 1\r\n\r\n", b"400"),
        (b"GET /<script> HTTP/1.1\r\nExpect: all\r\nHost: 127.0.0.1\r\n\r\n", b"4"),
    ],
)
def test_malformed_http_is_refused_with_the_headers_of_all_answers(local: Served, asked: bytes, status: bytes) -> None:
    with socket.create_connection((urlsplit(local.address).hostname, urlsplit(local.address).port), 30) as connection:
        connection.sendall(asked)
        said = b""
        while b"\r\n\r\n" not in said and (part := connection.recv(1 << 16)):
            said += part
    assert said.split()[1].startswith(status)
    for name, value in HEADERS.items():
        assert f"{name}: {value}\r\n".encode() in said


def test_every_answer_has_a_policy_by_which_nothing_foreign_runs(local: Served) -> None:
    nothing = "default-src 'none'; base-uri 'none'; form-action 'none'; frame-ancestors 'none'"
    assert ask(local, "/nothing").headers["Content-Security-Policy"] == nothing
    assert ask(local, Host="evil.example").headers["Content-Security-Policy"] == nothing
    page = ask(local)
    own, _, framing = page.headers["Content-Security-Policy"].rpartition("; ")
    assert f'content="{own}"' in page.text
    assert "script-src 'sha256-" in own
    assert framing == "frame-ancestors 'none'"


def test_a_body_of_100_megabytes_is_not_kept(local: Served) -> None:
    address = urlsplit(local.address)
    before = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss
    head = f"POST / HTTP/1.1\r\nHost: {address.netloc}\r\nContent-Length: {MUCH}\r\n\r\n"
    with socket.create_connection((address.hostname or "", address.port or 0), LONG) as connection:
        connection.sendall(head.encode())
        with suppress(OSError):  # the server hangs up
            for _ in range(100):
                connection.sendall(bytes(MUCH // 100))
    assert resource.getrusage(resource.RUSAGE_SELF).ru_maxrss - before < MUCH // 1000 / 4  # in KiB
    assert ask(local).status == 200


# Browsers


def talk(served: Served, what: Callable[[aiohttp.ClientWebSocketResponse], Any]) -> Any:
    """Talk to the server by a websocket, as the page does."""

    async def talked() -> Any:
        origin = served.address.rstrip("/")
        async with aiohttp.ClientSession() as session, session.ws_connect(f"{origin}/live", origin=origin) as opened:
            return await asyncio.wait_for(what(opened), LONG)

    return asyncio.run(talked())


async def snapshot(opened: aiohttp.ClientWebSocketResponse) -> dict[str, Any]:
    """Wait for a snapshot and confirm it."""
    said: dict[str, Any] = await opened.receive_json()
    await opened.send_str(str(said["turn"]))
    return said


async def answer(opened: aiohttp.ClientWebSocketResponse, text: str) -> dict[str, Any]:
    """Ask, and return the answer, with the snapshots confirmed that come before it."""
    await opened.send_str(text)
    while "re" not in (said := await opened.receive_json()):
        await opened.send_str(str(said["turn"]))
    return dict(said)


@pytest.mark.parametrize(
    ("text", "error"),
    [
        ("{", "a request is JSON"),
        ("[" * 60_000, "a request is JSON"),
        ("[]", "a request is a JSON object"),
        ('{"id": 1}', "unknown request 'None'"),
        ('{"id": 1, "do": {}}', "unknown request '{}'"),
        ('{"id": 1, "do": "exec"}', "unknown request 'exec'"),
        ('{"id": 1, "do": "read"}', "node is missing, or not a text"),
        ('{"id": 1, "do": "read", "node": "nobody", "object": "1000"}', "unknown node 'nobody'"),
        ('{"id": 1, "do": "read", "node": "128", "object": "1000"}', "unknown node '128'"),
        ('{"id": 1, "do": "read", "node": "\\u00b2", "object": "1000"}', "unknown node '²'"),
        ('{"id": 1, "do": "read", "node": "lift", "object": "Nothing"}', "unknown object 'Nothing'"),
        ('{"id": 1, "do": "send", "message": "Move To", "fields": []}', "fields are texts by name"),
        ('{"id": 1, "do": "send", "message": "Move To", "fields": {"x": 5}}', "fields are texts by name"),
        ('{"id": 1, "do": "send", "message": "Move To", "fields": {"x": "9999"}}', "y, angle, speed missing"),
        ('{"id": 1, "do": "send", "message": "Goto YX"}', "unknown message 'Goto YX'"),
        ('{"id": 1, "do": "nmt", "command": "explode", "node": "all"}', "unknown NMT command 'explode'"),
        ('{"id": 1, "do": "write", "node": "lift", "object": "1017", "value": "70000"}', "allowed: 0..65535"),
        ('{"id": 1, "do": "write", "node": "lift", "object": "1017", "value": "soon"}', "allowed: an integer"),
        ('{"id": 1, "do": "write", "node": "lift", "object": "1017", "value": "1_000"}', "allowed: an integer"),
        ('{"id": 1, "do": "write", "node": "lift", "object": "1017", "value": "\\u0663"}', "allowed: an integer"),
        ('{"id": 1, "do": "watch", "node": "lift", "object": 7}', "object is missing, or not a text"),
        ('{"id": 1, "do": "send frame", "frame": "800#"}', "'800#' is not a frame"),
        ('{"id": 1, "do": "send frame", "frame": "100#000102030405060708"}', "is not a frame"),
        ('{"id": 1, "do": "begin list", "key": "a", "title": "a", "rows": [5]}', "rows are missing, or not objects"),
        (
            '{"id": 1, "do": "begin list", "key": "a", "title": "a", "rows": [{"send": "100#", "period": "1 ms"}]}',
            "a:1:30: period = '1 ms' is not allowed; allowed: 0.005..60 s",
        ),
        ('{"id": 1, "do": "keep list", "name": "../a", "rows": [{"send": "100#"}]}', "'../a': a list has letters"),
        ('{"id": 1, "do": "list", "name": "a"}', "unknown list 'a'"),
    ],
)
def test_wrong_requests_are_answered_in_one_line(local: Served, text: str, error: str) -> None:
    said = talk(local, lambda opened: answer(opened, text))
    assert error in said["error"]
    assert "\n" not in said["error"]


def test_a_request_that_is_too_long_ends_the_connection_and_nothing_else(local: Served) -> None:
    async def shout(opened: aiohttp.ClientWebSocketResponse) -> int | None:
        await opened.send_str("x" * 200_000)
        while not (await opened.receive()).type.name.startswith("CLOS"):
            pass
        return opened.close_code

    assert talk(local, shout) == aiohttp.WSCloseCode.MESSAGE_TOO_BIG
    assert talk(local, snapshot)["turn"] > 0


@pytest.mark.parametrize(
    "words",
    [
        {"do": "send", "message": "Halt Lift"},
        {"do": "nmt", "command": "stop", "node": "all"},
        {"do": "stop"},
        {"do": "write", "node": "lift", "object": "1017", "value": "100"},
        {"do": "send frame", "frame": "100#"},
        {"do": "begin list", "key": "a", "title": "a", "rows": [{"send": "100#"}]},
        {"do": "keep list", "name": "a", "rows": [{"send": "100#"}]},
        {"do": "record"},
        {"do": "stop recording"},
    ],
    ids=lambda words: words["do"],
)
def test_without_control_nothing_gets_on_the_bus_or_the_disk(tmp_path: Path, words: dict[str, str]) -> None:
    name = channel()
    with open_bus("virtual", name) as other, live_page(name, tmp_path, control=False) as served:
        said = talk(served, lambda opened: answer(opened, json.dumps({"id": 1, **words})))
        assert said["error"] == "this page is read-only: start the server with --control"
        assert other.recv(0) is None
        assert list(tmp_path.iterdir()) == []


@pytest.mark.parametrize(
    ("node", "data"), [("all", "0200"), ("lift", "0202"), ("3", "0203"), ("node 127", "027F"), ("nav", None)]
)
def test_an_nmt_command_goes_to_a_node_or_to_all(tmp_path: Path, node: str, data: str | None) -> None:
    name = channel()
    with open_bus("virtual", name) as other, live_page(name, tmp_path) as served:
        words = json.dumps({"id": 1, "do": "nmt", "command": "stop", "node": node})
        said = talk(served, lambda opened: answer(opened, words))
        heard = other.recv(LONG if data else 0)
    if data is None:
        assert said["error"].startswith("unknown node 'nav'")
    else:
        assert said["ok"] == f"000#{data}"
        assert heard
        assert (heard.arbitration_id, heard.data.hex().upper()) == (0, data)


EACH_10_MS = {"id": 1, "do": "begin list", "key": "a", "title": "it", "rows": [{"send": "123#AB", "period": "10 ms"}]}


async def ended(opened: aiohttp.ClientWebSocketResponse) -> str:
    """Wait for the end of the list of somebody, and return why it has ended."""
    while not (why := (await snapshot(opened))["lists"].get("a", {}).get("ended")):
        pass
    return str(why)


@pytest.mark.parametrize(
    ("end", "why"), [({"do": "stop"}, "STOP"), ({"do": "end list", "key": "a"}, "ended")], ids=["STOP", "End"]
)
def test_a_list_goes_on_until_it_is_ended(tmp_path: Path, end: dict[str, str], why: str) -> None:
    async def run(opened: aiohttp.ClientWebSocketResponse) -> str:
        assert (await answer(opened, json.dumps(EACH_10_MS)))["ok"] is None
        for _ in range(10):  # the bus of this process: what is read here was sent
            assert other.recv(LONG) is not None
        await answer(opened, json.dumps({"id": 2, **end}))
        while other.recv(0.2) is not None:
            pass
        return await ended(opened)

    name = channel()
    with open_bus("virtual", name) as other, live_page(name, tmp_path) as served:
        assert talk(served, run) == why


@pytest.mark.parametrize("words", [EACH_10_MS, {"id": 1, "do": "send frame", "frame": "123#AB"}], ids=["list", "frame"])
def test_frames_queued_before_a_stop_are_not_sent_after_it(tmp_path: Path, words: dict[str, Any]) -> None:
    async def stopped(opened: aiohttp.ClientWebSocketResponse) -> list[dict[str, Any]]:
        await opened.send_str(json.dumps(words))  # nodes are asked first what they obey, and nobody answers
        await opened.send_str('{"id": 2, "do": "stop"}')
        said = list[dict[str, Any]]()
        while len(said) < 2:
            if "re" in (answer := await opened.receive_json()):
                said.append(answer)
        return said

    name = channel()
    with open_bus("virtual", name) as other, live_page(name, tmp_path) as served:
        stop, late = talk(served, stopped)
        assert (stop["re"], late["re"], late["error"]) == (2, 1, "it was stopped meanwhile: not carried out")
        while (heard := other.recv(0)) is not None:
            assert heard.arbitration_id != 0x123


def test_a_list_ends_with_a_page_that_is_not_heard_any_more(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("eurobot_od.web.drives.SILENT", 0.2)

    async def run(opened: aiohttp.ClientWebSocketResponse) -> None:
        await answer(opened, json.dumps(EACH_10_MS))
        while other.recv(0.5) is not None:
            await asyncio.sleep(0)

    name = channel()
    with open_bus("virtual", name) as other, live_page(name, tmp_path) as served:
        talk(served, run)
        assert talk(served, ended) == "its page is not heard"


def test_a_row_is_sent_when_another_node_sends_what_it_waits_for(tmp_path: Path) -> None:
    words = {**EACH_10_MS, "rows": [{"send": "705#R1", "trigger": "185", "burst": 2}], "sure": True}

    async def run(opened: aiohttp.ClientWebSocketResponse) -> str:
        await answer(opened, json.dumps(words))
        assert other.recv(0) is None
        Driver(other).send(Frame(0x185))
        sent = [other.recv(LONG) for _ in range(2)]
        assert [(each.arbitration_id, each.is_remote_frame) for each in sent if each] == [(0x705, True)] * 2
        await answer(opened, json.dumps(words | {"key": "b"}))
        return str((await answer(opened, json.dumps(words)))["error"])

    name = channel()
    with open_bus("virtual", name) as other, live_page(name, tmp_path) as served:
        assert talk(served, run) == "it is being sent already: end it first"


def test_a_kept_list_is_a_file_that_is_read_again(tmp_path: Path) -> None:
    rows = [
        {"send": "123#AB", "period": "10 ms", "burst": 2, "gap": "5 ms"},
        {"send": "Halt Cause", "fields": {"cause": "curtain"}, "trigger": "Weight Response.weight > 1"},
    ]

    async def keep(opened: aiohttp.ClientWebSocketResponse) -> Any:
        await answer(opened, json.dumps({"id": 1, "do": "keep list", "name": "warm up", "rows": rows}))
        assert (await answer(opened, '{"id": 2, "do": "lists"}'))["ok"] == ["warm up"]
        return (await answer(opened, '{"id": 3, "do": "list", "name": "warm up"}'))["ok"]

    with live_page(channel(), tmp_path) as served:
        assert talk(served, keep) == rows
    text = (tmp_path / "sequences" / "warm up.yaml").read_text()
    assert len(read_list(text, "warm up.yaml", plant.decoder().protocol)) == 2


def test_an_object_is_read_and_its_value_shown(tmp_path: Path) -> None:
    name = channel()
    with line(name), live_page(name, tmp_path) as served:
        words = json.dumps({"id": 1, "do": "read", "node": "lift", "object": "0x1017"})
        said = talk(served, lambda opened: answer(opened, words))
        assert said["ok"] == {"value": 1000, "text": "1000"}


def test_the_diagnosis_is_told_without_control(tmp_path: Path) -> None:
    name = channel()
    with open_bus("virtual", name) as other, live_page(name, tmp_path, control=False) as served:
        Driver(other).send(Frame(0x082, bytes.fromhex("1082110000000000")))

        async def diagnosis(opened: aiohttp.ClientWebSocketResponse) -> dict[str, Any]:
            while True:
                said = (await answer(opened, json.dumps({"id": 1, "do": "diagnosis"})))["ok"]
                if said["incidents"]:
                    return dict(said)

        said = talk(served, diagnosis)
    assert said["verdict"].startswith("1 error in 1 frame")
    assert [each[0] for each in said["incidents"][0]["facts"]] == ["Seen", "Frames", "Likely", "To do", "Source"]


def test_an_object_that_is_watched_is_read_and_comes_with_the_snapshots(tmp_path: Path) -> None:
    async def watch(opened: aiohttp.ClientWebSocketResponse) -> dict[str, Any]:
        words = {"id": 1, "do": "watch", "node": "lift", "object": "0x1017"}
        key = (await answer(opened, json.dumps(words)))["ok"]
        while True:
            read = (await snapshot(opened))["objects"].get(key)
            if read and read["samples"]:
                return dict(read)

    name = channel()
    with line(name), live_page(name, tmp_path) as served:
        read = talk(served, watch)
    time, value = read["samples"][0]
    assert time > 0
    assert (value, read["trouble"]) == (1000, "")


def test_no_more_browsers_than_a_server_has_room_for(local: Served) -> None:
    async def crowd() -> list[int]:
        origin = local.address.rstrip("/")
        async with aiohttp.ClientSession() as http, AsyncExitStack() as stack:
            for _ in range(MOST_BROWSERS):
                await stack.enter_async_context(http.ws_connect(f"{origin}/live", origin=origin))
            async with http.get(f"{origin}/live", headers={"Origin": origin, **ASKED}) as refused:
                return [refused.status]

    assert asyncio.run(asyncio.wait_for(crowd(), LONG)) == [503]
    assert talk(local, snapshot)["turn"] > 0, "there is room again"


def test_a_browser_that_is_gone_without_a_word_keeps_no_place(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(server, "SILENCE", 0.2)

    async def say_nothing(address: str) -> None:
        origin = address.rstrip("/")
        async with (
            aiohttp.ClientSession() as http,
            http.ws_connect(f"{origin}/live", origin=origin, autoping=False) as opened,
        ):
            while not (await opened.receive()).type.name.startswith("CLOS"):
                pass

    with live_page(channel(), tmp_path) as served:
        asyncio.run(asyncio.wait_for(say_nothing(served.address), LONG))


def test_a_browser_that_confirms_nothing_is_left_out_and_then_has_every_frame(tmp_path: Path) -> None:
    async def sleep_and_wake(driver: Driver, opened: aiohttp.ClientWebSocketResponse) -> list[dict[str, Any]]:
        owed = [await opened.receive_json() for _ in range(MOST_OWED + 1)]
        for number in range(50):
            driver.send(Frame(0x703, bytes([number])))
        with pytest.raises(asyncio.TimeoutError):
            await opened.receive(0.5)  # as long as ten snapshots take: none comes
        await opened.send_str(str(owed[-1]["turn"]))
        return [*owed, await opened.receive_json()]

    name = channel()
    with open_bus("virtual", name) as bus, live_page(name, tmp_path) as served:
        Driver(bus).send(Frame(0x701, b"\x05"))
        *owed, woken = talk(served, partial(sleep_and_wake, Driver(bus)))
        assert sum(len(each["history"]) for each in owed) == 1
        assert (woken["first"], [each[2] for each in woken["history"]]) == (
            1,
            [f"{number:02x}" for number in range(50)],
        )


def test_of_too_many_requests_at_once_the_last_are_dropped(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    async def flood(opened: aiohttp.ClientWebSocketResponse) -> list[int]:
        for number in (1, 2, 3):  # a node that is silent keeps the first of them waiting, and the others wait for it
            await opened.send_str(json.dumps({"id": number, "do": "read", "node": "lift", "object": "0x1017"}))
        answered = [(await answer(opened, "0"))["re"] for _ in range(2)]  # "0" asks nothing: it confirms no turn
        return [*answered, (await answer(opened, '{"id": 4, "do": "objects", "node": "lift"}'))["re"]]

    monkeypatch.setattr(server, "MOST_PENDING", 2)
    with live_page(channel(), tmp_path) as served:
        assert talk(served, flood) == [1, 2, 4]


def test_twenty_browsers_see_every_frame_counted(tmp_path: Path) -> None:
    async def counted(http: aiohttp.ClientSession, origin: str, ready: asyncio.Semaphore) -> int:
        async with http.ws_connect(f"{origin}/live", origin=origin) as opened:
            await snapshot(opened)
            ready.release()
            while (said := await snapshot(opened))["frames"] < 1000:
                pass
            return int(said["frames"])

    async def all_of_them(origin: str, driver: Driver) -> list[int]:
        ready = asyncio.Semaphore(0)
        async with aiohttp.ClientSession() as http:
            counts = [asyncio.create_task(counted(http, origin, ready)) for _ in range(20)]
            for _ in counts:
                await ready.acquire()
            for _ in range(1000):
                driver.send(Frame(0x100, bytes(5)))
            return await asyncio.wait_for(asyncio.gather(*counts), LONG)

    name = channel()
    with open_bus("virtual", name) as bus, live_page(name, tmp_path) as served:
        assert asyncio.run(all_of_them(served.address.rstrip("/"), Driver(bus))) == [1000] * 20


def test_a_port_that_is_taken_is_told_in_a_line(local: Served, capfd: pytest.CaptureFixture[str]) -> None:
    from eurobot_od import cli

    taken = urlsplit(local.address).netloc
    assert cli.main(["serve", "--listen", taken, "-i", "virtual", "-c", channel()]) == 2
    assert f"cannot listen at {taken}" in capfd.readouterr().err


def test_when_descriptors_end_one_line_is_logged_and_no_traceback(caplog: pytest.LogCaptureFixture) -> None:
    loop = asyncio.new_event_loop()
    handle = server._report_once()
    for error in (*[OSError(errno.EMFILE, "Too many open files")] * 3, OSError(errno.EPIPE, "Broken pipe")):
        handle(loop, {"message": "asyncio's own", "exception": error})
    loop.close()
    said = [each.getMessage().splitlines()[0] for each in caplog.records]
    assert said == [
        "connections wait, as there are no more descriptors: [Errno 24] Too many open files",
        "asyncio's own",
    ]


def test_a_silent_connection_does_not_disturb_others(local: Served) -> None:
    address = urlsplit(local.address)
    with socket.create_connection((address.hostname or "", address.port or 0)):
        assert ask(local).status == 200


LOCAL, OPEN = AccessRules(), AccessRules("0.0.0.0", "right")
BENCH = "https://bench.example"
PROXIED = AccessRules("127.0.0.1", "right", BENCH)


@pytest.mark.parametrize(
    ("access", "headers", "shown", "upgrade"),
    [
        (LOCAL, {"Host": "127.0.0.1:8014"}, "", False),
        (LOCAL, {"Host": "localhost:8014"}, "", False),
        (LOCAL, {"Host": "[::1]:8014"}, "", False),
        (LOCAL, {"Host": "127.0.0.1"}, "", False),  # port 80
        (LOCAL, {"Host": "127.0.0.1:8014", "Origin": "http://127.0.0.1:8014"}, "", True),
        (OPEN, {"Host": "192.0.2.7:8014"}, "right", False),  # an address in figures is nobody's name
        (AccessRules("robot.local", "right"), {"Host": "robot.local:8014"}, "right", False),
        (PROXIED, {"Host": "bench.example", "Origin": BENCH}, "right", True),
        (PROXIED, {"Host": "127.0.0.1:8014", "Origin": BENCH}, "right", True),  # a proxy that says its own Host
    ],
)
def test_requests_of_this_page_are_admitted(
    access: AccessRules, headers: dict[str, str], shown: str, upgrade: bool
) -> None:
    assert access.refusal(headers, shown, upgrade) is None


@pytest.mark.parametrize(
    ("access", "headers", "shown", "upgrade", "status", "why"),
    [
        (LOCAL, {}, "", False, 403, "Host ''"),
        (LOCAL, {"Host": "evil.example:8014"}, "", False, 403, "Host 'evil.example:8014'"),  # a name that points here
        (LOCAL, {"Host": "127.0.0.1.evil.example"}, "", False, 403, "is not this server"),
        (LOCAL, {"Host": "localhost.evil.example:8014"}, "", False, 403, "is not this server"),
        (LOCAL, {"Host": "127.0.0.1:8014", "Origin": "http://evil.example"}, "", True, 403, "another page"),
        (LOCAL, {"Host": "127.0.0.1:8014", "Origin": "http://127.0.0.1:9999"}, "", True, 403, "another page"),
        (LOCAL, {"Host": "127.0.0.1:8014", "Origin": "https://127.0.0.1:8014"}, "", True, 403, "another page"),
        (LOCAL, {"Host": "127.0.0.1:8014", "Origin": "null"}, "", False, 403, "another page"),  # a file, a sandbox
        (LOCAL, {"Host": "127.0.0.1:8014"}, "", True, 403, "another page"),  # a websocket that belongs to no browser
        (OPEN, {"Host": "192.0.2.7:8014"}, "", False, 401, "missing or wrong"),
        (OPEN, {"Host": "192.0.2.7:8014"}, "righ", False, 401, "missing or wrong"),
        (OPEN, {"Host": "192.0.2.7:8014"}, "räight", False, 401, "missing or wrong"),
        (OPEN, {"Host": "192.0.2.7:8014"}, "right\udcff", False, 401, "missing or wrong"),  # a byte that is not text
        (OPEN, {"Host": "evil.example"}, "right", False, 403, "is not this server"),
        (PROXIED, {"Host": "bench.example", "Origin": BENCH}, "", True, 401, "missing or wrong"),
        (PROXIED, {"Host": "bench.example", "Origin": "https://evil.example"}, "right", True, 403, "another page"),
        (PROXIED, {"Host": "bench.example"}, "right", True, 403, "another page"),
    ],
)
def test_requests_of_other_pages_are_refused(
    access: AccessRules, headers: dict[str, str], shown: str, upgrade: bool, status: int, why: str
) -> None:
    refusal = access.refusal(headers, shown, upgrade)
    assert refusal is not None
    assert (refusal.status, why in refusal.why) == (status, True)


def test_only_loopback_needs_no_token() -> None:
    assert [is_local(each) for each in ("127.0.0.1", "127.1.2.3", "::1", "localhost")] == [True] * 4
    assert [is_local(each) for each in ("0.0.0.0", "::", "192.0.2.7", "robot.local")] == [False] * 4
    assert AccessRules.at("::1").token == ""
    assert AccessRules.at("::1", "https://bench.example").token  # whom a proxy lets in, nobody knows
    assert AccessRules.at("0.0.0.0", token="mine").token == "mine"
    assert len({AccessRules.at("0.0.0.0").token for _ in range(3)} - {""}) == 3  # a new one at each start


@pytest.mark.parametrize(
    ("access", "listening", "address"),
    [
        (LOCAL, ("127.0.0.1", 8014), "http://127.0.0.1:8014/"),
        (OPEN, ("0.0.0.0", 8014), "http://127.0.0.1:8014/?token=right"),  # a browser can go to no 0.0.0.0
        (OPEN, ("::", 8014, 0, 0), "http://[::1]:8014/?token=right"),  # two more numbers in IPv6
        (LOCAL, ("fe80::1", 80, 0, 2), "http://[fe80::1]:80/"),
        (PROXIED, ("127.0.0.1", 8014), "https://bench.example/?token=right"),
    ],
)
def test_the_address_to_type(access: AccessRules, listening: tuple[object, ...], address: str) -> None:
    assert access.address(listening) == address
