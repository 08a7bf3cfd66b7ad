"""Suites as YAML: what a person can read and edit, whatever a file calls its objects."""

from __future__ import annotations

from pathlib import Path

import yaml

from eurobot_od.check.conformance import suite, writing
from eurobot_od.check.conformance.step import Data
from eurobot_od.od.dictionary import Dictionary
from tests.kit.devices import MODULE, NODE_ID, read

STEPS: list[tuple[Data, str]] = [
    # a step, and its line
    (
        {"name": "read", "sdo": {"read": "0x1017:0", "expect": 500}},
        '- {name: "read", sdo: {read: "0x1017:0", expect: 500}}',
    ),
    ({"name": "on", "nmt": "reset communication"}, '- {name: "on", nmt: reset communication}'),
    (
        {"name": "x", "sdo": {"write": "0x1000:0", "data": "00", "abort": ["0x06010002"]}},
        '- {name: "x", sdo: {write: "0x1000:0", data: "00", abort: [0x06010002]}}',
    ),
    ({"name": "wait", "wait": "50 ms"}, '- {name: "wait", wait: 50 ms}'),
]


def test_a_step_is_one_line() -> None:
    lines = "".join(f"  {line}\n" for _, line in STEPS)
    assert writing.documents([{"steps": [step for step, _ in STEPS]}]) == f"---\nsteps:\n{lines}"


NAMES = [
    "Motor speed",
    'with "quotes" and \\backslashes\\',
    "[brackets], {braces}: and # more",
    "no",
    "012",
    "Größe µm",
    "tab\tand \x07 bell \x9f",
    "x" * 1000,
    "- dash",
    "{present}",
    "%s",
]


RENAMED = ["Measured value", "Output", "Output mode", "Input", "Channel 1", "Channel 2", "Channel 3", "Factor", "Key",
           "Enabled", "Set value", "Unit"]  # fmt: skip
"""Names in the sample, one for each of those above, and more."""


def test_any_name_of_a_file_is_read_back(tmp_path: Path) -> None:
    text = MODULE.read_text()
    for before, name in zip(RENAMED, NAMES, strict=False):
        assert text.count(f"ParameterName={before}\n") == 1
        text = text.replace(f"ParameterName={before}\n", f"ParameterName={name}\n")
    assert len(NAMES) <= len(RENAMED)
    file = tmp_path / "odd name [1].eds"
    file.write_text(text, encoding="latin-1", errors="replace")
    dictionary = Dictionary.load(file, NODE_ID)
    suites = suite.text(dictionary)
    assert len(list(yaml.safe_load_all(suites))) == len(suite.CHAPTERS)
    assert len(read(dictionary, suites)) == len(suite.CHAPTERS)
