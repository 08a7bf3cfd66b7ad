"""Laws of the protocol: every message survives the wire, in every dialect, and no bytes from it raise."""

from __future__ import annotations

from typing import Any

import pytest
from hypothesis import given
from hypothesis import strategies as st

from eurobot_od.errors import FrameLengthError, RemoteError
from eurobot_od.pdo.binding import Binding
from eurobot_od.pdo.kinds import Message, flagged_fields
from eurobot_od.pdo.protocol import Protocol
from tests.kit import lift
from tests.kit.lift import Brake, Building, Configure, Doors, MoveTo, NoTime, Ride, Sensor, StateResponse, Trouble

PROTOCOLS = {name: lift.protocol(name) for name in (lift.DIALECT, lift.REVERSED)}
BINDINGS = [(protocol, binding) for protocol in PROTOCOLS.values() for binding in protocol.bindings]

# A place with or without a turn, or nothing known; 255, 255 without a turn cannot be said.
TURNS = st.none() | st.integers(0, 359)
PLACES = st.tuples(st.integers(0, 3000), st.integers(0, 2000), TURNS).filter(lambda place: place != (255, 255, None))
POSITIONS = st.just((None, None, None)) | PLACES

# What the limits in the EDS do not say; a message that is not here has plain numbers.
MEANINGS: dict[type[Message], st.SearchStrategy[Any]] = {
    Brake: st.tuples(st.sampled_from(Trouble)),
    MoveTo: st.tuples(st.integers(0, 3000), st.sampled_from(Ride), st.integers(0, 100), st.integers(0, 600)),
    StateResponse: st.tuples(st.integers(0, 60000) | st.sampled_from(NoTime)),
    Configure: st.tuples(st.sampled_from(Building), st.integers(0, 2), st.integers(0, 1), st.integers(0, 50)),
}


def meanings(binding: Binding) -> st.SearchStrategy[Message]:
    """Messages that may be sent, as the binding maps them."""
    make: Any = binding.type
    if "sensor" in binding.kinds:
        return st.tuples(POSITIONS, st.sampled_from(Sensor)).map(lambda parts: make(*parts[0], parts[1]))
    if binding.type is MoveTo and "doors" in binding.layout.fields:
        return st.tuples(MEANINGS[MoveTo], st.sampled_from(Doors)).map(lambda parts: make(*parts[0], parts[1]))
    return MEANINGS.get(binding.type, st.just(())).map(lambda values: make(*values))


def raw_values(binding: Binding) -> st.SearchStrategy[dict[str, int]]:
    return st.fixed_dictionaries({field: st.integers(0, (1 << w) - 1) for field, w in binding.layout.widths.items()})


@pytest.mark.parametrize(("protocol", "binding"), BINDINGS)
@given(draws=st.data())
def test_decodes_what_was_encoded(protocol: Protocol, binding: Binding, draws: st.DataObject) -> None:
    message = draws.draw(meanings(binding))
    frame = protocol.encode(message)
    assert frame.cob_id == binding.cob_id
    assert protocol.decode(*frame) == message
    assert flagged_fields(message) == []


@pytest.mark.parametrize(("protocol", "binding"), BINDINGS)
@given(draws=st.data())
def test_decodes_any_raw_values_and_encodes_those_in_range_again(
    protocol: Protocol, binding: Binding, draws: st.DataObject
) -> None:
    data = protocol.pack(binding.name, **draws.draw(raw_values(binding)))
    message = protocol.decode(binding.cob_id, data)
    if not flagged_fields(message):
        assert protocol.encode(message).data == data


@pytest.mark.parametrize("protocol", PROTOCOLS.values(), ids=PROTOCOLS.keys())
@given(cob_id=st.integers(0, 0x7FF), data=st.binary(max_size=8))
def test_bytes_from_the_wire_are_a_message_or_a_remote_error(protocol: Protocol, cob_id: int, data: bytes) -> None:
    try:
        message = protocol.decode(cob_id, data)
    except RemoteError:
        return
    assert type(message) is protocol.binding_of(cob_id).type


@pytest.mark.parametrize(("protocol", "binding"), BINDINGS)
@given(data=st.binary(max_size=8))
def test_frame_is_read_from_its_message_s_length_on(protocol: Protocol, binding: Binding, data: bytes) -> None:
    if len(data) in binding.lengths or len(data) > binding.layout.length:
        cut = data[: binding.layout.length]
        assert protocol.decode(binding.cob_id, data) == protocol.decode(binding.cob_id, cut)
    else:
        with pytest.raises(FrameLengthError):
            protocol.decode(binding.cob_id, data)
