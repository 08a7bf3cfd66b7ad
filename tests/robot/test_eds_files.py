"""The robot's EDS files: other programs read them without a word, and our rules find nothing above an info."""

from __future__ import annotations

import logging
import subprocess
import sys
from pathlib import Path

import canopen
import pytest
import yaml

from eurobot_od.cli.lint import read_network
from eurobot_od.lint.findings import Finding, Severity
from eurobot_od.lint.network import lint_network
from eurobot_od.lint.rules import lint
from eurobot_od.od.normal import normal
from eurobot_od.robot import dialects

EDS = dialects.eds_folder()
FILES = sorted(EDS.glob("*/*.eds"))
TABLE = yaml.safe_load((EDS / "protocol.yaml").read_text())

every_file = pytest.mark.parametrize("file", FILES, ids=lambda file: f"{file.parent.name}/{file.stem}")


def above_info(found: list[Finding]) -> list[Finding]:
    return [each for each in found if each.severity is not Severity.INFO]


@every_file
def test_dcfchk_accepts(file: Path) -> None:
    dcfchk = [sys.executable, "-W", "default", "-m", "dcf.cli", "--node_id", "2", str(file)]
    done = subprocess.run(dcfchk, capture_output=True, text=True, check=False)
    assert (done.returncode, done.stdout, done.stderr) == (0, "", "")


@every_file
def test_canopen_reads_without_a_word(file: Path, caplog: pytest.LogCaptureFixture) -> None:
    with caplog.at_level(logging.DEBUG):
        canopen.import_od(str(file), node_id=2)
    assert caplog.messages == []


@every_file
def test_canopen_gets_the_very_text(file: Path) -> None:
    made = normal(file.read_bytes())
    assert made.text.encode() == file.read_bytes()
    assert (made.changes, made.refusals) == ([], [])


@every_file
def test_a_file_has_nothing_above_info(file: Path) -> None:
    assert above_info(lint(file.read_bytes(), str(file))) == []


@pytest.mark.parametrize("dialect", dialects.names())
def test_a_dialect_has_nothing_above_info(dialect: str) -> None:
    files = sorted(dialects.folder(dialect).glob("*.eds"))
    assert above_info(lint_network(read_network([str(each) for each in files]))) == []


def test_the_network_file_has_nothing_above_info() -> None:
    assert above_info(lint_network(read_network([str(EDS / "network.yaml")]))) == []


def test_the_network_file_is_what_the_protocol_table_says() -> None:
    declared = yaml.safe_load((EDS / "network.yaml").read_text())
    assert declared["order"] == [*TABLE["messages"]]
    assert declared["shared"] == [name for name, each in TABLE["messages"].items() if len(each["senders"]) > 1]
    assert {name: each["node_id"] for name, each in declared["nodes"].items()} == {
        name: each["node_id"] for name, each in TABLE["nodes"].items()
    }
