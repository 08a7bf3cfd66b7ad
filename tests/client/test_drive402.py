"""A drive from the master's side: enabled, homed, moved, stopped; and what it does when the drive does not."""

from __future__ import annotations

import asyncio
from collections.abc import Callable, Iterator
from contextlib import contextmanager, suppress
from typing import Any

import pytest

from eurobot_od.bus.live import Live
from eurobot_od.client.network import AsyncNetwork, SimulatedNetwork, simulated
from eurobot_od.device.faults import DRIVE_FAULTS, Leaving
from eurobot_od.device.profiles import SimulatedDrive
from eurobot_od.errors import DriveError, LocalError, NodeRefused
from eurobot_od.frame import Frame
from eurobot_od.od.cia402 import State
from eurobot_od.od.values import SDO_RESPONSE_BASE
from tests.client.peers import new_channel, open_bus
from tests.client.servo import SERVO


@contextmanager
def drive(fault: str | None = None, **options: Any) -> Iterator[SimulatedNetwork]:
    kind = DRIVE_FAULTS[fault].given_to(SimulatedDrive) if fault else SimulatedDrive
    with simulated(kind(SERVO, **options)) as network:
        yield network


def test_a_drive_is_enabled_and_disabled() -> None:
    with drive() as network:
        axis = network[5].drive402
        axis.enable()
        assert axis.status.state is State.ENABLED
        axis.enable()  # it is enabled
        axis.disable()
        assert axis.state is State.DISABLED


def test_move_returns_at_the_target() -> None:
    with drive() as network:
        axis = network[5].drive402
        axis.move_to(20_000, velocity=500)
        assert axis.position == pytest.approx(20_000, abs=50)
        assert network[5]["Profile velocity"].value == 500
        axis.move_to(-1000, relative=True)
        assert axis.position == pytest.approx(19_000, abs=50)


@pytest.mark.long
@pytest.mark.parametrize("method", [None, 35, 24, 18])
def test_the_drive_homes(method: int | None) -> None:
    with drive(travel=(-5, 5)) as network:
        network[5][0x6099, 1].value = 600
        axis = network[5].drive402
        axis.home(method)
        assert abs(axis.position) < 200


def test_a_drive_turns_until_it_is_halted() -> None:
    with drive() as network:
        axis = network[5].drive402
        axis.velocity = 60
        network.sleep(1)
        assert axis.velocity == 60
        axis.halt()
        network.sleep(1)
        assert (axis.velocity, axis.state) == (0, State.ENABLED)
        axis.velocity = -60
        network.sleep(1)
        axis.quick_stop()
        network.sleep(1)
        assert (axis.velocity, axis.state) == (0, State.DISABLED)


def test_its_status_is_all_at_once() -> None:
    with drive() as network:
        assert network[5].drive402.status == (State.DISABLED, 0x0270, 1, 0, 0, 0, "")


def test_a_fault_is_reset() -> None:
    with drive() as network:
        network.devices[5].axes[0].fault(0x2310)  # type: ignore[attr-defined]
        axis = network[5].drive402
        with pytest.raises(DriveError, match="enable: it has a fault, error code 0x2310"):
            axis.enable()
        axis.fault_reset()
        axis.fault_reset()  # there is none any more
        axis.enable()
        assert axis.state is State.ENABLED


# What goes wrong, with the fault that makes it, in the words of the error

WRONG: dict[str, tuple[Callable[[Any], object], str]] = {
    "never-enables": (lambda axis: axis.enable(), "enable: not within 2 s; it is in Switched on"),
    "following-error": (lambda axis: axis.move_to(9000), "move: it has a fault, error code 0x8611"),
    "encoder-lost": (lambda axis: axis.move_to(9000), "move: it has a fault, error code 0x7305"),
    "overcurrent": (lambda axis: axis.move_to(90_000), "move: it has a fault, error code 0x2310"),
    "target-never-reached": (
        lambda axis: axis.move_to(900, within=3),
        r"move: not within 3 s; .* \(statusword 0x\w{4}\)$",
    ),
    "homing-stuck": (lambda axis: axis.home(24, within=3), r"home: not within 3 s; .* 0x\w{4}\)$"),
}


@pytest.mark.parametrize(("fault", "call", "text"), [(fault, *said) for fault, said in WRONG.items()])
def test_a_command_without_effect_is_a_drive_error(fault: str, call: Callable[[Any], object], text: str) -> None:
    with drive(fault) as network, pytest.raises(DriveError, match=text):
        call(network[5].drive402)


