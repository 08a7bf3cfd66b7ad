"""What the view of files is answered: by its functions, and by the server that lets nobody else ask."""

from __future__ import annotations

import http.client
import json
from collections.abc import Iterator
from contextlib import closing
from pathlib import Path
from typing import Any
from urllib.parse import urlsplit

import pytest

from eurobot_od.web import editor as editor_module
from eurobot_od.web import server
from eurobot_od.web.access import AccessRules
from eurobot_od.web.editor import EditableFile, FileEditor
from tests.web.scene import LONG, serving

DOCS = Path(__file__).parents[2] / "docs"
MOTOR = (DOCS / "motor.eds").read_bytes()
TEXT = MOTOR.decode("latin-1")


@pytest.fixture
def motor(tmp_path: Path) -> Path:
    file = tmp_path / "motor.eds"
    file.write_bytes(MOTOR)
    return file


def asked(editor: FileEditor, **said: Any) -> Any:
    """Return what a request is answered."""
    answer = json.loads(editor.answer(json.dumps(said)))
    return answer.get("ok", answer.get("error"))


NOBODYS = FileEditor(lambda: ())
"""The editor of a page that has no file of the disk."""


def edited(*words: str, data: bytes = MOTOR, name: str = "motor.eds") -> Any:
    return asked(NOBODYS, do="edit", name=name, text=data.decode("latin-1"), words=words)


def test_an_edit_is_that_of_the_command_and_says_what_it_changes() -> None:
    made = edited("set", "1017", "DefaultValue=250")
    assert made["text"] == TEXT.replace("DefaultValue=500", "DefaultValue=250")
    assert [each for each in made["changed"] if each[0] in "+-"] == ["-DefaultValue=500", "+DefaultValue=250"]


@pytest.mark.parametrize(
    "data",
    [MOTOR.replace(b"\n", b"\r\n"), MOTOR.replace(b"\n", b"\r"), b"\xef\xbb\xbf" + MOTOR,
     MOTOR.replace(b"Producer heartbeat time", b"Herzschl\xe4ge"),
     MOTOR.replace(b"Producer heartbeat time", "Herzschläge".encode()),
     MOTOR.replace(b"Producer heartbeat time", "Пульс".encode("cp1251"))],
    ids=["CRLF", "CR", "byte order mark", "Latin-1", "UTF-8", "Windows-1251"],
)  # fmt: skip
def test_every_byte_of_any_encoding_comes_back(data: bytes) -> None:
    made = edited("set", "1017", "DefaultValue=250", data=data)
    assert made["text"].encode("latin-1") == data.replace(b"DefaultValue=500", b"DefaultValue=250")


def test_objects_pdos_and_findings_are_data() -> None:
    found = asked(NOBODYS, do="look", name="motor.eds", text=TEXT)
    (motor,) = (each for each in found["objects"] if each["index"] == 0x2000)
    assert (motor["kind"], motor["own"], [each["name"] for each in motor["variables"]]) == (
        "RECORD", False, ["Highest sub-index supported", "Speed", "Current", "Target speed"],
    )  # fmt: skip
    assert motor["variables"][1]["entries"]["datatype"] == "0x0003"
    assert [each["object"] for pdo in found["pdos"] if pdo["name"] == "TPDO1" for each in pdo["entries"]] == [
        "0x2000:1", "0x2000:2", "0x6064:0",
    ]  # fmt: skip
    names = [each["name"] for pdo in found["pdos"] if pdo["name"] == "TPDO1" for each in pdo["entries"]]
    assert names == ["Motor: Speed", "Motor: Current", "Position actual value"]
    assert [(each["code"], each["level"], each["index"], each["sub"]) for each in found["findings"]] == [
        ("W442", "warning", 0x2100, None)
    ]


def test_a_finding_without_an_object_belongs_to_the_file() -> None:
    found = asked(NOBODYS, do="look", name="other.eds", text=TEXT)["findings"]
    assert {(each["index"], each["sub"]) for each in found if each["code"] != "W442"} == {(None, None)}


REFUSED: list[tuple[dict[str, Any], str]] = [
    ({"do": "edit", "name": "m.eds", "text": TEXT, "words": ["map", "TPDO1", "2100"]},
     "not changed: line 322: E637 TPDO 1 maps 0x2100 sub 0, whose PDOMapping is not 1"),
    ({"do": "edit", "name": "m.eds", "text": TEXT, "words": ["set", "1017", "DefaultValue=70000"]},
     "1017: DefaultValue '70000': expected UNSIGNED16, 0..65535"),
    ({"do": "edit", "name": "m.eds", "text": TEXT, "words": ["set", "1017"]}, "write set OBJECT KEY=VALUE..."),
    ({"do": "edit", "name": "m.eds", "text": TEXT, "words": ["move", "1017"]}, "unknown edit 'move'; did you mean"),
    ({"do": "edit", "name": "m.eds", "text": TEXT, "words": [7]}, "words are a list of texts"),
    ({"do": "edit", "name": "m.eds", "text": TEXT, "words": []}, "words are a list of texts"),
    ({"do": "edit", "name": "m.eds", "text": "Пульс", "words": ["set"]}, "text is the bytes of a file"),
    ({"do": "edit", "name": "m.eds", "words": ["set"]}, "text is missing, or not a text"),
    ({"do": "look", "name": "m.eds", "text": "\0" * 9}, "m.eds: not a readable EDS: "),
    ({"do": "look", "name": "m.eds", "text": "[x]\na=1\n"}, "m.eds: not a readable EDS: no section describes a"),
    ({"do": "open", "file": "/etc/passwd"}, "/etc/passwd is no file of this page"),
    ({"do": "save", "file": "/etc/passwd", "digest": "", "text": TEXT}, "this page saves nothing: start the server"),
    ({"do": "leave"}, "unknown request 'leave'"),
]  # fmt: skip


