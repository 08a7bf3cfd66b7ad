"""The table of rules, and the page that is made from it: `.venv/bin/python -m tests.traffic.diagnosis.test_rules`."""

from __future__ import annotations

import re
from collections.abc import Iterable, Iterator
from pathlib import Path

from eurobot_od.cli import COMMANDS
from eurobot_od.lint.findings import LEVELS
from eurobot_od.robot.check.diagnosis import EurobotRule
from eurobot_od.traffic.diagnosis.incidents import IncidentRule
from eurobot_od.traffic.diagnosis.rules import BusRule

PAGE = Path(__file__).parents[3] / "docs" / "diagnosis-rules.md"
HEAD = """# Rules of `diagnose`

This page lists what [`diagnose`](diagnose.md) looks for: what must not be, its likely cause, what to do, and the clause
or source. It is made from the tables in `eurobot_od/traffic/diagnosis/rules.py` and
`eurobot_od/robot/check/diagnosis.py` by `.venv/bin/python -m tests.traffic.diagnosis.test_rules`. For each rule
`tests/traffic/diagnosis/defects.py` has a log that breaks it, and one that nearly does.

Of incidents of one level those further up in the table are shown first: they are more often the cause of the others.
"""


def table(rules: Iterable[IncidentRule]) -> Iterator[str]:
    """Write rules as a table."""
    yield "| rule | level | what must not be | likely cause | what to do | source |"
    yield "|---|---|---|---|---|---|"
    for each in rules:
        texts = (each.what, each.cause, each.remedy, each.clause)
        yield f"| `{each.id}` | {LEVELS[each.severity]} | {' | '.join(text.replace('|', '&#124;') for text in texts)} |"


def page() -> str:
    """Return the page."""
    ours, robots = "\n".join(table(BusRule)), "\n".join(table(EurobotRule))
    return f"{HEAD}\n## Any bus\n\n{ours}\n\n## The robot of 2014\n\n{robots}\n"


def test_the_page_is_current() -> None:
    assert PAGE.read_text("utf-8") == page()


def test_rules_have_names_of_their_own() -> None:
    names = [each.id for each in (*BusRule, *EurobotRule)]
    assert len(set(names)) == len(names)


def test_no_rule_says_what_another_one_says() -> None:
    assert len({each.what for each in BusRule}) == len(BusRule)  # equal members would be one


def test_what_to_do_names_commands_that_there_are_and_their_node_first() -> None:
    named = [text.split() for each in (*BusRule, *EurobotRule) for text in re.findall("`(.+?)`", each.remedy)]
    commands = [words for words in named if not words[0].startswith("-")]
    assert ["nmt", "NODE", "start"] in commands
    assert [words for words in commands if words[0] not in COMMANDS or "NODE" in words[2:]] == []


if __name__ == "__main__":
    PAGE.write_text(page(), "utf-8")
