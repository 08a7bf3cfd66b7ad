"""The view of files in a browser: files are opened, changed in every way, undone, saved; all else of them stays."""

from __future__ import annotations

import json
from collections.abc import Iterator
from dataclasses import dataclass
from difflib import SequenceMatcher
from pathlib import Path

import pytest

from eurobot_od.web.editor import LARGEST, EditableFile, FileEditor
from eurobot_od.web.page import page
from tests.web.browser import PATIENCE, Page
from tests.web.scene import channel, live_page, serving

MOTOR = (Path(__file__).parents[2] / "docs" / "motor.eds").read_bytes()
ODD = MOTOR.replace(b"\n", b"\r\n").replace(b"Producer heartbeat time", b"Herzschl\xe4ge ; Takt") + b"; no line end"
"""The motor with line ends of Windows, a letter of Latin-1, a comment and a last line without an end."""

SHIFT, CTRL = 8, 2
"""Modifiers of a key in the DevTools protocol."""


@dataclass
class Desk:
    """A page that edits the file of a motor, which is on the disk, and the folder of its downloads."""

    page: Page
    file: Path
    downloads: Path

    def choose(self, number: str) -> None:
        """Choose the object whose line of the tree begins with a number."""
        found = "[...document.querySelectorAll('.item')].find(each => each.querySelector('.id')?.textContent === {})"
        self.page.run(f"{found.format(json.dumps(number))}.click()")
        self.page.wait(f"document.querySelector('.object-form .id')?.textContent.startsWith({number.lstrip(':')!r}) || "
                       f"document.querySelector('.object-form .id')?.textContent.endsWith({number!r})")  # fmt: skip

    def set(self, key: str, value: str | bool) -> None:
        """Write into a field of the form, or tick it."""
        field = f"""document.querySelector('[data-focus="field {key}"]')"""
        name = "checked" if isinstance(value, bool) else "value"
        self.page.run(f"{field}.{name} = {json.dumps(value)}")

    def press(self, button: str) -> str:
        """Press a button and return what is said afterwards."""
        self.page.run("document.querySelector('.file-answer').textContent = ''")
        self.page.click(f'[data-focus="{button}"]')
        return self.answer()

    def answer(self) -> str:
        """Return what is said, once there is something."""
        return str(self.page.wait("document.querySelector('.file-answer').textContent"))

    def said(self, words: str) -> None:
        """Wait until this is said, or something that has `...` in place of these words' end."""
        begin, rest, _ = words.partition("...")
        fits = f".startsWith({json.dumps(begin)})" if rest else f" === {json.dumps(words)}"
        self.page.wait(f"document.querySelector('.file-answer').textContent{fits}")

    def key(self, key: str, modifiers: int = 0) -> None:
        """Press a key with Shift or Ctrl."""
        for kind in ("rawKeyDown", "keyUp"):
            self.page.call("Input.dispatchKeyEvent", type=kind, key=key, modifiers=modifiers)

    def drop(self, file: Path) -> None:
        """Drop a file of the disk into the view."""
        self.page.run("document.querySelector('.file-answer').textContent = ''")
        self.page.drop({"items": [], "files": [str(file)], "dragOperationsMask": 1}, ".files")

    def download(self, name: str = "motor.eds") -> bytes:
        """Press Download and return what the browser writes."""
        self.page.call("Page.setDownloadBehavior", behavior="allow", downloadPath=str(self.downloads))
        self.page.click('[data-focus="Download"]')
        file = self.downloads / name
        for _ in range(int(PATIENCE / 0.05)):
            if file.is_file() and not list(self.downloads.glob("*.crdownload")):
                data = file.read_bytes()
                file.unlink()
                return data
            self.page.run("new Promise(done => setTimeout(done, 50))")
        raise AssertionError("nothing was downloaded")

    def mapped(self) -> list[str]:
        """Return the names of what the PDO carries, as they are drawn."""
        drawn = "[...document.querySelectorAll('.entry > span:first-child')].map(each => each.textContent)"
        return list(self.page.run(drawn))


@pytest.fixture
def control() -> bool:
    return True


