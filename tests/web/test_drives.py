"""Drives of CiA 402 on the page: in a browser, and what the server does when nobody holds the button any more."""

from __future__ import annotations

import json
from collections.abc import Callable, Iterator, Mapping
from contextlib import contextmanager, suppress
from pathlib import Path
from types import MappingProxyType
from typing import Any, NamedTuple

import aiohttp
import can
import canopen
import pytest

from eurobot_od.bus.live import Live, open_bus
from eurobot_od.bus.simulated.network import ON_TIME
from eurobot_od.client.lifeline import LOST_AFTER
from eurobot_od.client.motion import AxisAddress, AxisObjects, MotionEnd
from eurobot_od.client.network import SimulatedNetwork, simulated
from eurobot_od.device.faults import DRIVE_FAULTS
from eurobot_od.device.nmt import NmtState
from eurobot_od.device.profiles import SimulatedDrive
from eurobot_od.errors import DriveError, LocalError
from eurobot_od.frame import Frame
from eurobot_od.od.cia402 import State
from eurobot_od.od.dictionary import Dictionary
from eurobot_od.od.sdo_channels import SdoChannel
from eurobot_od.od.values import Address
from eurobot_od.traffic.meaning import Decoder
from eurobot_od.web.drives import HELD, SILENT, STOPS, Drives, MayMove, axes_of, units
from eurobot_od.web.session import Session
from tests.bus.live.loose import until
from tests.client.servo import EDS, SERVO
from tests.eds_text import record
from tests.kit import plant
from tests.web.browser import Page
from tests.web.scene import Served, channel, live_page
from tests.web.test_server import answer, snapshot, talk

AXIS = AxisAddress(5, 1)
REQUESTS, TURNS = 0x605, bytes.fromhex("2B4060000F000000")
"""Where the drive is asked, and the request by which it begins to turn."""

NETWORK = Decoder([Dictionary.load(EDS, 5, "servo")])


class Bench(NamedTuple):
    served: Served
    drive: SimulatedDrive
    channel: str

    @property
    def session(self) -> Session:
        assert self.served.session is not None
        return self.served.session

    @property
    def velocity(self) -> float:
        return self.drive.axes[0].motor.velocity

    @property
    def state(self) -> State:
        return self.drive.axes[0].state

    def ask(self, **words: Any) -> Any:
        return talk(self.served, lambda opened: answer(opened, json.dumps({"id": 1, **words})))

    def drive_to(self, command: str) -> Any:
        return self.ask(do="drive", node="servo", axis=1, command=command)


@contextmanager
def bench(
    tmp_path: Path,
    control: bool = True,
    fault: str = "",
    given: Mapping[Address, int] = MappingProxyType({}),
    dictionary: Dictionary = SERVO,
) -> Iterator[Bench]:
    kind = DRIVE_FAULTS[fault].given_to(SimulatedDrive) if fault else SimulatedDrive
    name, drive = channel(), kind(dictionary, given=given)
    network = NETWORK if dictionary is SERVO else Decoder([dictionary])
    with (
        Live.node(open_bus("virtual", name), drive),
        # The drive is a thread of this process: on a loaded machine it may answer late.
        live_page(name, tmp_path, control, network=network, panels=(), answer_wait=5.0) as served,
    ):
        yield Bench(served, drive, name)


def open_drives(page: Page, served: Served) -> None:
    page.open(served.address)
    # What comes with the connection moves the tabs, and a click goes to a place.
    page.wait("connection.up && document.body.classList.contains('control') === connection.control")
    page.wait("!document.querySelector('.status.is-wrong')")
    page.click("#tab-drives")
    page.wait("document.querySelector('.machine .now')")


NOW = "document.querySelector('.machine .now text').textContent"


def test_only_a_device_with_the_profile_402_is_a_drive() -> None:
    assert [each.number for each in axes_of(SERVO)] == [1]
    assert axes_of(Dictionary.load(plant.FILES.folder() / "lift.eds", 2)) == []


FACTORS = record(0x608F, "Position encoder resolution", (1, "UNSIGNED32", "2000"), (2, "UNSIGNED32", "1")) + record(
    0x6096, "Velocity factor", (1, "UNSIGNED32", "60"), (2, "UNSIGNED32", "2000")
)


def test_values_are_told_in_the_units_of_the_factors_in_the_file(tmp_path: Path, window: Page) -> None:
    file = tmp_path / "factors.eds"
    file.write_text(EDS.read_text() + FACTORS)
    dictionary, name = Dictionary.load(file, 5, "servo"), channel()
    assert units(NETWORK.dictionaries[0], AXIS) == {}
    assert units(dictionary, AXIS) == pytest.approx({"position": 1 / 2000, "velocity": 1.0})
    with (
        Live.node(open_bus("virtual", name), SimulatedDrive(dictionary)) as live,
        live_page(name, tmp_path, network=Decoder([dictionary]), panels=()) as served,
    ):
        assert live
        open_drives(window, served)
        window.wait("document.querySelector('.facts').textContent.includes('position0 (0.000 turns)')")
        window.wait("document.querySelector('.facts').textContent.includes('velocity0 (0.000 1/min)')")