def writing(index: int, value: int) -> Frame:
    """Return another program's write of an object of the drive."""
    command = {0x6040: 0x2B, 0x6060: 0x2F}.get(index, 0x23)
    return Frame(0x605, bytes([command]) + index.to_bytes(2, "little") + b"\0" + value.to_bytes(4, "little"))


MOVE_TO_0 = (writing(0x607A, 0), writing(0x6040, 0x3F), writing(0x6040, 0xF))

OTHERS: dict[str, tuple[tuple[Frame, ...], Callable[[Any], object], str]] = {
    "a move, disabled": (
        (writing(0x6040, 0),),
        lambda axis: axis.move_to(60_000),
        r"move: it is in Switch on disabled \(statusword 0x0\w+\): another program, or an input",
    ),
    "a move, moved elsewhere": (
        MOVE_TO_0,
        lambda axis: axis.move_to(60_000),
        "move: another program has written the target 0, not 60000, 0x607A",
    ),
    "a move, halted": (
        (writing(0x6040, 0x10F),),
        lambda axis: axis.move_to(60_000),
        r"move: it stands at \d+, not at 60000; it is in Operation enabled",
    ),
    "a homing, in another mode": (
        (writing(0x6060, 1), *MOVE_TO_0),
        lambda axis: axis.home(24, within=60),
        "home: another program has put it into profile position",
    ),
    "a homing, disabled": (
        (writing(0x6040, 0),),
        lambda axis: axis.home(24),
        "home: it is in Switch on disabled",
    ),
}


@pytest.mark.parametrize(("writes", "call", "text"), OTHERS.values(), ids=OTHERS)
def test_a_motion_that_another_program_ends_is_a_drive_error(
    writes: tuple[Frame, ...], call: Callable[[Any], object], text: str
) -> None:
    with drive(travel=(-50, 50)) as network:
        axis, clock, device = network[5].drive402, network.master.clock, network.devices[5]
        waiting, began = list(writes), clock()

        def kick() -> None:
            while waiting and clock() > began + 0.5:
                device.receive(waiting.pop(0), clock())

        axis.kick = kick
        with pytest.raises(DriveError, match=text):
            call(axis)
        assert (waiting, clock() - began < 12) == ([], True)
        assert axis.velocity == 0


def test_a_disabled_drive_does_not_get_its_torque_back_from_a_halt() -> None:
    with drive() as network:
        axis = network[5].drive402
        axis.velocity = 60
        network.devices[5].receive(writing(0x6040, 6), network.master.clock())
        with pytest.raises(DriveError, match="turn: it is in Ready to switch on"):
            axis.check_turning(60)
        axis.halt()
        assert axis.state is State.DISABLED


@pytest.mark.parametrize(
    ("write", "text"),
    [
        (writing(0x60FF, 10), "another program has written the target 10, not 60, 0x60FF"),
        (writing(0x6060, 1), "another program has put it into profile position"),
    ],
    ids=["target", "mode"],
)
def test_a_turning_drive_is_checked_for_commands_of_others(write: Frame, text: str) -> None:
    with drive() as network:
        axis = network[5].drive402
        axis.velocity = 60
        axis.check_turning(60)
        network.devices[5].receive(write, network.master.clock())
        network.sleep(0.1)
        with pytest.raises(DriveError, match=text):
            axis.check_turning(60)


def test_a_move_into_a_limit_switch_ends_there_and_names_it() -> None:
    with drive(travel=(-1, 1)) as network:
        axis = network[5].drive402
        begun = network.master.clock()
        with pytest.raises(DriveError, match=r"internal limit active \(bit 11\): positive limit switch"):
            axis.move_to(1_000_000)
        assert network.master.clock() - begun < 20
        assert axis.status.limit == "internal limit active (bit 11): positive limit switch"


def test_a_move_past_a_software_limit_says_that_it_did_not_arrive() -> None:
    with drive(given={(0x607D, 2): 500}) as network:
        axis = network[5].drive402
        with pytest.raises(DriveError, match=r"it stands at \d+, not at 9000; .* internal limit active"):
            axis.move_to(9000)


class Hindered(Leaving, SimulatedDrive):
    """Shows one of its objects as it is not."""

    SHOWN = (0x6041, 0)

    def outgoing(self, frames: list[Frame]) -> list[Frame]:
        index, value = self.SHOWN
        answer = index.to_bytes(2, "little") + b"\0"
        return [
            Frame(each.cob_id, each.data[:4] + value.to_bytes(4, "little"))
            if each.cob_id == SDO_RESPONSE_BASE + 5 and each.data[1:4] == answer and each.data[0] != 0x60
            else each
            for each in super().outgoing(frames)
        ]


