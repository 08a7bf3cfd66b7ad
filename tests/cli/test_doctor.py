"""The command `doctor`: what it says of packages, extras and ports, whatever this machine has."""

from __future__ import annotations

import sys
from importlib.metadata import version

import pytest

from eurobot_od.cli import doctor
from eurobot_od.support import extras
from eurobot_od.support.extras import Package
from tests.cli.console import run


def test_it_names_what_is_installed_and_says_whether_something_is_wrong(capsys: pytest.CaptureFixture[str]) -> None:
    said = run(capsys, "doctor")
    lines = said.out.splitlines()
    assert lines[0].startswith("eurobot-od ")
    assert f"package    python-can {version('python-can')}" in lines
    assert any(line.startswith("drivers    ") and "virtual" in line for line in lines)
    assert {line.split()[0] for line in lines if line} <= {
        *(
            "eurobot-od",
            "package",
            "extra",
            "robot",
            "interface",
            "drivers",
            "no",
            "socketcan",
            "adapter",
            "wrong",
            "nothing",
        ),
    }
    assert (lines[-1] == "nothing is wrong") is not any(line.startswith("wrong") for line in lines)
    assert (said.status, said.err) == (0 if lines[-1] == "nothing is wrong" else 1, "")


def test_packages_are_lines() -> None:
    assert list(doctor.packages([Package("canopen", "2.4.1"), Package("wings", "")])) == [
        "package    canopen 2.4.1",
        "package    wings is not installed",
    ]


def test_an_extra_is_told_with_its_versions_or_with_what_installs_it() -> None:
    brought = {"monitor": ["python-can>=4"], "flight": ["no-such-wings>=2", "python-can>=4"]}
    assert list(doctor.extra_lines(brought)) == [
        f"extra      monitor  python-can {version('python-can')}",
        f"extra      flight   not installed: {sys.executable} -m pip install 'no-such-wings>=2' 'python-can>=4'",
    ]


def test_what_an_extra_of_another_package_brings_is_looked_for_too() -> None:
    names = [each.name for each in extras.installed("python-can[mf4]>=4.4")]
    assert names[:2] == ["python-can", "asammdf"]


def test_a_port_without_permission_is_told_with_what_gives_it() -> None:
    assert list(doctor.denied(["/dev/ttyUSB0"])) == [
        ("/dev/ttyUSB0 cannot be opened by this user", "sudo usermod -aG dialout $USER, and log in again")
    ]
