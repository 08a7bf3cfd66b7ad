"""Runs the workbench's commands, each in this process, and prints how they ended; see `test_without_robot`."""

from __future__ import annotations

import json
import signal
import sys
import threading
from contextlib import redirect_stderr, redirect_stdout
from io import StringIO
from pathlib import Path

import eurobot_od
from eurobot_od import cli
from eurobot_od.bus.live import Live, open_bus
from eurobot_od.device.simulated import SimulatedDevice
from eurobot_od.od.dictionary import Dictionary

BUS = ["-i", "virtual", "-c", "can0"]
MOTOR = ["--eds", "5=motor.eds"]

COMMANDS = (
    ("show", *MOTOR),
    ("node", *MOTOR, *BUS, "--node-id", "6", "--duration", "100 ms"),
    ("send", "605#4000100000000000", "--expect", "585#", *MOTOR, *BUS),
    ("check", "--conformance", "--simulate", *MOTOR),
    ("check", "motor.check.yaml", *MOTOR, *BUS),
    ("check", "motor.check.yaml", "--simulate", *MOTOR, "--fault", "heartbeat-missing", "--step", "type"),
    ("faults",),
    ("decode", "motor.log", *MOTOR),
    ("archive", "motor.log", "-o", "season", *MOTOR),
    ("query", "season", "--report", "periods"),
    ("query", "season", "SELECT count(*) FROM frames"),
    ("compare", "motor.log", "motor.log", *MOTOR),
    ("replay", "motor.log", *MOTOR, *BUS),
    ("monitor", "motor.log", "--statistics", *MOTOR),
    ("serve", "motor.log", "--listen", "127.0.0.1:0", *MOTOR),
    ("load", "net.yaml"),
    ("lint", "motor.eds"),
    ("diff", "motor.eds", "motor.eds"),
    ("export", "c", *MOTOR),
    ("export", "dbc", *MOTOR),
    ("export", "docs", *MOTOR),
    ("export", "wireshark", *MOTOR),
    ("export", "mcap", "motor.log", "-o", "motor.mcap", *MOTOR),
    ("export", "xdd", "motor.eds"),
    ("make-eds", "protocol.yaml", "-o", "eds"),
    ("scan", "--listen", "100 ms", *MOTOR, *BUS),
    ("read", "5", "0x1000", *MOTOR, *BUS),
    ("write", "5", "0x1017", "500", *MOTOR, *BUS),
    ("dump", "5", *MOTOR, *BUS),
    ("pdo", "5", *MOTOR, *BUS),
    ("export-dcf", "5", "-o", "motor.dcf", *MOTOR, *BUS),
    ("configure", "5", "motor.dcf", *BUS),
    ("store", "5", *BUS),
    ("restore", "5", *BUS),
    ("lss", "find", *BUS),
    ("program", "5", "motor.log", *MOTOR, *BUS),
    ("emcy", "5", *BUS),
    ("drive", "5", "status", *BUS),
    ("boot", "net.yaml", *BUS),
    ("nmt", "5", "start", *BUS),
    ("watch", "5", "--for", "700 ms", *BUS),
    ("sync", "--count", "1", *BUS),
    ("time", "--count", "1", *BUS),
    ("doctor",),
    ("completion", "bash"),
    ("--help",),
    *((command, "--help") for command in cli.COMMANDS),
)
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
    assert not Path(eurobot_od.__file__).with_name("robot").exists(), eurobot_od.__file__
    with Live.node(open_bus("virtual", "can0"), SimulatedDevice(Dictionary.load("motor.eds", 5))):
        json.dump([(words, *run(words)) for words in COMMANDS], sys.stdout)
