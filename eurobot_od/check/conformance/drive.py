"""Suites for drives by CiA 402: objects, the state machine as a table, quick stop, a lost heartbeat, moves.

Rule of this file: nothing gives the motor torque but what needs `--motion`, and nothing there is faster or goes
farther than it says. Where the motor stands at the end is where it stood, or where its last step says.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from typing import NamedTuple

from eurobot_od.check.conformance.profile import Needs, ProfileClauses, allowed_steps
from eurobot_od.check.conformance.subject import Subject, awake, group, read, skip, title, write
from eurobot_od.check.conformance.writing import Data, documents, hexadecimal
from eurobot_od.check.format import VERSION
from eurobot_od.device.nmt import NmtState
from eurobot_od.od.dictionary import Dictionary
from eurobot_od.od.profiles import cia402
from eurobot_od.od.profiles.cia402 import ARROWS, POWERED, DriveCommand, Mode, State
from eurobot_od.od.standard import CONSUMED_HEARTBEATS
from eurobot_od.od.values import ERROR_CONTROL_BASE, Address
from eurobot_od.sdo.wire import ClientCommand, initiate

TAG = "profile"

SOON, MOVED = "2 s", "30 s"
"""How long an arrow of the state machine, and a move, may take."""

WATCHED = 200
"""Milliseconds of the heartbeat that is lost."""

STAYS, LEAVES = 6, 2
"""Quick stop option codes: with the first the drive stays in Quick stop active."""


class MotionBounds(NamedTuple):
    """How far a motor may be moved, and how fast, in the drive's units."""

    way: int
    velocity: int


class TestedDrive(NamedTuple):
    """A drive under test, and which steps may be done; `motion` None: the motor gets no torque."""

    subject: Subject
    allowed: frozenset[Needs]
    motion: MotionBounds | None

    def has(self, index: int) -> bool:
        """Tell whether the file has an object."""
        return self.subject.find((index, 0)) is not None

    def settable(self, index: int, value: int, sub: int = 0) -> bool:
        """Tell whether an object can have a value, and its own again."""
        return self.subject.may_be((index, sub), value)

    @property
    def modes(self) -> tuple[Mode, ...]:
        """The modes of operation that the file says it has."""
        return cia402.supported(self.subject.number((cia402.SUPPORTED_MODES, 0)))


CLAUSES: ProfileClauses[TestedDrive] = ProfileClauses()
"""The suite, in the order of this file: what gives no torque comes first."""

_clause = CLAUSES.clause


# Steps


def _digits(mask: int, bits: int) -> str:
    """Return the pattern of a byte that has these bits."""
    # Patterns compare digits: of each four bits of the mask come the digits that it lets through.
    digits = ""
    for m, b in ((mask >> 4, bits >> 4), (mask & 15, bits & 15)):
        allowed = "".join(f"{n:X}" for n in range(16) if n & m == b)
        digits += "?" if len(allowed) == 16 else allowed if len(allowed) == 1 else f"[{allowed}]"
    return digits


def _until(drive: TestedDrive, name: str, mask: int, bits: int, within: str = SOON) -> Data:
    """Ask for the statusword until it has these bits."""
    subject = drive.subject
    ask = subject.request(initiate(ClientCommand.UPLOAD << 5, (cia402.STATUSWORD, 0)))
    # 4B is an expedited answer of 2 bytes (CiA 301, 7.2.4.3); the other two bytes may be anything.
    head = f"4B{cia402.STATUSWORD & 0xFF:02X}{cia402.STATUSWORD >> 8:02X}00"
    word = _digits(mask & 0xFF, bits & 0xFF) + _digits(mask >> 8, bits >> 8)
    poll = {**ask, "every": "20 ms"}
    return {"name": name, "poll": poll, "until": subject.answer(f"{head}{word}????"), "within": within}


def _state(drive: TestedDrive, state: State) -> Data:
    return _until(drive, f"it is in {state.words}", state.mask, state.bits)


def _command(word: int, name: str) -> Data:
    return write(f"{name} ({hexadecimal(word)})", (cia402.CONTROLWORD, 0), value=word)


def _commanded(command: DriveCommand) -> Data:
    return _command(command.bits, command.words)