@pytest.mark.parametrize(
    ("index", "value", "words"),
    [
        (0x1000, 401, "its 0x1000 says profile 401, not 402"),
        (0x6041, 0x0240, r"its power stage has no voltage \(bit 4\)"),
        (0x6041, 0x0050, r"it takes no commands from the bus \(bit 9\)"),
        (0x6040, 0, "its controlword is 0x0000: somebody else writes it"),
        (0x6061, 0, r"no mode of operation is chosen \(0x6060\)"),
        (0x6061, 3, "it ignores the controlword"),
    ],
)
def test_why_a_drive_is_not_enabled_is_said(index: int, value: int, words: str) -> None:
    kind = type("NeverEnabled", (DRIVE_FAULTS["never-enables"].given_to(Hindered),), {"SHOWN": (index, value)})
    with simulated(kind(SERVO)) as network, pytest.raises(DriveError, match=f"enable: not within 2 s; .*: {words}$"):
        network[5].drive402.enable()


def test_a_fault_that_stays_is_said() -> None:
    with drive("fault-reset-ignored") as network:
        network.devices[5].axes[0].fault(0x2310)  # type: ignore[attr-defined]
        with pytest.raises(DriveError, match="fault reset: it has a fault, error code 0x2310"):
            network[5].drive402.fault_reset()


def test_a_switch_that_is_nowhere_is_a_homing_error() -> None:
    with drive(travel=(-1, 1)) as network, pytest.raises(DriveError, match="home: homing error"):
        network[5].drive402.home(24)


def test_a_motion_that_is_given_up_is_halted() -> None:
    with drive() as network:
        axis = network[5].drive402
        with suppress(DriveError):
            axis.move_to(1_000_000, velocity=100, within=1)
        network.sleep(1)
        assert (axis.velocity, axis.state) == (0, State.ENABLED)


def test_ctrl_c_halts_a_motion() -> None:
    with drive() as network:
        axis, clock = network[5].drive402, network.master.clock
        interrupts = iter([KeyboardInterrupt])

        def interrupting() -> float:
            if clock() > begun + 1:  # as Ctrl-C does, once, wherever the program is
                for interrupt in interrupts:
                    raise interrupt
            return clock()

        begun = clock()
        network.master.clock = interrupting
        with pytest.raises(KeyboardInterrupt):
            axis.move_to(1_000_000)
        network.sleep(1)
        assert axis.velocity == 0
        assert 1000 < axis.position < 100_000


@pytest.mark.parametrize("method", [15, 99])
def test_an_unknown_homing_method_is_refused_locally(method: int) -> None:
    with drive() as network, pytest.raises(LocalError, match="not a homing method"):
        network[5].drive402.home(method)


def test_a_mode_that_the_drive_does_not_have_is_refused() -> None:
    with drive(given={(0x6502, 0): 1}) as network, pytest.raises(NodeRefused):
        network[5].drive402.velocity = 5


def test_an_axis_that_no_drive_has_is_refused_here() -> None:
    with drive() as network, pytest.raises(LocalError, match=r"axis 9 is not in 1\.\.8"):
        network[5].axis402(9)


def test_without_a_file_the_types_are_those_of_the_standard() -> None:
    with drive() as network:
        axis = network.add(5).drive402
        axis.move_to(-3000)
        assert axis.position == pytest.approx(-3000, abs=50)


def test_in_an_event_loop_it_is_awaited() -> None:
    async def main(channel: str) -> None:
        async with AsyncNetwork.open("virtual", channel, answer_wait=2.0) as network:
            axis = network.add(5, SERVO).drive402
            await axis.home(35)
            await axis.move_to(2000)
            assert await axis.position == pytest.approx(2000, abs=50)
            await axis.turn(100)
            assert (await axis.status).mode == 3
            moving = asyncio.create_task(axis.move_to(10_000_000))
            while await axis.velocity < 500:
                pass
            moving.cancel()
            with suppress(asyncio.CancelledError):
                await moving
            while await axis.velocity != 0:
                pass
            await axis.disable()
            assert await axis.state is State.DISABLED

    channel = new_channel()
    with Live.node(open_bus(channel), SimulatedDrive(SERVO)):
        asyncio.run(asyncio.wait_for(main(channel), 30))
