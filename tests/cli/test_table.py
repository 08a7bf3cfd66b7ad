"""Commands as rows of tables: a row gives its function what it takes, and nothing else."""

from __future__ import annotations

from inspect import Parameter, signature

import pytest

from eurobot_od.cli import TABLES, bus, drive, find, objects, parameters
from eurobot_od.cli.export import FORMS
from eurobot_od.cli.table import CommandRow

ROWS = {**bus.COMMANDS, **objects.COMMANDS, **parameters.COMMANDS, **FORMS, **drive.COMMANDS, "lss": find("lss")}


@pytest.mark.parametrize("name", ROWS)
def test_a_row_has_the_parameters_of_its_function(name: str) -> None:
    row = ROWS[name]
    assert isinstance(row, CommandRow)
    taken = signature(row.function).parameters.values()
    named = {each.name for each in taken if each.kind is not Parameter.VAR_KEYWORD}
    given = {each.name for each in row.parameters}
    assert given >= named
    assert given == named or any(each.kind is Parameter.VAR_KEYWORD for each in taken)


def test_each_row_is_found_by_its_name() -> None:
    assert TABLES.keys() == {*bus.COMMANDS, *objects.COMMANDS, *parameters.COMMANDS}
    assert all(find(name) is ROWS[name] for name in TABLES)