WAYS: dict[State, tuple[DriveCommand, ...]] = {
    State.DISABLED: (),
    State.READY: (DriveCommand.SHUTDOWN,),
    State.SWITCHED_ON: (DriveCommand.SHUTDOWN, DriveCommand.SWITCH_ON),
    State.ENABLED: (DriveCommand.SHUTDOWN, DriveCommand.SWITCH_ON, DriveCommand.ENABLE),
    State.QUICK_STOP: (DriveCommand.SHUTDOWN, DriveCommand.SWITCH_ON, DriveCommand.ENABLE, DriveCommand.QUICK_STOP),
}
"""The commands that bring a drive from Switch on disabled into each state."""


def _into(drive: TestedDrive, state: State) -> Iterator[Data]:
    """Bring the drive into a state, each arrow seen."""
    yield _commanded(DriveCommand.DISABLE_VOLTAGE)
    yield _state(drive, State.DISABLED)
    present = State.DISABLED
    for command in WAYS[state]:
        present = ARROWS[present, command].after
        yield _commanded(command)
        yield _state(drive, present)


def _off(drive: TestedDrive) -> Iterator[Data]:
    yield _commanded(DriveCommand.DISABLE_VOLTAGE)
    yield _state(drive, State.DISABLED)


# Objects


@_clause("6.2", "Objects", Needs.READING)
def _objects(drive: TestedDrive) -> Iterator[Data]:
    for index in (cia402.CONTROLWORD, cia402.STATUSWORD):  # mandatory: a drive without them is red
        variable = drive.subject.find((index, 0))
        yield read(title(variable) if variable else hexadecimal(index), (index, 0))
    for index in (cia402.MODE_DISPLAY, cia402.SUPPORTED_MODES, cia402.ERROR_CODE):
        variable = drive.subject.find((index, 0))
        if variable is not None and variable.readable:
            yield read(title(variable), (index, 0))
        else:
            yield skip(hexadecimal(index), f"the file has no {hexadecimal(index)} that can be read")


# State machine


LEADS_TO: Mapping[tuple[State, DriveCommand | None], State] = {
    **{pair: arrow.after for pair, arrow in ARROWS.items()},
    (State.READY, DriveCommand.ENABLE): State.ENABLED,  # two arrows with one command (CiA 402-2, table of commands)
}
"""The state after a command, by the state before; a command that is not here leaves the state as it is."""


def _table(drive: TestedDrive, powered: bool) -> Iterator[Data]:
    """Give the rows of the state machine: each command in each state, those with torque or those without."""
    for before in (State.DISABLED, State.READY, State.SWITCHED_ON, State.ENABLED):
        for command in DriveCommand:
            after = LEADS_TO.get((before, command), before)
            # In states with torque "no command", which precedes a fault reset, is Disable voltage.
            edge = command is DriveCommand.FAULT_RESET and before is not State.DISABLED
            if edge or powered is not bool({before, after} & {*POWERED}) or after is State.QUICK_STOP:
                continue
            reset = [_command(0, "no command")] * (command is DriveCommand.FAULT_RESET)  # it is a rising edge
            name = f"{command.words} in {before.words}: {'stays' if before is after else after.words}"
            yield group(name, *_into(drive, before), *reset, _commanded(command), _state(drive, after), *_off(drive))


@_clause("8.1", "States", Needs.REVERSIBLE)
def _states(drive: TestedDrive) -> Iterator[Data]:
    return _table(drive, powered=False)


@_clause("8.1", "States with torque", Needs.MOTION)
def _states_with_torque(drive: TestedDrive) -> Iterator[Data]:
    return _table(drive, powered=True)


# With torque


@_clause("8.4", "Quick stop", Needs.MOTION)
def _quick_stop(drive: TestedDrive) -> Iterator[Data]:
    option = cia402.QUICK_STOP_OPTION
    if not drive.settable(option, STAYS):
        steps = (*_into(drive, State.ENABLED), _commanded(DriveCommand.QUICK_STOP))
        # Where its option code leads is the maker's matter; all that can be asked is that it is not a fault.
        ended = _until(drive, "it stops", State.DISABLED.mask & 0x08, 0)
        yield group("from Operation enabled", *steps, ended, *_off(drive))
        return
    own = drive.subject.number((option, 0))
    stays = write(f"option code {STAYS}: it stays", (option, 0), value=STAYS)
    leaves = write(f"option code {LEAVES}: it leaves", (option, 0), value=LEAVES)
    back = write("option code as before", (option, 0), value=own)
    for command, after in ((DriveCommand.ENABLE, State.ENABLED), (DriveCommand.DISABLE_VOLTAGE, State.DISABLED)):
        steps = (stays, *_into(drive, State.QUICK_STOP), _commanded(command), _state(drive, after))
        yield group(f"{command.words} in Quick stop active: {after.words}", *steps, *_off(drive), back)
    steps = (leaves, *_into(drive, State.ENABLED), _commanded(DriveCommand.QUICK_STOP), _state(drive, State.DISABLED))
    yield group("ends in Switch on disabled", *steps, back)