def test_the_state_machine_shows_where_the_drive_is(tmp_path: Path, window: Page) -> None:
    with bench(tmp_path) as scene:
        open_drives(window, scene.served)
        assert window.run(NOW) == "Switch on disabled"
        assert window.run("groupColour(sources[0], 'servo')") == "", "what the device sends is not faulty"
        window.run(
            "[...document.querySelectorAll('.drive button')].find(each => each.textContent === 'Enable').click()"
        )
        window.wait(f"{NOW} === 'Operation enabled'")
        assert window.text(".drive-state") == "Operation enabled"
        assert window.run("document.querySelector('.machine').getAttribute('aria-label')").endswith("Operation enabled")
        assert scene.state is State.ENABLED
        window.run("document.querySelector('.drive .halt').click()")
        window.wait(f"{NOW} === 'Switch on disabled'")


@pytest.mark.parametrize("width", [390, 820, 1440])
def test_the_state_machine_can_be_read(tmp_path: Path, window: Page, width: int) -> None:
    window.size(width)
    with bench(tmp_path) as scene:
        open_drives(window, scene.served)
        heights = "[...document.querySelectorAll('.machine text')].map(each => each.getBoundingClientRect().height)"
        assert window.run(f"Math.min(...{heights})") >= 11
        wide = """[...document.querySelectorAll('.machine g')].map(each => each.querySelector('rect')
            .getBoundingClientRect().width - each.querySelector('text').getBoundingClientRect().width)"""
        assert min(window.run(wide)) > 0, "each name fits its box"
        assert window.run("document.documentElement.scrollWidth - innerWidth") == 0


def test_on_a_phone_that_is_turned_nothing_is_wider_than_the_page(tmp_path: Path, window: Page) -> None:
    with bench(tmp_path) as drive:
        window.size(820)
        open_drives(window, drive.served)
        window.wait("document.querySelector('.drive canvas, .drive .plot svg')")
        window.size(390)
        window.wait("document.documentElement.scrollWidth === 390")  # not as wide as the plots were


def test_a_jog_turns_while_its_button_is_held_and_the_plots_show_it(tmp_path: Path, window: Page) -> None:
    with bench(tmp_path) as scene:
        scene.drive_to("enable")
        open_drives(window, scene.served)
        place = window.hold(".jog button:nth-of-type(2)")
        until(lambda: scene.velocity > 0)
        window.run(f"new Promise(done => setTimeout(done, {2000 * HELD}))")
        assert scene.velocity > 0, "it is said again and again that the button is held"
        window.wait("sources[0].frames.length > 0")
        window.wait("document.querySelectorAll('.drive .chart canvas').length === 2")
        window.release(place)
        until(lambda: abs(scene.velocity) < 0.001)
        assert scene.state is State.ENABLED, "halted, not switched off"


REFUSED = [  # what is typed as velocity, and as the person's own limit; what is said
    ("-500", "", "velocity = -500 is not allowed; allowed: 1..12000"),
    ("1000000000", "", "velocity = 1000000000 is not allowed; allowed: 1..12000"),
    ("500", "300", "velocity = 500 is not allowed; allowed: 1..300"),
    ("", "", "velocity is empty; allowed: 1..12000"),
    ("٣", "", "velocity = ٣ is not a whole number; allowed: 1..12000"),
    ("1_000", "", "velocity = 1_000 is not a whole number; allowed: 1..12000"),
]


def test_a_jog_out_of_bounds_is_refused_with_the_range(tmp_path: Path, window: Page) -> None:
    with bench(tmp_path) as scene:
        scene.drive_to("enable")
        open_drives(window, scene.served)
        window.wait("document.querySelector('.jog button').offsetParent")
        for velocity, limit, said in REFUSED:
            window.run(f"""(() => {{
                document.querySelector('.jog input').value = {json.dumps(velocity)};
                document.querySelector('.hint input').value = {json.dumps(limit)};
            }})()""")
            window.click(".jog button:nth-of-type(2)")
            assert window.text("#toast") == said
            assert not window.run("document.querySelector('.jog .held')")
        assert scene.velocity == 0


def test_a_jog_by_the_keyboard(tmp_path: Path, window: Page) -> None:
    with bench(tmp_path) as scene:
        scene.drive_to("enable")
        open_drives(window, scene.served)
        window.run("document.querySelector('.jog button').focus()")
        window.call("Input.dispatchKeyEvent", type="keyDown", key=" ")
        until(lambda: scene.velocity < 0)
        window.call("Input.dispatchKeyEvent", type="keyUp", key=" ")
        until(lambda: abs(scene.velocity) < 0.001)


def test_a_jog_whose_page_has_gone_is_halted(tmp_path: Path) -> None:
    with bench(tmp_path) as scene:
        assert scene.drive_to("enable")["ok"] is None
        assert scene.ask(do="jog", node="servo", axis=1, velocity=500)["ok"] is None
        until(lambda: scene.velocity > 0)
        until(lambda: abs(scene.velocity) < 0.001)
        assert scene.state is State.ENABLED


class Jogged(NamedTuple):
    """A drive in simulated time that is enabled, and what has it jog."""

    network: SimulatedNetwork
    drives: Drives

    @property
    def velocity(self) -> float:
        return self.network.devices[5].axes[0].motor.velocity  # type: ignore[attr-defined, no-any-return]

    def pass_time(self, seconds: float, held: bool = False) -> None:
        """Advance the time as a server does: what is due is sent, what comes is received."""
        end = self.network.master.clock() + seconds
        while self.network.master.clock() < end - 1e-9:
            if held:
                self.drives.hold(AXIS)
            self.drives.step()
            self.network.sleep(0.01)


