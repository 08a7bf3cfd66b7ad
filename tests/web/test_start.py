"""The page that begins with nothing: what it offers, what it refuses, and from there to a bus and back in a browser."""

from __future__ import annotations

import asyncio
import json
from base64 import b64encode
from collections.abc import Sequence
from contextlib import suppress
from pathlib import Path
from typing import Any

import can
import pytest

from eurobot_od.bus.live import adapters
from eurobot_od.errors import BusError, LocalError
from eurobot_od.library.library import Library
from eurobot_od.web.start import BusChoice, LogChoice, SimulatedChoice, StartPage
from tests.cli.processes import command, line
from tests.kit.devices import MOTOR
from tests.web.browser import Page


def refused(choice: BusChoice) -> None:
    if choice.interface != "virtual":
        raise BusError(f"cannot open {choice.interface}")


def tried(log: Path) -> None:
    if b"#" not in log.read_bytes():
        raise LocalError(f"{log.name}: not a known log")


@pytest.fixture
def start(tmp_path: Path) -> StartPage:
    (tmp_path / "devices").mkdir()
    return StartPage(Library([tmp_path / "devices"]), tmp_path, True, refused, tried)


def ask(start: StartPage, **words: Any) -> Any:
    return json.loads(asyncio.run(start.answer(json.dumps(words))))


def sent(start: StartPage, file: Path) -> None:
    data = b64encode(file.read_bytes()).decode()
    assert ask(start, do="file", name=file.name, at=0, data=data) == {"ok": file.stat().st_size}


def test_a_file_that_is_dropped_is_in_the_library_and_can_be_simulated(start: StartPage) -> None:
    sent(start, MOTOR)
    (added,) = ask(start, do="add to library", file="motor.eds")["ok"]
    (device,) = ask(start, do="devices")["ok"]
    assert "motor.eds" in added
    assert device["name"].endswith("Motor controller")
    chosen = [{"file": device["file"], "node_id": number} for number in (5, 6)]
    assert ask(start, do="simulate", devices=chosen) == {"ok": None}
    assert start.choice == SimulatedChoice([(Path(device["file"]), 5), (Path(device["file"]), 6)])


def test_a_bus_is_chosen_only_if_it_can_be_opened(start: StartPage) -> None:
    words = {"do": "connect", "channel": "a", "bit_rate": 250_000}
    assert ask(start, interface="slcan", **words) == {"error": "cannot open slcan"}
    assert start.choice is None
    ask(start, interface="virtual", **words)
    assert start.choice == BusChoice("virtual", "a", 250_000)


def test_a_log_is_sent_or_chosen_from_the_folder(start: StartPage, tmp_path: Path) -> None:
    log = tmp_path / "friday.log"
    log.write_text("(1.0) can0 182#\n")
    assert ask(start, do="logs") == {"ok": ["friday.log"]}
    ask(start, do="open", log="friday.log")
    assert start.choice == LogChoice(log)
    start.choice = None
    sent(start, log)
    ask(start, do="open", file="friday.log")
    assert start.choice == LogChoice(log)


@pytest.mark.parametrize("is_sent", [True, False])
def test_a_file_that_is_no_log_is_refused_and_not_kept(start: StartPage, tmp_path: Path, is_sent: bool) -> None:
    letter = (tmp_path if not is_sent else tmp_path / "devices") / "letter.txt"
    letter.write_text("Dear")
    if is_sent:
        sent(start, letter)
    said = ask(start, do="open", **({"file": letter.name} if is_sent else {"log": letter.name}))
    assert said == {"error": "letter.txt: not a known log"}
    assert start.choice is None
    assert ask(start, do="logs") == {"ok": [] if is_sent else ["letter.txt"]}


