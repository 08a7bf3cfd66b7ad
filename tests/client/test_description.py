"""Who a node is, and which EDS describes it: ours by identity, its own by upload."""

from __future__ import annotations

import pytest

from eurobot_od.client.description import device_name, fitting, read_identity, uploaded
from eurobot_od.errors import DictionaryError
from eurobot_od.od.dictionary import Dictionary
from eurobot_od.od.identity import Identity
from tests.client.peers import LIFT, line, master_on, peer, stock_lift
from tests.kit import plant

NO_SUCH_OBJECT = bytes.fromhex("00000206")
LIFT_IDENTITY = Identity(0, 2, 0x10000, 1)


def test_a_node_and_its_eds_have_one_identity() -> None:
    with line("lift") as channel, master_on(channel) as master:
        assert read_identity(master.node(2)) == LIFT_IDENTITY
    assert Identity.of(Dictionary.load(LIFT)) == LIFT_IDENTITY


@pytest.mark.parametrize(
    ("other", "difference"),
    [
        (LIFT_IDENTITY, None),
        (LIFT_IDENTITY._replace(serial=99), None),  # another piece of the same kind
        (LIFT_IDENTITY._replace(revision=0x10007), None),  # a minor revision behaves the same
        (LIFT_IDENTITY._replace(revision=0x20000), "major revision 0x2, not 0x1"),
        (LIFT_IDENTITY._replace(product=3), "product code 0x3, not 0x2"),
        (LIFT_IDENTITY._replace(vendor=0x123), "vendor-ID 0x123, not 0x0"),
    ],
)
def test_kinds_of_devices_differ_in_vendor_product_or_major_revision(other: Identity, difference: str | None) -> None:
    assert LIFT_IDENTITY.difference(other) == difference


def test_a_node_without_identity_has_zeros_and_no_name() -> None:
    with peer(lambda request: [b"\x80" + request[1:4] + NO_SUCH_OBJECT]) as channel, master_on(channel) as master:
        node = master.node(2)
        assert read_identity(node) == Identity()
        assert device_name(node) == ""
        assert uploaded(node) is None


def test_our_nodes_are_recognised_by_their_identity() -> None:
    with line("lift", "scale") as channel, master_on(channel) as master:
        for node_id, name in ((2, "lift"), (3, "scale")):
            found = fitting(master.node(node_id), plant.load_all("plain"))
            assert found is not None
            assert found.file == plant.FILES.folder("plain") / f"{name}.eds"


def test_an_eds_of_another_dialect_is_not_taken() -> None:
    with line("lift") as channel, master_on(channel) as master:
        assert fitting(master.node(2), plant.load_all("packed")) is None


def test_our_node_gives_its_eds() -> None:
    with line("lift") as channel, master_on(channel) as master:
        found = uploaded(master.node(2))
    assert found is not None
    assert found.content == LIFT.read_bytes()
    assert found.node_id == 2
    assert found.default((0x1200, 1)) == 0x602


def test_an_eds_that_is_none_is_refused() -> None:
    with stock_lift() as (channel, node), master_on(channel) as master:
        node.set_data(0x1021, 0, b"[1000]\nno EDS")
        with pytest.raises(DictionaryError, match=r"^EDS of node 2: not a readable EDS"):
            uploaded(master.node(2))


def test_a_compressed_eds_is_not_taken() -> None:
    with stock_lift() as (channel, node), master_on(channel) as master:
        node.set_data(0x1022, 0, b"\1")
        assert uploaded(master.node(2)) is None