@contextmanager
def jogging() -> Iterator[Jogged]:
    """An enabled drive, with nobody else."""
    with simulated(SimulatedDrive(SERVO)) as network:
        drives = Drives(network.master, [SERVO], network.master.clock)
        network.master.observers += (lambda cob_id, data, _: drives.hear(Frame(cob_id, data)),)
        drives.command(AXIS, "enable")
        yield Jogged(network, drives)


@pytest.fixture
def jogged() -> Iterator[Jogged]:
    with jogging() as scene:
        yield scene


def lost(scene: Jogged, chance: Callable[[Frame], bool]) -> None:
    """Lose the bus's frames for which `chance` is true."""
    scene.network.simulation.disturb = lambda _, frame: () if chance(frame) else ON_TIME


def test_a_jog_goes_on_while_it_is_held_and_ends_when_it_is_not(jogged: Jogged) -> None:
    jogged.drives.jog(AXIS, 500)
    jogged.pass_time(3 * HELD, held=True)
    assert jogged.velocity > 0
    jogged.pass_time(HELD + 0.5)
    assert abs(jogged.velocity) < 0.001
    assert jogged.drives.data()["moving"] == []
    assert jogged.network[5][0x60FF].value == 0


def test_the_entry_of_a_jog_goes_only_when_the_drive_stands(jogged: Jogged) -> None:
    jogged.drives.jog(AXIS, 500)
    jogged.pass_time(HELD, held=True)
    lost(jogged, lambda frame: frame.cob_id == REQUESTS)
    jogged.drives.stop(AXIS)
    jogged.pass_time(0.4)
    assert jogged.velocity > 0
    assert jogged.drives.stopping(AXIS)
    lost(jogged, lambda _: False)
    jogged.pass_time(0.5)
    assert abs(jogged.velocity) < 0.001
    assert jogged.drives.stopping(AXIS) is None


def test_a_jog_whose_answer_is_lost_is_halted_all_the_same(jogged: Jogged) -> None:
    simulation, network = jogged.network.simulation, jogged.network

    def hang(now: float, frame: Frame) -> None:
        if frame == Frame(REQUESTS, TURNS):  # it hears that, and neither answers nor hears the halt that follows
            simulation.plan(now + 1e-6, lambda: simulation.freeze(network.stations[5], now + 5.0))

    simulation.observers.append(hang)
    jogged.drives.hold(AXIS)
    with pytest.raises(DriveError, match="is not known to stand"):
        jogged.drives.jog(AXIS, 500)
    simulation.observers.remove(hang)
    jogged.pass_time(2.9)
    assert jogged.drives.stopping(AXIS)
    assert "is not known to stand" in jogged.drives.data()["wrong"][0]
    jogged.pass_time(2)
    assert abs(jogged.velocity) < 0.001


def test_a_stop_makes_orders_before_it_void(jogged: Jogged) -> None:
    ticket = jogged.drives.ticket(AXIS)
    jogged.drives.hold(AXIS)
    jogged.drives.stop(AXIS)
    with pytest.raises(LocalError, match="it was stopped meanwhile"):
        jogged.drives.jog(AXIS, 500, ticket=ticket)
    jogged.pass_time(1)
    assert jogged.velocity == 0


def test_an_order_is_refused_while_its_axis_is_being_stopped(jogged: Jogged) -> None:
    jogged.drives.stop(AXIS)
    with pytest.raises(LocalError, match="servo is still being stopped"):
        jogged.drives.jog(AXIS, 500)


@pytest.mark.parametrize("stop", ["halt", "quick stop", "disable"])
def test_nothing_turns_when_it_is_enabled_after_a_stop(jogged: Jogged, stop: str) -> None:
    """It turned at 1000 with nothing held: the target was still in the drive."""
    for value, target in ((1000, "velocity"), (50, "torque")):
        jogged.drives.command(AXIS, "enable")
        jogged.drives.jog(AXIS, value, target)
        jogged.pass_time(HELD, held=True)
        assert jogged.velocity != 0
        jogged.drives.stop(AXIS, STOPS[stop])
        jogged.pass_time(1)
        jogged.drives.command(AXIS, "enable")
        jogged.pass_time(1)
        assert abs(jogged.velocity) < 0.001


def test_a_move_goes_on_while_its_page_is_seen(jogged: Jogged) -> None:
    jogged.drives.command(AXIS, "move", {"position": 10_000_000, "velocity": 500})
    jogged.pass_time(1, held=True)
    assert jogged.velocity > 0
    jogged.pass_time(HELD + 0.5)
    assert abs(jogged.velocity) < 0.001


def test_a_move_that_is_slow_to_begin_is_not_taken_for_ended(jogged: Jogged) -> None:
    """The drive still says "target reached" of the set-point before, while the order is on its way."""
    begun = jogged.network.master.clock()

    def look(_now: float, _frame: Frame) -> None:  # as the motion thread does, while the order waits for answers
        if jogged.network.master.clock() > begun:
            jogged.drives.hold(AXIS)
            jogged.drives.step()

    jogged.network[5].drive402.choose(1)  # type: ignore[arg-type]
    jogged.network.sleep(0.2)
    jogged.network.simulation.observers.append(look)
    jogged.network.simulation.disturb = lambda _, frame: (0.2,) if frame.cob_id == REQUESTS else ON_TIME
    jogged.drives.command(AXIS, "move", {"position": 10_000_000, "velocity": 500})
    jogged.network.simulation.observers.remove(look)
    jogged.network.simulation.disturb = lambda *_: ON_TIME
    assert jogged.drives.data()["moving"] == [["servo", 1]]
    jogged.pass_time(HELD + 0.8)
    assert abs(jogged.velocity) < 0.001


