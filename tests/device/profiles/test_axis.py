"""An axis by CiA 402: its state machine, each command in each state, stops by their option codes, faults."""

from __future__ import annotations

from collections.abc import Callable, Mapping

import pytest
from canopen.profiles.p402 import State402

from eurobot_od.device.profiles.axis import MOST_STEPS
from eurobot_od.device.profiles.motion import STEP, Plant
from eurobot_od.od.cia402 import TRANSITIONS, DriveCommand, State
from tests.device.profiles.bench import Bench

# The state machine once more, written from the figure in CiA 402-2 and not from the package's table: what each command
# makes of each state. `.`: nothing; "Enable operation" in Ready to switch on takes two arrows.
MACHINE = """
            shutdown switch-on enable  disable-voltage quick-stop fault-reset
disabled    ready    .         .       .               .          .
ready       .        on        enabled disabled        disabled   .
on          ready    .         enabled disabled        disabled   .
enabled     ready    on        .       disabled        quick      .
quick       .        .         enabled disabled        .          .
fault       .        .         .       .               .          disabled
"""

WORDS = {
    "shutdown": 0x06,
    "switch-on": 0x07,
    "enable": 0x0F,
    "disable-voltage": 0x00,
    "quick-stop": 0x02,
    "fault-reset": 0x80,
}

STATUS = {  # masks and bits as canopen has them
    "disabled": "SWITCH ON DISABLED",
    "ready": "READY TO SWITCH ON",
    "on": "SWITCHED ON",
    "enabled": "OPERATION ENABLED",
    "quick": "QUICK STOP ACTIVE",
    "fault": "FAULT",
}

STAYS = {(0x605A, 0): 6}
"""A quick stop option code with which Quick stop active lasts."""


def _fault(bench: Bench) -> None:
    bench.axis.fault(0x1000)


def _words(*words: int) -> Callable[[Bench], None]:
    return lambda bench: bench.command(*words)


WAYS: Mapping[str, Callable[[Bench], None]] = {
    "disabled": lambda _: None,
    "ready": _words(0x06),
    "on": _words(0x06, 0x07),
    "enabled": _words(0x06, 0x07, 0x0F),
    "quick": _words(0x06, 0x07, 0x0F, 0x02),
    "fault": _fault,
}
"""How the axis comes into each state."""


def _cells() -> list[tuple[str, str, str]]:
    head, *rows = (line.split() for line in MACHINE.strip().splitlines())
    return [(state, word, state if cell == "." else cell) for state, *cells in rows for word, cell in zip(head, cells)]


def says(bench: Bench, state: str) -> bool:
    mask, bits = State402.SW_MASK[STATUS[state]]
    return bench[0x6041] & mask == bits


@pytest.mark.parametrize(("before", "word", "after"), _cells())
def test_each_command_in_each_state(before: str, word: str, after: str) -> None:
    bench = Bench(STAYS)
    WAYS[before](bench)
    assert says(bench, before)
    bench.command(WORDS[word])
    assert says(bench, after)


def test_the_table_of_arrows_is_that_of_canopen() -> None:
    ours = {(each.before.words.upper(), each.after.words.upper()): each for each in TRANSITIONS}
    theirs = {arrow for arrow in State402.TRANSITIONTABLE if arrow[0] != "START"}  # power-on is not an arrow of ours
    # 7 and 10 are theirs once, by Disable voltage.
    assert ours.keys() == theirs
    assert sorted({each.number for each in TRANSITIONS}) == [*range(1, 13), 14, 15, 16]


@pytest.mark.parametrize("state", State)
def test_each_state_has_bits_of_its_own(state: State) -> None:
    assert [other for other in State if state.bits & other.mask == other.bits] == [state]


@pytest.mark.parametrize("command", DriveCommand)
def test_each_command_has_bits_of_its_own(command: DriveCommand) -> None:
    assert [other for other in DriveCommand if command.bits & other.mask == other.bits] == [command]


def test_a_fault_is_reset_by_a_rising_edge_alone() -> None:
    bench = Bench()
    bench.command(0x80)
    bench.axis.fault(0x2310)
    bench.command(0x80)
    assert says(bench, "fault")
    bench.command(0x00, 0x80)
    assert says(bench, "disabled")
    assert bench.faults == [0x2310, None]
    assert bench[0x603F] == 0


