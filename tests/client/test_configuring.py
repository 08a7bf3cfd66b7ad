"""Configuring a node from a DCF: all of it or nothing, and one clear line about file, node or bus if it fails."""

from __future__ import annotations

from collections.abc import Callable
from datetime import datetime
from pathlib import Path

import canopen
import pytest
from canopen.sdo.exceptions import SdoAbortedError

from eurobot_od.client.configure import Configured, DictionaryArea, apply, check_file, configure, difference
from eurobot_od.client.master import Procedure, RemoteNode
from eurobot_od.device.nmt import NmtCommand, NmtState
from eurobot_od.errors import BusError, ConfigurationError, DictionaryError, NoAnswer
from eurobot_od.frame import Frame
from eurobot_od.od import dcf
from eurobot_od.od.description import DescribedDevice
from eurobot_od.od.dictionary import Dictionary
from eurobot_od.od.document import parse
from eurobot_od.od.objects import address_of
from eurobot_od.od.values import Address, Value
from eurobot_od.pdo.protocol import Protocol
from eurobot_od.support.progress import Progress, unwatched
from tests.client.peers import EDS, LIFT, line, master_on, open_bus, stock_lift
from tests.eds_text import DEVICE_TYPE, variable, with_entry
from tests.kit import plant
from tests.kit.plant import messages as m

NOW = datetime(2014, 5, 28, 12, 0, 1)
NOW_BYTES = [(11105).to_bytes(4, "little"), (43_201_000).to_bytes(4, "little")]
"""Days since 1984-01-01, and milliseconds since midnight."""

HEARTBEAT: Address = (0x1017, 0)
SPEED: Address = (0x2101, 1)
COB_ID: Address = (0x1402, 1)
COUNT: Address = (0x1602, 0)
ENTRY: Address = (0x1602, 5)
STORE: Address = (0x1010, 1)

NEW: dict[Address, Value] = {HEARTBEAT: 500, SPEED: 900, COB_ID: 0x18, ENTRY: 0x20000602}
"""What the tests configure: a setting of each kind, and Move To under 0x018 with 2 reserved bits in place of 6."""

ORDER = [HEARTBEAT, SPEED, COB_ID, COUNT, ENTRY, COUNT, COB_ID, (0x1020, 1), (0x1020, 2), STORE]


@pytest.fixture
def make(tmp_path: Path) -> Callable[..., Dictionary]:
    """Writes a DCF of node 2 and reads it: values, EDS, and what is done to its text."""

    def write(
        values: dict[Address, Value], eds: str = LIFT.read_text(), change: Callable[[str], str] = str, node_id: int = 2
    ) -> Dictionary:
        file = tmp_path / "lift.dcf"
        file.write_text(change(dcf.with_values(DescribedDevice(parse(eds)), values, node_id, "lift", 500)))
        return Dictionary.load(file)

    return write


class Writes:
    """Takes note of what is written to a stock node, and refuses or ends it where a test wants it to."""

    def __init__(self, node: canopen.LocalNode) -> None:
        self.node = node
        self.addresses: list[Address] = []
        self.refused: set[int] = set()
        self.silent_after: int | None = None
        node.add_write_callback(self._written)  # type: ignore[no-untyped-call]

    def _written(self, index: int, subindex: int, od: object, data: bytes) -> None:
        if len(self.addresses) in self.refused:
            self.refused.clear()
            raise SdoAbortedError(0x08000022)
        self.addresses.append((index, subindex))
        if len(self.addresses) == self.silent_after:
            self.node.network.unsubscribe(0x602)


def values(node: canopen.LocalNode) -> list[int]:
    """What a stock node has of the objects that the tests configure."""
    return [int.from_bytes(node.get_data(*address), "little") for address in NEW]


def set_access(node: canopen.LocalNode, address: Address, access: str) -> None:
    variable = node.object_dictionary.get_variable(*address)
    assert variable is not None
    variable.access_type = access


FORMER = [1000, 800, 0x202, 0x20000606]


# It works


def test_our_drive_is_configured_stored_and_takes_gotos_under_the_new_identifier(
    make: Callable[..., Dictionary],
) -> None:
    description = make(NEW)
    with line("lift") as channel, master_on(channel) as master:
        node = master.node(2)
        assert configure(node, description, NOW) == Configured(len(NEW), stored=True, verified=True)
        assert [node.upload((0x1020, subindex)) for subindex in (1, 2)] == NOW_BYTES
        assert difference(node, description).changes == ()
        protocol = Protocol.of_devices([description], plant.CATALOGUE)
        heard: list[Frame] = []
        confirm = protocol.cob_id(m.MoveConfirm)
        master.listeners[confirm] = lambda data: heard.append(Frame(confirm, data))
        master.send(*protocol.encode(m.MoveTo(1500, 1000, 90, 50)))
        assert protocol.cob_id(m.MoveTo) == 0x18
        assert master.pump(1, lambda: heard == [Frame(confirm)])


