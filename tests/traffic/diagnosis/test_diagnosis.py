"""A diagnosis as a whole: quiet on a network that works, as large as what is wrong, whatever the log."""

from __future__ import annotations

import tracemalloc
from collections.abc import Iterator
from pathlib import Path

import pytest

from eurobot_od.client.lifeline import arm, disarm, heartbeat
from eurobot_od.client.network import SimulatedNetwork, simulated
from eurobot_od.frame import Frame
from eurobot_od.od.dictionary import Dictionary
from eurobot_od.traffic.diagnosis import Diagnosis
from eurobot_od.traffic.diagnosis.incidents import MOST, PLACES, Incident
from eurobot_od.traffic.diagnosis.rules import BusRule
from eurobot_od.traffic.entries import Damage, Foreign
from eurobot_od.traffic.meaning import Decoder
from tests.traffic.mixed_bus import dictionaries, recorded

DOCS = Path(__file__).parents[3] / "docs"


class Listening:
    """A diagnosis of a simulated network, by the files of its devices."""

    def __init__(self, network: SimulatedNetwork) -> None:
        files = [each.dictionary for each in network.devices.values()]
        self.diagnosis = Diagnosis(Decoder(files, refused=lambda _: None))
        network.simulation.observers.append(lambda time, frame: self.diagnosis.take(time, "", frame) and None)

    def found(self) -> list[Incident]:
        self.diagnosis.end()
        return self.diagnosis.incidents.sorted()


def test_a_motor_that_runs_for_a_minute_is_quiet() -> None:
    with simulated(DOCS / "motor.eds", node_id=5) as network:
        listening = Listening(network)
        network[5].nmt.start()
        network[5]["Motor.Target speed"].value = 1000
        network.sleep(60.0)
    assert [each.title for each in listening.found()] == []


def test_a_servo_that_is_configured_and_runs_for_a_minute_is_quiet() -> None:
    with simulated(DOCS / "servo.dcf") as network:
        listening = Listening(network)
        (servo,) = network.devices
        network[servo].configure(DOCS / "servo.dcf")
        network[servo].nmt.start()
        for _ in range(600):
            network.send(0x080)
            network.sleep(0.1)
    assert [each.title for each in listening.found()] == []


def test_a_drive_that_a_program_moves_and_leaves_is_quiet() -> None:
    with simulated(DOCS / "servo.eds", node_id=5) as network:
        listening = Listening(network)
        node = network.master.node(5)
        network.sleep(2.0)
        line = arm(node, [0], 127)
        for _ in range(20):
            network.send(*heartbeat(127))
            network.sleep(0.1)
        disarm(node, line)
        network.sleep(10.0)
    assert BusRule.HEARTBEAT_LOST not in {each.rule for each in listening.found()}


@pytest.mark.parametrize(
    ("first", "boots"), [(0.0, False), (3.0, True)], ids=["there from the beginning", "with a boot-up"]
)
def test_a_device_that_is_silent_is_lost_though_nobody_consumes_it(first: float, boots: bool) -> None:
    diagnosis = Diagnosis(Decoder([], refused=lambda _: None))
    rows = [(first + 0.1 * n, Frame(0x709, b"\0" if boots and not n else b"\5")) for n in range(20)]
    rows += [(0.1 * n, Frame(0x70A, b"\5")) for n in range(200)]
    for time, frame in sorted(rows, key=lambda row: row[0]):
        diagnosis.take(time, "", frame)
    diagnosis.end()
    assert {each.rule for each in diagnosis.incidents.sorted()} == {BusRule.HEARTBEAT_LOST}


OFF, CONFIRMED = "2300180185010080", "6000180100000000"
ON = "2300180185010000"

OUT_OF_STEP: dict[str, tuple[list[tuple[int, str]], set[BusRule]]] = {
    "a last one before the boot-up": ([(0x705, "05"), (0, "8105"), (0x185, "01"), (0x705, "00")], set()),
    "one after the boot-up": ([(0, "8105"), (0x705, "00"), (0x185, "01")], {BusRule.PDO_LENGTH}),
    "on, before the confirmation": (
        [(0x605, OFF), (0x585, CONFIRMED), (0x605, ON), (0x185, "00" * 6), (0x585, CONFIRMED)],
        set(),
    ),
    "off, and sent": ([(0x605, OFF), (0x585, CONFIRMED), (0x185, "00" * 6)], {BusRule.PDO_OFF}),
}