def test_a_move_that_is_there_needs_nobody_any_more(jogged: Jogged) -> None:
    jogged.drives.command(AXIS, "move", {"position": 2000})
    jogged.pass_time(2, held=True)
    assert jogged.drives.data()["moving"] == []
    assert jogged.network[5].drive402.position == pytest.approx(2000, abs=50)


def test_a_homing_that_is_slow_to_begin_is_not_taken_for_ended() -> None:
    """The drive says that it has homed, of the time before, until it begins anew."""
    end, word = MotionEnd(AxisObjects(AXIS, SdoChannel.default(5), SERVO), 0.0, homing=True), 0x1427
    answers = {0.1: word, 0.2: word, 0.3: 0x0027, 0.9: 0x0027, 1.0: word, 1.2: word}
    for at, said in answers.items():
        assert end.receive(Frame(0x585, bytes.fromhex("4B416000") + said.to_bytes(4, "little")), at)
        assert not end.done
    end.receive(Frame(0x585, bytes.fromhex("4B416000") + word.to_bytes(4, "little")), 1.5)
    assert end.done


JOGS_BY_RPDO = Frame(0x405, bytes.fromhex("0F00E8030000"))
"""RPDO 3: enabled, with a target velocity of 1000."""


def sent_raw(scene: Jogged, who: object = None) -> None:
    """Turn the drive by a frame of its RPDO."""
    scene.network[5].drive402.choose(3)  # type: ignore[arg-type]
    scene.network[5].nmt.state = "OPERATIONAL"
    scene.drives.send_raw([AXIS], lambda: scene.network.master.send(*JOGS_BY_RPDO), who)
    scene.pass_time(1)
    assert scene.velocity > 0, "without being held"


@pytest.mark.parametrize(
    "end",
    [
        lambda drives: drives.end_raw([AXIS], "page"),  # it is no longer sent again and again
        lambda drives: drives.left("page"),
        lambda drives: drives.begin_end(),
        lambda drives: drives.stop(AXIS),
    ],
)
def test_a_motion_by_raw_frames_is_ended_at_rest(end: Callable[[Drives], object]) -> None:
    with jogging() as scene:
        sent_raw(scene, "page")
        assert scene.drives.is_raw([AXIS], "page")
        scene.drives.end_raw([AXIS], "another page")
        scene.drives.left("another page")
        scene.drives.hold(AXIS, "page")
        scene.pass_time(1)
        assert scene.velocity > 0
        end(scene.drives)
        assert not scene.drives.is_raw([AXIS], "page")
        scene.pass_time(1)
        assert abs(scene.velocity) < 0.001
        assert scene.network[5][0x60FF].value == 0


def test_the_drive_stands_when_what_was_sent_raw_is_left_by_a_program_that_is_killed(jogged: Jogged) -> None:
    sent_raw(jogged)
    jogged.network.sleep(LOST_AFTER + 0.3)
    assert abs(jogged.velocity) < 0.001


def test_a_motion_by_raw_frames_ends_once_its_page_is_silent(jogged: Jogged) -> None:
    """A page that was frozen, or the network to it cut, left the drive turning for up to 30 s."""
    sent_raw(jogged, "page")
    for _ in range(8):
        jogged.drives.hear_page("page")
        jogged.pass_time(0.5)
    assert jogged.velocity > 0
    jogged.pass_time(SILENT + 0.5)
    assert abs(jogged.velocity) < 0.001


def test_a_motion_by_raw_frames_ends_with_the_jog(jogged: Jogged) -> None:
    jogged.drives.jog(AXIS, 500, who="page")
    jogged.drives.send_raw([AXIS], lambda: None, "another page")
    jogged.pass_time(HELD + 0.5)
    assert abs(jogged.velocity) < 0.001


def test_raw_frames_queued_before_a_stop_are_not_sent(jogged: Jogged) -> None:
    ticket, sent = jogged.drives.ticket(AXIS), list[bool]()
    jogged.drives.stop(AXIS)
    with pytest.raises(LocalError, match="it was stopped meanwhile"):
        jogged.drives.send_raw([AXIS], lambda: sent.append(True), None, ticket)
    assert not sent


def test_no_frame_of_a_list_is_sent_once_what_it_moves_is_stopped(jogged: Jogged) -> None:
    jogged.drives.send_raw([AXIS], lambda: None, "page")
    with jogged.drives.raw_gate([AXIS], "page"):
        pass
    jogged.drives.stop(AXIS)
    with pytest.raises(LocalError, match="it was stopped"), jogged.drives.raw_gate([AXIS], "page"):
        raise AssertionError("it is let out")


JOGS = f"405#{JOGS_BY_RPDO.data.hex()}"
LIST = {"do": "begin list", "key": "a", "title": "it", "rows": [{"send": JOGS, "period": "20 ms"}]}


