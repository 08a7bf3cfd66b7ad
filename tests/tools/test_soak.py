"""The soak: a short run with several processes, and that it sees what was not noticed, not counted, or has grown."""

from __future__ import annotations

import subprocess
import sys
from collections.abc import Iterator
from pathlib import Path

import pytest
import soak
from programs import Program
from soak import CREDIT, FaultRecord, Life, Loss, Losses, Role, Soak, Usage
from soak_node import NUMBERED

from eurobot_od.traffic.monitor import FRAMES_LOST

pytestmark = pytest.mark.skipif(not Path("/proc/self/status").exists(), reason="what a process has is Linux's to say")

SECONDS = 12


@pytest.mark.long
@pytest.mark.live
def test_each_injected_fault_is_noticed_recovered_and_counted() -> None:
    pytest.importorskip("can_remote")
    command = [sys.executable, soak.__file__, "--minutes", str(SECONDS / 60), "--remote", "--seed", "5"]
    done = subprocess.run(command, capture_output=True, text=True, timeout=600)
    assert done.stdout.splitlines()[-1].endswith(" faults, 0 wrong"), done.stdout + done.stderr
    assert (done.returncode, done.stderr) == (soak.FINE, "")


HAS = Usage(40_000, 4, 5)
LIVES = {
    "as before": (HAS, 1000, False),
    "an arena of the allocator": (HAS._replace(memory=41_000), 0, False),
    "what a table takes": (HAS._replace(memory=42_000), 10_000, False),
    "less of everything": (Usage(1, 1, 1), 1000, False),
    "2.5 kB a frame": (HAS._replace(memory=52_500), 5000, True),
    "a thread": (HAS._replace(threads=5), 1000, True),
    "a descriptor": (HAS._replace(descriptors=6), 1000, True),
}


@pytest.mark.parametrize(("end", "frames", "grown"), LIVES.values(), ids=LIVES)
def test_which_growth_counts(end: Usage, frames: int, grown: bool) -> None:
    assert Life(HAS, end, frames).has_grown is grown


LOST = {
    "counted before it is missed": ([(0.0, 3), (1.0, range(5))], 3),
    "counted after it is missed": ([(0.0, range(5)), (1.0, 3)], 3),
    "counted for other frames, long ago": ([(0.0, 3), (CREDIT + 1, range(5))], 0),
    "counted long afterwards": ([(0.0, range(5)), (CREDIT + 1, 3)], 0),
    "counted in parts": ([(0.0, 2), (1.0, range(5)), (2.0, 2), (3.0, 9)], 5),
    "not counted": ([(0.0, range(5))], 0),
}


@pytest.mark.parametrize(("events", "counted"), LOST.values(), ids=LOST)
def test_a_loss_is_excused_only_by_what_is_counted_around_its_time(
    events: list[tuple[float, int | range]], counted: int
) -> None:
    losses = Losses()
    for now, event in events:
        if isinstance(event, range):
            losses.miss(event, now)
        else:
            losses.count(event, now)
    assert sum(loss.counted for loss in losses.all) == counted


LINES = ("last 2, overflow 0, missed 0", "numbers 3..5 missing", "last 8, overflow 1, missed 1")


@pytest.fixture
def role() -> Iterator[Role]:
    """A process that prints what a node of the soak does, sees the numbers 0 to 8 except some, and ends."""
    role = Role("node", sys.executable, "-c", f"print({chr(10).join(LINES)!r})")
    role.program.wait()
    yield role
    role.kill()


def test_a_role_s_missing_numbers_are_read_from_its_lines(role: Role) -> None:
    assert (role.last, role.before) == (8, [range(2)])
    assert role.losses.all == [Loss(range(3, 6), counted=2)]


def test_counted_frames_excuse_no_number_of_the_time_without_bus() -> None:
    away = ("bus failed: pulled out; it is opened again", "bus back: after a gap of 1.0 s", "numbers 3..5 missing")
    lines = "\n".join(("last 2, overflow 0, missed 0", *away, "last 8, overflow 4, missed 0"))
    role = Role("node", sys.executable, "-c", f"print({lines!r})")
    role.program.wait()
    role.kill()
    assert role.losses.all == [Loss(range(3, 6), counted=0)]


def test_the_monitor_s_missing_numbers_are_read_from_its_lines() -> None:
    numbers = [f"0.1  {NUMBERED:03X}#{number.to_bytes(4, 'little').hex().upper()}" for number in (0, 4)]
    foreign = f"0.1  12345{NUMBERED:03X}#FFFFFFFF"  # it has an identifier of 29 bits
    lines = "\n".join([numbers[0], f"# {FRAMES_LOST.format(2)}", foreign, numbers[1]])
    role = Role("monitor", sys.executable, "-c", f"print({lines!r})")
    role.program.wait()
    role.kill()
    assert role.losses.all == [Loss(range(1, 4), counted=2)]


AGAIN = """
import pathlib, sys
file = pathlib.Path(sys.argv[1])
print("last 20, overflow 0, missed 0" if file.exists() else "last 8, overflow 1, missed 0")
file.touch()
"""


def test_numbers_sent_while_a_role_did_not_run_are_known(tmp_path: Path) -> None:
    role = Role("node", sys.executable, "-c", AGAIN, str(tmp_path / "was here"))
    role.program.wait()
    role.kill()
    role.start()
    role.program.wait()
    role.kill()
    assert (role.last, role.losses.all, role.before) == (20, [], [range(8), range(9, 20)])


def test_only_lines_printed_since_a_time_count(role: Role) -> None:
    assert not role.has_printed("missing", since=float("inf"))
    assert role.has_printed("missing", since=0.0)


def test_a_program_hands_on_its_lines_and_its_status() -> None:
    said: list[str] = []
    code = "import sys; print('one'); print('two', file=sys.stderr); sys.exit(3)"
    program = Program(sys.executable, "-c", code, took=said.append)
    assert program.wait() == 3
    assert sorted(said) == ["one", "two"]
    program.kill()


RECORDS = {
    "noticed and recovered": (FaultRecord("it", 1.0, 1.0), []),
    "not noticed": (FaultRecord("it", None, 1.0), ["it: not noticed"]),
    "not recovered": (FaultRecord("it", 1.0, None), ["it: not recovered"]),
}


class Past(Soak):
    """A soak that is over: one role, and numbers of which one second each was the time of sending."""

    def __init__(self, role: Role, *records: FaultRecord) -> None:
        self.records = list(records)
        self.wrong = []
        self.sent_at = [float(n) for n in range(9)]
        self.roles = {}
        self.monitor = role
        self.stands = []


@pytest.mark.parametrize(("records", "complaints"), RECORDS.values(), ids=RECORDS)
def test_a_fault_that_was_not_noticed_or_recovered_is_a_complaint(
    role: Role, records: FaultRecord, complaints: list[str]
) -> None:
    role.losses.all[0].counted = 3
    assert Past(role, records).complaints() == complaints


def test_each_number_is_received_or_its_loss_is_known(role: Role) -> None:
    past = Past(role)
    assert past.lost(role) == (4, 2, 0, 2, 1)
    assert past.complaints() == ["node: 1 frames uncounted"]
    role.away.append([4.0, 5.0])
    assert past.lost(role) == (4, 2, 2, 1, 0)


def test_numbers_missed_by_a_running_process_are_uncounted(role: Role) -> None:
    role.losses.all.clear()
    role.pauses[:] = [[0.0, 0.5]]
    assert Past(role).lost(role) == (7, 1, 0, 0, 1)