@pytest.fixture
def desk(tmp_path: Path, window: Page, control: bool) -> Iterator[Desk]:
    downloads, file = tmp_path / "downloads", tmp_path / "motor.eds"
    downloads.mkdir()
    file.write_bytes(ODD)
    editor = FileEditor(lambda: [EditableFile(file, "named")], control)
    with serving(lambda: page("motor.eds", [], editor=True), editor=editor) as address:
        window.open(address)
        window.wait("document.querySelector('.item')")
        yield Desk(window, file, downloads)
        window.run("for (const each of editedFiles.values()) each.saved = each.text")  # or the page asks at its end


def changes(before: bytes, after: bytes) -> list[str]:
    """Return the lines that are gone and new, with their ends."""
    old, new = (each.decode("latin-1").splitlines(keepends=True) for each in (before, after))
    codes = SequenceMatcher(None, old, new, autojunk=False).get_opcodes()
    found = (
        ([f"-{each}" for each in old[a:b]], [f"+{each}" for each in new[c:d]])
        for kind, a, b, c, d in codes
        if kind != "equal"
    )
    return [line for gone, added in found for line in (*gone, *added)]


def test_only_the_value_edited_in_the_form_changes_in_the_file(desk: Desk) -> None:
    desk.choose("0x1017")
    desk.set("DefaultValue", "250")
    desk.set("HighLimit", "900")
    assert desk.press("apply") == "set 0x1017 DefaultValue=250 HighLimit=900"
    after = desk.download()
    assert changes(ODD, after) == ["-DefaultValue=500\r\n", "+DefaultValue=250\r\n", "+HighLimit=900\r\n"]
    assert after == ODD.replace(b"=500\r\nPDOMapping=0\r\n", b"=250\r\nPDOMapping=0\r\nHighLimit=900\r\n")
    assert desk.file.read_bytes() == ODD


def test_undo_and_redo_by_button_and_key(desk: Desk) -> None:
    desk.choose("0x1017")
    for value in ("1", "2"):
        desk.set("DefaultValue", value)
        desk.press("apply")
    assert desk.press("Undo") == "undone: set 0x1017 DefaultValue=2"
    assert b"DefaultValue=1\r\n" in desk.download()
    desk.page.run("document.querySelector('.item').focus()")
    desk.key("z", CTRL)
    desk.said("undone: set 0x1017 DefaultValue=1")
    assert desk.download() == ODD
    assert desk.page.run("document.querySelector('[data-focus=Undo]').disabled")
    for value in ("1", "2"):
        desk.key("y", CTRL)
        desk.said(f"redone: set 0x1017 DefaultValue={value}")
    assert changes(ODD, desk.download()) == ["-DefaultValue=500\r\n", "+DefaultValue=2\r\n"]


def test_an_edit_that_causes_a_lint_error_is_refused_and_changes_nothing(desk: Desk) -> None:
    desk.choose("0x6064")
    desk.set("PDOMapping", value=False)
    said = desk.press("apply")
    assert said.startswith("not changed: line ")
    assert "maps 0x6064 sub 0, whose PDOMapping is not 1" in said
    desk.choose("0x1017")
    desk.set("DefaultValue", "70000")
    assert "expected UNSIGNED16, 0..65535" in desk.press("apply")
    assert desk.download() == ODD


def test_objects_are_added_renamed_and_removed(desk: Desk) -> None:
    desk.page.run("document.querySelector('.adder').open = true")
    for name, value in {"index": "0x2101", "name": "Filter time"}.items():
        desk.page.run(f"""document.querySelector('[data-focus="new {name}"]').value = '{value}'""")
    assert desk.press("add").startswith('add 0x2101 "Filter time" kind=VAR type=UNSIGNED16 access=rw map=0')
    assert desk.page.text(".object-form .id") == "0x2101", "what is new is chosen"
    desk.set("ParameterName", "Time constant")
    assert desk.press("apply") == 'set 0x2101 "ParameterName=Time constant"'
    assert b"[2101]\r\nParameterName=Time constant\r\n" in desk.download()
    assert desk.press("Remove") == "remove 0x2101"
    assert desk.download() == ODD