async def turned_by(opened: aiohttp.ClientWebSocketResponse, scene: Bench, **sent: Any) -> None:
    """Order the server to send RPDO 3, and wait until the drive turns."""
    for words in (
        {"do": "drive", "node": "servo", "axis": 1, "command": "enable"},
        {"do": "write", "node": "servo", "object": "0x6060", "value": "3", "sure": True},
        {"do": "nmt", "command": "start", "node": "servo", "sure": True},
        {**sent, "sure": True},
    ):
        assert "error" not in await answer(opened, json.dumps({"id": 1, **words}))
    while scene.velocity <= 0:
        await snapshot(opened)


@pytest.mark.parametrize(
    "end",
    [
        None,  # its page is closed
        {"do": "end list", "key": "a"},
        {"do": "drive", "node": "servo", "axis": 1, "command": "halt"},
        {"do": "drive", "node": "servo", "axis": 1, "command": "disable"},
        {"do": "stop"},
        {"do": "hidden"},
    ],
)
def test_a_list_ends_at_rest(tmp_path: Path, end: dict[str, Any] | None) -> None:
    """A page that was closed left its last target in the drive, and a halt met the next frame."""

    async def act(opened: aiohttp.ClientWebSocketResponse) -> None:
        await turned_by(opened, scene, **LIST)
        if end is not None:
            await answer(opened, json.dumps({"id": 1, **end}))
            # While the page is open: at its end, and by its own watch, the drive would stand as well.
            while abs(scene.velocity) > 0.001 or scene.drive.device.objects.kept((0x60FF, 0)) != 0:
                await snapshot(opened)
            while not (await snapshot(opened))["lists"]["a"]["ended"]:
                pass

    with bench(tmp_path) as scene:
        talk(scene.served, act)
        until(lambda: abs(scene.velocity) < 0.001)
        until(lambda: scene.drive.device.objects.kept((0x60FF, 0)) == 0)


def test_a_motion_ends_when_its_page_is_closed(tmp_path: Path) -> None:
    with bench(tmp_path) as scene:
        talk(scene.served, lambda opened: turned_by(opened, scene, do="send frame", frame=JOGS))
        until(lambda: abs(scene.velocity) < 0.001)


class Killed(BaseException):
    """The program is gone."""


@pytest.mark.parametrize(
    "order",
    [
        lambda drives: drives.jog(AXIS, 1000),
        lambda drives: drives.command(AXIS, "move", {"position": 10_000_000, "velocity": 500}),
    ],
)
def test_the_drive_stands_after_whatever_frame_the_program_is_killed(order: Callable[[Drives], object]) -> None:
    turned = []
    for frames in range(1, 26, 3):
        with jogging() as scene:
            send, left = scene.network.master.send, iter(range(frames))

            def counted(cob_id: int, data: bytes, send: Any = send, left: Iterator[int] = left) -> None:
                if next(left, None) is None:
                    raise Killed
                send(cob_id, data)

            scene.network.master.send = counted  # type: ignore[method-assign]
            with suppress(Killed):
                order(scene.drives)
                scene.pass_time(5, held=True)
            turned.append(abs(scene.velocity) > 0)
            scene.network.sleep(LOST_AFTER + 0.5)
            assert abs(scene.velocity) < 0.001
    assert any(turned)


MOVED = {"do": "send frame", "frame": "6A0#0600E8030000"}
"""A frame that moves nothing by the file."""


def test_the_guard_reads_what_the_drive_has_mapped(tmp_path: Path) -> None:
    """RPDO 3 had been moved before the server began: one click turned the drive."""
    with bench(tmp_path, given={(0x1402, 1): 0x6A0}) as scene:
        assert scene.ask(**MOVED)["asks"] == "it carries 0x6040:0 to servo, which commands a drive"


def test_a_drive_that_does_not_say_what_it_obeys_has_to_be_confirmed(tmp_path: Path) -> None:
    with bench(tmp_path) as scene:
        assert scene.ask(do="read", node="servo", object="0x1000")["ok"], "it is there"
        assert scene.ask(do="nmt", command="stop", node="servo")["ok"], "it answers no SDO then"
        until(lambda: scene.drive.device.state is NmtState.STOPPED)
        assert scene.ask(**MOVED)["asks"].startswith("which frames servo obeys now is not known: ")


def test_the_guard_hears_what_another_master_maps(tmp_path: Path) -> None:
    with bench(tmp_path) as scene, canopen.Network(open_bus("virtual", scene.channel)) as other:
        until(lambda: scene.ask(**MOVED).get("ok") == MOVED["frame"])  # of a drive that answers late it is not known
        other.notifier = can.Notifier(other.bus, other.listeners, 0.1)
        drive = other.add_node(5, str(EDS))
        seen = [scene.session.in_force]
        for written in (0x8000_0405, 0x6A0):
            drive.sdo[0x1402][1].raw = written
            until(lambda: scene.session.in_force is not seen[-1])
            seen.append(scene.session.in_force)
        assert scene.ask(**MOVED)["asks"].startswith("it carries 0x6040:0 to servo")
        # A reset takes that back; what was stored meanwhile nobody has heard, so it is read again.
        shown = scene.session.in_force
        scene.ask(do="nmt", command="reset communication", node="servo", sure=True)
        until(lambda: scene.session.in_force is not shown)
        assert scene.ask(**MOVED)["ok"] == MOVED["frame"]
        assert "asks" in scene.ask(do="send frame", frame="405#060000000000")