# Stops

TOP = 2000
"""A velocity, in position units/s."""


def turning(objects: Mapping[tuple[int, int], int]) -> Bench:
    bench = Bench({(0x60FF, 0): TOP, **objects}).enable(3)
    bench.run(1)
    assert bench[0x606C] == TOP
    return bench


STOPS = [
    # word, option object, code: seconds to a stand from 2000, and the state then
    (0x02, 0x605A, 1, 0.2, State.DISABLED),  # slow down ramp, 10 000
    (0x02, 0x605A, 2, 0.04, State.DISABLED),  # quick stop ramp, 50 000
    (0x02, 0x605A, 5, 0.2, State.QUICK_STOP),
    (0x02, 0x605A, 6, 0.04, State.QUICK_STOP),
    (0x06, 0x605B, 1, 0.2, State.READY),
    (0x07, 0x605C, 1, 0.2, State.SWITCHED_ON),
    (0x10F, 0x605D, 1, 0.2, State.ENABLED),
    (0x10F, 0x605D, 2, 0.04, State.ENABLED),
]


@pytest.mark.parametrize(("word", "option", "code", "seconds", "after"), STOPS)
def test_an_option_code_says_how_the_motor_stops(
    word: int, option: int, code: int, seconds: float, after: State
) -> None:
    bench = turning({(option, 0): code})
    bench.command(word)
    bench.run(seconds * 0.8)
    assert bench[0x606C] > 0.1 * TOP
    bench.run(seconds * 0.2 + 0.004)
    assert (bench[0x606C], bench.state) == (0, after)
    stood = bench.position
    bench.run(0.5)
    assert bench.position == stood


@pytest.mark.parametrize(("code", "after"), [(3, State.DISABLED), (4, State.DISABLED), (7, State.QUICK_STOP)])
def test_at_the_current_limit_it_stops_as_fast_as_the_motor_can(code: int, after: State) -> None:
    bench = turning({(0x605A, 0): code})
    bench.command(0x02)
    bench.run(0.003)
    assert (bench[0x606C], bench.state) == (0, after)


@pytest.mark.parametrize(("word", "option", "after"), [(0x06, 0x605B, State.READY), (0x07, 0x605C, State.SWITCHED_ON)])
def test_with_option_code_0_the_motor_coasts(word: int, option: int, after: State) -> None:
    bench = turning({(option, 0): 0})
    bench.command(word)
    assert bench.state is after
    bench.run(0.01)
    assert 0 < bench[0x606C] < TOP  # by friction alone
    assert bench.axis.busy
    bench.run(0.1)
    assert bench[0x606C] == 0
    assert not bench.axis.busy


def test_quick_stop_with_option_code_0_disables_at_once() -> None:
    bench = turning({(0x605A, 0): 0})
    bench.command(0x02)
    assert bench.state is State.DISABLED


def test_a_quick_stop_that_lasts_no_longer_cannot_be_taken_back() -> None:
    bench = turning({(0x605A, 0): 2})
    bench.command(0x02, 0x0F)
    assert bench.state is State.QUICK_STOP


def test_a_stop_that_is_taken_back_in_time_goes_on() -> None:
    bench = turning({(0x605C, 0): 1})
    bench.command(0x07)
    bench.run(0.1)
    bench.command(0x0F)
    bench.run(0.5)
    assert (bench[0x606C], bench.state) == (TOP, State.ENABLED)


def test_after_a_halt_the_motion_goes_on() -> None:
    bench = turning({})
    bench.command(0x10F)
    bench.run(0.5)
    assert bench.is_set(10)  # the target of a halt is velocity 0
    bench.command(0x0F)
    bench.run(0.5)
    assert bench[0x606C] == TOP


# Faults

REACTIONS = [(0, 0.0, 0.04), (1, 0.2, 0.2), (2, 0.04, 0.04)]