def test_a_sub_index_is_added_to_a_record(desk: Desk) -> None:
    desk.choose("0x2000")
    desk.page.click('[data-focus="Add a sub-index"]')
    assert desk.page.run("""document.querySelector('[data-focus="new sub-index"]').value""") == "4"
    desk.page.run("""document.querySelector('[data-focus="new name"]').value = 'Load'""")
    assert desk.press("add").startswith("add 0x2000:4 Load type=UNSIGNED16")
    assert b"[2000sub4]\r\nParameterName=Load\r\n" in desk.download()


def choose_pdo(desk: Desk, name: str) -> None:
    desk.page.run(f"""(found => {{ found.value = '{name}'; found.dispatchEvent(new Event('change')); }})
        (document.querySelector('[data-focus=pdo]'))""")


def test_a_mapping_is_changed_by_drag(desk: Desk) -> None:
    choose_pdo(desk, "TPDO1")
    assert desk.mapped() == ["Motor: Speed", "Motor: Current", "Position actual value"]
    desk.page.drag(".entry:nth-child(3)", ".pdo-bits", along=0.01)  # before the first one
    desk.said("map TPDO1 0x6064:0 0x2000:1 0x2000:2")
    assert desk.mapped() == ["Position actual value", "Motor: Speed", "Motor: Current"]
    choose_pdo(desk, "RPDO1")
    desk.page.drag(".item[data-key='24676']", ".pdo-bits", along=0.9)  # 0x6064
    desk.said("not changed: ...")
    assert desk.answer().endswith("E641 RPDO 1 maps 0x6064 sub 0, which is ro")
    choose_pdo(desk, "TPDO2")
    desk.page.drag(".item[data-key='24676']", ".pdo-bits", along=0.9)
    desk.said("map TPDO2 0x6064")
    assert b"NrOfTXPDO=2\r\n" in desk.download()


def test_a_mapping_is_changed_by_keys(desk: Desk) -> None:
    choose_pdo(desk, "TPDO1")
    desk.page.run("document.querySelector('.entry').focus()")
    desk.key("ArrowRight", SHIFT)
    desk.said("map TPDO1 0x2000:2 0x2000:1 0x6064:0")
    assert desk.page.run("document.activeElement.textContent").startswith("Motor: Speed"), "what was moved is in focus"
    desk.key("ArrowRight")
    desk.key("Delete")
    desk.said("map TPDO1 0x2000:2 0x2000:1")
    assert desk.mapped() == ["Motor: Current", "Motor: Speed"]
    assert "bits 16 to 31" in desk.page.text(".entry-line")
    desk.page.run("""document.querySelector(".item[data-key='24676']").focus()""")
    desk.key("m")
    desk.said("map TPDO1 0x2000:2 0x2000:1 0x6064")
    lines = ["DefaultValue=0x20000110\r\n", "DefaultValue=0x20000210\r\n"]
    assert sorted(changes(ODD, desk.download())) == [f"{sign}{line}" for sign in "+-" for line in lines]


def test_a_profile_is_inserted_and_its_findings_are_at_their_objects(desk: Desk) -> None:
    desk.page.run("""(found => { found.value = '402'; found.dispatchEvent(new Event('change')); })
        (document.querySelector('[data-focus=profile]'))""")
    desk.said("insert profile 402...")
    assert desk.page.run("document.querySelector('.item[data-key=\"24640\"]') !== null"), "0x6040 is there"
    desk.choose("0x2100")
    assert "W442" in desk.page.text(".object-form .finding-list")
    desk.page.click(".findings summary")
    desk.page.wait("document.querySelectorAll('.findings .finding-list li').length > 0")
    desk.press("Undo")
    assert desk.download() == ODD


BROKEN = [
    ("picture.png", b"\x89PNG\r\n\x1a\n\0\0\0\rIHDR", "picture.png: not a readable EDS: "),
    ("empty.eds", b"", "empty.eds: not a readable EDS: no section describes a device or an object"),
    ("text.eds", b"Dear all,\nwe are on holiday.\n", "text.eds: not a readable EDS: "),
    ("header.eds", MOTOR.replace(b"[1017]", b"[1017"), "header.eds: not a readable EDS: line 127: a malformed"),
    ("motor.xdd", b"<?xml version='1.0'?><a/>", "motor.xdd: a device description in XML; `export eds` makes"),
    ("huge.eds", b";" * (LARGEST + 1), "huge.eds: 4194305 bytes; the page edits files of up to 4 MB"),
]