def test_a_log_that_is_sent_replaces_no_other_of_its_name(start: StartPage, tmp_path: Path) -> None:
    (tmp_path / "friday.log").write_text("(1.0) can0 182#\n")
    (tmp_path / "devices" / "friday.log").write_text("(2.0) can0 183#\n")
    sent(start, tmp_path / "devices" / "friday.log")
    said = ask(start, do="open", file="friday.log")
    assert said == {"error": "friday.log is in the folder already, with another content: rename one of them"}
    assert (tmp_path / "friday.log").read_text() == "(1.0) can0 182#\n"


@pytest.mark.parametrize(
    ("words", "error"),
    [
        ({"do": "explode"}, "unknown request 'explode'"),
        ({"do": "simulate", "devices": []}, "choose 1 to 32 devices"),
        ({"do": "simulate", "devices": [{"file": "x", "node_id": 0}]}, "each device has a file and a node-ID 1..127"),
        ({"do": "simulate", "devices": [{"file": "x", "node_id": 5}]}, "unknown device 'x'"),
        ({"do": "open", "log": "../secret"}, "unknown log '../secret'"),
        ({"do": "file", "name": "../x.eds", "at": 0, "data": ""}, "'../x.eds': a file has letters"),
        ({"do": "file", "name": "x.eds", "at": 5, "data": ""}, "x.eds: the part at 5 does not follow the 0 bytes"),
        ({"do": "file", "name": "x.eds", "at": 0, "data": "?"}, "x.eds: the part at 0 is not base64"),
        ({"do": "add to library", "file": "x.eds"}, "unknown file 'x.eds'"),
        ({"do": "listen", "interface": "virtual", "channel": "a", "bit_rate": 500_000}, "cannot listen silently"),
        ({"do": "listen", "interface": "socketcan", "channel": "can0", "bit_rate": 500_000}, "is the system's"),
    ],
    ids=str,
)
def test_wrong_requests_of_the_first_page_are_answered_in_one_line(
    start: StartPage, words: dict[str, Any], error: str
) -> None:
    said = ask(start, **words)
    assert error in said["error"]
    assert "\n" not in said["error"]


def test_without_control_other_machines_choose_nothing(tmp_path: Path) -> None:
    start = StartPage(Library([]), tmp_path, False, refused, tried)
    words = {"do": "connect", "interface": "virtual", "channel": "a"}
    assert ask(start, **words) == {"error": "this page is read-only: start the server with --control"}
    assert start.choice is None


class Adapter(can.BusABC):
    """An adapter on a bus of 250 kbit/s."""

    opened: Sequence[dict[str, Any]] = ()

    def __init__(self, ignore_config: bool, interface: str, channel: str, bitrate: int, **options: Any) -> None:
        super().__init__(channel=channel)
        assert (ignore_config, interface) == (True, "slcan")
        Adapter.opened = [*Adapter.opened, {"bitrate": bitrate, **options}]
        self._waiting = [can.Message(arbitration_id=0x705, data=[5])] * 3 if bitrate == 250_000 else []
        if bitrate == 125_000:
            self._waiting = [can.Message(arbitration_id=0x705), can.Message(is_error_frame=True)]

    def send(self, msg: can.Message, timeout: float | None = None) -> None:
        raise AssertionError("it must not send")

    def _recv_internal(self, timeout: float | None) -> tuple[can.Message | None, bool]:
        return (self._waiting.pop(0) if self._waiting else None), False


@pytest.mark.parametrize(("bit_rate", "frames"), [(500_000, 0), (250_000, 3), (125_000, 0)])
def test_a_bit_rate_is_found_by_listening_alone(monkeypatch: pytest.MonkeyPatch, bit_rate: int, frames: int) -> None:
    monkeypatch.setattr(can, "Bus", Adapter)
    assert adapters.frames_at("slcan", "/dev/ttyACM0", bit_rate, wait=0.01) == frames
    assert Adapter.opened[-1] == {"bitrate": bit_rate, "listen_only": True}


