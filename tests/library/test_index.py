"""The index: what files describe, and when they are read again."""

from __future__ import annotations

import os
from pathlib import Path

import pytest

from eurobot_od.library import index
from eurobot_od.library.index import CACHE, DATA, FolderKind, LibraryEntry, described, entries, user_folder
from tests.kit.library import PRODUCT, REVISION, VENDOR, device_text, library_of

XDD = Path(__file__).parents[1] / "export" / "samples"


@pytest.fixture(autouse=True)
def cache(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """An empty cache."""
    monkeypatch.setenv("XDG_CACHE_HOME", str(tmp_path / "cache"))
    monkeypatch.setenv("LOCALAPPDATA", str(tmp_path / "cache"))
    return tmp_path / "cache"


@pytest.fixture
def reads(monkeypatch: pytest.MonkeyPatch) -> list[str]:
    """The names of the files that are read."""
    read: list[str] = []

    def reading(path: Path) -> LibraryEntry:
        read.append(path.name)
        return described(path)

    monkeypatch.setattr(index, "described", reading)
    return read


def test_an_entry_says_which_device_and_whose_it_is(tmp_path: Path) -> None:
    folder = library_of(tmp_path / "lib", axis=device_text())
    whose = (VENDOR, PRODUCT, REVISION, 0x0002_0192, "A Maker", "Axis", "")
    assert entries(folder) == [LibraryEntry(folder / "axis.eds", *whose)]


# What a file says otherwise than by the values of 0x1018 and 0x1000.
INFO = "[DeviceInfo]\nVendorNumber=0x29C\nProductNumber=5\nRevisionNumber=0x20000\n"
SAID_ELSEWHERE = [
    (INFO + device_text(None, None, None).partition("\n\n")[2], (VENDOR, 5, 0x20000), ""),  # makers leave 0x1018 empty
    (device_text(0, PRODUCT, None), (0, PRODUCT, 0), ""),
    (
        INFO + "[1000]\nParameterName=Device type\nDataType=7\n",
        (0, 0, 0),
        "",
    ),  # it has no 0x1018
    ("not an EDS", (0, 0, 0), "not a readable EDS (`lint` says more)"),
    ("", (0, 0, 0), "not a readable EDS (`lint` says more)"),
]


@pytest.mark.parametrize(("text", "identity", "problem"), SAID_ELSEWHERE)
def test_the_index_reads_values_as_a_dictionary_does(
    tmp_path: Path, text: str, identity: tuple[int, ...], problem: str
) -> None:
    (tmp_path / "some.eds").write_text(text)
    found = described(tmp_path / "some.eds")
    assert (found.identity[:3], found.problem) == (identity, problem)


def test_files_below_and_of_all_forms_are_found_and_others_are_not(tmp_path: Path) -> None:
    library_of(tmp_path / "a" / "b", one=device_text())
    library_of(tmp_path / ".hidden", two=device_text())
    (tmp_path / "three.DCF").write_text(device_text())
    (tmp_path / "device.yaml").write_text("emcy: {}\n")
    (tmp_path / "gone.eds").symlink_to(tmp_path / "nowhere")
    assert [each.path.relative_to(tmp_path).as_posix() for each in entries(tmp_path)] == ["a/b/one.eds", "three.DCF"]


def test_a_file_is_read_again_only_when_it_has_changed(tmp_path: Path, reads: list[str]) -> None:
    folder = library_of(tmp_path / "lib", one=device_text(), two=device_text(product=2))
    assert [each.product for each in entries(folder)] == [PRODUCT, 2]
    assert (entries(folder), reads) == (entries(folder), ["one.eds", "two.eds"])
    (folder / "two.eds").write_text(device_text(product=33))
    os.utime(folder / "two.eds", ns=(1, 1))  # whatever its time: another one
    assert ([each.product for each in entries(folder)], reads[2:]) == ([PRODUCT, 33], ["two.eds"])
    (folder / "one.eds").unlink()
    assert ([each.product for each in entries(folder)], reads[3:]) == ([33], [])


DEEP = pytest.param(b"[" * 100_000, id="nested deeply")


@pytest.mark.parametrize(
    "content",
    [b"", b"{", DEEP, b"[]", b'{"version": 1, "files": {"one.eds": [1]}}', b'{"version": 0, "files": {}}'],
)
def test_a_damaged_index_is_made_anew(tmp_path: Path, reads: list[str], content: bytes) -> None:
    folder = library_of(tmp_path / "lib", one=device_text())
    expected = entries(folder)
    index.file_of(folder).write_bytes(content)
    reads.clear()
    assert (entries(folder), reads) == (expected, ["one.eds"])
    assert (entries(folder), reads) == (expected, ["one.eds"])


@pytest.mark.posix
def test_an_index_that_cannot_be_written_costs_only_time(tmp_path: Path, cache: Path, reads: list[str]) -> None:
    cache.write_text("a file in its place")
    folder = library_of(tmp_path / "lib", one=device_text())
    assert entries(folder) == entries(folder)
    assert reads == ["one.eds", "one.eds"]


def test_a_folder_that_is_not_there_has_no_files_and_no_index(tmp_path: Path, cache: Path) -> None:
    assert entries(tmp_path / "nowhere") == []
    assert not cache.exists()


@pytest.mark.parametrize(("kind", "folder"), [(DATA, "user_data_path"), (CACHE, "user_cache_path")])
def test_the_users_folders_are_those_of_platformdirs(
    kind: FolderKind, folder: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    platformdirs = pytest.importorskip("platformdirs")
    assert user_folder(kind) == getattr(platformdirs, folder)("eurobot-od", appauthor=False)
    monkeypatch.delenv(kind.variable, raising=False)
    assert user_folder(kind) == getattr(platformdirs, folder)("eurobot-od", appauthor=False)