@_clause("8.4", "Connection", Needs.MOTION)
def _lost_heartbeat(drive: TestedDrive) -> Iterator[Data]:
    """Lose a heartbeat that the drive watches: it has a fault, which a rising edge resets."""
    name, address, subject = "a lost heartbeat, and its reset", (CONSUMED_HEARTBEATS, 1), drive.subject
    another = subject.another
    entry = another << 16 | WATCHED
    if not subject.may_be(address, entry) or not drive.settable(cia402.ABORT_CONNECTION, 1):
        yield skip(name, "the file has no 0x1016:1 and 0x6007 that can be written")
        return
    beat = f"{ERROR_CONTROL_BASE + another:03X}#{NmtState.OPERATIONAL:02X}"
    own = subject.number((cia402.ABORT_CONNECTION, 0))
    yield group(
        name,
        write("abort connection: a fault", (cia402.ABORT_CONNECTION, 0), value=1),
        *_into(drive, State.ENABLED),
        write(f"watch node {another}", address, value=entry),
        {"name": "its heartbeat, and no second one", "send": {"raw": beat}},
        _state(drive, State.FAULT),
        # No command leaves a fault but the reset, and that only with a rising edge (CiA 402-2, transition 15).
        _command(DriveCommand.ENABLE.bits, "Enable operation"),
        _state(drive, State.FAULT),
        write("watch nobody", address, value=0),
        _command(0, "no command"),
        _commanded(DriveCommand.FAULT_RESET),
        _state(drive, State.DISABLED),
        write("abort connection as before", (cia402.ABORT_CONNECTION, 0), value=own),
    )


def _mode(drive: TestedDrive, mode: Mode) -> Iterator[Data]:
    """Choose a mode of operation, and enable."""
    yield write(f"mode {cia402.MODE_WORDS[mode]}", (cia402.MODE, 0), value=int(mode))
    yield read("it is the mode", (cia402.MODE_DISPLAY, 0), expect=int(mode))
    yield from _into(drive, State.ENABLED)


def _without(drive: TestedDrive, mode: Mode, *objects: Address) -> str:
    """Say why a mode cannot be tried; nothing if it can."""
    lacks = [hexadecimal(index) for index, sub in objects if drive.subject.find((index, sub)) is None]
    reasons = {
        f"the file has no mode {cia402.MODE_WORDS[mode]} (0x6502)": mode not in drive.modes,
        f"the file has no {', '.join(lacks)}": bool(lacks),
    }
    return next((reason for reason, holds in reasons.items() if holds), "")


HERE = 37
"""The homing method that does not move."""


@_clause("11.1", "Homing", Needs.MOTION)
def _homing(drive: TestedDrive) -> Iterator[Data]:
    name = "present position is home"
    why = _without(drive, Mode.HOMING, (cia402.MODE, 0), (cia402.HOMING_METHOD, 0), (cia402.POSITION, 0))
    if why:
        yield skip(name, why)
        return
    done = cia402.BIT_12 | cia402.TARGET_REACHED
    start = _command(DriveCommand.ENABLE.bits | cia402.HOMING_START, "start homing")
    yield group(
        name,
        write(f"method {HERE}", (cia402.HOMING_METHOD, 0), value=HERE),
        *_mode(drive, Mode.HOMING),
        # Bits 13, 12 and 10: no error, not attained, target reached (CiA 402-2, clause 11).
        _until(drive, "not started", 0x3400, cia402.TARGET_REACHED),
        start,
        _until(drive, "homing attained", done | cia402.BIT_13, done, MOVED),
        *_off(drive),
    )


