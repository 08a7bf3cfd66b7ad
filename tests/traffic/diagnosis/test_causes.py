"""What is said of an incident is what is the case: the culprit's name, the true period, no cause that cannot be."""

from __future__ import annotations

import pytest

from eurobot_od.traffic.diagnosis.incidents import Incident
from eurobot_od.traffic.diagnosis.rules import BusRule
from tests.traffic.diagnosis.defects import DRIVE, FULL, TOO_FULL, Log, at, beats, every, log, status
from tests.traffic.diagnosis.test_defects import diagnosed, with_followers


def found(rule: BusRule, frames: Log, *devices: str) -> Incident:
    (incident,) = (each for each in with_followers(diagnosed(frames, devices)) if each.rule is rule)
    return incident


FLOOD = every(0.00025, "185#FFFFFFFFFFFFFFFF", 1.2)


def test_a_full_bus_names_the_identifier_that_fills_it() -> None:
    assert "100% of it is 0x123" in found(BusRule.LOAD_FULL, FULL).text


@pytest.mark.parametrize(("devices", "node"), [((), "likely node 5"), (("event",), "event")], ids=["no file", "a file"])
def test_a_full_bus_names_the_node_that_fills_it(devices: tuple[str, ...], node: str) -> None:
    assert found(BusRule.LOAD_FULL, FLOOD, *devices).text.endswith(f"{node})")


def test_more_than_all_means_that_the_bus_is_faster() -> None:
    assert "the bus is faster, -b says its bit rate" in found(BusRule.LOAD_HIGH, TOO_FULL).text


def test_delays_are_consequences_of_a_full_bus() -> None:
    frames = log(FLOOD, beats(until=0.4), beats(start=1.19, until=1.2, period=0.001), beats(node=6, until=0.2))
    first, *others = diagnosed(frames, ())
    assert first.rule is BusRule.LOAD_FULL
    assert [each.rule for each in others if each.rule in (BusRule.HEARTBEAT_LOST, BusRule.TWO_NODES)] == []


def test_the_period_of_a_pdo_by_a_coarse_clock_is_the_average() -> None:
    frames = log(beats(until=4), every(0.04, "205#0000", 1.0), every(0.04, "205#0000", 1.0, 0.016))
    assert "it came every 20 ms (observed)" in found(BusRule.PDO_STOPS, frames).text


@pytest.mark.parametrize(("answer", "toggle"), [("705#05", 0), ("705#85", 1)])
def test_the_toggle_bit_that_comes_twice_is_said(answer: str, toggle: int) -> None:
    text = found(BusRule.GUARD_TOGGLE, at("705#R1", answer, "705#R1", answer, gap=0.1)).text
    assert text.endswith(f"two answers to node guarding with toggle {toggle}")


@pytest.mark.parametrize(
    ("word", "controls", "why"),
    [
        (0x0250, ["0F00"], "Shutdown (0x0006) was left out"),
        (0x0231, ["0600", "0D00"], "controlword 0x000D lacks enable voltage (bit 1)"),
        (0x0031, ["0600", "0F00"], "statusword bit 9 (remote) is 0"),
        (0x0221, ["0600", "0F00"], "statusword bit 4 is 0: its power stage has no voltage"),
        (0x0231, ["0600", "0F00"], "Switch on (0x0007) was left out"),
    ],
    ids=["shutdown", "a bit", "remote", "voltage", "switch on"],
)
def test_what_keeps_a_drive_from_being_enabled_is_named(word: int, controls: list[str], why: str) -> None:
    frames = log(status(word, 0, 3), at(*(f"205#{each}01" for each in controls), start=0.5))
    assert why in found(BusRule.DRIVE_NOT_ENABLED, frames, *DRIVE).text


def test_another_heartbeat_than_the_file_says_is_told_with_it() -> None:
    text = found(BusRule.HEARTBEAT_CHANGED, beats(period=0.06), "arm").text
    assert text == "a heartbeat every 60 ms, with 0x1017 = 100 ms"


def test_an_input_that_flutters_is_named_by_its_number() -> None:
    frames = log(every(0.04, "185#0100", start=0.02), every(0.04, "185#0000", start=0.04))
    assert found(BusRule.INPUT_FLUTTERS, frames, "module").text.startswith("input 1 (0x6000:1, bit 0) ")


def test_a_wide_statusword_shows_a_second_axis() -> None:
    frames = at("605#4041600000000000", "585#4341600037061802", gap=0.05)
    assert found(BusRule.DRIVE_FAULT, frames, *DRIVE).text.startswith("axis 2 ")


BLOCK = ("605#A008100010000000", "585#C408100020000000", "605#A300000000000000")
SEQUENCE = "605#8008100003000405"


def test_an_abort_by_the_client_is_an_incident() -> None:
    text = found(BusRule.SDO_ABORT, at(*BLOCK, SEQUENCE)).text
    assert text == "has its client abort the read of 0x1008:00: 0x05040003 Invalid sequence number"


def test_an_abort_whose_transfer_is_not_in_the_log_is_an_incident() -> None:
    assert "0x05040003" in found(BusRule.SDO_ABORT, at("705#05", SEQUENCE)).text


def test_a_mode_that_a_drive_refuses_is_one_that_it_does_not_have() -> None:
    frames = at("605#2F6060000B000000", "585#8060600030000906")
    assert found(BusRule.SDO_ABORT, frames).cause == "the drive does not have this mode of operation: compare 0x6502"


ALTERNATING = sorted(each for start in (0.0, 0.024) for each in every(0.04, "080#", 1.0, start))
COARSE = log(ALTERNATING, at("080#", start=ALTERNATING[-1][0] + 0.036))
EARLY_OR_LATE = (4, -7, 0, 7, -3, -6, 2, 6, -1, 5, -5, 1)
"""By how many ms SYNCs of a period of 20 ms are early or late."""

