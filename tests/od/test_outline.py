"""Outlines say what the dictionaries say; what is kept of them counts only for the very same file."""

from __future__ import annotations

import json
import os
import shutil
from collections.abc import Callable
from pathlib import Path

import pytest

from eurobot_od.errors import DictionaryError, MappingError
from eurobot_od.od import outline_cache
from eurobot_od.od.dictionary import Dictionary
from eurobot_od.od.outline import SERVICES, Described, Outline
from eurobot_od.robot import dialects

EDS = sorted(dialects.eds_folder().glob("*/*.eds"))


@pytest.fixture
def folder(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """The folder of what is kept, empty."""
    monkeypatch.setenv(outline_cache.VARIABLE, str(tmp_path / "kept"))
    return tmp_path / "kept"


@pytest.fixture
def eds(tmp_path: Path) -> Path:
    file = tmp_path / "drive.eds"
    file.write_bytes(Path(dialects.eds_folder(), "canopen", "drive.eds").read_bytes())
    return file


@pytest.fixture
def read(monkeypatch: pytest.MonkeyPatch) -> list[Path]:
    """The files that canopen was asked to read."""
    asked: list[Path] = []
    load = Dictionary.load

    def noted(file: Path) -> Dictionary:
        asked.append(file)
        return load(file)

    monkeypatch.setattr(Dictionary, "load", noted)
    return asked


@pytest.mark.parametrize("file", EDS, ids=lambda file: f"{file.parent.name}-{file.stem}")
def test_an_outline_says_what_the_dictionary_says(file: Path, folder: Path) -> None:
    dictionary = Dictionary.load(file)
    made, kept = outline_cache.load(file), outline_cache.load(file)
    assert len(list(folder.iterdir())) == 1
    for outline in (Outline.of(dictionary), made, kept):
        assert (outline.file, outline.name, outline.node_id) == (file, dictionary.name, dictionary.node_id)
        assert outline.pdos == dictionary.pdos
        for entry in dictionary.objects.values():
            for subindex, variable in getattr(entry, "subindices", {0: entry}).items():
                described = outline.described((entry.index, subindex))
                assert described is not None
                assert described.name == variable.qualname
                default = dictionary.default((entry.index, subindex)) if entry.index in SERVICES else None
                assert outline.default((entry.index, subindex)) == (default if isinstance(default, int) else None)


@pytest.mark.parametrize(
    ("address", "expected"),
    [
        ((0x1018, 1), Described("Identity object.Vendor-ID", 4, False)),
        ((0x1008, 0), Described("Manufacturer device name", 0, False)),  # text is no integer
        ((0x2000, 99), None),
        ((0x5FFF, 0), None),
    ],
)
def test_objects_are_described(address: tuple[int, int], expected: Described | None, eds: Path) -> None:
    assert outline_cache.load(eds).described(address) == expected


@pytest.mark.usefixtures("folder")
def test_the_second_time_canopen_is_not_asked(eds: Path, read: list[Path]) -> None:
    outline_cache.load(eds)
    outline_cache.load(eds)
    assert read == [eds]


@pytest.mark.usefixtures("folder")
def test_a_changed_file_is_read_anew(eds: Path, read: list[Path]) -> None:
    before, times = outline_cache.load(eds), eds.stat()
    eds.write_bytes(eds.read_bytes().replace(b"0x00000008", b"0x00000009"))
    os.utime(eds, ns=(times.st_atime_ns, times.st_mtime_ns))  # same size, same time: only the content tells
    after = outline_cache.load(eds)
    assert read == [eds, eds]
    assert {each.cob_id for each in before.pdos} ^ {each.cob_id for each in after.pdos} == {8, 9}


SPOILT: tuple[Callable[[bytes], bytes], ...] = (
    lambda content: content[:0],
    lambda content: content[:100],  # cut off
    lambda content: b"[1]\n" + content.partition(b"\n")[2],  # JSON of another kind
    lambda content: b"\xff" + content,
    lambda content: content.replace(b"[[", b"[[1", 1),  # another version of the reader
    lambda content: content.replace(b'"node_id"', b'"node"'),
)


@pytest.mark.parametrize("spoil", SPOILT)
def test_a_spoilt_entry_is_as_good_as_none(
    eds: Path, folder: Path, read: list[Path], spoil: Callable[[bytes], bytes]
) -> None:
    expected = outline_cache.load(eds).pdos
    (entry,) = folder.iterdir()
    entry.write_bytes(spoil(entry.read_bytes()))
    assert outline_cache.load(eds).pdos == expected
    assert outline_cache.load(eds).pdos == expected
    assert read == [eds, eds]


@pytest.mark.parametrize("variable", ["", "a file"])
def test_without_a_folder_nothing_is_kept(
    eds: Path, read: list[Path], variable: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    (tmp_path / "a file").touch()
    monkeypatch.setenv(outline_cache.VARIABLE, variable and str(tmp_path / variable))
    assert outline_cache.load(eds).pdos == outline_cache.load(eds).pdos
    assert read == [eds, eds]


@pytest.mark.parametrize(
    ("environment", "expected"),
    [
        ({"XDG_CACHE_HOME": "/somewhere"}, "/somewhere/eurobot-od"),
        ({"XDG_CACHE_HOME": "relative"}, None),  # the XDG specification: to be ignored
        ({"XDG_CACHE_HOME": "/a", outline_cache.VARIABLE: "/b"}, "/b"),
        ({outline_cache.VARIABLE: ""}, None),
    ],
)
def test_the_folder(environment: dict[str, str], expected: str | None, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.delenv(outline_cache.VARIABLE)
    for name, value in environment.items():
        monkeypatch.setenv(name, value)
    assert outline_cache.folder() == (expected and Path(expected))


def test_files_that_cannot_be_read(tmp_path: Path, folder: Path) -> None:
    with pytest.raises(DictionaryError):
        outline_cache.load(tmp_path / "missing.eds")
    empty = tmp_path / "empty.eds"
    empty.touch()
    with pytest.raises(DictionaryError):
        outline_cache.load(empty)
    assert not folder.exists()


def test_a_mapping_that_does_not_hold_is_not_kept(spoil_eds: Callable[..., Path], folder: Path) -> None:
    broken = spoil_eds(("drive", "1600sub0", "DefaultValue", None)) / "drive.eds"
    for _ in range(2):
        with pytest.raises(MappingError):
            outline_cache.load(broken)
    assert not folder.exists()


def test_the_whole_dictionary_is_loaded_on_demand(eds: Path, read: list[Path]) -> None:
    outline = Outline.of(Dictionary.load(eds))
    assert outline.dictionary.objects[0x1018].name == "Identity object"
    assert read == [eds]


def test_what_is_kept_is_json_and_the_file(eds: Path, folder: Path) -> None:
    outline_cache.load(eds)
    (entry,) = folder.iterdir()
    _, outline, objects, content = entry.read_bytes().split(b"\n", 3)
    assert json.loads(outline)["node_id"] == 2
    assert json.loads(objects)["1018:1"] == ["Identity object.Vendor-ID", 4, False]
    assert content == eds.read_bytes()


def test_objects_are_described_after_the_entry_is_gone(eds: Path, folder: Path) -> None:
    outline_cache.load(eds)
    kept = outline_cache.load(eds)
    shutil.rmtree(folder)
    assert kept.described((0x1018, 1)) == Described("Identity object.Vendor-ID", 4, False)
