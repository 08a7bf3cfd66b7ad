"""npm's `canopen`, a CANopen stack in another language, as a reader of our EDS files and as the master of our drive.

`judge.js` asks the package; frames go between its process and an in-process bus as lines of JSON.
"""

from __future__ import annotations

import json
import os
import subprocess
import threading
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import IO, Any

import can

from eurobot_od.od.dictionary import Dictionary
from eurobot_od.od.values import PdoDirection
from eurobot_od.robot import dialects
from interop_rows.bench import PATIENCE, open_bus, robot
from interop_rows.row import Answer, Differs, agree
from interop_rows.sheets import all_eds, label
from interop_rows.tools import NODE_MODULES

JUDGE = Path(__file__).with_name("judge.js")

NO_BITS = (
    "its PDO values ignore the mapped bit lengths and put whole objects one after the other, where CiA 301 maps bits "
    "(minimal example: Kalman Position Response in tests/interop/test_upstream.py); `$NODEID` (CiA 306-1) reads as 0, "
    "so a device cannot start from an EDS with SDO server parameters; a mapped sub-index 10 is read as 16. "
    "Use it for identifiers, SDO, NMT and EMCY, not for this protocol's bits"
)


def start(*words: str | Path) -> subprocess.Popen[str]:
    """Start the judge with a question."""
    command = ["node", str(JUDGE), *map(str, words)]
    environment = {**os.environ, "NODE_PATH": str(NODE_MODULES)}
    pipe = subprocess.PIPE
    return subprocess.Popen(command, env=environment, stdin=pipe, stdout=pipe, stderr=pipe, text=True)


def ask(*words: str | Path) -> Any:
    """Return the judge's answer to a question that needs no bus; raises Differs if it failed."""
    with start(*words) as judge:
        said, complaint = judge.communicate(timeout=60)
    if not said:
        raise Differs(complaint)
    return json.loads(said)["said"]


def load(_: Path) -> Answer:
    """Load every EDS with the package, and compare objects, identifiers, mapped objects and lengths."""
    files = all_eds()
    for file, said in zip(files, ask("load", *files), strict=True):
        dictionary = Dictionary.load(file)
        agree(f"the number of objects in {label(file)}", said["objects"], len(dictionary.objects))
        for direction, key in ((PdoDirection.RPDO, "receive"), (PdoDirection.TPDO, "transmit")):
            agree(f"the {key} PDOs of {label(file)}", said[key], _pdos(dictionary, direction))
    return Answer("every EDS loaded; objects, identifiers, mapped objects and bit counts of all PDOs as ours", NO_BITS)


def _pdos(dictionary: Dictionary, direction: PdoDirection) -> list[list[Any]]:
    return [
        [pdo.cob_id, [each.name for each in pdo.mapping], sum(each.bits for each in pdo.mapping)]
        for pdo in dictionary.pdos
        if pdo.direction is direction and pdo.valid
    ]


def unpack(file: Path, cob_id: int, data: bytes) -> Sequence[int]:
    """Return the values that the package takes from a PDO."""
    values: list[int] = ask("unpack", file, str(cob_id), data.hex())
    return values


def talk(_: Path) -> Answer:
    """Control our drive with the package as the master."""
    with robot("drive") as channel, open_bus(channel) as bus, start("talk") as judge:
        said = _bridge(judge, bus)
    drive = dialects.load("drive", dialects.DEFAULT)
    eds = drive.content.decode()
    agree(
        "what it heard",
        said,
        {
            "period": 1000,
            "name": drive.default((0x1008, 0)),
            "segments": eds,
            "blocks": eds,
            "abort": 0x06020000,
            "changed": 20,
            "states": [4, 127, 5, 0],
            "emergency": [0x8210, 0x11, "PDO not processed due to length error"],
        },
    )
    return Answer("SDO upload (expedited, segments, blocks), download, abort, NMT, heartbeat, boot-up and EMCY")


def _bridge(judge: subprocess.Popen[str], bus: can.BusABC) -> Any:
    """Carry frames between the judge and the bus until the judge answers."""
    assert judge.stdin is not None
    assert judge.stdout is not None
    watchdog = threading.Timer(6 * PATIENCE, judge.kill)
    watchdog.start()
    notifier = can.Notifier(bus, [_to(judge.stdin)], timeout=0.01)
    try:
        for line in judge.stdout:
            thing = json.loads(line)
            if "said" in thing:
                return thing["said"]
            data = bytes.fromhex(thing["data"])
            bus.send(can.Message(arbitration_id=thing["id"], data=data, is_extended_id=False))
    finally:
        watchdog.cancel()
        notifier.stop()
        judge.kill()
    raise Differs(judge.stderr.read() if judge.stderr else "the judge ended without a word")


def _to(stdin: IO[str]) -> Callable[[can.Message], None]:
    def pass_on(message: can.Message) -> None:
        stdin.write(json.dumps({"id": message.arbitration_id, "data": message.data.hex()}) + "\n")
        stdin.flush()

    return pass_on
