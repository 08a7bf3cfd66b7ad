"""What plug-ins bring, and what is asked of all that count."""

from __future__ import annotations

from pathlib import Path

import pytest

from eurobot_od.errors import LocalError, UnknownName
from eurobot_od.plugin import NOTHING, Plugin, Plugins
from eurobot_od.robot.plugin import ROBOT


def test_an_empty_robot_adds_nothing_to_the_workbench() -> None:
    assert Plugin() == NOTHING
    assert NOTHING.dialects.names() == []
    with pytest.raises(LocalError, match="which devices"):
        NOTHING.dialects.load_all()
    assert Plugins().fault_names() == [name for name in Plugins(ROBOT).fault_names() if name in Plugins().fault_names()]


def test_a_suite_has_the_name_of_its_file_and_a_program_of_that_name_is_no_suite(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    for name in ("lift.check.yaml", "arm.yaml", "notes.txt"):
        (tmp_path / name).touch()
    robot = Plugins(Plugin(suites=tmp_path))
    assert robot.shipped_suites() == {"arm": tmp_path / "arm.yaml", "lift": tmp_path / "lift.check.yaml"}
    here = tmp_path / "here"
    here.mkdir()
    monkeypatch.chdir(here)
    (here / "lift").touch()  # compiled
    assert robot.suite("lift") == tmp_path / "lift.check.yaml"
    assert robot.suite("./lift") == Path("lift")
    assert robot.suite("lift.yaml") == robot.suite("lift.check.yaml") == robot.suite("lift")
    (here / "arm.yaml").touch()
    assert robot.suite("arm.yaml") == Path("arm.yaml")
    with pytest.raises(LocalError, match=r"is a folder: name its files, such as .*\*\.yaml"):
        robot.suite(str(here))
    with pytest.raises(UnknownName, match="unknown suite 'lft'"):
        robot.suite("lft")


def test_the_most_specific_device_package_is_used() -> None:
    of_maker, of_product, other = (Plugin(identity=each) for each in ((7,), (7, 5), (7, 6)))
    known = Plugins(packages=[of_maker, of_product, other, Plugin()])
    assert known.for_identity((7, 5, 1, 9)) is of_product
    assert known.for_identity((7, 8, 1, 9)) is of_maker
    assert known.for_identity((8, 5, 1, 9)) is NOTHING
    assert known.for_identity((0, 0, 0, 0)) is NOTHING
