"""The robot's rules of `diagnose` beside those for any bus."""

from __future__ import annotations

import re

from eurobot_od.cli import COMMANDS
from eurobot_od.robot.check.diagnosis import EurobotRule
from eurobot_od.traffic.diagnosis.rules import BusRule


def test_rules_have_names_of_their_own() -> None:
    names = [each.id for each in (*BusRule, *EurobotRule)]
    assert len(set(names)) == len(names)


def test_remedies_name_existing_commands_with_their_node_first() -> None:
    named = [text.split() for each in EurobotRule for text in re.findall("`(.+?)`", each.remedy)]
    commands = [words for words in named if not words[0].startswith("-")]
    assert [words for words in commands if words[0] not in COMMANDS or "NODE" in words[2:]] == []
