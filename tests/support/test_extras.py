"""Extras that are missing: the line names what installs them."""

from __future__ import annotations

import sys

import pytest

from eurobot_od.errors import LocalError
from eurobot_od.support import extras


def test_requirements_are_grouped_by_extra() -> None:
    requirements = [
        "canopen>=2.4",
        "polars>=1.20; extra == 'season'",
        'duckdb<2,>=1.1 ; python_version > "3" and extra == "season"',
        "tomli; python_version < '3.11'",
        "aiohttp>=3.9; extra == 'web'",
    ]
    assert extras.of_extras(requirements) == {"season": ["polars>=1.20", "duckdb<2,>=1.1"], "web": ["aiohttp>=3.9"]}


def test_a_missing_package_is_one_line_with_the_command_that_installs_it() -> None:
    with pytest.raises(LocalError) as raised, extras.needed("monitor"):
        raise ModuleNotFoundError(name="rich")
    begun, install = str(raised.value).split(" brings it: ")
    assert begun == "rich is not installed; the extra `monitor`"
    assert install.startswith(f"{sys.executable} -m pip install 'rich")


def test_a_module_of_our_own_that_is_missing_is_a_bug() -> None:
    with pytest.raises(ModuleNotFoundError), extras.needed("web"):
        raise ModuleNotFoundError(name="eurobot_od.web.wings")


def test_an_unknown_extra_has_no_install_command() -> None:
    assert extras.missing("wings", "flight") == "wings is not installed; the extra `flight` brings it"