def test_the_drive_stands_when_the_program_is_killed(jogged: Jogged) -> None:
    jogged.drives.jog(AXIS, 1000)
    jogged.pass_time(1, held=True)
    assert jogged.velocity > 0
    jogged.network.sleep(LOST_AFTER + 0.3)  # nobody does a step
    assert abs(jogged.velocity) < 0.001


def test_the_heartbeat_consumer_of_a_drive_is_restored(jogged: Jogged) -> None:
    drive, before = jogged.network[5], (0, 1)
    jogged.drives.jog(AXIS, 100)
    assert (drive[0x1016, 1].value >> 16, drive[0x6007].value) == (127, 3)
    jogged.drives.begin_end()
    assert not jogged.drives.may_end, "it still turns"
    jogged.pass_time(0.5)
    assert jogged.drives.may_end
    jogged.drives.put_back()
    assert (drive[0x1016, 1].value, drive[0x6007].value) == before
    assert abs(jogged.velocity) < 0.001


GOES_ON = "servo: this drive goes on if this program or its adapter fails"


def blind_drive(folder: Path) -> Dictionary:
    """Return a drive that cannot watch us."""
    file = folder / "blind.eds"
    file.write_text(EDS.read_text().replace("6007", "6106"))  # its 0x6007 is somewhere else
    return Dictionary.load(file, 5, "servo")


def test_a_drive_that_cannot_watch_us_has_to_be_accepted_once(tmp_path: Path) -> None:
    blind = blind_drive(tmp_path)
    with simulated(SimulatedDrive(blind)) as network:
        scene = Jogged(network, Drives(network.master, [blind], network.master.clock))
        scene.drives.command(AXIS, "enable")
        with pytest.raises(MayMove, match=f"{GOES_ON}: it has no 0x6007"):
            scene.drives.jog(AXIS, 500)
        assert scene.velocity == 0
        scene.drives.accept(5)
        scene.drives.jog(AXIS, 500)
        scene.pass_time(0.3, held=True)
        assert scene.velocity > 0


@pytest.mark.parametrize(
    "order",
    [
        {"do": "send frame", "frame": JOGS},
        {"do": "send frame", "frame": "605#2B40600006000000"},
        LIST,
        {"do": "write", "node": "servo", "object": "0x6040", "value": "6"},
    ],
    ids=["RPDO", "SDO request", "list", "write"],
)
def test_raw_frames_to_a_drive_without_heartbeat_consumer_need_a_second_confirmation(
    tmp_path: Path, order: dict[str, Any]
) -> None:
    with bench(tmp_path, dictionary=blind_drive(tmp_path)) as scene:
        moves = scene.ask(**order)["asks"]
        assert "which commands a drive" in moves or moves.endswith("commands a drive")
        goes_on = scene.ask(**order, sure=True, confirmed=moves)["asks"]
        assert goes_on.startswith(GOES_ON)
        assert scene.drive.device.objects.kept((0x6040, 0)) == 0, "nothing was sent"
        assert scene.ask(**order, sure=True)["asks"] == goes_on, "nobody was asked that"
        assert "error" not in scene.ask(**order, sure=True, confirmed=goes_on)
        assert "asks" not in scene.ask(**order, sure=True), "once is enough"


def test_raw_frames_to_a_drive_that_does_not_answer_need_a_second_confirmation() -> None:
    with jogging() as scene:
        scene.network[5].nmt.state = "STOPPED"
        with pytest.raises(MayMove, match=GOES_ON) as question:
            scene.drives.send_raw([AXIS], lambda: None, "page")
        sent: list[bool] = []
        scene.drives.send_raw([AXIS], lambda: sent.append(True), "page", confirmed=str(question.value))
        assert sent


def test_a_click_for_each_question_sends_a_frame_to_a_drive_that_cannot_watch_us(tmp_path: Path, window: Page) -> None:
    button, reason = (f"document.querySelector('.send .sure {each}')" for each in ("button", ".reason"))
    with bench(tmp_path, dictionary=blind_drive(tmp_path)) as scene:
        open_drives(window, scene.served)
        window.click("#tab-send")
        window.run("document.querySelector('.send select').value = '(a frame as bytes)'")
        window.run("document.querySelector('.send select').dispatchEvent(new Event('change'))")
        window.run("document.querySelector('[placeholder=\"1A5\"]').value = '605'")
        window.run("document.querySelector('[placeholder=\"01 02 FF\"]').value = '2B 40 60 00 06 00 00 00'")
        for asked in ("0x6040:0 of servo commands a drive", GOES_ON):
            window.run(f"{button}.click()")
            window.wait(f"{reason}.textContent.startsWith({json.dumps(asked)})")
        assert scene.drive.device.objects.kept((0x6040, 0)) == 0
        window.run(f"{button}.click()")
        until(lambda: scene.drive.device.objects.kept((0x6040, 0)) == 6)


def test_stop_is_a_quick_stop_and_ends_a_jog(tmp_path: Path, window: Page) -> None:
    with bench(tmp_path) as scene:
        scene.drive_to("enable")
        open_drives(window, scene.served)
        scene.ask(do="jog", node="servo", axis=1, velocity=500)
        window.press("Escape")
        until(lambda: scene.state is State.DISABLED)
        window.wait("document.querySelector('#toast').textContent === 'stop sent: quick stop to servo'")
        window.wait("document.querySelector('.alarm').textContent.startsWith('servo stands, ')")
        window.wait(f"{NOW} === 'Switch on disabled'")
        scene.ask(do="hold", node="servo", axis=1)
        assert abs(scene.velocity) < 0.001


