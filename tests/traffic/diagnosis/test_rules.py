"""The table of rules."""

from __future__ import annotations

import re
from pathlib import Path

from eurobot_od.cli import COMMANDS
from eurobot_od.traffic.diagnosis.rules import EXPLAINED, BusRule
from tests.traffic.diagnosis.defects import DEFECTS

PAGE = Path(__file__).parents[3] / "docs" / "diagnose.md"


def test_rules_have_names_of_their_own() -> None:
    names = [each.id for each in BusRule]
    assert len(set(names)) == len(names)


def test_no_rule_says_what_another_one_says() -> None:
    assert len({each.what for each in BusRule}) == len(BusRule)  # equal members would be one


def test_remedies_name_existing_commands() -> None:
    named = [text.split() for each in BusRule for text in re.findall("`(.+?)`", each.remedy)]
    commands = [words for words in named if not words[0].startswith("-")]
    assert ["nmt", "NODE", "start"] in commands
    assert [words for words in commands if words[0] not in COMMANDS or "NODE" in words[2:]] == []


def rows_of_the_page() -> list[list[str]]:
    table = PAGE.read_text().partition("## What it can tell")[2].partition("\n## ")[0]
    return [row.split(" | ") for row in table.splitlines() if row.startswith("| ")][1:]


def test_each_finding_on_the_page_of_rules_has_a_rule_and_a_defect() -> None:
    named = {each for row in rows_of_the_page() for each in re.findall(r"`([a-z-]+)`", row[0])}
    assert len(named) >= 25
    assert named <= {each.rule.id for each in DEFECTS}


def test_the_page_says_of_each_row_how_it_is_told() -> None:
    assert [row[0] for row in rows_of_the_page() if len(row) != 3 or not row[1].strip()] == []


def test_the_page_names_rules_that_there_are() -> None:
    cells = " ".join(" ".join(row) for row in rows_of_the_page())
    known = {each.id for each in BusRule}
    assert {each for each in re.findall(r"`([a-z]+-[a-z-]+)`", cells) if each not in known} == set()


def test_the_rules_that_follow_from_others_exist() -> None:
    known = {each.id for each in BusRule}
    assert set(EXPLAINED) <= set(BusRule.__members__)
    assert {each for ids in EXPLAINED.values() for each in ids} <= known
