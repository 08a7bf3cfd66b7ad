"""Which file of a library fits a device, and what is told about it."""

from __future__ import annotations

import os
from pathlib import Path

import pytest

from eurobot_od.errors import LocalError
from eurobot_od.library import library
from eurobot_od.library.library import (
    CACHE,
    DATA,
    VARIABLE,
    FolderKind,
    Library,
    LibraryDevices,
    LibraryEntry,
    described,
    entries,
    folders,
    user_folder,
    users_folder,
)
from eurobot_od.od.dictionary import Dictionary
from eurobot_od.od.identity import Identity, contradiction
from eurobot_od.od.maker import device_yaml_of
from eurobot_od.od.values import Address
from tests.kit.library import OTHER_PRODUCT, PRODUCT, REVISION, VENDOR, device_text, library_of


def at(revision: int, **others: int | None) -> str:
    return device_text(revision=revision, **others)  # type: ignore[arg-type]


# The files of a library, the device's revision and type, and the files that fit, the best one first.
FITS = [
    ({"a": at(0x10000)}, 0x10000, None, "a"),
    ({"a": at(0x10001), "b": at(0x10002), "c": at(0x10004)}, 0x10003, None, "bac"),  # the nearest older one
    ({"a": at(0x10005), "b": at(0x10009)}, 0x10003, None, "ab"),  # no older one: the nearest newer one
    ({"a": at(0x20000), "b": at(0x10000)}, 0x10003, None, "ba"),  # another major revision behaves otherwise
    ({"a": at(0x10003), "b": at(0x20000)}, 0x20003, None, "ba"),
    ({"a": at(0), "b": at(0x20000)}, 0x10003, None, "ab"),  # one that says no revision is for all
    ({"a": at(0x10003, device_type=0x191), "b": at(0x10001, device_type=0x192)}, 0x10003, 0x192, "ba"),
    ({"a": at(0x10003, device_type=0x191), "b": at(0x10001, device_type=0x192)}, 0x10003, None, "ab"),
    ({"a": at(0x10003, device_type=None), "b": at(0x10001, device_type=0x192)}, 0x10003, 0x192, "ab"),
    ({"a": at(0x10000, product=OTHER_PRODUCT), "b": at(0x10000, vendor=1)}, 0x10000, None, ""),
    ({"a": "no EDS"}, 0x10000, None, ""),
]


@pytest.mark.parametrize(("texts", "revision", "device_type", "fitting"), FITS)
def test_the_best_fit_comes_first_and_the_rest_is_named(
    tmp_path: Path, texts: dict[str, str], revision: int, device_type: int | None, fitting: str
) -> None:
    folder = tmp_path / str(hash((*texts.values(), revision, device_type)))
    found = Library([library_of(folder, **texts)]).find(Identity(VENDOR, PRODUCT, revision, 77), device_type)
    names = [each.path.stem for each in (found.entry, *found.others)] if found else []
    assert "".join(names) == fitting


def test_an_eds_is_for_all_devices_of_a_kind_and_a_dcf_for_one(tmp_path: Path) -> None:
    folder = library_of(tmp_path, b=device_text())
    (folder / "a.dcf").write_text(device_text())
    found = Library([folder]).find(Identity(VENDOR, PRODUCT, 0x0002_0003))
    assert found
    assert found.entry.path.name == "b.eds"


# The identity of a device without a product code: any file of the maker's without one might be its own.
NO_PRODUCT = [
    (VENDOR, 0x192, "a"),
    (VENDOR, 0x191, ""),
    (VENDOR, None, ""),
    (0, 0x192, ""),
]


@pytest.mark.parametrize(("vendor", "device_type", "fitting"), NO_PRODUCT)
def test_without_a_product_code_the_device_type_decides(
    tmp_path: Path, vendor: int, device_type: int | None, fitting: str
) -> None:
    texts = {"a": device_text(product=None, device_type=0x192), "z": device_text(0, None, device_type=0x192)}
    found = Library([library_of(tmp_path / "lib", **texts)]).find(Identity(vendor), device_type)
    assert (found.entry.path.stem if found else "") == fitting


DIFFERENCES = [
    (Identity(1, 2, 0x10000), Identity(1, 2, 0x10005, 9), None),
    (Identity(1, 2, 0x10000), Identity(1, 3, 0x10005), "product code 0x3, not 0x2"),
    (Identity(1, 2, 0x10000), Identity(1, 2, 0x20000), "major revision 0x2, not 0x1"),
    (Identity(0, 2), Identity(1, 2, 0x20000), None),  # the file does not say it
    (Identity(1, 2, 0x10000), Identity(1), None),  # nor the device, yet
]