def test_a_fault_is_shown_and_reset(tmp_path: Path, window: Page) -> None:
    with bench(tmp_path) as scene:
        scene.drive_to("enable")
        open_drives(window, scene.served)
        scene.drive.axes[0].fault(0x2310)
        window.wait("document.querySelector('.drive-state').textContent === 'Fault: error code 0x2310'")
        assert window.run("document.querySelector('.machine .now').classList.contains('faulty')")
        refused = scene.ask(do="jog", node="servo", axis=1, velocity=5)
        assert refused["error"] == "enable the drive first: it is in Fault"
        window.run(
            "[...document.querySelectorAll('.drive button')].find(each => each.textContent === 'Fault reset').click()"
        )
        window.wait(f"{NOW} === 'Switch on disabled'")


@pytest.mark.parametrize(
    ("words", "error"),
    [
        ({"do": "drive", "node": "servo", "axis": 1, "command": "explode"}, "unknown command of a drive 'explode'"),
        ({"do": "drive", "node": "servo", "axis": 2, "command": "enable"}, "node 5 has no axis 2 of CiA 402"),
        ({"do": "drive", "node": "servo", "axis": "1", "command": "enable"}, "node 5 has no axis 1 of CiA 402"),
        ({"do": "drive", "node": "9", "axis": 1, "command": "enable"}, "node 9 has no axis 1 of CiA 402"),
        ({"do": "drive", "node": "servo", "axis": 1}, "command is missing, or not a text"),
        ({"do": "jog", "node": "servo", "axis": 1}, "velocity is missing, or not a whole number"),
        ({"do": "jog", "node": "servo", "axis": 1, "velocity": True}, "velocity is missing, or not a whole number"),
        (
            {"do": "jog", "node": "servo", "axis": 1, "velocity": 12_001},
            "velocity = 12001 is not allowed; allowed: -12000..12000",
        ),
        (
            {"do": "jog", "node": "servo", "axis": 1, "torque": -1001},
            "torque = -1001 is not allowed; allowed: -1000..1000",
        ),
        ({"do": "drive", "node": "servo", "axis": 1, "command": "move"}, "position is missing"),
        (
            {"do": "drive", "node": "servo", "axis": 1, "command": "move", "position": 2**31},
            "position = 2147483648 is not allowed",
        ),
        (
            {"do": "jog", "node": "servo", "axis": 1, "velocity": 5},
            "enable the drive first: it is in Switch on disabled",
        ),
    ],
)
def test_wrong_orders_of_a_drive_are_refused(tmp_path: Path, words: dict[str, Any], error: str) -> None:
    with bench(tmp_path) as scene:
        assert scene.ask(**words)["error"].startswith(error)
        assert scene.state is State.DISABLED


@pytest.mark.parametrize("do", ["drive", "jog", "hold"])
def test_without_control_a_drive_is_read_only(tmp_path: Path, window: Page, do: str) -> None:
    with bench(tmp_path, control=False) as scene:
        said = scene.ask(do=do, node="servo", axis=1, command="enable", velocity=5)
        assert said["error"] == "this page is read-only: start the server with --control"
        open_drives(window, scene.served)
        assert (
            window.run("[...document.querySelectorAll('.drive .buttons button')].some(each => each.offsetParent)")
            is False
        )


# STOP, in simulated time


def nmt_of(scene: Jogged, seconds: float) -> list[bytes]:
    """Return the NMT commands that are sent while some time passes."""
    sent: list[bytes] = []
    scene.network.simulation.observers.append(lambda _, frame: sent.append(frame.data) if frame.cob_id == 0 else None)
    scene.pass_time(seconds)
    return sent


def test_stop_reaches_every_node_that_was_heard(jogged: Jogged) -> None:
    jogged.drives.jog(AXIS, 1000)
    jogged.drives.hear(Frame(0x709, b"\5"))
    jogged.drives.hear(Frame(0x18A, b"\5"))  # a TPDO of node 10, by its COB-ID
    said = jogged.drives.stop_all()
    assert said == "quick stop to servo; NMT stop to node 9, node 10, and to all: no file describes node 9, node 10"
    sent = nmt_of(jogged, 0.5)
    assert abs(jogged.velocity) < 0.001
    assert sent[:2] == [bytes([2, 9]), bytes([2, 10])], "at once"
    assert bytes([2, 0]) in sent, "to all, once the axis stands"
    jogged.drives.hear(Frame(0x709, b"\4"))
    jogged.pass_time(2)
    data = jogged.drives.data()
    assert "node 9 is stopped (NMT)" in data["said"]
    assert [text.partition(":")[0] for text in data["wrong"]] == ["node 10 is not known to be stopped"]


def test_stop_of_known_drives_alone_leaves_them_where_they_can_be_asked(jogged: Jogged) -> None:
    assert jogged.drives.stop_all() == "quick stop to servo"
    assert nmt_of(jogged, 0.5) == []
    assert jogged.drives.data()["said"][0].startswith("servo stands, ")


