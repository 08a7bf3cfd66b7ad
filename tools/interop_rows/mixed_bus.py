"""Compares tshark's names for the frames of a bus with devices of several makers with ours.

tshark knows the predefined connection set; wherever it names a service, our name has to be the same service.
"""

from __future__ import annotations

import re
import sys
from collections import Counter
from collections.abc import Mapping
from pathlib import Path

from eurobot_od.traffic import services
from eurobot_od.traffic.decoding import TrackingDecoder
from eurobot_od.traffic.meaning import Decoder, Meaning
from interop_rows.row import Answer, agree
from interop_rows.tools import run

ROOT = str(Path(__file__).resolve().parents[2])
if ROOT not in sys.path:
    sys.path.insert(0, ROOT)  # the bus is the tests'

from tests.traffic.mixed_bus import dictionaries, log_text, recorded  # noqa: E402

OURS: Mapping[str, tuple[str, ...]] = {
    "Default-SDO": (services.SDO,),
    "NMT Error Control": (services.HEARTBEAT, services.GUARDING),
    "NMT": (services.NMT,),
    "EMCY": (services.EMCY_NAME,),
    "SYNC": (services.SYNC_NAME,),
    "TIME STAMP": (services.TIME_NAME,),
    "LSS": (services.LSS,),
}
"""Our names for the services, by the beginning of tshark's line."""

PDO = re.compile(r"PDO(?P<number>\d) \((?P<way>tx|rx)\)")
UNNAMED = re.compile(r"Unknown|ID: |Ext\. ID: ")
"""tshark's text for a frame whose service it does not know."""


def named_by_tshark(folder: Path) -> Answer:
    """Dissect the bus with tshark, and compare its name for each frame with ours."""
    frames = recorded()
    file = folder / "mixed.log"
    file.write_text(log_text(frames))
    following = TrackingDecoder(Decoder(dictionaries()))
    meanings = [following(time, "can0", frame) for time, frame in frames]
    done = run("tshark", "-r", file, "-d", "can.subdissector,canopen", "-T", "fields", "-e", "_ws.col.Info")
    lines = done.stdout.splitlines()
    agree("the number of frames", len(lines), len(meanings))
    agree("frames that have no name with us", [str(each.raw) for each in meanings if not each.name or each.defects], [])
    named = [(line, meaning) for line, meaning in zip(lines, meanings) if not UNNAMED.match(line)]
    for line, meaning in named:
        agree(f"the name of {meaning.raw}, {line}", is_same(line, meaning), True)
    kinds = Counter(meaning.name for meaning in meanings if meaning.message is None)
    said = ", ".join(f"{kind} {count}" for kind, count in sorted(kinds.items()))
    pdos = len(meanings) - kinds.total()
    others = Counter(meaning.name for line, meaning in zip(lines, meanings) if UNNAMED.match(line))
    return Answer(
        f"of {len(meanings)} frames it names {len(named)}, each as we do (PDO {pdos}, {said}); we name all",
        f"it has no name for {', '.join(f'{count} of {kind}' for kind, count in sorted(others.items()))}",
    )


def is_same(line: str, meaning: Meaning) -> bool:
    """Return whether a line of tshark and a meaning of ours name the same service."""
    if found := PDO.match(line):
        return meaning.name.endswith(f"{'TPDO' if found['way'] == 'tx' else 'RPDO'}{found['number']}")
    # The longest beginning: NMT is that of NMT Error Control, too.
    known = [each for each in OURS if line.startswith(each)]
    return meaning.name in OURS[max(known, key=len)] if known else False
