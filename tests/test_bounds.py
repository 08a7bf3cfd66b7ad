"""The bounds of SECURITY.md: ten times each is fed to a command, which says so in one line and takes little memory."""

from __future__ import annotations

import gzip
import shlex
import subprocess
import sys
import tracemalloc
from collections.abc import Callable
from functools import partial
from pathlib import Path
from random import Random

import pytest

pytest.importorskip("pyarrow", reason="the extra `season` is not installed")

import pyarrow as pa
from pyarrow import parquet as pq

from eurobot_od.frame import EXTENDED, Frame
from eurobot_od.od import document
from eurobot_od.season.results import MOST_BYTES, MOST_ROWS
from eurobot_od.support import files, yaml_places
from eurobot_od.traffic import entries, monitor
from eurobot_od.traffic.diagnosis import Diagnosis
from eurobot_od.traffic.monitor import Traffic
from tests.kit import plant

pytestmark = pytest.mark.skipif(not Path("/proc/self/status").exists(), reason="only Linux tells the memory so")

MOTOR = Path(__file__).parents[1] / "docs" / "motor.eds"

MEASURED = """
import sys
from eurobot_od.cli import main
status = main(sys.argv[1:])
with open("/proc/self/status") as said:  # not `getrusage`: that begins with what the process before had
    print(next(int(line.split()[1]) for line in said if line.startswith("VmHWM")) >> 10)
sys.exit(status)
"""
"""Runs a command, and prints at last how many MB it took at most."""

MOST_MEGABYTES = 200
"""Memory of a command that is fed ten times a bound, MB; without any file it is 40 to 120, by what it imports."""


def ten_times(file: Path, bound: int, part: bytes, begin: bytes = b"") -> None:
    """Write a file with ten times as many parts as are read."""
    file.write_bytes(begin + part * (10 * bound))


def sections(file: Path) -> None:
    """Write ten times as many sections as are read."""
    file.write_text("".join(f"[{number:X}]\n" for number in range(10 * document.MOST_SECTIONS)))


def sparse(file: Path) -> None:
    """Write a file of ten times the most bytes that are read."""
    with file.open("wb") as opened:
        opened.truncate(10 * files.MOST)


def network(file: Path, node_id: Callable[[int], int] = lambda number: number) -> None:
    """Write a network with ten times as many nodes as there are node-IDs."""
    nodes = (f"  n{number}: {{file: {MOTOR}, node_id: {node_id(number)}}}\n" for number in range(1, 1271))
    file.write_text("nodes:\n" + "".join(nodes))


def packed_line(file: Path) -> None:
    """Write a compressed log with one line of ten times the most bytes."""
    file.write_bytes(gzip.compress(b"0" * (10 * entries.LARGEST)))


def rows(file: Path, texts: list[str], number: int) -> None:
    """Write a season in which a file of `runs` has so many rows, all of one text of some."""
    (file / "runs").mkdir(parents=True)
    column = pa.DictionaryArray.from_arrays(pa.array([0] * number, pa.int32()), texts)
    # Without Arrow's schema it is read as texts, each of them whole.
    pq.write_table(pa.table({"run": column}), file / "runs" / "a.parquet", store_schema=False)


def lying(file: Path) -> None:
    """Write a season in which a file of `runs` holds ten times the most bytes, in pages of which its footer says 1."""
    rows(file, ["a" * MOST_BYTES * 10], 1)
    made = file / "runs" / "a.parquet"
    column = pq.ParquetFile(made).metadata.row_group(0).column(0)
    content = made.read_bytes()
    said = number(column.total_uncompressed_size)
    assert content.count(said) == 2  # of the column and of the row group
    made.write_bytes(content.replace(said, number(1, len(said))))


def number(value: int, length: int = 0) -> bytes:
    """A number as Thrift writes it in `length` bytes, at least."""
    found = list[int]()
    value <<= 1
    while value > 0x7F or len(found) + 1 < length:
        found.append(value & 0x7F | 0x80)
        value >>= 7
    return bytes([*found, value])


LINES = partial(ten_times, bound=document.MOST_LINES, part=b"\n")
TAGS = partial(ten_times, bound=document.MOST_TAGS, part=b"<")
VALUES = partial(ten_times, bound=yaml_places.MOST_VALUES, part=b"1,", begin=b"[")

FED: dict[str, tuple[str, Callable[[Path], None], str]] = {
    "bytes of an EDS": ("lint a.eds", sparse, "larger than 16 MB"),
    "sections of an EDS": ("lint a.eds", sections, "1000000 sections, and 100000 are the most"),
    "sections of a nodelist": ("show --network a.cpj", sections, "1000000 sections, and 100000 are the most"),
    "lines of an EDS": ("show --eds 5=a.eds", LINES, "lines, and 500000 are the most"),
    "tags of an XDD": ("lint a.xdd", TAGS, "tags, and 600000 are the most"),
    "values of YAML": ("show --network a.yaml", VALUES, "more than 500000"),
    "nodes of a network": ("show --network a.yaml", partial(network, node_id=lambda n: n % 127 + 1), "1270 nodes"),
    "node-IDs of a network": ("show --network a.yaml", network, "'1270' is not allowed; allowed: whole numbers 1..127"),
    "bytes of a line": ("decode a.log.gz", packed_line, "nothing in it can be read"),
    "rows of a season": ("query a 'SELECT * FROM runs'", partial(rows, texts=["a"], number=10 * MOST_ROWS), "damaged"),
    "bytes of a season": (
        "query a 'SELECT * FROM runs'", partial(rows, texts=["a" * 1_000_000], number=10 * MOST_BYTES // 1_000_000),
        "damaged",
    ),
    "pages of a season, whatever its footer says": ("query a 'SELECT * FROM runs'", lying, "damaged"),
}  # fmt: skip


@pytest.mark.parametrize("what", FED)
def test_ten_times_a_bound_is_one_line_and_little_memory(what: str, tmp_path: Path) -> None:
    words, feed, said = FED[what]
    file = next(each for each in words.split() if each.startswith(("a", "5=a"))).removeprefix("5=")
    feed(tmp_path / file)
    done = subprocess.run(
        [sys.executable, "-c", MEASURED, *shlex.split(words)],
        cwd=tmp_path, capture_output=True, text=True, timeout=60,
    )  # fmt: skip
    assert said in done.stderr
    assert int(done.stdout.splitlines()[-1]) < MOST_MEGABYTES


def test_beyond_some_thousand_identifiers_of_29_bits_a_live_view_counts_and_keeps_nothing(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    monkeypatch.setattr(monitor, "MOST_EXTENDED", 500)
    traffic, diagnosis, random = Traffic(plant.decoder(), 500_000), Diagnosis(plant.decoder()), Random(1)

    def take(number: int) -> int:
        for _ in range(number):
            frame = Frame(EXTENDED | random.getrandbits(29), b"12345678")
            time = traffic.frames / 2000
            diagnosis.take_meaning(time, "", traffic.take(time, frame), traffic.following)
        return tracemalloc.get_traced_memory()[0]

    tracemalloc.start()
    before, after = take(1000), take(4000)
    tracemalloc.stop()
    *_, others = traffic.rows.values()
    assert (len(traffic.rows), others.name, others.identifier) == (501, "other identifiers", None)
    assert traffic.frames == sum(row.count for row in traffic.rows.values()) == 5000
    assert after - before < 2 << 20, "what stays are remembered frames, a bounded number: without the bound 13 MB"
    assert traffic.load(traffic.now)[0] >= 0
