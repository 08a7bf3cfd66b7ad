"""The messages of a network: what EDS files send by themselves, and what a network file says about the rest."""

from __future__ import annotations

from pathlib import Path

import pytest

from eurobot_od.cli.load import of_robot
from eurobot_od.errors import FileError, LocalError
from eurobot_od.od.dictionary import Dictionary
from eurobot_od.od.network import NetworkFile, read_network_file
from eurobot_od.od.values import BASE_IDENTIFIER
from eurobot_od.traffic.load import MessageSet, network_set
from tests.eds_text import DEVICE_TYPE, pdo, record, variable
from tests.kit import plant

NODES = "nodes: {a: {file: a.eds}}\ntraffic:\n"
SPEED = variable("2000", "Speed", "UNSIGNED16", "0") + variable("2001", "Period", "UNSIGNED16", "25")


def device(*sections: str) -> Dictionary:
    return Dictionary.read("".join((DEVICE_TYPE, SPEED, *sections)).encode(), Path("a.eds"), 5)


def tpdo(**settings: str) -> str:
    subs = {"type": 2, "inhibit": 3, "timer": 5}
    return pdo(0x1800, "0x20000010", settings={subs[name]: text for name, text in settings.items()})


def found(*sections: str, rows: str = "") -> MessageSet:
    network = read_network_file(NODES + rows, "n.yaml") if rows else NetworkFile([])
    return network_set([device(*sections)], {0x185: "Speed"}, network, "n.yaml")


BY_ITSELF = [
    ("event timer", [tpdo(timer="20")], (0x185, 2, 20_000)),
    ("inhibit time", [tpdo(timer="20", inhibit="50")], (0x185, 2, 5_000)),  # it may come that often
    ("SYNC", [tpdo(type="3"), variable("1006", "Cycle", "UNSIGNED32", "4000")], (0x185, 2, 12_000)),
    ("heartbeat", [variable("1017", "Heartbeat", "UNSIGNED16", "100")], (0x705, 1, 100_000)),
    ("EMCY", [variable("1015", "Inhibit", "UNSIGNED16", "10")], (0x085, 8, 1_000)),
]


@pytest.mark.parametrize(("sections", "expected"), [row[1:] for row in BY_ITSELF], ids=[row[0] for row in BY_ITSELF])
def test_periodic_messages_of_an_eds(sections: list[str], expected: tuple[int, int, int]) -> None:
    (message,) = found(*sections).messages
    assert (message.identifier, message.length, message.period) == expected


def test_the_sync_producer_is_its_sender() -> None:
    sync = variable("1005", "SYNC", "UNSIGNED32", "0x40000080"), variable("1006", "Cycle", "UNSIGNED32", "4000")
    assert [(each.name, each.period) for each in found(*sync).messages] == [("SYNC", 4000)]


@pytest.mark.parametrize(("index", "is_client"), [(0x127F, False), (0x1280, True), (0x12FF, True), (0x1300, False)])
def test_an_sdo_client_is_a_record_of_1280_to_12ff(index: int, is_client: bool) -> None:
    client = record(index, "Client", (0, "UNSIGNED8", "3"), (3, "UNSIGNED8", "5"))
    rows = "  SDO: {every: 1 s}\n"
    if is_client:
        assert len(found(client, rows=rows).messages) == 2
    else:
        with pytest.raises((LocalError, FileError)):
            found(client, rows=rows)


def test_a_message_without_a_period_is_refused() -> None:
    with pytest.raises(LocalError, match="no period is known of Speed; say it in `traffic`"):
        found(tpdo())


ROWS = [
    ("a duration", "every: 30 ms", (30_000, 30_000, 0)),
    ("a setting, in ms", "every: Period, deadline: 10 ms, jitter: 2 ms", (25_000, 10_000, 2_000)),
]


@pytest.mark.parametrize(("row", "expected"), [row[1:] for row in ROWS], ids=[row[0] for row in ROWS])
def test_traffic_of_a_network_file(row: str, expected: tuple[int, int, int]) -> None:
    (message,) = found(tpdo(), rows=f"  Speed: {{{row}, reason: driving}}\n").messages
    assert (message.period, message.deadline, message.jitter) == expected
    assert message.reason == "driving"


WRONG_ROWS = [
    ("  Pace: {every: 1 s}\n", "3:3: traffic of 'Pace', which no node sends"),
    ("  Speed: {every: Pace}\n", "3:18: 'Pace' is neither a duration nor a setting of a device"),
    ("  Speed: {every: 0 ms}\n", "3:18: 'Speed' has a period of 0"),
    ("  Speed: {answers: Pace}\n", "3:20: 'Speed' answers 'Pace', which has no period"),
    ("  Speed: {answers: Speed}\n", "3:20: 'Speed' answers 'Speed', which has no period"),
    ("  Speed: {deadline: 1 s}\n", "3:3: 'Speed' has no period"),
]


@pytest.mark.parametrize(("rows", "what"), WRONG_ROWS)
def test_a_row_that_does_not_hold_is_told_by_its_place(rows: str, what: str) -> None:
    with pytest.raises(FileError) as error:
        found(tpdo(), rows=rows)
    assert str(error.value) == f"n.yaml:{what}"


def test_a_row_for_emcy_is_for_every_node() -> None:
    (message,) = found(rows="  EMCY: {every: 1 s}\n").messages
    assert (message.name, message.identifier) == ("EMCY a", 0x085)


def test_an_sdo_answer_answers_the_clients_request() -> None:
    client = record(0x1280, "Client", (0, "UNSIGNED8", "3"), (3, "UNSIGNED8", "5"))
    request, answer = sorted(found(client, rows="  SDO: {every: 1 s}\n").messages, key=lambda each: -each.identifier)
    assert (request.identifier, answer.identifier, answer.answers) == (0x605, 0x585, request.name)


def test_mailboxes_are_a_setting() -> None:
    boxes = record(0x2110, "Transmit", (0, "UNSIGNED8", "1"), (1, "UNSIGNED8", "3"))
    assert found(boxes.replace("Entry 1", "Mailboxes")).mailboxes == {"a": 3}


# A plug-in's network file


@pytest.mark.parametrize("dialect", plant.DIALECTS)
def test_every_message_of_a_plug_in_has_its_period_and_reason(dialect: str) -> None:
    promised = of_robot(plant.PLANT, dialect)
    sent = {each.name for each in plant.protocol(dialect).bindings}
    assert {name for name in sent if any(each.name.startswith(name) for each in promised.messages)} == sent
    assert all(each.reason for each in promised.messages)
    assert promised.bit_rate == 500_000


def test_a_setting_of_a_devices_file_is_the_period() -> None:
    panel = next(each.configured({}) for each in plant.load_all() if each.name == "panel")
    period = panel.number(panel.address("Polling.Polling period")) or 0
    polled = [each for each in of_robot(plant.PLANT).messages if each.name == "Place Request"]
    assert [each.period for each in polled] == [1000 * period]
    assert all(each.identifier <= BASE_IDENTIFIER for each in polled)
