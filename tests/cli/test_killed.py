"""Commands that are killed in the middle of each write: under each name stands the old file or the new one, whole."""

from __future__ import annotations

import re
import shutil
import subprocess
import sys
from pathlib import Path

import pytest

resource = pytest.importorskip("resource", reason="limits of a process are POSIX's")

ROOT = Path(__file__).parents[2]
FORMER = b"; what was there\n"
LOG = "(1.0) can0 605#4000100000000000\n(1.1) can0 585#4300100091010200\n(2.5) can0 185#0102030405060708\n"

WRITING = (
    "edit motor.eds set 0x1017 DefaultValue=700",
    "edit motor.eds set 0x1017 DefaultValue=700 -o out.eds",
    "lint --fix bad.eds -o out.eds",
    "make-eds device.yaml -o made",
    "new-device thermometer",
    "new-device gripper --package --eds motor.eds",
    "devices add motor.eds --library library",
    "export c --eds 5=motor.eds -o out.h",
    "export canopennode motor.eds -o made",
    "export dbc --eds 5=motor.eds -o out.dbc",
    "export docs --eds 5=motor.eds -o out.md",
    "export wireshark --eds 5=motor.eds -o out.lua",
    "export suite in.log --eds 5=motor.eds --node motor -o out.yaml",
    "export eds motor.eds -o out.eds",
    "export dcf 5=motor.eds -o out.dcf",
    "export cdcf motor.dcf -o out.bin",
    "export xdd motor.eds -o out.xdd",
    "diagnose in.log --eds 5=motor.eds --report out.html",
    "check --conformance --eds 5=motor.eds --simulate --tag nmt -q --junit out.xml",
    "check --conformance --eds 5=motor.eds --simulate --tag nmt -q --report out.html",
    "check --conformance --eds 5=motor.eds --tag nmt -o out.yaml",
    "export mcap in.log --eds 5=motor.eds -o out.mcap",
    "archive in.log -o season --eds 5=motor.eds",
)

TIME = re.compile(rb"\d{4}-\d\d-\d\d[ T]\d\d:\d\d:\d\d\S{0,6}")
"""When a report was made."""

BEGUN = b"it has begun, and has no results"
"""A report says so until its run has ended."""

PROGRAM = """
import os, signal, sys
moment, *words = sys.argv[1:]
from resource import RLIMIT_FSIZE, setrlimit
from eurobot_od.cli import main

def look(event, _):
    if event == moment:
        os.kill(os.getpid(), signal.SIGKILL)

if moment.isdecimal():  # the kernel kills whoever writes more bytes to a file, and then in the middle of the write
    signal.signal(signal.SIGXFSZ, signal.SIG_DFL)
    setrlimit(RLIMIT_FSIZE, (int(moment), int(moment)))
sys.addaudithook(look)
sys.exit(main(words))
"""


def bench(folder: Path) -> None:
    """Lay down what the commands read."""
    folder.mkdir()
    (folder / "library").mkdir()
    shutil.copy(ROOT / "docs" / "motor.eds", folder)
    dcf = (ROOT / "docs" / "motor.eds").read_text() + "\n[DeviceComissioning]\nNodeID=5\nBaudrate=500\n"
    (folder / "motor.dcf").write_text(dcf)
    bad = (ROOT / "docs" / "motor.eds").read_text().replace("ObjectType=0x7", "ObjectType=", 1)
    (folder / "bad.eds").write_text(bad)
    (folder / "in.log").write_text(LOG)
    table = (ROOT / "eurobot_od" / "cli" / "new_device_files" / "device" / "NAME.yaml.new").read_text()
    (folder / "device.yaml").write_text(table.replace("NAME", "device"))


def files(folder: Path) -> dict[str, bytes]:
    """Return the files under their own names; what a crash leaves beside them has another one."""
    found = {each.relative_to(folder): each for each in folder.rglob("*") if each.is_file()}
    own = {
        path: each
        for path, each in found.items()
        if each.suffix != ".new" and not any(part.startswith(".") for part in path.parts)
    }
    return {path.as_posix(): TIME.sub(b"", each.read_bytes()) for path, each in own.items()}


def run(words: str, folder: Path, moment: str = "") -> int:
    """Run a command in a folder, killed at a moment: after so many bytes of a file, or before an event of Python."""
    done = subprocess.run(
        [sys.executable, "-B", "-c", PROGRAM, moment, *words.split()],
        cwd=folder,
        capture_output=True,
        timeout=120,
        check=False,
    )
    assert b"Traceback" not in done.stderr, done.stderr
    return done.returncode


def check_killed(words: str, folder: Path) -> None:
    """Check that a command which is killed in any of its writes leaves whole files, and none less than before."""
    bench(folder / "before")
    bench(folder / "whole")
    before = files(folder / "before")
    assert run(words, folder / "whole") in (0, 1)
    whole = files(folder / "whole")
    made = {name: content for name, content in whole.items() if content != before.get(name)}
    former = before | {name: FORMER for name in made if name.startswith("out.")}
    longest = max(map(len, made.values()))
    for moment in ("0", str(longest // 2), str(longest - 1), "os.rename"):
        bench(place := folder / f"at {moment}")
        for name in former.keys() - before.keys():
            (place / name).write_bytes(FORMER)
        assert run(words, place, moment) < 0, "it is killed"
        left = files(place)
        wrong = {name for name, content in left.items() if content not in (former.get(name), whole.get(name))}
        assert not {name for name in wrong if BEGUN not in left[name]}
        assert former.keys() <= left.keys()


@pytest.mark.long
@pytest.mark.parametrize("words", WRITING)
def test_a_kill_leaves_the_old_file_or_the_new_one(words: str, tmp_path: Path) -> None:
    check_killed(words, tmp_path)
