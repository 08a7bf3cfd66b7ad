"""The table of rules."""

from __future__ import annotations

import re

from eurobot_od.cli import COMMANDS
from eurobot_od.traffic.diagnosis.rules import BusRule


def test_rules_have_names_of_their_own() -> None:
    names = [each.id for each in BusRule]
    assert len(set(names)) == len(names)


def test_no_rule_says_what_another_one_says() -> None:
    assert len({each.what for each in BusRule}) == len(BusRule)  # equal members would be one


def test_what_to_do_names_commands_that_there_are_and_their_node_first() -> None:
    named = [text.split() for each in BusRule for text in re.findall("`(.+?)`", each.remedy)]
    commands = [words for words in named if not words[0].startswith("-")]
    assert ["nmt", "NODE", "start"] in commands
    assert [words for words in commands if words[0] not in COMMANDS or "NODE" in words[2:]] == []