@pytest.mark.parametrize(("said", "why"), REFUSED, ids=[each[1][:40] for each in REFUSED])
def test_a_request_that_cannot_be_is_answered_in_one_line(said: dict[str, Any], why: str) -> None:
    answer = asked(NOBODYS, **said)
    assert answer.startswith(why)
    assert answer.isprintable()


@pytest.mark.parametrize("body", ["", "[", "7", "[" * 100_000, '{"do": 1e999}', "\ufffd"])
def test_malformed_requests_are_answered(body: str) -> None:
    assert "error" in json.loads(NOBODYS.answer(body))


def test_a_file_that_is_too_large_is_neither_looked_at_nor_made(monkeypatch: pytest.MonkeyPatch) -> None:
    assert asked(NOBODYS, do="look", name="m.eds", text=" " * ((4 << 20) + 1)).endswith(" files of up to 4 MB")
    monkeypatch.setattr(editor_module, "LARGEST", len(MOTOR))
    assert "bytes; the page edits files of up to" in asked(NOBODYS, do="look", name="m.eds", text=TEXT + " ")
    assert "bytes; the page edits files of up to" in edited("insert", "profile", "402")


# On the disk


def test_files_are_listed_once_and_only_those_that_can_be_edited() -> None:
    rows = {"named": ["motor.eds"], "library": ["motor.eds", "other.xdd"], "network": ["Axis.DCF"]}
    files = [EditableFile(Path(name), origin) for origin, names in rows.items() for name in names]
    found = asked(FileEditor(lambda: files), do="list")
    assert [(each["name"], each["origin"]) for each in found["files"]] == [
        ("motor.eds", "named"), ("Axis.DCF", "network"),
    ]  # fmt: skip
    assert found["profiles"] == ["301", "401", "402"]


@pytest.mark.parametrize("control", [False, True])
def test_only_with_control_a_file_is_saved_and_none_of_this_program(control: bool, motor: Path) -> None:
    ours = editor_module.PROGRAM / "ours.eds"
    editor = FileEditor(lambda: [EditableFile(motor, "named"), EditableFile(ours, "network")], control)
    assert [each["saves"] for each in asked(editor, do="list")["files"]] == [control, False]
    said = asked(editor, do="save", file=str(ours), digest="", text=TEXT)
    assert said.startswith("not saved: ours.eds is a part of this program" if control else "this page saves nothing")


def test_a_save_writes_while_the_file_is_the_one_that_was_opened(motor: Path) -> None:
    editor = FileEditor(lambda: [EditableFile(motor, "named")], control=True)
    digest = asked(editor, do="open", file=str(motor))["digest"]
    text = TEXT.replace("=500", "=250")
    digest = asked(editor, do="save", file=str(motor), digest=digest, text=text)["digest"]
    assert motor.read_text() == text
    assert asked(editor, do="save", file=str(motor), digest=digest, text=TEXT)["digest"] != digest
    assert asked(editor, do="save", file=str(motor), digest=digest, text=text) == (
        "not saved: motor.eds was changed on the disk since it was opened; download yours"
    )
    assert motor.read_bytes() == MOTOR


def test_a_text_that_is_no_eds_is_not_saved(motor: Path) -> None:
    editor = FileEditor(lambda: [EditableFile(motor, "named")], control=True)
    digest = asked(editor, do="open", file=str(motor))["digest"]
    assert "not a readable EDS" in asked(editor, do="save", file=str(motor), digest=digest, text="\0\1\2")
    assert motor.read_bytes() == MOTOR


# Over HTTP


@pytest.fixture
def address(motor: Path) -> Iterator[str]:
    editor = FileEditor(lambda: [EditableFile(motor, "named")], control=True)
    with serving(lambda: "", AccessRules("127.0.0.1", "secret"), editor=editor) as address:
        yield address


HEADERS = {"Cookie": "token-{port}=secret", "Origin": "http://{host}"}


def post(address: str, body: bytes, **headers: str | None) -> tuple[int, str]:
    """Send a request to the editor, without the headers that are None."""
    place = urlsplit(address)
    named = {**HEADERS, **{name.replace("_", "-"): value for name, value in headers.items()}}
    sent = {name: each.format(host=place.netloc, port=place.port) for name, each in named.items() if each is not None}
    with closing(http.client.HTTPConnection(place.hostname or "", place.port or 0, timeout=LONG)) as connection:
        connection.request("POST", "/files", body, sent)
        with connection.getresponse() as answer:
            return answer.status, answer.read().decode()


ASKERS: list[tuple[str, dict[str, str | None], int]] = [
    ("the page", {}, 200),
    ("nobody known", {"Cookie": None}, 401),
    ("another page", {"Origin": "http://evil.example"}, 403),
    ("no page", {"Origin": None}, 403),
    ("another host", {"Host": "evil.example"}, 403),
]


@pytest.mark.parametrize(("who", "headers", "status"), ASKERS, ids=[each[0] for each in ASKERS])
def test_only_the_page_may_ask(who: str, headers: dict[str, str | None], status: int, address: str) -> None:
    assert (who, post(address, b'{"do": "list"}', **headers)[0]) == (who, status)


def test_a_request_is_read_up_to_a_limit(monkeypatch: pytest.MonkeyPatch, address: str) -> None:
    monkeypatch.setitem(server.LONGEST_POSTS, "/files", 1000)
    assert post(address, b'{"do": "look", "name": "x.eds", "text": "' + b"x" * 2000 + b'"}')[0] == 413