def test_an_adapter_without_listen_only_mode_does_not_listen() -> None:
    with pytest.raises(LocalError, match="usb2can cannot listen silently"):
        adapters.frames_at("usb2can", "0", 500_000)


def arrives(window: Page, expression: str) -> None:
    """Wait until an expression is true, also if another page is loaded meanwhile."""
    for _ in range(5):
        with suppress(AssertionError):  # the page that was asked is gone
            window.wait(expression)
            return
    raise AssertionError(f"never true: {expression}")


def words(text: str) -> str:
    """Return the button with some words, as an expression of the page."""
    return f"[...document.querySelectorAll('button')].find(each => each.textContent === {json.dumps(text)})"


def test_the_bus_of_the_last_time_is_offered(tmp_path: Path) -> None:
    last = BusChoice("slcan", "/dev/ttyACM0", 250_000)
    start = StartPage(Library(()), tmp_path, True, refused, tried, last)
    said = start.page().partition('"last":')[2].partition("}")[0]
    assert json.loads(said + "}") == {"interface": "slcan", "channel": "/dev/ttyACM0", "bit_rate": 250_000}


def test_a_workspace_keeps_its_bus_and_the_first_page_leads_to_the_files_and_back(window: Page, tmp_path: Path) -> None:
    labels = "['interface of python-can', 'channel', 'bit rate']"
    fields = f"{labels}.map(each => document.querySelector(`[aria-label='${{each}}']`).value).join()"
    with command("serve", str(tmp_path), "--control", "--listen", "127.0.0.1:0") as process:
        window.may_lose_its_server = True
        window.open(line(process, "http://127.0.0.1:").split()[0])
        window.run(f"{words('Edit device files')}.click()")
        arrives(window, "document.querySelector('#view-files:not([hidden])')")
        window.run(f"{words('Close')}.click()")
        arrives(window, "document.querySelector('.start')")
        window.run("document.querySelector('[aria-label=\"interface of python-can\"]').value = 'virtual'")
        window.run("document.querySelector('[aria-label=channel]').value = 'kept'")
        window.run("document.querySelector('[aria-label=\"bit rate\"]').value = '250000'")
        window.run(f"{words('Connect')}.click()")
        arrives(window, "typeof Tabs === 'function' && connection.alive")
        window.run(f"{words('Disconnect')}.click()")
        arrives(window, f"document.querySelector('.start') && {fields} === 'virtual,kept,250000'")
        process.terminate()
        process.communicate(timeout=30)
    kept = 'bus: {"interface": "virtual", "channel": "kept", "bit_rate": 250}'
    assert (tmp_path / "eurobot-od.yaml").read_text() == f"library: [devices]\n{kept}\n"


def test_from_nothing_to_a_simulated_bus_and_back(window: Page, tmp_path: Path) -> None:
    with command("serve", str(tmp_path), "--control", "--listen", "127.0.0.1:0") as process:
        window.may_lose_its_server = True
        window.open(line(process, "http://127.0.0.1:").split()[0])
        document = window.call("DOM.getDocument")["root"]["nodeId"]
        drop = window.call("DOM.querySelector", nodeId=document, selector=".start .card:nth-child(2) input[type=file]")
        window.call("DOM.setFileInputFiles", files=[str(MOTOR)], nodeId=drop["nodeId"])
        window.wait("document.querySelector('.start select option[value$=\"motor.eds\"]')")
        window.run(f"{words('Add')}.click()")
        window.run(f"{words('Simulate')}.click()")
        arrives(window, "document.querySelector('.messages') && connection.alive && connection.state.frames > 2")
        window.run(f"{words('Disconnect')}.click()")
        arrives(window, "document.querySelector('.start')")
        process.terminate()
        process.communicate(timeout=60)
    assert process.returncode == 0
    assert (tmp_path / "eurobot-od.yaml").read_text() == "library: [devices]\n"
    assert [each.name for each in (tmp_path / "devices").rglob("*.eds")] == ["motor.eds"]