def test_the_order_of_writes_is_that_of_cia_301(
    make: Callable[..., Dictionary], monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr("eurobot_od.client.master.BOOT_WAIT", 0.1)
    with stock_lift() as (channel, node), master_on(channel) as master:
        writes = Writes(node)
        with pytest.raises(ConfigurationError):  # canopen's node sends no boot-up
            configure(master.node(2), make(NEW), NOW)
        assert writes.addresses == ORDER
        assert values(node) == [NEW[address] for address in NEW]


def test_a_difference_is_found_by_reading_alone(make: Callable[..., Dictionary]) -> None:
    with stock_lift() as (channel, node), master_on(channel) as master:
        writes = Writes(node)
        plan = difference(master.node(2), make(NEW))
        assert writes.addresses == []
    assert [(address_of(each.thing), *each.texts) for each in plan.changes] == [
        (HEARTBEAT, "1000", "500"),
        (COB_ID, "0x00000202", "0x00000018"),
        (ENTRY, "0x20000606", "0x20000602"),
        (SPEED, "800 mm/s", "900 mm/s"),
    ]


def test_equal_objects_are_not_written(make: Callable[..., Dictionary]) -> None:
    with stock_lift() as (channel, node), master_on(channel) as master:
        writes = Writes(node)
        assert configure(master.node(2), make({HEARTBEAT: 1000}), NOW) == Configured(0, stored=False)
        assert writes.addresses == []


def test_a_node_that_cannot_store_is_configured_until_its_reset(make: Callable[..., Dictionary]) -> None:
    eds = LIFT.read_text().replace("=0x1010\n", "=0x5010\n").replace("[1010", "[5010")
    with stock_lift() as (channel, node), master_on(channel) as master:
        writes = Writes(node)
        assert configure(master.node(2), make(NEW, eds), NOW) == Configured(len(NEW), stored=False)
        assert STORE not in writes.addresses


OWN: Address = (0x2100, 1)


def test_a_makers_object_that_is_called_node_id_is_none(make: Callable[..., Dictionary]) -> None:
    eds = with_entry(LIFT.read_text(), "2100sub1", "DefaultValue", "7")
    with stock_lift() as (channel, node), master_on(channel) as master:
        node.set_data(*OWN, b"\x07")  # of another axis, or what a switch says
        assert difference(master.node(2), make({OWN: 7}, eds)).changes == ()
        assert [address_of(each.thing) for each in difference(master.node(2), make({OWN: 9}, eds)).changes] == [OWN]


@pytest.mark.parametrize(
    ("options", "configured", "commands"),
    [
        ({"stores": False}, Configured(4, stored=False), [0x80, 0x01]),
        ({"resets": False}, Configured(4, stored=True), [0x80, 0x01]),
        ({}, Configured(4, stored=True, verified=True), [0x80, 0x81]),
    ],
)
def test_storing_and_the_reset_can_be_left_out(
    make: Callable[..., Dictionary], options: dict[str, bool], configured: Configured, commands: list[int]
) -> None:
    with line("lift") as channel, master_on(channel) as master, open_bus(channel) as listener:
        plan = difference(master.node(2), make(NEW))
        assert apply(master.node(2), plan, NOW, **options) == configured
        sent = iter(lambda: listener.recv(0), None)
        assert [each.data[0] for each in sent if each.arbitration_id == 0] == commands
        master.node(2).reset()
        assert (master.node(2).upload(HEARTBEAT) == (500).to_bytes(2, "little")) is configured.stored


@pytest.mark.parametrize(
    ("chapters", "changed"),
    [
        ([DictionaryArea.COMMUNICATION], [HEARTBEAT]),
        ([DictionaryArea.PDO], [COB_ID, ENTRY]),
        ([DictionaryArea.MANUFACTURER], [SPEED]),
        ([DictionaryArea.PROFILE], []),
        ([*DictionaryArea], [HEARTBEAT, COB_ID, ENTRY, SPEED]),
    ],
)
def test_chapters_of_a_file_are_configured_alone(
    make: Callable[..., Dictionary], chapters: list[DictionaryArea], changed: list[Address]
) -> None:
    with line("lift") as channel, master_on(channel) as master:
        plan = difference(master.node(2), make(NEW), chapters)
        assert [address_of(each.thing) for each in plan.changes] == changed
        if changed:
            apply(master.node(2), plan, NOW)
        marked = master.node(2).upload((0x1020, 1)) == NOW_BYTES[0]
        assert marked is (len(chapters) == len(DictionaryArea))  # only the whole file is a verified configuration


def test_an_object_that_can_only_be_written_is_written_and_not_compared(make: Callable[..., Dictionary]) -> None:
    eds = with_entry(LIFT.read_text(), "2101sub1", "AccessType", "wo")
    with stock_lift() as (channel, node), master_on(channel) as master:
        writes = Writes(node)
        set_access(node, SPEED, "wo")
        set_access(node, STORE, "ro")
        with pytest.raises(ConfigurationError, match="refused to write 0x1010:1"):
            configure(master.node(2), make({SPEED: 900}, eds), NOW)
        assert writes.addresses[0] == SPEED


def boots(node: canopen.LocalNode, *lost: Address) -> None:
    """Make a stock node boot after a reset, which loses the values of some objects."""

    def reset(_: int, data: bytearray, __: float) -> None:
        if data[0] == NmtCommand.RESET_NODE:
            for address in lost:
                variable = node.object_dictionary.get_variable(*address)
                assert variable is not None
                assert variable.default is not None
                node.set_data(*address, variable.encode_raw(variable.default))
            node.network.send_message(0x702, b"\0")

    node.network.subscribe(0, reset)


VERIFY: Address = (0x1020, 1)
WITHOUT_MARK = LIFT.read_text().replace("=0x1020\n", "=0x5020\n").replace("[1020", "[5020")


@pytest.mark.parametrize("eds", [LIFT.read_text(), WITHOUT_MARK])
def test_a_node_that_booted_with_what_it_stored_is_configured(make: Callable[..., Dictionary], eds: str) -> None:
    with stock_lift() as (channel, node), master_on(channel) as master:
        boots(node)
        assert configure(master.node(2), make(NEW, eds), NOW) == Configured(len(NEW), stored=True, verified=True)


@pytest.mark.parametrize(
    ("eds", "lost"), [(LIFT.read_text(), [SPEED]), (LIFT.read_text(), [VERIFY, SPEED]), (WITHOUT_MARK, [SPEED])]
)
def test_a_node_that_did_not_store_is_told(make: Callable[..., Dictionary], eds: str, lost: list[Address]) -> None:
    with stock_lift() as (channel, node), master_on(channel) as master:
        boots(node, *lost)
        with pytest.raises(ConfigurationError) as told:
            configure(master.node(2), make(NEW, eds), NOW)
    assert str(told.value) == (
        "node 2: 0x2101:1 Motion.Maximum speed reads 800 mm/s after 900 mm/s was written; "
        "node 2 was written completely, stored and reset before that"
    )


def test_a_value_that_was_right_before_and_is_lost_at_the_reset_is_told(make: Callable[..., Dictionary]) -> None:
    with stock_lift() as (channel, node), master_on(channel) as master:
        node.set_data(*SPEED, (NEW[SPEED]).to_bytes(2, "little"))  # type: ignore[union-attr]
        boots(node, SPEED)
        with pytest.raises(
            ConfigurationError, match=r"Motion\.Maximum speed reads 800 mm/s after 900 mm/s was written"
        ):
            configure(master.node(2), make(NEW), NOW)


# Which objects


@pytest.mark.parametrize(
    ("index", "is_one"),
    [
        (0x1001, False),  # a state, though some files let it be written
        (0x1002, True),
        (0x1003, False),  # a history
        (0x1004, True),
        (0x1010, False),  # store, restore: commands
        (0x1011, False),
        (0x1012, True),
        (0x1020, False),  # the mark of a configuration
        (0x1021, True),
        (0x1023, False),  # the OS's commands
        (0x1024, False),
        (0x1025, True),
        (0x1F4F, True),
        (0x1F50, False),  # programs
        (0x1F51, False),
        (0x1F52, True),
        (0x2000, True),
    ],
)
def test_a_configuration_writes_parameters_alone(tmp_path: Path, index: int, is_one: bool) -> None:
    file = tmp_path / "arm.eds"
    file.write_text(DEVICE_TYPE + variable(f"{index:04X}", "Anything", "UNSIGNED32"))
    assert ((index, 0) in Dictionary.load(file, 5).parameters) is is_one


def test_read_only_objects_are_no_parameters(tmp_path: Path) -> None:
    file = tmp_path / "arm.eds"
    file.write_text(DEVICE_TYPE)
    assert (0x1000, 0) not in Dictionary.load(file, 5).parameters
    assert (0x2000, 0) not in Dictionary.load(file, 5).parameters


# The file is wrong


@pytest.mark.parametrize(
    ("make_arguments", "told"),
    [
        (
            {"node_id": 5},
            "is of node 5; these COB-IDs do not follow the node-ID: 0x1402:1 RPDO3 0x018; for node 2 keep",
        ),
        ({"eds": (EDS / "scale.eds").read_text()}, "is for another device: node 2 has product code 0x2, not 0x3"),
        (
            {"change": lambda text: text.replace("[1018sub1]\n", "[1018sub1]\nParameterValue=7\n")},
            "has vendor-ID 0x0, not",
        ),
        ({"change": lambda text: text[: text.index("[DeviceCom")]}, "incomplete: no NodeID in [DeviceComissioning]"),
        ({"change": lambda text: text.replace("[1017]", "[5017]")}, "incomplete: no section [1017]"),
        ({"values": {SPEED: 0}}, "0x2101: sub 1 (Motion.Maximum speed): 0 is not allowed; allowed: 1.."),
        ({"values": {HEARTBEAT: 65536}}, "0x1017: sub 0 (Producer heartbeat time): 65536 is not allowed"),
        ({"values": {HEARTBEAT: "often"}}, "(Producer heartbeat time): often is not allowed; allowed: an integer"),
        ({"values": {ENTRY: 0x30000110}}, "0x1602: maps 0x3000 sub 1, which is missing"),
        ({"values": {ENTRY: 0x20000111}}, "0x1602: maps 0x2000 sub 1 with 17 bits, its type has 16"),
        ({"values": {(0x2100, 1): 3}}, "0x2100: Node.Node-ID 3 is not the NodeID 2"),
    ],
)
def test_a_file_that_does_not_fit_is_refused_before_anything_is_written(
    make: Callable[..., Dictionary], make_arguments: dict[str, object], told: str
) -> None:
    with stock_lift() as (channel, node), master_on(channel) as master:
        writes = Writes(node)
        with pytest.raises(DictionaryError) as refused:
            configure(master.node(2), make(**{"values": NEW, **make_arguments}), NOW)
        assert told in str(refused.value)
        assert str(refused.value).startswith(make({}).file.as_posix())
        assert writes.addresses == []


def test_a_pdo_that_is_wrong_in_the_devices_own_eds_does_not_stop_the_rest(make: Callable[..., Dictionary]) -> None:
    eds = with_entry(LIFT.read_text(), "1602sub1", "DefaultValue", "0x30000110")
    with stock_lift() as (channel, node), master_on(channel) as master:
        boots(node)
        described = make({SPEED: 900}, eds)
        told = list[str]()
        check_file(described, 2, by_default=lambda error: told.append(error.what))
        assert told == ["maps 0x3000 sub 1, which is missing"]
        assert configure(master.node(2), described, NOW).changed == 1


def test_an_object_that_the_node_does_not_have_is_the_files_fault(make: Callable[..., Dictionary]) -> None:
    with stock_lift() as (channel, node), master_on(channel) as master:
        del node.object_dictionary[0x2101]
        writes = Writes(node)
        with pytest.raises(
            DictionaryError, match=r"0x2101: sub 1 \(Motion\.Maximum speed\): node 2 has no such object"
        ):
            configure(master.node(2), make(NEW), NOW)
        assert writes.addresses == []


def part(share: float) -> Callable[[str], str]:
    return lambda text: text[: round(share * len(text))]


CUTS = {str(share): part(share) for share in (0.001, 0.01, 0.1, 0.3, 0.5, 0.7, 0.9, 0.99)} | {
    "in the last object": lambda text: text[: text.rindex("DataType")],
    "in the last line": lambda text: text[: text.rindex("=")],
}


@pytest.mark.parametrize("cut", CUTS.values())
def test_a_file_that_was_cut_off_is_refused(make: Callable[..., Dictionary], cut: Callable[[str], str]) -> None:
    with stock_lift() as (channel, _), master_on(channel) as master, pytest.raises(DictionaryError):
        configure(master.node(2), make(NEW, change=cut), NOW)


# The node is wrong


@pytest.mark.parametrize("place", range(len(ORDER)))
def test_a_refusal_anywhere_leaves_the_node_as_it_was(make: Callable[..., Dictionary], place: int) -> None:
    with stock_lift() as (channel, node), master_on(channel) as master:
        Writes(node).refused.add(place)
        with pytest.raises(ConfigurationError) as told:
            configure(master.node(2), make(NEW), NOW)
        assert values(node) == FORMER
    index, subindex = ORDER[place]
    assert f"node 2 refused to write 0x{index:04X}:{subindex}" in str(told.value)
    assert str(told.value).endswith("; node 2 has its former values again and is pre-operational")


@pytest.mark.parametrize("place", range(1, len(ORDER)))
def test_silence_anywhere_names_what_is_written_and_what_is_not(
    make: Callable[..., Dictionary], monkeypatch: pytest.MonkeyPatch, place: int
) -> None:
    monkeypatch.setattr("eurobot_od.client.configure.STORE_WAIT", 0.2)
    with stock_lift() as (channel, node), master_on(channel, 0.2) as master:
        Writes(node).silent_after = place
        with pytest.raises(ConfigurationError) as told:
            configure(master.node(2), make(NEW), NOW)
    head, _, state = str(told.value).partition("; ")
    assert head.startswith("no answer from node 2")
    assert state.startswith("node 2 is pre-operational; written and not stored: ")
    new, _, old = state.partition("not written: ")
    speed = "0x2101:1 Motion.Maximum speed"
    assert (speed in new) == (ORDER.index(SPEED) <= place)
    assert (speed in old) == (ORDER.index(SPEED) > place)


def test_a_value_that_does_not_read_back_is_taken_back(make: Callable[..., Dictionary]) -> None:
    with stock_lift() as (channel, node), master_on(channel) as master:
        node.add_read_callback(  # type: ignore[no-untyped-call]
            lambda index, subindex, **_: 801 if (index, subindex) == SPEED else None
        )
        with pytest.raises(ConfigurationError, match="reads 801 mm/s after 900 mm/s was written; node 2 has its"):
            configure(master.node(2), make(NEW), NOW)
        assert node.get_data(*HEARTBEAT) == b"\xe8\x03"


class Interrupted(RemoteNode):
    """A node whose user presses Ctrl-C after the third write."""

    writes = 0

    @Procedure
    async def download(
        self,
        address: Address,
        data: bytes,
        name: str = "",
        wait: float | None = None,
        progress: Progress = unwatched,
    ) -> None:
        await super().download.steps(address, data, name, wait, progress)
        self.writes += 1
        if self.writes == 3:
            raise KeyboardInterrupt


def test_an_interrupt_leaves_the_node_as_it_was(make: Callable[..., Dictionary]) -> None:
    with stock_lift() as (channel, node), master_on(channel) as master:
        with pytest.raises(ConfigurationError, match=r"^interrupted; node 2 has its former values again"):
            configure(Interrupted(master, 2), make(NEW), NOW)
        assert values(node) == FORMER


def test_a_node_goes_back_to_the_state_it_was_in(make: Callable[..., Dictionary]) -> None:
    with stock_lift() as (channel, node), master_on(channel) as master:
        Writes(node).refused.add(1)
        remote = master.node(2)
        node.nmt.state = "OPERATIONAL"
        node.network.send_message(0x702, bytes([NmtState.OPERATIONAL]))
        assert remote.wait_for(NmtState.OPERATIONAL, 1)
        with pytest.raises(ConfigurationError, match="has its former values again and is operational"):
            configure(remote, make(NEW), NOW)
        assert remote.upload(HEARTBEAT) == b"\xe8\x03"  # by now the node has seen all that was sent before
        assert node.nmt.state == "OPERATIONAL"


def test_a_node_that_does_not_boot_was_configured_before(
    make: Callable[..., Dictionary], monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr("eurobot_od.client.master.BOOT_WAIT", 0.05)
    with stock_lift() as (channel, _), master_on(channel) as master:
        told = "no boot-up of node 2 .*; node 2 was written completely, stored and reset before that"
        with pytest.raises(ConfigurationError, match=told):
            configure(master.node(2), make(NEW), NOW)


def test_a_node_that_is_not_there_is_told_before_anything_is_sent_to_it(make: Callable[..., Dictionary]) -> None:
    with line() as channel, master_on(channel, 0.02) as master, pytest.raises(NoAnswer):
        configure(master.node(2), make(NEW), NOW)


# The bus is wrong


def test_a_bus_that_fails_half_way_names_the_state(make: Callable[..., Dictionary]) -> None:
    with stock_lift() as (channel, node), master_on(channel, 0.3) as master:
        remote = master.node(2)
        plan = difference(remote, make(NEW))
        node.add_write_callback(lambda **_: master.bus.shutdown())  # type: ignore[no-untyped-call]
        with pytest.raises(BusError, match=r"closed bus; node 2 is pre-operational; written and not stored: 0x1017:0 "):
            apply(remote, plan, NOW)
