#!/usr/bin/env python3
"""Measures the EDS checker: wall time against dcfchk on a device of 200 objects, and growth up to 10 000 objects.

Rule of this file: programs take turns, so that a busy machine slows all of them; the middle of the times counts.
"""

from __future__ import annotations

import argparse
import os
import subprocess
import sys
import tempfile
import time
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from pathlib import Path
from statistics import median

PDOS = 16
"""RPDOs, and TPDOs, of the measured device."""
FIRST, SUBS = 0x2000, 4
BESIDE = str(Path(sys.executable).parent)
COMMANDS = {
    "python -c pass": [sys.executable, "-c", "pass"],
    "eurobot-od lint": [f"{BESIDE}/eurobot-od", "lint"],
    "dcfchk": [f"{BESIDE}/dcfchk", "-n", "5"],
}

ENVIRONMENT = {name: value for name, value in os.environ.items() if name != "PYTHONDONTWRITEBYTECODE"}
"""Installed programs have their bytecode beside them."""


def make_eds(count: int) -> str:
    """Write the EDS of a device with so many objects: PDOs, and data half in variables, half in records."""
    communication = [*([0x1000, 0x1001, 0x1017, 0x1018]), *_records(0x1400), *_records(0x1800)]
    data = range(FIRST, FIRST + max(count - len(communication), 2 * PDOS))
    parts = [_head(communication, data), *map(_communication, communication), *map(_data, data)]
    return "\n".join(parts)


def _records(start: int) -> list[int]:
    return [*range(start, start + PDOS), *range(start + 0x200, start + 0x200 + PDOS)]


def _head(communication: Sequence[int], data: Sequence[int]) -> str:
    rates = "".join(f"BaudRate_{rate}=1\n" for rate in (10, 20, 50, 125, 250, 500, 800, 1000))
    mandatory = [0x1000, 0x1001, 0x1018]
    lists = {
        "MandatoryObjects": mandatory,
        "OptionalObjects": [each for each in sorted(communication) if each not in mandatory],
        "ManufacturerObjects": data,
    }
    return (
        "[FileInfo]\nFileName=bench.eds\nFileVersion=1\nFileRevision=1\nEDSVersion=4.0\nDescription=bench\n"
        "CreationTime=09:30AM\nCreationDate=03-01-2014\nCreatedBy=bench\nModificationTime=09:30AM\n"
        "ModificationDate=03-01-2014\nModifiedBy=bench\n\n[DeviceInfo]\nVendorName=Example\nVendorNumber=1\n"
        f"ProductName=Bench\nProductNumber=1\nRevisionNumber=1\nOrderCode=B\n{rates}SimpleBootUpMaster=0\n"
        "SimpleBootUpSlave=1\nGranularity=8\nDynamicChannelsSupported=0\nGroupMessaging=0\n"
        f"NrOfRXPDO={PDOS}\nNrOfTXPDO={PDOS}\nLSS_Supported=0\n\n"
    ) + "\n".join(_list(name, indices) for name, indices in lists.items())


def _list(name: str, indices: Sequence[int]) -> str:
    entries = "".join(f"{number}=0x{index:04X}\n" for number, index in enumerate(indices, start=1))
    return f"[{name}]\nSupportedObjects={len(indices)}\n{entries}"


def _variable(name: str, type_: int, access: str, default: object, mappable: int = 0) -> str:
    return (
        f"[{name}]\nParameterName=Object {name}\nObjectType=0x7\nDataType=0x{type_:04X}\nAccessType={access}\n"
        f"DefaultValue={default}\nPDOMapping={mappable}\n"
    )


def _record(index: int, subs: Sequence[str]) -> str:
    head = f"[{index:04X}]\nParameterName=Record {index:04X}\nObjectType=0x9\nSubNumber={len(subs) + 1}\n"
    zero = _variable(f"{index:04X}sub0", 5, "const", len(subs))
    return "\n".join([head, zero, *subs])


