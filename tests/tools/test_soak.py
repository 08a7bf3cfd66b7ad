"""The soak: a short run with several processes, and that it sees what was not noticed, not counted, or has grown."""

from __future__ import annotations

import subprocess
import sys
from collections.abc import Iterator
from pathlib import Path

import pytest
import soak
from programs import Program
from soak import Life, Role, Soak, Told, Usage

pytestmark = pytest.mark.skipif(not Path("/proc/self/status").exists(), reason="what a process has is Linux's to say")

SECONDS = 12


@pytest.mark.live
def test_everything_that_goes_wrong_is_noticed_recovered_and_counted() -> None:
    pytest.importorskip("can_remote")
    command = [sys.executable, soak.__file__, "--minutes", str(SECONDS / 60), "--remote", "--seed", "5"]
    done = subprocess.run(command, capture_output=True, text=True, timeout=600)
    assert done.stdout.splitlines()[-1].endswith(" faults, 0 wrong"), done.stdout + done.stderr
    assert (done.returncode, done.stderr) == (soak.FINE, "")


HAS = Usage(40_000, 4, 5)
LIVES = {
    "as before": (HAS, False),
    "a little memory": (HAS._replace(memory=40_100), False),
    "less of everything": (Usage(1, 1, 1), False),
    "much memory": (HAS._replace(memory=80_000), True),
    "a thread": (HAS._replace(threads=5), True),
    "a descriptor": (HAS._replace(descriptors=6), True),
}


@pytest.mark.parametrize(("end", "grown"), LIVES.values(), ids=LIVES)
def test_what_has_grown(end: Usage, grown: bool) -> None:
    assert Life(HAS, end).has_grown is grown


LINES = ("last 2, overflow 0, missed 0", "numbers 3..5 missing", "last 8, overflow 1, missed 1")


@pytest.fixture
def role() -> Iterator[Role]:
    """A process that says what a node of the soak does, sees the numbers 0 to 8 but for some, and ends."""
    role = Role("node", sys.executable, "-c", f"print({chr(10).join(LINES)!r})")
    role.program.wait()
    yield role
    role.kill()


def test_what_a_role_lacks_is_read_from_its_lines(role: Role) -> None:
    assert (role.last, role.lost, role.before) == (8, [range(3, 6)], [])
    role.kill()
    assert role.counted == 2


AGAIN = """
import pathlib, sys
file = pathlib.Path(sys.argv[1])
print("last 20, overflow 0, missed 0" if file.exists() else "last 8, overflow 1, missed 0")
file.touch()
"""


def test_what_was_sent_while_it_did_not_run_is_known(tmp_path: Path) -> None:
    role = Role("node", sys.executable, "-c", AGAIN, str(tmp_path / "was here"))
    role.program.wait()
    role.kill()
    role.start()
    role.program.wait()
    role.kill()
    assert (role.last, role.lost, role.before, role.counted) == (20, [], [range(9, 20)], 1)


def test_what_is_told_since_a_time(role: Role) -> None:
    assert not role.has_said("missing", since=float("inf"))
    assert role.has_said("missing", since=0.0)


def test_a_program_hands_on_its_lines_and_its_status() -> None:
    said: list[str] = []
    code = "import sys; print('one'); print('two', file=sys.stderr); sys.exit(3)"
    program = Program(sys.executable, "-c", code, took=said.append)
    assert program.wait() == 3
    assert sorted(said) == ["one", "two"]
    program.kill()


TOLD = {
    "noticed and recovered": (Told("it", 1.0, 1.0), []),
    "not noticed": (Told("it", None, 1.0), ["it: not noticed"]),
    "not recovered": (Told("it", 1.0, None), ["it: not recovered"]),
}


class Past(Soak):
    """A soak that is over: one role, and numbers of which one second each was the time of sending."""

    def __init__(self, role: Role, *told: Told) -> None:
        self.told, self.wrong, self.sent_at = list(told), [], [float(n) for n in range(9)]
        self.roles, self.monitor = {}, role


@pytest.mark.parametrize(("told", "complaints"), TOLD.values(), ids=TOLD)
def test_what_was_neither_noticed_nor_recovered(role: Role, told: Told, complaints: list[str]) -> None:
    role.counted = 3
    assert Past(role, told).complaints() == complaints


def test_each_number_is_received_or_its_loss_is_known(role: Role) -> None:
    past = Past(role)
    assert past.lost(role) == (6, 0, 0, 0, 3)
    assert past.complaints() == ["node: 3 frames uncounted"]
    role.away.append([4.0, 5.0])
    assert past.lost(role) == (6, 0, 2, 0, 1)
    role.counted = 2
    assert past.lost(role) == (6, 0, 2, 1, 0)