@pytest.mark.parametrize(("rows", "rules"), OUT_OF_STEP.values(), ids=OUT_OF_STEP)
def test_a_pdo_before_a_reset_or_a_write_is_confirmed_is_no_fault(
    rows: list[tuple[int, str]], rules: set[BusRule]
) -> None:
    servo = Dictionary.load(DOCS / "servo.eds", 5)
    diagnosis = Diagnosis(Decoder([servo], refused=lambda _: None))
    for number, (cob_id, data) in enumerate(rows):
        diagnosis.take(number / 100, "", Frame(cob_id, bytes.fromhex(data)))
    diagnosis.end()
    assert {each.rule for each in diagnosis.incidents.sorted()} & {BusRule.PDO_LENGTH, BusRule.PDO_OFF} == rules


def test_two_producers_of_sync_with_much_different_periods_are_two() -> None:
    diagnosis = Diagnosis(Decoder([], refused=lambda _: None))
    for hundredth in range(1000):
        if hundredth % 10 == 0 or hundredth % 2:
            diagnosis.take(hundredth / 100, "", Frame(0x080, b""))
    diagnosis.end()
    assert {each.rule for each in diagnosis.incidents.sorted()} == {BusRule.SYNC_TWO}


def test_a_bus_with_everything_on_it_shows_what_was_done_to_it_and_nothing_else() -> None:
    diagnosis = Diagnosis(Decoder(dictionaries(), refused=lambda _: None))
    for time, frame in recorded():
        diagnosis.take(time, "", frame)
    diagnosis.end()
    found = {each.rule for each in diagnosis.incidents.sorted()}
    assert found == {
        BusRule.CONSUMER_UNFED,  # clean.eds waits for node 2
        BusRule.GUARD_UNANSWERED,  # those with a heartbeat
        BusRule.SDO_UNANSWERED,  # node 99
        BusRule.SYNC_TWO,  # with and without a counter
        BusRule.EMCY_RAISED,
        BusRule.EMCY_REGISTER,  # those sent by hand
        BusRule.EMCY_CLEARED,
        BusRule.SDO_ABORT,
        BusRule.SDO_PROBED,
        BusRule.PDO_UNHEARD,  # there is no file of the master
    }


def frames(number: int) -> Iterator[tuple[float, Frame | Foreign]]:
    """Yield frames that break many rules again and again."""
    for n in range(number // 4):
        yield n / 100, Foreign(Damage.ERROR_FRAME, f"2000{n % 0x1000:04X}#")
        yield n / 100 + 0.001, Frame(0x600 + n % 3 + 1, bytes([0x40, n & 0xFF, n >> 8 & 0xFF, 0, 0, 0, 0, 0]))
        yield n / 100 + 0.002, Frame(0x080 + n % 3 + 1, bytes([n & 0xFF, n >> 8 & 0xFF, 0x11, 0, 0, 0, 0, 0]))
        yield n / 100 + 0.003, Frame(0x300 + n % 3, n.to_bytes(4, "little"))


def test_an_incident_has_a_number_and_a_few_places() -> None:
    diagnosis = Diagnosis(Decoder([]))
    for n in range(100):
        diagnosis.take(n / 10, "", Foreign(Damage.ERROR_FRAME, "20000080#"), n + 1)
    (found,) = diagnosis.incidents.sorted()
    assert (found.seen.number, len(found.seen.places), found.seen.last.line) == (100, PLACES, 100)


def test_bus_off_is_told_in_words() -> None:
    diagnosis = Diagnosis(Decoder([]))
    diagnosis.take(0.0, "", Foreign(Damage.ERROR_FRAME, "20000040#"))
    assert [each.title for each in diagnosis.incidents.sorted()] == ["a controller is bus-off (20000040#)"]


def test_many_incidents_of_one_rule_are_one_more() -> None:
    diagnosis = Diagnosis(Decoder([]))
    for n in range(3 * MOST):
        diagnosis.take(n / 10, "", Frame(0x080 + n + 1, bytes([0x10, 0x81, 0x11, 0, 0, 0, 0, 0])))
    diagnosis.end()
    found = [each for each in diagnosis.incidents.sorted() if each.rule is BusRule.EMCY_RAISED]
    assert len(found) == MOST + 1
    assert found[0].title == "A node reports an error and does not take it back (others than those above)"


@pytest.mark.long
def test_memory_does_not_grow_with_the_log() -> None:
    diagnosis, sizes = Diagnosis(Decoder([])), []
    tracemalloc.start()
    for number, (time, raw) in enumerate(frames(200_000), 1):
        diagnosis.take(time, "", raw)
        if number in (20_000, 200_000):
            sizes.append(tracemalloc.get_traced_memory()[0])
    tracemalloc.stop()
    assert sizes[1] - sizes[0] < 100_000
