"""Who may see the page: the rule alone; `test_server.py` asks the real server."""

from __future__ import annotations

import pytest

from eurobot_od.web.access import AccessRules, is_local
from tests.rows import rows

LOCAL, OPEN = AccessRules(), AccessRules("0.0.0.0", "right")


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
    ],
)
def test_admitted(access: AccessRules, headers: dict[str, str], shown: str, upgrade: bool) -> None:
    assert access.refusal(headers, shown, upgrade) is None


@rows(
    "access, headers, shown, upgrade, status, why",
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
    ],
)
def test_refused(
    access: AccessRules, headers: dict[str, str], shown: str, upgrade: bool, status: int, why: str
) -> None:
    refusal = access.refusal(headers, shown, upgrade)
    assert refusal is not None
    assert (refusal.status, why in refusal.why) == (status, True)


def test_only_loopback_needs_no_token() -> None:
    assert [is_local(each) for each in ("127.0.0.1", "127.1.2.3", "::1", "localhost")] == [True] * 4
    assert [is_local(each) for each in ("0.0.0.0", "::", "192.0.2.7", "robot.local")] == [False] * 4


@pytest.mark.parametrize(
    ("access", "listening", "address"),
    [
        (LOCAL, ("127.0.0.1", 8014), "http://127.0.0.1:8014/"),
        (OPEN, ("0.0.0.0", 8014), "http://127.0.0.1:8014/?token=right"),  # a browser can go to no 0.0.0.0
        (OPEN, ("::", 8014, 0, 0), "http://[::1]:8014/?token=right"),  # two more numbers in IPv6
        (LOCAL, ("fe80::1", 80, 0, 2), "http://[fe80::1]:80/"),
    ],
)
def test_the_address_to_type(access: AccessRules, listening: tuple[object, ...], address: str) -> None:
    assert access.address(listening) == address
