"""The examples at the end of each `--help`: there are some, and they run as they stand."""

from __future__ import annotations

import shutil
from collections.abc import Iterator
from pathlib import Path

import pytest

from eurobot_od import cli
from eurobot_od.cli.signature import EXAMPLE, Forms
from eurobot_od.robot import plugin
from tests.test_docs import Shell, bus, shell

__all__ = ["bus", "shell"]

NEEDS = {
    "program": "a device that takes programs",
    "lss": "a device with LSS",
    "time": "a bus on which 0x100 is TIME; on the robot's it is not",
    "world": "somebody who ends it",
    "lint --robot": "a robot of that name",
    "configure": "a node 6",
    "export suite": "a log with a motor",
}
"""Begins of the examples that do not run here, and what they would need."""

FILES = {
    "network.yaml": "nodes:\n  motor: {file: motor.eds, node_id: 5}\n",
    "thermometer.yaml": "device: {product: Thermometer}\n",
    "sequences/warm-up.yaml": "- {send: motor.RPDO1, fields: {target_speed: 100}}\n",
    "ours.yaml": "0x1017: {ParameterValue: 250}\n",
}
SET_UP = """\
match --log run.log
match --log again.log
export xdd motor.eds -o motor.xdd
dump 5 --eds motor.eds -o motor.dcf -i socketcan -c can0
"""
"""What makes the files that the examples are about."""

STATUS = {"export": 1, "lint": 1, "diff": 1, "compare": 1, "boot": 1, "diagnose": 1}
"""Where the files and the bus of this test bring findings."""


def examples() -> Iterator[tuple[str, str]]:
    """Yield each command with an example of it."""
    for command in (*cli.COMMANDS, *plugin.COMMANDS):
        found = cli.find(command, "eurobot2014" if command in plugin.COMMANDS else None)
        functions = found.functions.values() if isinstance(found, Forms) else [found]
        for each in functions:
            for example in EXAMPLE.findall(each.__doc__ or ""):
                yield command, example


def test_each_command_has_examples_that_begin_with_its_name() -> None:
    given = list(examples())
    assert {command for command, _ in given} == {*cli.COMMANDS, *plugin.COMMANDS}
    assert [example for command, example in given if example.split()[0] != command] == []


def test_the_help_ends_with_them(capsys: pytest.CaptureFixture[str]) -> None:
    with pytest.raises(SystemExit):
        cli.main(["nmt", "--help"])
    *_, heading, first, second = capsys.readouterr().out.splitlines()
    assert (heading, first) == ("examples:", "  eurobot-od nmt 5 start -i socketcan -c can0")
    assert second.startswith("  eurobot-od nmt all ")


@pytest.mark.long
@pytest.mark.posix
@pytest.mark.usefixtures("bus")
def test_the_examples_run(shell: Shell) -> None:
    Path("sequences").mkdir()
    for name, text in FILES.items():
        Path(name).write_text(text, encoding="utf-8")
    Path("makers").mkdir()
    shutil.copy("docs/servo.eds", "servo.eds")
    shutil.copy("eurobot_od/robot/match/strategy.py", "mine.py")
    for line in SET_UP.splitlines():
        assert shell.run(f"{cli.PROGRAM} {line}")[0] == 0, line
    wrong = []
    for command, example in examples():
        if not example.startswith(tuple(NEEDS)):
            shutil.copy("docs/motor.eds", "motor.eds")  # which other examples change
            status, lines = shell.run(f"{cli.PROGRAM if command in plugin.COMMANDS else cli.WORKBENCH} {example}")
            if status not in (0, STATUS.get(command)):
                wrong.append((example, int(status), lines[-3:]))
    assert not wrong, "\n".join(map(str, wrong))
