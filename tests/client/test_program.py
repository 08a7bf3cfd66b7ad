"""Downloading a program: what a good device takes, and one line with the state the node is in for any other."""

from __future__ import annotations

from binascii import crc_hqx
from pathlib import Path
from typing import Any
from zlib import crc32

import pytest

from eurobot_od.client.program import DownloadProcedure, Loaded, load
from eurobot_od.errors import BusError, ProgramError
from eurobot_od.od.dictionary import Dictionary
from tests.client.flash import IDENTITY, NODE_ID, FlashDevice, KeyedFlashDevice, Trouble, eds
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
START = "`write 9 0x1F51:1 1` starts it"
MAY_BE_STOPPED = f"its program may be stopped; {START} again"
MAY_BE_CLEARED = f"its program is stopped and may be cleared: download it again, or, if it is still there, {START}"
DOES_NOT_RUN = f"the program is written and does not run; {START}, or download it again"
NOT_STARTED = f"the program is written and not started: download it again, or {START} as it is"
BAD = [
    (Trouble(refuses=0), f"node 9 refused to write {CONTROL} (STOP): {STATE}", MAY_BE_STOPPED),
    (Trouble(silent_after=0), f"no end of it in {STATUS} within 30000 ms after start of an operation",
     MAY_BE_STOPPED),
    (Trouble(refuses=3), f"node 9 refused to write {CONTROL} (CLEAR): {STATE}",
     MAY_BE_CLEARED),
    (Trouble(error_after=3, error=7), f"{STATUS} says: flash secured", MAY_BE_CLEARED),
    (Trouble(busy_for=40.0, error_after=3), f"no end of it in {STATUS} within 30000 ms after start of an operation",
     MAY_BE_STOPPED),
    (Trouble(refuses_data=True),
     "node 9 refused to write 0x1F50:1 Program data: Access failed due to a hardware error (0x06060000)",
     "it is stopped without a whole program: download it again"),
    (Trouble(error_after=0x1F50, error=3), f"{STATUS} says: data format error or wrong CRC",
     "it is stopped without a whole program: download it again"),
    (Trouble(error_after=0x1F50, error=42), f"{STATUS} says: error 42",
     "it is stopped without a whole program: download it again"),
    (Trouble(identification=7),
     "0x1F56:1 Program software identification is 0x7, which is not a CRC of the file (CRC-32 0x670222CB, "
     "CRC-16 (start value 0) 0x7557, CRC-16 (start value 0xFFFF) 0xBA8)", NOT_STARTED),
    (Trouble(refuses=1), f"node 9 refused to write {CONTROL} (START): {STATE}",
     DOES_NOT_RUN),
    (Trouble(starts=False), f"{CONTROL} says: stopped", DOES_NOT_RUN),
    (Trouble(error_after=1, error=1), f"{STATUS} says: no valid program", DOES_NOT_RUN),
]  # fmt: skip


@pytest.mark.parametrize(("trouble", "why", "state"), BAD)
def test_a_failure_says_why_and_in_which_state_the_node_is(trouble: Trouble, why: str, state: str) -> None:
    with wired(FlashDevice(trouble)) as master, pytest.raises(ProgramError) as failed:
        load(master.node(NODE_ID), PROGRAM)
    assert str(failed.value) == f"{why}; node 9: {state}"


OTHER_DEVICE = Dictionary.read(eds().encode() + IDENTITY, Path("other.eds"), NODE_ID)
WITHOUT_DATA = Dictionary.read(eds(0x1F50).encode(), Path("no-data.eds"), NODE_ID)
NOWHERE: list[tuple[Trouble, dict[str, Any], str]] = [
    (Trouble(without=(0x1F50,)), {},
     "node 9 refused to read 0x1F50:0 Program data: Object does not exist (0x06020000)"),
    (Trouble(without=(0x1F51,)), {},
     "node 9 refused to read 0x1F51:0 Program control: Object does not exist (0x06020000)"),
    (Trouble(), {"program": 2}, "0x1F50 Program data has 1 program: there is no program 2"),
    (Trouble(), {"content": bytes((1 << 24) + 1)},
     "the file has 16777217 bytes; a program has at most 16777216"),
    (Trouble(), {"dictionary": OTHER_DEVICE},
     "other.eds is for another device: node 9 has vendor-ID 0x0, not 0x7"),
    (Trouble(), {"dictionary": WITHOUT_DATA}, "no-data.eds has no 0x1F50:1 Program data that can be written"),
]  # fmt: skip


@pytest.mark.parametrize(("trouble", "options", "why"), NOWHERE)
def test_a_node_without_a_place_for_the_program_is_not_touched(
    trouble: Trouble, options: dict[str, Any], why: str
) -> None:
    device = FlashDevice(trouble)
    with wired(device) as master, pytest.raises(ProgramError) as failed:
        load(master.node(NODE_ID), **{"content": PROGRAM, **options})
    assert str(failed.value) == f"{why}; node 9: its program is as it was"
    assert (device.program, device.running, device.commands) == (b"old", True, [])


def test_a_download_that_was_broken_off_is_taken_up_again_by_the_next() -> None:
    device = FlashDevice(Trouble(refuses_data=True))
    with wired(device) as master:
        with pytest.raises(ProgramError):
            load(master.node(NODE_ID), PROGRAM)
        device.trouble = Trouble(refuses=0)  # it is in its loader: there is nothing to stop
        load(master.node(NODE_ID), PROGRAM)
    assert (device.program, device.running) == (PROGRAM, True)


def test_a_download_without_a_node_fails() -> None:
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


# By the maker's own procedure

KEYED = DownloadProcedure(
    unlock=[((0x1F51, 1), b"\x80")], part=1024, ready_at=(0x1F57, 1), crc=lambda content: crc32(content) ^ 0xFFFF_FFFF
)


def test_a_program_is_downloaded_by_the_procedure_of_its_maker() -> None:
    device = KeyedFlashDevice()
    with wired(device) as master:
        loaded = load(master.node(NODE_ID), PROGRAM[:2500], procedure=KEYED)
    assert loaded == Loaded(2500, "the maker's CRC")
    assert device.parts == [1024, 1024, 452]
    assert (device.program, device.running, device.commands) == (PROGRAM[:2500], True, [0, 3, 1])


@pytest.mark.parametrize(
    ("procedure", "said"),
    [
        (KEYED._replace(unlock=[]), "refused to write 0x1F51:1 Program control"),
        (KEYED._replace(part=2048), "it is stopped without a whole program"),
        (KEYED._replace(ready_at=None), "it is stopped without a whole program"),
        (KEYED._replace(crc=None), "which is not a CRC of the file"),
    ],
)
def test_no_part_of_the_procedure_can_be_left_out(procedure: DownloadProcedure, said: str) -> None:
    with wired(KeyedFlashDevice()) as master, pytest.raises(ProgramError, match=said):
        load(master.node(NODE_ID), PROGRAM, procedure=procedure)