@pytest.mark.parametrize(("code", "reacts", "stops"), REACTIONS)
def test_a_fault_stops_as_its_option_code_says(code: int, reacts: float, stops: float) -> None:
    bench = turning({(0x605E, 0): code})
    bench.axis.fault(0x2310)
    assert bench.state is (State.FAULT_REACTION if reacts else State.FAULT)
    bench.run(stops + 0.005)
    assert (bench.state, bench[0x606C], bench[0x603F]) == (State.FAULT, 0, 0x2310)


def test_a_second_fault_is_not_reported_before_the_first_is_reset() -> None:
    bench = Bench()
    bench.axis.fault(0x2310)
    bench.axis.fault(0x7305)
    assert bench.faults == [0x2310]


FOLLOWING = {(0x6065, 0): 20, (0x6066, 0): 50}


def test_a_motor_that_does_not_follow_is_a_fault() -> None:
    weak = Plant(acceleration=0.5)  # turns/s²; commanded are 10
    bench = Bench(FOLLOWING, plant=weak).enable()
    bench.write(0x607A, 5000)
    bench.command(0x1F)
    bench.rest()
    assert (bench.state, bench[0x603F]) == (State.FAULT, 0x8611)


@pytest.mark.parametrize("window", [{(0x6065, 0): 0xFFFFFFFF}, {(0x6065, 0): -1}, {}])
def test_without_a_window_nobody_looks_at_the_following_error(window: Mapping[tuple[int, int], int]) -> None:
    bench = Bench(window, plant=Plant(acceleration=0.5)).enable()
    bench.write(0x607A, 5000)
    bench.command(0x1F)
    bench.run(0.5)
    assert bench.state is State.ENABLED
    assert abs(bench[0x60F4]) > 20


CONNECTION = {0: State.ENABLED, 1: State.FAULT, 2: State.DISABLED, 3: State.DISABLED}


@pytest.mark.parametrize(("code", "after"), CONNECTION.items())
def test_the_abort_connection_option_code_is_obeyed(code: int, after: State) -> None:
    bench = turning({(0x6007, 0): code})
    bench.axis.connection_lost()
    bench.run(0.5)
    assert bench.state is after


# What a file has


def test_an_axis_shows_only_the_objects_of_its_file() -> None:
    bench = Bench(without=(0x6064, 0x60F4, 0x60FD, 0x603F)).enable()
    bench.axis.fault(0x2310)
    assert 0x6064 not in {index for index, _ in bench.shelf.values}


@pytest.mark.parametrize(
    ("modes", "asked", "taken"),
    [(0x1, 3, 1), (0x4, 1, 3), (0x4, 3, 3), (0x3FF, 9, 9), (0x2FF, 9, 1), (None, 1, 1), (None, 10, 10)],
)
def test_a_mode_that_the_file_does_not_have_is_not_taken(modes: int | None, asked: int, taken: int) -> None:
    first = 3 if modes == 0x4 else 1
    without = (0x6502,) if modes is None else ()
    bench = Bench({(0x6060, 0): first} | ({} if modes is None else {(0x6502, 0): modes}), without=without)
    bench.write(0x6060, asked)
    assert bench[0x6061] == taken


def test_after_a_long_halt_it_goes_on_from_there() -> None:
    bench = Bench({(0x60FF, 0): 500}).enable(3)
    bench.run(1)
    before = bench.position
    bench.now += 100.0
    bench.axis.advance(bench.now)
    assert bench.position == pytest.approx(before + 500 * MOST_STEPS * STEP, abs=1)
    bench.run(1)
    assert bench.position == pytest.approx(before + 500 * MOST_STEPS * STEP + 500, abs=1)


def test_an_axis_is_busy_until_the_motor_has_followed() -> None:
    bench = Bench(plant=Plant(acceleration=1.0, friction=0.1)).enable()
    bench.write(0x607A, 1000)
    bench.command(0x1F)
    while bench.axis.demand.position != 1000:
        bench.run(0.01, 0.01)
    assert abs(bench.position - 1000) > 10
    assert bench.axis.busy
    bench.rest()
    assert bench.position == 1000


def test_a_drive_of_one_mode_needs_no_object_for_it() -> None:
    bench = Bench({(0x6502, 0): 0x4, (0x60FF, 0): 500}, without=(0x6060,))
    bench.command(0x06, 0x07, 0x0F)
    bench.run(1)
    assert bench[0x606C] == 500
