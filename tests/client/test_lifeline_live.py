"""The `drive` command in a process of its own: whatever becomes of it, the drive that it turns comes to a stand."""

from __future__ import annotations

import signal
import subprocess
import sys
from collections.abc import Callable

import pytest
from programs import free_port

from eurobot_od.bus.live import Live, open_bus, share
from eurobot_od.device.profiles import SimulatedDrive
from eurobot_od.od.cia402 import State
from tests.bus.live.loose import until
from tests.client.servo import EDS, SERVO

pytestmark = [pytest.mark.live, pytest.mark.posix]

Program = subprocess.Popen[str]

ENDS: dict[str, tuple[Callable[[Program], object], State]] = {
    "Ctrl-C": (lambda program: program.send_signal(signal.SIGINT), State.ENABLED),
    "SIGTERM": (lambda program: program.send_signal(signal.SIGTERM), State.ENABLED),
    "a closed terminal": (lambda program: program.send_signal(signal.SIGHUP), State.ENABLED),
    "SIGKILL": (lambda program: program.kill(), State.DISABLED),
    "Ctrl-Z": (lambda program: program.send_signal(signal.SIGSTOP), State.DISABLED),
}
"""What ends or stops the command, and the state of the drive then: halted by us, or by its own quick stop."""


@pytest.mark.parametrize("end", ENDS)
def test_the_drive_stands_whatever_becomes_of_the_command(end: str) -> None:
    port, (act, state) = free_port(), ENDS[end]
    channel = share(port)
    drive = SimulatedDrive(SERVO)
    words = ["drive", "5", "jog", "500", "-i", "remote", "-c", channel, "--eds", f"5={EDS}", "--robot", "none"]
    with Live.node(open_bus("virtual", channel), drive):
        command = [sys.executable, "-m", "eurobot_od", *words]
        # As in a terminal: a program that a shell starts in the background ignores Ctrl-C.
        program = subprocess.Popen(
            command, stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL, text=True,
            preexec_fn=lambda: signal.signal(signal.SIGINT, signal.SIG_DFL) and None,
        )  # fmt: skip
        try:
            motor = drive.axes[0].motor
            until(lambda: motor.velocity > 0)
            act(program)
            until(lambda: abs(motor.velocity) < 0.001)
            until(lambda: drive.axes[0].state is state)
        finally:
            program.kill()
            program.wait()
        assert abs(motor.velocity) < 0.001
