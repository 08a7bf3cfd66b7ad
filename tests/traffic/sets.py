"""Small sets of messages for the analysis, and what hypothesis makes them of."""

from __future__ import annotations

from hypothesis import strategies as st

from eurobot_od.traffic.load import PeriodicMessage

FAR = 10**9
"""A deadline that is never missed."""


def message(rank: int, bits: int, period: int, jitter: int = 0, node: str = "", deadline: int = FAR) -> PeriodicMessage:
    """Return a message with the identifier `rank`."""
    return PeriodicMessage(rank, bits, period, deadline, jitter, node)


messages = st.builds(
    message,
    st.just(0),
    st.sampled_from((55, 65, 75, 95, 115, 135)),
    st.integers(300, 4000),
    st.one_of(st.just(0), st.integers(0, 1500)),
    st.sampled_from(("a", "b")),
)


def ranked(found: list[PeriodicMessage]) -> list[PeriodicMessage]:
    """Return messages with the identifiers 0, 1, ... in their order."""
    return [each._replace(identifier=rank) for rank, each in enumerate(found)]


sets = st.lists(messages, min_size=1, max_size=7).map(ranked)
"""Sets from a tenth of the bus to over all of it."""