@pytest.mark.parametrize(("said", "device", "difference"), DIFFERENCES)
def test_missing_values_are_no_difference(said: Identity, device: Identity, difference: str | None) -> None:
    assert contradiction(said, device) == difference


def test_maker_files_are_found_beside_the_eds(tmp_path: Path) -> None:
    assert device_yaml_of(tmp_path / "axis.eds") is None
    (tmp_path / "device.yaml").touch()
    assert device_yaml_of(tmp_path / "axis.eds") == tmp_path / "device.yaml"
    (tmp_path / "axis.device.yaml").touch()
    assert device_yaml_of(tmp_path / "axis.eds") == tmp_path / "axis.device.yaml"


def test_typed_folders_count_before_the_environments_and_the_network_files(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    typed, environment, written = (tmp_path / each for each in ("typed", "environment", "written"))
    for each in (typed, environment, written):
        each.mkdir()
    assert folders() == [users_folder()]
    assert folders(written=[str(written)]) == [written]
    monkeypatch.setenv(VARIABLE, os.pathsep.join(map(str, (environment, typed))))
    assert folders(written=[str(written)]) == [environment, typed]
    assert folders([str(typed)], [str(written)]) == [typed]
    with pytest.raises(LocalError, match=r"library .*nowhere: no such folder"):
        folders([str(tmp_path / "nowhere")])


# Descriptions of nodes


def numbers(revision: int, product: int = PRODUCT) -> dict[Address, int]:
    return {(0x1018, 1): VENDOR, (0x1018, 2): product, (0x1018, 3): revision}


def test_a_node_is_described_by_what_it_shows_bit_by_bit(tmp_path: Path) -> None:
    told: list[str] = []
    folder = library_of(tmp_path / "lib", old=at(0x10000), new=at(0x10002))
    describe = LibraryDevices(Library([folder]), told.append)
    shown: dict[Address, int] = {}
    found = []
    for address, number in numbers(0x10002).items():
        shown[address] = number
        found.append(describe(5, shown))
    assert [each and each.file.stem for each in found] == [None, "old", "new"]
    assert (found[2] and found[2].name, found[2] and found[2].node_id, told) == ("new_5", 5, [])
    assert describe(5, shown) is found[2]


def test_another_version_is_told_once_with_both_names_and_the_rest(tmp_path: Path) -> None:
    told: list[str] = []
    folder = library_of(tmp_path / "lib", a=at(0x10000), b=at(0x20000))
    describe = LibraryDevices(Library([folder]), told.append)
    describe(5, numbers(0x30000))
    describe(5, numbers(0x30000))
    (line,) = told
    assert line.endswith(
        "b.eds is for another version: it has major revision 0x3, not 0x2; also of this product: a.eds"
    )


def test_files_that_fit_alike_are_told_once(tmp_path: Path) -> None:
    told: list[str] = []
    folder = library_of(tmp_path / "lib", a=at(0x10000), b=at(0x10000), c=at(0x20000))
    found = LibraryDevices(Library([folder]), told.append)(5, numbers(0x10000))
    assert found
    assert found.file.name == "a.eds"
    assert told == [f"node 5: {folder / 'a.eds'} is taken; as well fit b.eds"]


def test_a_named_file_that_is_for_another_device_is_told_and_kept(tmp_path: Path) -> None:
    told: list[str] = []
    folder = library_of(tmp_path / "lib", right=device_text())
    named = Dictionary.read(device_text(product=OTHER_PRODUCT).encode(), Path("named.eds"), 5)
    describe = LibraryDevices(Library([folder]), told.append)
    assert describe(5, numbers(0x20003), named) is None
    assert told == ["named.eds is for another device: node 5 has product code 0x1001, not 0x1002"]


def test_a_file_that_nobody_named_gives_way_to_one_that_fits(tmp_path: Path) -> None:
    told: list[str] = []
    folder = library_of(tmp_path / "lib", right=device_text())
    implied = Dictionary.read(device_text(product=OTHER_PRODUCT).encode(), Path("implied.eds"), 5)
    found = LibraryDevices(Library([folder]), told.append, [5])(5, numbers(0x20003), implied)
    assert (found and found.file.name, told) == ("right.eds", [])


def test_a_file_that_cannot_be_loaded_is_told_once(tmp_path: Path) -> None:
    told: list[str] = []
    folder = library_of(tmp_path / "lib", odd=device_text())
    library = Library([folder])
    assert library.entries
    (folder / "odd.eds").write_text("[x]\n")  # after it was indexed
    describe = LibraryDevices(library, told.append)
    assert describe(5, numbers(0x20003)) is None
    assert describe(5, numbers(0x20003)) is None
    assert len(told) == 1
    assert told[0].startswith("node 5: ")


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

    monkeypatch.setattr(library, "described", reading)
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
    library.file_of(folder).write_bytes(content)
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
