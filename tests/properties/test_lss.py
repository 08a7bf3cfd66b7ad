"""Devices without a node-ID on a bus that loses and delays answers: what is found is there, and nothing is left out."""

from __future__ import annotations

from typing import TypeAlias

from hypothesis import given, settings
from hypothesis import strategies as st

from eurobot_od.client import lss
from eurobot_od.client.lss import perform
from eurobot_od.errors import RemoteError
from eurobot_od.od.identity import Identity
from tests.client.lss_slave import UnreliableStation
from tests.client.wired import wired

NUMBERS = st.sampled_from([0, 1, 2, 0x80000000, 0xFFFFFFFF, 0x12345678])
IDENTITIES = st.builds(Identity, NUMBERS, NUMBERS, NUMBERS, NUMBERS)
Stations: TypeAlias = "list[tuple[Identity, list[float | None]]]"
DELAYS = st.lists(st.sampled_from([0.0] * 12 + [0.05, 0.12, 0.3, None]), min_size=1, max_size=40)


@settings(max_examples=25, deadline=None)
@given(st.lists(st.tuples(IDENTITIES, DELAYS), max_size=3, unique_by=lambda each: each[0]))
def test_a_search_finds_all_devices_and_no_other_or_is_an_error(
    stations: Stations,
) -> None:
    with wired(*(UnreliableStation(*each) for each in stations)) as master:
        try:
            found = perform(master, lss.find_all())
        except RemoteError:
            assert stations, "nobody has answered"
            return
    heard = [identity for identity, delays in stations if any(each is not None for each in delays)]
    assert {*heard} <= {*found} <= {identity for identity, _ in stations}
