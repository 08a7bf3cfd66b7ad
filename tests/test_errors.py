"""The error tree: whose fault each error is, and its one line of text."""

from __future__ import annotations

from itertools import permutations

import pytest

from eurobot_od.errors import (
    BusError,
    Cause,
    ConfigurationError,
    DamagedFile,
    DictionaryError,
    DriveError,
    EurobotError,
    FieldError,
    FileError,
    FrameLengthError,
    HeartbeatLost,
    ListenerError,
    LocalError,
    MappingError,
    NamedObject,
    NoAnswer,
    NodeClassError,
    NodeFailed,
    NodeRefused,
    ProgramError,
    ProgramFailed,
    Refused,
    RemoteError,
    StateError,
    UnknownIdentifier,
    UnknownName,
    WorldError,
    WrongAnswer,
    YamlError,
)
from tests.kit.lift import Doors

ERRORS: list[tuple[EurobotError, type[EurobotError], str]] = [
    # the caller's: nothing was sent
    (UnknownName("message", "Goto Z"), LocalError, "unknown message 'Goto Z'"),
    (UnknownName("node", "wheel", ["core", "drive"]), LocalError, "unknown node 'wheel'; known: core, drive"),
    (UnknownName("node", "driv", ["core", "drive"]), LocalError, "unknown node 'driv'; did you mean drive?"),
    (UnknownName("node", "DRIV", ["core", "Drive"]), LocalError, "unknown node 'DRIV'; did you mean Drive?"),
    (
        UnknownName("fault", "stop-ignord", ["nmt-stop-ignored", "stop-ignored", "mute"]),
        LocalError,
        "unknown fault 'stop-ignord'; did you mean stop-ignored or nmt-stop-ignored?",
    ),
    (
        UnknownName("object", "target", ["Target torque", "Actual speed", "Target velocity", "Target torque"]),
        LocalError,
        "unknown object 'target'; did you mean Target torque or Target velocity?",
    ),
    (
        UnknownName("object", "speed max", ["Max speed", "Speed", "Maximal motor speed"]),
        LocalError,
        "unknown object 'speed max'; did you mean Max speed or Maximal motor speed?",
    ),
    (
        UnknownName("message", "posi", [f"Position {n}" for n in range(9)]),
        LocalError,
        "unknown message 'posi'; did you mean Position 0 or Position 1 or Position 2 or Position 3 or Position 4 or "
        "Position 5, or one of 3 more?",
    ),
    (
        UnknownName("fault", "nonsense", range(1000, 1214)),
        LocalError,
        "unknown fault 'nonsense'; 214 are known, and none is like it; `faults` lists them",
    ),
    (
        UnknownName("object", "target_sped", ["Motor", "Motor.Target speed", "Motor.Target speed", "Fan.Target speed"]),
        LocalError,
        "unknown object 'target_sped'; did you mean Fan.Target speed or Motor.Target speed?",
    ),
    (UnknownName("barrier", 9, ["1", "2"]), LocalError, "unknown barrier 9; known: 1, 2"),
    (
        FieldError("Move To", "height", 5000, "0..3000 mm"),
        LocalError,
        "Move To: height = 5000 is not allowed; allowed: 0..3000 mm",
    ),
    (FieldError("Move To", "height", "a", "0..9"), LocalError, "Move To: height = 'a' is not allowed; allowed: 0..9"),
    (
        FieldError("Move To", "doors", Doors.OPEN, "closed"),
        LocalError,
        "Move To: doors = open is not allowed; allowed: closed",
    ),
    (ListenerError("lamp: too late"), LocalError, "lamp: too late"),
    (StateError("not now"), LocalError, "not now"),
    (NodeClassError("lift.py:3", "Lift has no such table"), LocalError, "lift.py:3: Lift has no such table"),
    # a file's
    (FileError("a.yaml", "is empty"), EurobotError, "a.yaml: is empty"),
    (YamlError("a.yaml", ["a.yaml:1:2: one", "a.yaml:3:4: two"]), FileError, "a.yaml:1:2: one\na.yaml:3:4: two"),
    (DictionaryError("a/drive.eds", None, "is empty"), FileError, "a/drive.eds: is empty"),
    (DictionaryError("drive.eds", 0x1A03, "no value"), EurobotError, "drive.eds: 0x1A03: no value"),
    (DamagedFile("stored.dcf", None, "damaged"), DictionaryError, "stored.dcf: damaged"),
    (MappingError("drive.eds", 0x1603, "65 bits"), DictionaryError, "drive.eds: 0x1603: 65 bits"),
    # a peer's, or the wire's
    (UnknownIdentifier(0x7), RemoteError, "no message has the identifier 0x007"),
    (FrameLengthError("Move To", 8, 7, "6 or 8"), RemoteError, "Move To (0x008): 7 bytes of data, expected 6 or 8"),
    (FrameLengthError("TPDO1", 0x38012345, 2, "8"), RemoteError, "TPDO1 (0x18012345): 2 bytes of data, expected 8"),
    (NoAnswer("MoveTo", "MoveConfirm", 6, 0.5), RemoteError, "no MoveConfirm after 6 x MoveTo (500 ms each)"),
    (
        NodeRefused(2, "write 0x1017:0", 0x06090030, "value range exceeded"),
        RemoteError,
        "node 2 refused to write 0x1017:0: value range exceeded (0x06090030)",
    ),
    (HeartbeatLost(5, 0.3), NoAnswer, "no heartbeat of node 5 within 300 ms after the last one"),
    (
        WrongAnswer("read 0x1017:0", "it is short", NamedObject(5, (0x1017, 0))),
        RemoteError,
        "node 5 gave an odd answer to read 0x1017:0: it is short",
    ),
    (Refused(Cause.STATE, "the safe state is held"), RemoteError, "the safe state is held"),
    (ConfigurationError("drive is half configured"), RemoteError, "drive is half configured"),
    (DriveError("the drive has a fault"), RemoteError, "the drive has a fault"),
    (ProgramError("drive has no program"), RemoteError, "drive has no program"),
    (NodeFailed("the wheels are gone"), EurobotError, "the wheels are gone"),
    (WorldError("the world does not answer"), RemoteError, "the world does not answer"),
    # the node's own
    (ProgramFailed("mine.py:3 does not give way"), EurobotError, "mine.py:3 does not give way"),
    (NodeFailed("drive has failed and ended"), EurobotError, "drive has failed and ended"),
    # the bus's
    (BusError("gone"), EurobotError, "gone"),
]


@pytest.mark.parametrize(("error", "kind", "text"), ERRORS)
def test_error_has_its_place_in_the_tree_and_one_line(error: EurobotError, kind: type[EurobotError], text: str) -> None:
    assert isinstance(error, kind)
    assert str(error) == text


def test_every_error_has_a_row() -> None:
    def below(kind: type[EurobotError]) -> set[type[EurobotError]]:
        return {kind}.union(*map(below, kind.__subclasses__()))

    own = {each for each in below(EurobotError) if each.__module__ == EurobotError.__module__}
    assert own - {type(error) for error, *_ in ERRORS} == {EurobotError, LocalError, RemoteError}


def test_faults_are_kept_apart() -> None:
    for one, other in permutations((LocalError, DictionaryError, RemoteError, BusError), 2):
        assert not issubclass(one, other)


def test_a_number_too_long_for_python_is_printed() -> None:
    assert str(FieldError("Goto XY", "x", 10**5000, "0..3000 mm")).startswith("Goto XY: x = a number of thousands")