def test_a_node_that_was_never_heard_does_not_count_as_stopped() -> None:
    other = Dictionary.load(EDS, 7, "other").renumbered(7)
    with simulated(SimulatedDrive(SERVO)) as network:
        scene = Jogged(network, Drives(network.master, [SERVO, other], network.master.clock))
        network.master.observers += (lambda cob_id, data, _: scene.drives.hear(Frame(cob_id, data)),)
        scene.drives.stop_all()
        scene.pass_time(1.5)
        wrong = scene.drives.data()["wrong"]
        assert len(wrong) == 1
        assert wrong[0].startswith("other is not known to stand: quick stop, disable voltage, NMT stop sent for")
        assert "nothing was heard of it since" in wrong[0]


# Controls do not move under the pointer


PLACES = """JSON.stringify([...document.querySelectorAll('.drive .controls button, .drive .controls input')]
    .filter(each => each.offsetParent).map(each => {
        const box = each.getBoundingClientRect();
        return [box.x, box.y, box.width, box.height].map(Math.round);
    }))"""


@pytest.mark.parametrize("width", [390, 820, 1440])
def test_no_control_moves_whatever_header_and_state_say(tmp_path: Path, window: Page, width: int) -> None:
    window.size(width)
    with bench(tmp_path) as scene:
        open_drives(window, scene.served)
        window.wait("document.querySelector('.jog button').offsetParent")
        before = window.run(PLACES)
        window.run("""(() => {
            document.querySelector('header .status span:nth-of-type(2)').textContent = 'a bus that is lost '.repeat(20);
            document.querySelector('.drive-state').textContent = 'Fault: error code 0x8611 '.repeat(9);
            document.querySelector('.drive .facts').textContent = 'long '.repeat(200);
        })()""")
        assert window.run(PLACES) == before


def test_no_control_moves_when_one_is_armed(tmp_path: Path, window: Page) -> None:
    """The button grew by "press again", and the next one came under the pointer."""
    with bench(tmp_path) as scene:
        open_drives(window, scene.served)
        window.wait("document.querySelector('.jog button').offsetParent")
        before = window.run(PLACES)
        buttons = "[...document.querySelectorAll('.drive button')].filter(each => each.offsetParent)"
        for name in ("Move to", "Move by", "Step response", "Home"):
            found = f"{buttons}.find(each => each.textContent === '{name}')"
            window.run(f"(button => {{ button.focus(); button.click(); }})({found})")
            assert window.run("document.querySelector('.armed').textContent") == f"{name}: press again"
            assert window.run(PLACES) == before
        window.click("#tab-send")
        window.wait("document.querySelector('form.send select[aria-label=message]')")
        window.run("""(() => {
            const chosen = document.querySelector('form.send select[aria-label=message]');
            chosen.value = '(a frame as bytes)';
            chosen.dispatchEvent(new Event('change'));
            document.querySelector('form.send [aria-label^=identifier]').value = '605';
            document.querySelector('form.send [aria-label^=bytes]').value = '2B 40 60 00 06 00 00 00';
        })()""")
        shown = PLACES.replace(".drive .controls", ".send")
        before = window.run(shown)
        window.run("document.querySelector('.sure button').click()")
        window.wait("document.querySelector('.sure .armed')")
        assert window.run(shown) == before


def test_no_control_touches_another(tmp_path: Path, window: Page) -> None:
    with bench(tmp_path) as scene:
        open_drives(window, scene.served)
        window.wait("document.querySelector('.jog button').offsetParent")
        boxes = json.loads(window.run(PLACES))
        apart = [
            max(x2 - x1 - w1, x1 - x2 - w2, y2 - y1 - h1, y1 - y2 - h2)
            for n, (x1, y1, w1, h1) in enumerate(boxes)
            for x2, y2, w2, h2 in boxes[n + 1 :]
        ]
        assert min(apart) >= 6


def test_no_velocity_is_invented(tmp_path: Path, window: Page) -> None:
    file = tmp_path / "none.eds"
    head, tail = EDS.read_text().split("[6081]", 1)
    file.write_text(f"{head}[6081]{tail.replace('DefaultValue=1000', '', 1)}")
    dictionary, name = Dictionary.load(file, 5, "servo"), channel()
    with (
        Live.node(open_bus("virtual", name), SimulatedDrive(dictionary)),
        live_page(name, tmp_path, network=Decoder([dictionary]), panels=()) as served,
    ):
        open_drives(window, served)
        assert window.run("document.querySelector('.jog input').value") == ""


@pytest.mark.parametrize("event", ["visibilitychange", "pagehide", "blur"])
def test_a_jog_ends_when_nobody_sees_the_page(tmp_path: Path, window: Page, event: str) -> None:
    with bench(tmp_path) as scene:
        scene.drive_to("enable")
        open_drives(window, scene.served)
        window.run("document.querySelector('.jog button').focus()")
        window.call("Input.dispatchKeyEvent", type="keyDown", key=" ")
        until(lambda: scene.velocity < 0)
        window.run(f"""(() => {{
            Object.defineProperty(document, 'hidden', {{get: () => true, configurable: true}});
            ('{event}' === 'visibilitychange' ? document : window).dispatchEvent(new Event('{event}'));
        }})()""")
        assert not window.run("document.querySelector('.jog .held')")
        until(lambda: abs(scene.velocity) < 0.001)
