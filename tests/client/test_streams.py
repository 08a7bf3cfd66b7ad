"""What comes again and again: an iterator that is behind keeps the newest, and counts what it has dropped."""

from __future__ import annotations

import pytest

from eurobot_od.client import streams
from eurobot_od.client.configure import pdo_parameters
from eurobot_od.client.streams import BlockingStream
from eurobot_od.od.dictionary import Dictionary
from eurobot_od.pdo.kinds import NOTHING
from eurobot_od.pdo.protocol import Protocol
from tests.client.peers import LIFT, line, master_on
from tests.client.wired import wired


def test_an_iterator_that_is_behind_has_the_newest(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(streams, "BACKLOG", 2)
    with wired() as master:
        stream = BlockingStream[int](master.node(5), "TPDO1")
        reader = iter(stream)
        for number in range(4):
            stream.push(number)
        assert (next(reader), next(reader), reader.lost) == (2, 3, 2)


# PDOs as a node has them now: what a master has moved is decoded where it is, and not where the file says.


STATE_TPDO = 0x1801
MOVED = 0x155
NO_RTR, NOT_VALID = 0x4000_0000, 0x8000_0000


def test_a_pdo_that_a_master_has_moved() -> None:
    dictionary = Dictionary.load(LIFT)
    with line("lift") as channel, master_on(channel) as master:
        node = master.node(2)
        for address, value, size in (
            ((STATE_TPDO, 1), NOT_VALID | NO_RTR | 0x282, 4),
            ((STATE_TPDO + 0x200, 0), 0, 1),
            ((STATE_TPDO + 0x200, 1), 0x2002_0118, 4),
            ((STATE_TPDO + 0x200, 0), 1, 1),
            ((STATE_TPDO, 1), NO_RTR | MOVED, 4),
        ):
            node.download(address, value.to_bytes(size, "little"))
        present = dictionary.configured(pdo_parameters(node, dictionary))
    [pdo] = [each for each in present.pdos if each.index == STATE_TPDO]
    assert (pdo.cob_id, [(each.address, each.bits) for each in pdo.mapping]) == (MOVED, [((0x2002, 1), 24)])
    assert Protocol.of_devices([present], NOTHING).unpack(MOVED, b"\xdc\x05\0") == (
        "Move State Response",
        {"time": 1500},
    )
    assert {each.cob_id for each in dictionary.pdos} - {each.cob_id for each in present.pdos} == {0x282}


def test_refused_pdo_parameters_are_those_of_the_file() -> None:
    dictionary = Dictionary.load(LIFT)
    present = dictionary.configured({(STATE_TPDO, 2): 255})
    assert [each.cob_id for each in present.pdos] == [each.cob_id for each in dictionary.pdos]
    assert present.number((STATE_TPDO, 2)) == 255
    assert dictionary.number((STATE_TPDO, 2)) == 254