def _communication(index: int) -> str:
    single = {0x1000: (7, "ro"), 0x1001: (5, "ro"), 0x1017: (6, "rw")}
    if index in single:
        return _variable(f"{index:04X}", *single[index], 0)
    if index == 0x1018:
        return _record(index, [_variable(f"1018sub{sub}", 7, "ro", 1) for sub in (1, 2, 3)])
    number, is_mapping = index & 0x1FF, bool(index & 0x200)
    return _mapping(index, number) if is_mapping else _pdo(index, number)


def _pdo(index: int, number: int) -> str:
    base = 0x180 if index >= 0x1800 else 0x200
    cob_id = f"$NODEID+0x{base + 0x100 * number:X}" if number < 4 else "0x80000000"
    values = ((7, cob_id), (5, 255), (6, 0), (5, 0), (6, 0))
    return _record(
        index, [_variable(f"{index:04X}sub{n}", type_, "rw", value) for n, (type_, value) in enumerate(values, start=1)]
    )


def _mapping(index: int, number: int) -> str:
    target = FIRST + number + (PDOS if index >= 0x1800 else 0)
    entry = f"0x{target:04X}{target % 2:02X}10"
    subs = [_variable(f"{index:04X}sub{n}", 7, "rw", entry if n == 1 else 0) for n in range(1, 9)]
    return _record(index, subs).replace("AccessType=const\nDefaultValue=8", "AccessType=rw\nDefaultValue=1")


def _data(index: int) -> str:
    access = "rww" if index < FIRST + PDOS else "rwr"
    if index % 2 == 0:
        return _variable(f"{index:04X}", 6, access, 0, 1)
    return _record(index, [_variable(f"{index:04X}sub{sub}", 6, access, 0, 1) for sub in range(1, SUBS + 1)])


def wall_times(file: Path, rounds: int) -> Iterator[tuple[str, float]]:
    """Run the programs in turns; give the middle time of each in seconds, without the first round."""
    times: dict[str, list[float]] = {name: [] for name in COMMANDS}
    for _ in range(rounds + 1):
        for name, command in COMMANDS.items():
            times[name].append(_seconds([*command, *([] if "pass" in command else [str(file)])]))
    return ((name, median(each[1:])) for name, each in times.items())


def growth(counts: Sequence[int], rounds: int) -> Iterator[tuple[int, float]]:
    """Give the seconds that `eurobot-od lint` takes for devices of so many objects, the best of `rounds`."""
    for count in counts:
        with bench_file(count) as file:
            yield count, min(_seconds([*COMMANDS["eurobot-od lint"], str(file)]) for _ in range(rounds))


@contextmanager
def bench_file(count: int) -> Iterator[Path]:
    """Write the EDS of a device with so many objects for a while."""
    with tempfile.TemporaryDirectory() as folder:
        file = Path(folder) / "bench.eds"
        file.write_text(make_eds(count))
        yield file


def _seconds(command: Sequence[str]) -> float:
    start = time.perf_counter()
    subprocess.run(command, capture_output=True, check=False, env=ENVIRONMENT)
    return time.perf_counter() - start


def main(arguments: Sequence[str] | None = None) -> int:
    """Print the measurements."""
    parser = argparse.ArgumentParser(description=(__doc__ or "").splitlines()[0])
    parser.add_argument("--objects", type=int, default=200, help="objects of the device in the comparison (200)")
    parser.add_argument("--rounds", type=int, default=15, help="how often each program runs (15)")
    options = parser.parse_args(arguments)
    with bench_file(options.objects) as file:
        measured = dict(wall_times(file, options.rounds))
    for name, seconds in measured.items():
        print(f"{name:16} {seconds * 1000:7.1f} ms")
    print(f"ratio to dcfchk  {measured['eurobot-od lint'] / measured['dcfchk']:7.2f}")
    for count, seconds in growth((100, 1000, 10_000), 3):
        print(f"{count:6} objects   {seconds * 1000:7.1f} ms, {seconds / count * 1e6:.0f} us each")
    return 0


if __name__ == "__main__":
    sys.exit(main())
