"""Laws of the protocol: every message survives the wire, in every dialect, and no bytes from it raise."""

from __future__ import annotations

from typing import Any

from hypothesis import given
from hypothesis import strategies as st

from eurobot_od.pdo.binding import Binding
from eurobot_od.pdo.kinds import Message, flagged_fields
from eurobot_od.pdo.protocol import Protocol
from eurobot_od.robot import dialects
from eurobot_od.robot.model.messages import EmergencyStop, GotoStateResponse, GotoXY, StartConfigurationSet
from eurobot_od.robot.model.values import Barriers, Direction, GotoFault, Obstacle, Route, Source, TeamColour
from eurobot_od.robot.protocol import EurobotProtocol
from tests.rows import rows

PROTOCOLS = {name: EurobotProtocol.load(name) for name in dialects.names()}
BINDINGS = [(protocol, binding) for protocol in PROTOCOLS.values() for binding in protocol.bindings]

# A place on the field with or without a heading, or nothing known; 255, 255 without a heading cannot be said.
HEADINGS = st.none() | st.integers(0, 359)
PLACES = st.tuples(st.integers(0, 3000), st.integers(0, 2000), HEADINGS).filter(lambda place: place != (255, 255, None))
POSITIONS = st.just((None, None, None)) | PLACES

# What the limits in the EDS do not say; a message that is not here has plain numbers.
MEANINGS: dict[type[Message], st.SearchStrategy[Any]] = {
    EmergencyStop: st.tuples(st.sampled_from(Obstacle)),
    GotoXY: st.tuples(
        st.integers(0, 3000),
        st.integers(0, 2000),
        st.integers(0, 359),
        st.integers(0, 100),
        st.integers(0, 0xFFFF).map(Barriers),
    ),
    GotoStateResponse: st.tuples(st.none() | st.integers(0, 0x0FFFFE) | st.sampled_from(GotoFault)),
    StartConfigurationSet: st.tuples(
        st.sampled_from(TeamColour), st.integers(0, 2), st.integers(0, 1), st.integers(0, 50), st.integers(0, 50)
    ),
}


def meanings(binding: Binding) -> st.SearchStrategy[Message]:
    """Messages that may be sent, as the binding maps them."""
    make: Any = binding.type
    if "source" in binding.kinds:
        return st.tuples(POSITIONS, st.sampled_from(Source)).map(lambda parts: make(*parts[0], parts[1]))
    if {"direction", "route"} <= set(binding.layout.fields):
        extra = st.tuples(st.sampled_from(Direction), st.sampled_from(Route))
        return st.tuples(MEANINGS[binding.type], extra).map(lambda parts: make(*parts[0], *parts[1]))
    numbers = st.tuples(*(st.integers(*limits) for limits in binding.limits.values()))
    return MEANINGS.get(binding.type, numbers).map(lambda values: make(*values))


def raw_values(binding: Binding) -> st.SearchStrategy[dict[str, int]]:
    return st.fixed_dictionaries({field: st.integers(0, (1 << w) - 1) for field, w in binding.layout.widths.items()})


@rows("protocol, binding", BINDINGS)
@given(draws=st.data())
def test_decodes_what_was_encoded(protocol: Protocol, binding: Binding, draws: st.DataObject) -> None:
    message = draws.draw(meanings(binding))
    frame = protocol.encode(message)
    assert frame.cob_id == binding.cob_id
    assert protocol.decode(*frame) == message
    assert flagged_fields(message) == []


@rows("protocol, binding", BINDINGS)
@given(draws=st.data())
def test_decodes_any_raw_values_and_encodes_those_in_range_again(
    protocol: Protocol, binding: Binding, draws: st.DataObject
) -> None:
    data = protocol.pack(binding.name, **draws.draw(raw_values(binding)))
    message = protocol.decode(binding.cob_id, data)
    if not flagged_fields(message):
        assert protocol.encode(message).data == data