@pytest.mark.parametrize(("name", "data", "said"), BROKEN, ids=[each[0] for each in BROKEN])
def test_a_file_that_is_no_eds_is_one_line_and_leaves_the_others(
    name: str, data: bytes, said: str, desk: Desk, tmp_path: Path
) -> None:
    (tmp_path / name).write_bytes(data)
    desk.drop(tmp_path / name)
    assert desk.answer().startswith(said)
    assert desk.download() == ODD


def test_a_file_that_is_dropped_is_edited_beside_the_others_and_never_saved(desk: Desk, tmp_path: Path) -> None:
    other = tmp_path / "other.dcf"
    other.write_bytes(MOTOR)
    desk.choose("0x1017")
    desk.set("DefaultValue", "1")
    desk.press("apply")
    desk.drop(other)
    desk.said("other.dcf is open")
    desk.choose("0x1017")
    desk.set("DefaultValue", "7")
    desk.press("apply")
    assert desk.page.run("document.querySelector('[data-focus=Save]').hidden")
    assert desk.download("other.dcf") == MOTOR.replace(b"DefaultValue=500", b"DefaultValue=7")
    assert desk.page.run(
        "[...document.querySelectorAll('[data-focus=file] option')].map(each => each.textContent)"
    ) == [
        "● other.dcf",
        "● motor.eds",
    ]


def test_a_file_that_was_changed_on_disk_is_not_overwritten(desk: Desk) -> None:
    desk.choose("0x1017")
    desk.set("DefaultValue", "1")
    desk.press("apply")
    assert desk.press("Save") == "motor.eds saved"
    assert desk.file.read_bytes() == ODD.replace(b"=500", b"=1")
    desk.set("DefaultValue", "2")
    desk.press("apply")
    desk.file.write_bytes(MOTOR)
    assert desk.press("Save") == "not saved: motor.eds was changed on the disk since it was opened; download yours"
    assert desk.file.read_bytes() == MOTOR


@pytest.mark.parametrize("control", [False])
def test_without_control_there_is_no_save(desk: Desk) -> None:
    assert desk.page.run("document.querySelector('[data-focus=Save]').hidden")


def test_the_files_of_a_live_network_can_be_opened(tmp_path: Path, window: Page) -> None:
    name = channel()
    with live_page(name, tmp_path) as served:
        window.open(served.address)
        window.wait("connection.alive")
        window.click("#tab-files")
        window.wait("document.querySelectorAll('[data-focus=file] optgroup option').length > 1")
        window.run("""(found => { found.selectedIndex = 1; found.dispatchEvent(new Event('change')); })
            (document.querySelector('[data-focus=file]'))""")
        window.wait("document.querySelectorAll('.item').length > 10")
        assert window.run("isUnsaved()") is False
        window.may_lose_its_server = True


def test_a_file_is_edited_by_the_keyboard_alone(desk: Desk) -> None:
    """Find an object, change it, map it, undo all."""
    choose_pdo(desk, "TPDO1")
    desk.page.press("/")
    for letter in "Target":
        desk.page.press(letter)
    desk.page.wait("document.querySelectorAll('.item').length === 1")
    desk.page.call("Input.dispatchKeyEvent", type="keyDown", key="Tab", code="Tab", windowsVirtualKeyCode=9)
    assert desk.page.run("document.activeElement.textContent").startswith(":3Motor: Target speed")
    desk.key("Enter")
    desk.page.wait("document.querySelector('.object-form .id')?.textContent === '0x2000:3'")
    desk.page.run("document.querySelector('[data-focus=\"field DefaultValue\"]').select()")
    desk.page.run("document.querySelector('[data-focus=\"field DefaultValue\"]').focus()")
    desk.page.press("7")
    desk.page.call(
        "Input.dispatchKeyEvent", type="keyDown", key="Enter", code="Enter", windowsVirtualKeyCode=13, text="\r"
    )
    desk.said("set 0x2000:3 DefaultValue=7")
    assert desk.page.run("document.activeElement.dataset.focus") == "field DefaultValue"
