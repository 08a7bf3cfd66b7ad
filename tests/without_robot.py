"""Runs the workbench's commands where nobody can import the robot, and prints how they ended; see `test_without_robot`.

Arguments: the program, and the options that give a command its devices.
"""

from __future__ import annotations

import json
import signal
import sys
import threading
from collections.abc import Iterator, Sequence
from contextlib import redirect_stderr, redirect_stdout
from importlib.machinery import ModuleSpec
from io import StringIO

from eurobot_od import cli
from eurobot_od.bus.live import Live, open_bus
from eurobot_od.device.simulated import SimulatedDevice
from eurobot_od.od.dictionary import Dictionary

BUS = ("-i", "virtual", "-c", "can0")


class Refuser:
    """Finds nothing of the robot, and notes who has looked for it."""

    def __init__(self) -> None:
        self.refused: list[str] = []

    def find_spec(self, name: str, *_: object) -> ModuleSpec | None:
        """Refuse the robot's modules; raises ImportError."""
        if f"{name}.".startswith("eurobot_od.robot."):
            self.refused.append(name)
            raise ImportError(f"{name} is refused")
        return None


def commands(devices: Sequence[str]) -> Iterator[tuple[str, ...]]:
    """Yield every command of the workbench, each that takes devices with these."""
    alone = (
        ("faults",),
        ("query", "season", "--report", "periods"),
        ("query", "season", "SELECT count(*) FROM frames"),
        ("load", "net.yaml"),
        ("devices", "--library", "."),
        ("new-device", "gripper", "--package", "--eds", "motor.eds"),
        ("lint", "motor.eds"),
        ("edit", "motor.eds", "set", "1017", "DefaultValue=250", "--dry-run"),
        ("lint", "--network", "net.yaml"),
        ("diff", "motor.eds", "motor.eds"),
        ("export", "xdd", "motor.eds"),
        ("make-eds", "protocol.yaml", "-o", "eds"),
        ("lss", "find", *BUS),
        ("boot", "net.yaml", *BUS),
        ("sync", "--count", "1", *BUS),
        ("time", "--count", "1", *BUS),
        ("doctor",),
        ("completion", "bash"),
        ("--help",),
    )
    with_devices = (
        ("show",),
        ("check", "--conformance", "--simulate"),
        ("check", "motor.check.yaml", "--simulate", "--fault", "heartbeat-missing", "--step", "type"),
        ("decode", "motor.log"),
        ("diagnose", "motor.log"),
        ("archive", "motor.log", "-o", "season"),
        ("compare", "motor.log", "motor.log"),
        ("monitor", "motor.log", "--statistics"),
        ("serve", "motor.log", "--listen", "127.0.0.1:0"),
        ("export", "c"),
        ("export", "dbc"),
        ("export", "docs"),
        ("export", "wireshark"),
        ("export", "mcap", "motor.log", "-o", "motor.mcap"),
    )
    on_bus = (
        ("node", "--node-id", "6", "--for", "100 ms"),
        ("send", "605#4000100000000000", "--expect", "585#"),
        ("check", "motor.check.yaml"),
        ("replay", "motor.log"),
        ("scan", "--listen", "100 ms"),
        ("read", "5", "0x1000"),
        ("write", "5", "0x1017", "500"),
        ("dump", "5"),
        ("pdo", "5"),
        ("dump", "5", "-o", "motor.dcf"),
        ("configure", "5", "motor.dcf"),
        ("store", "5"),
        ("restore", "5"),
        ("program", "5", "motor.log"),
        ("emcy", "5"),
        ("drive", "5", "status"),
        ("nmt", "5", "start"),
        ("watch", "5", "--for", "700 ms"),
    )
    yield from ((*words, *devices) for words in with_devices)
    yield from ((*words, *devices, *BUS) for words in on_bus)
    yield from alone
    yield from ((command, "--help") for command in cli.COMMANDS)


ENDLESS = "serve"


class Terminal(StringIO):
    """Somebody presses Ctrl-C at the first line."""

    def write(self, text: str) -> int:
        written = super().write(text)
        signal.pthread_kill(threading.main_thread().ident or 0, signal.SIGINT)
        return written


def run(words: tuple[str, ...]) -> tuple[int, str, str]:
    """Run a command, an endless one until somebody presses Ctrl-C; give status and what it printed."""
    out = Terminal() if words[0] == ENDLESS and words[1] != "--help" else StringIO()
    err = StringIO()
    with redirect_stdout(out), redirect_stderr(err):
        try:
            status = cli.main(words)
        except SystemExit as end:
            status = int(end.code or 0)
    return int(status), out.getvalue(), err.getvalue()


if __name__ == "__main__":
    program, *devices = sys.argv[1:]
    sys.argv = [program]
    refuser = Refuser()
    sys.meta_path.insert(0, refuser)
    with Live.node(open_bus("virtual", "can0"), SimulatedDevice(Dictionary.load("motor.eds", 5))):
        done = []
        for words in commands(devices):
            done.append((words, *run(words), refuser.refused))
            refuser.refused = []
    json.dump(done, sys.stdout)
