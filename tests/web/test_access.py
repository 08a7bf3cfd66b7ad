"""Connections: few places for connections that show no token, and none for those that say nothing."""

from __future__ import annotations

import http.client
import socket
from collections.abc import Iterator
from contextlib import ExitStack
from dataclasses import dataclass
from urllib.parse import urlsplit

import pytest

from eurobot_od.web.access import LONGEST_SILENCE, MOST_CONNECTIONS, MOST_UNKNOWN, AccessRules, Connections
from tests.web.scene import LONG, serving

TOKEN = "a-token-that-nobody-guesses"


@dataclass(eq=False)
class Line:
    """A transport without a socket."""

    is_closed: bool = False

    def abort(self) -> None:
        self.is_closed = True

    def is_closing(self) -> bool:
        return self.is_closed


def opened(connections: Connections, count: int, *, is_known: bool = False) -> list[Line]:
    """Open some connections; on known ones a request was let in."""
    lines = [Line() for _ in range(count)]
    for each in lines:
        connections.add(each, each, 0.0)
        if is_known:
            with connections.answering(each, lambda: 0.0, is_known=True):
                pass
    return lines


def test_the_oldest_unknown_connection_makes_room_for_the_newest() -> None:
    connections = Connections()
    lines = opened(connections, MOST_UNKNOWN + 2)
    assert [each.is_closed for each in lines] == [True, True] + [False] * MOST_UNKNOWN
    assert connections.refused == 2


def test_known_connections_never_make_room() -> None:
    connections = Connections()
    known = opened(connections, 40, is_known=True)
    opened(connections, 10 * MOST_UNKNOWN)
    assert not any(each.is_closed for each in known)


def test_a_full_server_closes_a_new_connection() -> None:
    connections = Connections()
    known = opened(connections, MOST_CONNECTIONS, is_known=True)
    (late,) = opened(connections, 1)
    assert late.is_closed
    assert not any(each.is_closed for each in known)


def test_a_connection_without_a_whole_request_in_time_is_closed_unless_it_is_answered() -> None:
    connections = Connections()
    silent, busy, fresh = Line(), Line(), Line()
    for each in (silent, busy, fresh):
        connections.add(each, each, 0.0)
    with connections.answering(fresh, lambda: 5.0, is_known=True):
        pass
    with connections.answering(busy, lambda: 5.0, is_known=True):
        connections.close_silent(LONGEST_SILENCE + 0.1)
    assert [each.is_closed for each in (silent, busy, fresh)] == [True, False, False]


@pytest.fixture
def guarded() -> Iterator[tuple[str, int]]:
    with serving(lambda: "the page", AccessRules("127.0.0.1", TOKEN)) as address:
        where = urlsplit(address)
        yield where.hostname or "", where.port or 0


def test_a_browser_with_the_token_is_served_beside_many_that_say_half_a_request(guarded: tuple[str, int]) -> None:
    with ExitStack() as stack:
        half = [stack.enter_context(socket.create_connection(guarded)) for _ in range(3 * MOST_UNKNOWN)]
        for each in half:
            try:
                each.sendall(b"GET / HTTP/1.1\r\nHost: 127")
            except OSError:
                continue  # it had to make room already
        browser = http.client.HTTPConnection(*guarded, timeout=LONG)
        stack.callback(browser.close)
        browser.request("GET", "/", headers={"Cookie": f"token-{guarded[1]}={TOKEN}"})
        assert browser.getresponse().read() == b"the page"