UNEVEN = [(round(0.02 * n + EARLY_OR_LATE[n % 12] / 1000, 6), "080#") for n in range(121)]


@pytest.mark.parametrize(
    ("frames", "devices", "text"),
    [
        (UNEVEN, (), "SYNC comes 9 ms to 28 ms after the one before, 20 ms on average (observed)"),
        (COARSE, (), "SYNC comes 16 ms to 36 ms after the one before, 20.2 ms on average (observed)"),
        (
            log(every(0.04, "080#", 4.02), every(0.04, "080#", 4, 0.012)),
            (),
            "SYNC comes 12 ms and 28 ms by turns after the one before, 20 ms on average (observed)",
        ),
        (
            log(every(0.1, "080#", 0.4), at("080#", start=0.55)),
            ("clock",),
            "SYNC comes after 150 ms, with a period of 100 ms",
        ),
    ],
    ids=["jitter at random", "a coarse clock that is late once", "two times by turns", "the period of 0x1006"],
)
def test_jitter_is_told_as_it_was_seen(frames: Log, devices: tuple[str, ...], text: str) -> None:
    assert found(BusRule.SYNC_JITTER, frames, *devices).text == text


def test_a_timer_on_a_coarse_clock_is_no_second_producer() -> None:
    assert diagnosed(ALTERNATING, ()) == []


RESET_HELD = log(
    at("605#4000100000000000", "585#4300100092010200"),
    every(0.1, "185#1802", 3.0, 0.5),
    every(0.4, "205#8000", 3.0, 0.3),
)


def test_a_fault_reset_without_a_rising_edge_is_said() -> None:
    assert "only its rising edge resets" in found(BusRule.DRIVE_FAULT, RESET_HELD).text


AXES = log(
    at("605#4000100000000000", "585#4300100092010200"),
    *(every(0.2, f"605#4041{high}0000000000", 5.0, start) for high, start in (("60", 0.1), ("68", 0.15))),
    *(every(0.2, f"585#4B41{high}0037060000", 1.0, start) for high, start in (("60", 0.11), ("68", 0.16))),
    *(every(0.2, f"585#4B41{high}0018020000", 4.0, start) for high, start in (("60", 1.31), ("68", 1.36))),
    at("605#403F680000000000", "585#4B3F680020320000", start=1.4),
    at("605#2B40600080000000", "585#6040600000000000", "605#2B40680080000000", "585#6040680000000000", start=4.2),
    *(every(0.2, f"585#4B41{high}0050020000", 5.0, start) for high, start in (("60", 4.31), ("68", 4.36))),
)
"""A device of two axes, without a file, both in Fault for three seconds; the second one is asked why."""


@pytest.mark.parametrize(
    ("axis", "since", "code"),
    [("axis 1", 1.31, "its error code (0x603F) is not in the log"), ("axis 2", 1.36, "0x3220 (DC link undervoltage)")],
    ids=["the first axis", "the second axis"],
)
def test_the_fault_of_an_axis_has_its_time_its_error_code_and_what_ended_it(axis: str, since: float, code: str) -> None:
    faults = [each for each in diagnosed(AXES, ()) if each.rule is BusRule.DRIVE_FAULT]
    (fault,) = (each for each in faults if each.text.startswith(axis))
    assert code in fault.text
    assert fault.text.endswith("before: Operation enabled; ended by Fault reset of an SDO client")
    assert fault.seen.places[0].time == pytest.approx(since)


TOLD = at("085#1023080000000000", "085#2032080000000000", start=1.32)
"""Emergencies of both axes: they do not say of which one."""

READ_FIRST = at("605#403F600000000000", "585#4B3F600010230000", start=1.45)
OVERCURRENT, UNDERVOLTAGE = "0x2310 (continuous overcurrent at the output)", "0x3220 (DC link undervoltage)"


@pytest.mark.parametrize("frames", [log(AXES, TOLD), log(AXES, TOLD, READ_FIRST)], ids=["one is asked", "both are"])
def test_each_axis_in_fault_has_its_own_error_code(frames: Log) -> None:
    faults = [each.text for each in diagnosed(frames, ()) if each.rule is BusRule.DRIVE_FAULT]
    codes = {text[:6]: text.split("error code ")[1].split(";")[0] for text in faults}
    assert codes == {"axis 1": OVERCURRENT, "axis 2": UNDERVOLTAGE}


ENABLED = log(status(0x0237, 0, 5), at("285#05000000", start=0.6))
STOPS_205 = log(beats(until=4), every(0.05, "205#0000", 1.0))


@pytest.mark.parametrize(
    ("frames", "devices", "first", "then"),
    [
        (
            log(ENABLED, at("205#0F0101", "205#1F0101", start=0.5)),
            ("drive",),
            BusRule.DRIVE_HELD,
            BusRule.DRIVE_TARGET,
        ),
        (
            log(ENABLED, at("205#0F0001", "205#1F0001", start=0.5), at("205#1F0101", start=1.5)),
            ("drive",),
            BusRule.DRIVE_HELD,
            BusRule.DRIVE_TARGET,
        ),
        (log(STOPS_205, at("185#0000")), ("waiter", "copy"), BusRule.PDO_STOPS, BusRule.PDO_UNHEARD),
    ],
    ids=["halted before it is to move", "halted on its way", "a stop above a remark about files"],
)
def test_a_cause_stands_first(frames: Log, devices: tuple[str, ...], first: BusRule, then: BusRule) -> None:
    incidents = diagnosed(frames, devices)
    assert incidents[0].rule is first
    assert then in [each.rule for each in with_followers(incidents)[1:]]
