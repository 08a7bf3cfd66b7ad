"""Downloading a program: what a good device takes, and one line with the state the node is in for any other."""

from __future__ import annotations

from binascii import crc_hqx

import pytest

from eurobot_od.client.program import Loaded, load
from eurobot_od.errors import BusError, ProgramError
from tests.client.flash import NODE_ID, FlashDevice, Trouble
from tests.client.wired import wired

PROGRAM = bytes(range(256)) * 20


GOOD = [
    (Trouble(), "CRC-32"),
    (Trouble(identification=crc_hqx(PROGRAM, 0)), "CRC-16 (start value 0)"),
    (Trouble(identification=crc_hqx(PROGRAM, 0xFFFF)), "CRC-16 (start value 0xFFFF)"),
    (Trouble(without=(0x1F56,)), ""),
    (Trouble(without=(0x1F56, 0x1F57)), ""),  # both are optional
    (Trouble(restarts=True), "CRC-32"),  # silent while it goes from program to loader and back
]


@pytest.mark.parametrize(("trouble", "crc"), GOOD)
def test_a_program_is_stopped_cleared_written_verified_and_started(trouble: Trouble, crc: str) -> None:
    device, told = FlashDevice(trouble), list[tuple[int, int | None]]()
    with wired(device) as master:
        loaded = load(master.node(NODE_ID), PROGRAM, progress=lambda *each: told.append(each))
    assert loaded == Loaded(len(PROGRAM), crc)
    assert (device.program, device.running, device.commands) == (PROGRAM, True, [0, 3, 1])
    assert told[-1] == (len(PROGRAM), len(PROGRAM))


def test_an_identification_that_is_no_crc_is_left_alone_where_that_is_said() -> None:
    device = FlashDevice(Trouble(identification=7))
    with wired(device) as master:
        assert load(master.node(NODE_ID), PROGRAM, check_crc=False).crc == ""
    assert device.running


STATE = "Data cannot be transferred or stored to the application because of the present device state (0x08000022)"
CONTROL, STATUS = "0x1F51:1 Program control", "0x1F57:1 Flash status identification"
BAD = [
    (Trouble(without=(0x1F51,)), f"node 9 refused to read {CONTROL}: Object does not exist (0x06020000)",
     "its program is as it was"),
    (Trouble(refuses=0), f"node 9 refused to write {CONTROL} (STOP): {STATE}", "its program may be stopped"),
    (Trouble(silent_after=0), f"no end of it in {STATUS} within 30000 ms after start of an operation",
     "its program may be stopped"),
    (Trouble(refuses=3), f"node 9 refused to write {CONTROL} (CLEAR): {STATE}",
     "its program is stopped and may be cleared"),
    (Trouble(error_after=3, error=7), f"{STATUS} says: flash secured", "its program is stopped and may be cleared"),
    (Trouble(busy_for=40.0, error_after=3), f"no end of it in {STATUS} within 30000 ms after start of an operation",
     "its program may be stopped"),
    (Trouble(refuses_data=True),
     "node 9 refused to write 0x1F50:1 Program data: Access failed due to a hardware error (0x06060000)",
     "it is stopped without a whole program: download it again"),
    (Trouble(error_after=0x1F50, error=3), f"{STATUS} says: data format error or wrong CRC",
     "it is stopped without a whole program: download it again"),
    (Trouble(error_after=0x1F50, error=42), f"{STATUS} says: error 42",
     "it is stopped without a whole program: download it again"),
    (Trouble(identification=7),
     "0x1F56:1 Program software identification is 0x7, which is no CRC of the file (CRC-32 0x670222CB, "
     "CRC-16 (start value 0) 0x7557, CRC-16 (start value 0xFFFF) 0xBA8)", "the program is written and not started"),
    (Trouble(refuses=1), f"node 9 refused to write {CONTROL} (START): {STATE}",
     "the program is written and does not run"),
    (Trouble(starts=False), f"{CONTROL} says: stopped", "the program is written and does not run"),
    (Trouble(error_after=1, error=1), f"{STATUS} says: no valid program", "the program is written and does not run"),
]  # fmt: skip


@pytest.mark.parametrize(("trouble", "why", "state"), BAD)
def test_a_failure_says_why_and_in_which_state_the_node_is(trouble: Trouble, why: str, state: str) -> None:
    with wired(FlashDevice(trouble)) as master, pytest.raises(ProgramError) as failed:
        load(master.node(NODE_ID), PROGRAM)
    assert str(failed.value) == f"{why}; node 9: {state}"


def test_nobody_there() -> None:
    with (
        wired() as master,
        pytest.raises(ProgramError, match=r"^no answer from node 9 .*; node 9: its program is as it was"),
    ):
        load(master.node(NODE_ID), PROGRAM)


@pytest.mark.parametrize(("raised", "kind"), [(OSError("cable"), BusError), (KeyboardInterrupt(), ProgramError)])
def test_a_bus_that_fails_or_a_user_who_interrupts_is_told_the_state(
    raised: BaseException, kind: type[Exception]
) -> None:
    with wired(FlashDevice()) as master:

        def fail(*_: object) -> None:
            raise raised

        with pytest.raises(kind, match="; node 9: it is stopped without a whole program: download it again"):
            load(master.node(NODE_ID), PROGRAM, progress=lambda *_: setattr(master.bus, "send", fail))
