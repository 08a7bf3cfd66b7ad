"""An editor that follows the JSON Schema of suites agrees with the checker."""

from __future__ import annotations

import json
import re
from pathlib import Path
from typing import Any

import jsonschema
import yaml

from eurobot_od.robot.plugin import ROBOT
from tests.check.suites import HEAD, document, read, reader
from tests.rows import rows

VALIDATOR = jsonschema.Draft7Validator(json.loads(json.dumps(reader(None).schema())))
DOCS = Path(__file__).parents[2] / "docs"
GUIDE = (DOCS / "checks.md").read_text()
TUTORIAL = (DOCS / "firmware-check.md").read_text()
EXAMPLES = re.findall(r'^```yaml title=".*\.check\.yaml"\n(.*?)^```', TUTORIAL, re.DOTALL | re.MULTILINE)

WRONG = {
    "unknown key": HEAD + "step: []\nsteps: []\n",
    "version": HEAD.replace("1", "2") + "steps: []\n",
    "unknown node": HEAD.replace("drive", "wheels") + "steps: []\n",
    "no steps": HEAD,
    "unknown action": document("- sned: Stop Drive"),
    "two actions": document("- {send: Stop Drive, wait: 1 s}"),
    "key of another action": document("- {send: Stop Drive, within: 1 s}"),
    "missing key": document("- never: Goto Confirm"),
    "no unit": document("- wait: 500"),
    "unknown message": document("- send: Stop Drove"),
    "message without its fields": document("- send: Goto XY"),
    "unknown field": document("- expect: {Goto State Response: {tme: 3}}"),
    "unknown barrier": document("- expect: {Goto XY: {barriers: {fire 7: forced}}}"),
    "identifier over 11 bits": document("- send: {raw: '900#'}"),
    "unknown state": document("- heartbeat: awake"),
    "unknown command": document("- nmt: restart"),
    "no times": document("- {wait: 1 s, repeat: 0}"),
}


def keys_of_the_format() -> set[str]:
    """Return all keys of suites and steps, as the schema has them."""
    steps = VALIDATOR.schema["$defs"]["step"]["oneOf"]
    return {*VALIDATOR.schema["properties"], *(key for each in steps for key in each["properties"])}


def errors(text: str) -> list[Any]:
    return [error for each in yaml.safe_load_all(text) for error in VALIDATOR.iter_errors(each)]


def test_it_is_a_schema() -> None:
    jsonschema.Draft7Validator.check_schema(VALIDATOR.schema)


@rows("file", ROBOT.shipped_suites().values())
def test_it_takes_the_shipped_suites(file: Path) -> None:
    assert errors(file.read_text()) == []


@rows("text", EXAMPLES)
def test_it_takes_the_tutorial_s_examples(text: str) -> None:
    assert errors(text) == []


@rows("key", sorted(keys_of_the_format()))
def test_the_guide_explains_every_key(key: str) -> None:
    assert re.search(rf"`{key}[`:]", GUIDE)


@rows("text", WRONG.values())
def test_it_refuses_what_the_checker_refuses(text: str) -> None:
    assert errors(text)
    assert read(text)[1]