@_clause("10.1", "Profile position", Needs.MOTION)
def _position(drive: TestedDrive) -> Iterator[Data]:
    """Move by the way that is allowed, and back."""
    name, motion = "there and back", drive.motion
    objects = ((cia402.MODE, 0), (cia402.TARGET_POSITION, 0), (cia402.PROFILE_VELOCITY, 0), (cia402.POSITION, 0))
    why = _without(drive, Mode.PROFILE_POSITION, *objects)
    if why or motion is None:
        yield skip(name, why)
        return
    window = drive.subject.number((cia402.POSITION_WINDOW, 0)) & 0xFFFFFFFF
    # A window of all bits is switched off (CiA 402-2, clause 12.3.4), and one as wide as the way would see nothing.
    near = max(motion.way // 50, window if window < motion.way else 0, 1)
    yield group(
        name,
        read("where it is", (cia402.POSITION, 0), save="start"),
        write(f"velocity {motion.velocity}", (cia402.PROFILE_VELOCITY, 0), value=motion.velocity),
        *_mode(drive, Mode.PROFILE_POSITION),
        *_moved(drive, motion.way),
        *_moved(drive, -motion.way),
        read("it is back", (cia402.POSITION, 0), expect=f"{{start}} +- {near}"),
        *_off(drive),
    )


def _moved(drive: TestedDrive, way: int) -> Iterator[Data]:
    enable, reached = DriveCommand.ENABLE.bits, cia402.TARGET_REACHED | cia402.BIT_12
    bits = enable | cia402.NEW_SET_POINT | cia402.AT_ONCE | cia402.RELATIVE
    yield write(f"by {way}", (cia402.TARGET_POSITION, 0), value=way)
    yield _command(bits, "new set-point, relative")
    yield _until(drive, "set-point acknowledged", cia402.BIT_12, cia402.BIT_12)
    yield _command(enable, "no new set-point")
    yield _until(
        drive, "target reached", reached | State.ENABLED.mask, cia402.TARGET_REACHED | State.ENABLED.bits, MOVED
    )


@_clause("14.1", "Profile velocity", Needs.MOTION)
def _velocity(drive: TestedDrive) -> Iterator[Data]:
    name, motion = "up, and quick stop", drive.motion
    why = _without(drive, Mode.PROFILE_VELOCITY, (cia402.MODE, 0), (cia402.TARGET_VELOCITY, 0), (cia402.VELOCITY, 0))
    if why or motion is None:
        yield skip(name, why)
        return
    near = max(motion.velocity // 20, 1)
    reached = _until(drive, "target reached", cia402.TARGET_REACHED, cia402.TARGET_REACHED, MOVED)
    yield group(
        name,
        write("velocity 0", (cia402.TARGET_VELOCITY, 0), value=0),
        *_mode(drive, Mode.PROFILE_VELOCITY),
        write(f"velocity {motion.velocity}", (cia402.TARGET_VELOCITY, 0), value=motion.velocity),
        reached,
        read("it turns", (cia402.VELOCITY, 0), expect=f"{motion.velocity} +- {near}"),
        _commanded(DriveCommand.QUICK_STOP),
        {"name": "it stops", "wait": "1 s"},
        read("it stands", (cia402.VELOCITY, 0), expect=f"0 +- {near}"),
        write("velocity 0", (cia402.TARGET_VELOCITY, 0), value=0),
        *_off(drive),
    )


# The suite


def text(dictionary: Dictionary, reversible: bool = False, motion: MotionBounds | None = None) -> str:
    """Return the suite of a drive; `reversible` writes its controlword, `motion` gives it torque within its limits."""
    subject = Subject(dictionary)
    drive = TestedDrive(subject, allowed_steps(reversible, Needs.MOTION if motion else None), motion)
    is_written = Needs.REVERSIBLE in drive.allowed
    reset = [_command(0, "no command"), _commanded(DriveCommand.FAULT_RESET), _command(0, "no command")]
    suite: Data = {
        "spec": VERSION,
        "name": "CiA 402, drive",
        "node": dictionary.name,
        "tags": [TAG, "cia402"],
        "setup": [
            {**awake(subject), "name": "7.2.4.3.5 SDO: the device answers [reading]"},
            *([group("8.1 States: any fault is reset [reversible]", *reset)] * is_written),
        ],
        "steps": [*CLAUSES.named(drive)],
    }
    off = {**_commanded(DriveCommand.DISABLE_VOLTAGE), "name": "8.1 States: no torque [reversible]"}
    return documents([{**suite, "teardown": [off]} if is_written else suite])
